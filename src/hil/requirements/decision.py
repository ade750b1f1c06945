"""Whether a figure meets its limit, given how well it is known.

The rules follow ISO 14253-1 and ILAC-G8:09/2019. With the expanded uncertainty U95 = t * u, where t is the
97.5 % quantile of Student's distribution at the figure's degrees of freedom (GUM, annex G.3), and the
guard band w = U95 under `guarded`, w = 0 under `simple`:

    acceptance zone   minimum + w  to  maximum - w    PASS
    beyond a limit by more than w                     FAIL
    in the guard band, on either side of a limit      INCONCLUSIVE

So a pass under `guarded` is wrong in less than 2.5 % of cases per limit, and so is a failure. Whatever the
zone, nothing passes that is not a number, that is known too poorly for the limit's `min_tur`, or whose
uncertainty is missing, zero or infinite where the rule needs one. An insufficient `min_tur` leaves standing
only a failure by more than U95.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from numbers import Real
from typing import TypeGuard

from hil.model.errors import Misused
from hil.model.figure import Figure, FigureStatus
from hil.model.verdict import Verdict
from hil.requirements.requirement import Decision, Limit
from hil.requirements.units import convert, scale

__all__ = ["Judgement", "combined", "given", "judge"]

_NORMAL = 1.959963984540054
"""The coverage factor of 95 % where the degrees of freedom are infinite, as scipy.special.ndtri(0.975) has it."""
_STATUSES = frozenset(FigureStatus)
_HINT = "give a Figure of one number and its unit, or a text where the requirement names one"


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """A verdict with everything that led to it, in the limit's unit.

    Attributes:
        uncertainty: combined standard uncertainty, None if unknown or not finite.
        dof: its effective degrees of freedom, infinite where it is taken as exact.
        expanded: U95, None if the uncertainty is unknown.
        margin: distance from the value to the nearest acceptance limit, positive inside; None if
            there is none.
        tur: test uncertainty ratio (maximum - minimum) / (2 U95) of a limit with two sides, else None; None as well
            where the value is not a finite number: how well that was measured is unknown.
        reason: why the verdict is what it is; empty for a plain pass.
    """

    verdict: Verdict
    value: float | str
    unit: str
    uncertainty: float | None = None
    dof: float = math.inf
    expanded: float | None = None
    margin: float | None = None
    tur: float | None = None
    decision: Decision
    reason: str = ""


def given(value: object, limit: Limit, what: str) -> Figure | str:
    """Return a figure or a word of plain Python types, so that what is judged is what is recorded.

    NumPy numbers become floats: a float32 would be judged by digits other than those in the journal.

    Args:
        value: what the case passed.
        limit: the limit that the value is compared with.
        what: requirement and parameter, for messages.

    Raises:
        Misused: for a text or a bare number instead of a figure with a unit, and for anything else.
    """
    if isinstance(value, Figure):
        return _plain(value, what)
    if isinstance(value, str):
        if limit.unit:
            raise Misused(f"{what}: expected a number in {limit.unit}, found the text '{value}'", "give a Figure")
        return str(value)
    if not _is_real(value):
        expected = f"a number in {limit.unit}" if limit.unit else "a text"
        raise Misused(f"{what}: expected {expected}, found {_kind_of(value)}", _HINT)
    number = _real(value, what)
    if limit.unit != "1":
        expected, found = (
            (f"a number in {limit.unit}", f"{number:g} without a unit") if limit.unit else ("a text", f"{number:g}")
        )
        raise Misused(f"{what}: expected {expected}, found {found}", _HINT)
    return Figure(value=number, unit="1")


def _plain(figure: Figure, what: str) -> Figure:
    if not isinstance(figure.unit, str):
        raise Misused(f"{what}: the unit of a figure is a text, found {_kind_of(figure.unit)}", _HINT)
    if figure.status not in _STATUSES:
        raise Misused(f"{what}: {_kind_of(figure.status)} is not a status of a figure", "use one of FigureStatus")
    uncertainty = figure.uncertainty
    return Figure(
        value=_real(figure.value, f"{what}: the value of a figure"),
        unit=str(figure.unit),
        uncertainty=None if uncertainty is None else _real(uncertainty, f"{what}: the uncertainty of a figure"),
        dof=_real(figure.dof, f"{what}: the dof of a figure"),
        status=FigureStatus(figure.status),
    )


def _real(value: object, what: str) -> float:
    if not _is_real(value):
        raise Misused(f"{what} is one real number, found {_kind_of(value)}", _HINT)
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _is_real(value: object) -> TypeGuard[Real]:
    """Return whether this is one real number; Python's bool only looks like one, and NumPy's does not even do that."""
    return type(value) is float or (not isinstance(value, bool) and isinstance(value, Real))


def _kind_of(value: object) -> str:
    """Return what something is, on one line and without its memory address."""
    shape = getattr(value, "shape", ())
    kind = f"{type(value).__name__} of shape {shape}" if shape else type(value).__name__
    return f"{value!r} ({kind})" if isinstance(value, bool | bytes | complex | str | type(None)) else f"a {kind}"


def judge(figure: Figure | str, limit: Limit, *, instrument_uncertainty: float | None = None) -> Judgement:
    """Judge a figure, or a word, against a limit.

    Args:
        figure: what was found, in any unit that converts to the limit's.
        limit: what it must be. Without minimum, maximum and word, the value is only recorded.
        instrument_uncertainty: standard uncertainty of the instruments in the figure's unit, added in
            quadrature; None if there is none to add.

    Raises:
        UnitError: if the units do not convert.
    """
    if isinstance(figure, str):
        return _judge_word(figure, limit)
    if limit.equals is not None or not limit.unit:
        unit = figure.unit
        return Judgement(
            verdict=Verdict.INCONCLUSIVE,
            value=figure.value,
            unit=unit,
            decision=limit.decision,
            reason="expected a text, found a number",
        )
    found = combined(figure, limit, instrument_uncertainty)
    uncertainty = None if found.uncertainty is None else _finite(found.uncertainty)
    known = _known(found.value, uncertainty, found.dof, limit)
    verdict, reason = _verdict(known, limit, figure.status)
    return Judgement(
        verdict=verdict,
        value=found.value,
        unit=limit.unit,
        uncertainty=uncertainty,
        dof=found.dof,
        expanded=known.expanded,
        margin=known.margin,
        tur=known.tur,
        decision=limit.decision,
        reason=reason,
    )


def combined(figure: Figure, limit: Limit, instrument_uncertainty: float | None) -> Figure:
    """Return a figure in the limit's unit, with the instruments' uncertainty added; a limit without unit leaves it.

    Raises:
        UnitError: if the units do not convert.
    """
    if limit.equals is not None or not limit.unit:
        return Figure(value=figure.value, unit=figure.unit, status=figure.status)
    uncertainty, dof = _combined(figure, instrument_uncertainty)
    value = convert(figure.value, figure.unit, limit.unit)
    if uncertainty is not None:
        uncertainty *= scale(figure.unit, limit.unit)
    return Figure(value=value, unit=limit.unit, uncertainty=uncertainty, dof=dof, status=figure.status)


def _judge_word(word: str, limit: Limit) -> Judgement:
    verdict, reason = Verdict.RECORDED, ""
    if limit.equals is not None:
        verdict = Verdict.PASS if word == limit.equals else Verdict.FAIL
        reason = "" if word == limit.equals else f"expected '{limit.equals}', found '{word}'"
    elif limit.unit:
        verdict, reason = Verdict.INCONCLUSIVE, f"expected a number in {limit.unit}, found a text"
    return Judgement(verdict=verdict, value=word, unit="", decision=limit.decision, reason=reason)


@dataclass(slots=True)
class _Known:
    """What a verdict follows from, in the limit's unit: value, limits, guard band, and how well the value is known."""

    value: float
    low: float
    high: float
    expanded: float | None
    guard: float | None
    margin: float | None
    tur: float | None


def _known(value: float, uncertainty: float | None, dof: float, limit: Limit) -> _Known:
    expanded = None if uncertainty is None else _finite(_coverage(dof) * uncertainty)
    low = -math.inf if limit.minimum is None else float(limit.minimum)
    high = math.inf if limit.maximum is None else float(limit.maximum)
    guard = 0.0 if limit.decision is Decision.SIMPLE else expanded
    margin = tur = None
    if limit.bounded and math.isfinite(value) and guard is not None:
        margin = min(value - (low + guard), (high - guard) - value)
    if limit.minimum is not None and limit.maximum is not None and expanded and math.isfinite(value):
        tur = _finite((high - low) / (2 * expanded))
    return _Known(value, low, high, expanded, guard, margin, tur)


def _verdict(known: _Known, limit: Limit, status: FigureStatus) -> tuple[Verdict, str]:
    value, low, high = known.value, known.low, known.high
    obstacle = _obstacle(known, limit, status)
    if obstacle:
        return Verdict.INCONCLUSIVE, obstacle
    if not limit.bounded:
        return Verdict.RECORDED, ""
    guard = known.guard or 0.0
    coarse = _too_coarse(known, limit)
    band = (known.expanded or math.inf) if coarse else guard
    # An upper limit bounds the true value from above only: it can pass a maximum, and fail nothing.
    if status is not FigureStatus.UPPER_LIMIT and (value < low - band or value > high + band):
        return Verdict.FAIL, _beyond(value, limit, low)
    if coarse:
        return Verdict.INCONCLUSIVE, coarse
    if low + guard <= value <= high - guard:
        return Verdict.PASS, ""
    return Verdict.INCONCLUSIVE, _between(low, high, guard, limit.unit)


def _obstacle(known: _Known, limit: Limit, status: FigureStatus) -> str:
    """Return why this value proves nothing, an empty string if it can."""
    value = known.value
    if not math.isfinite(value):
        return f"the value is {value}, not a finite number"
    if status in {FigureStatus.NOT_OBSERVABLE, FigureStatus.MODEL_REJECTED}:
        return f"the analysis says: {status.value}"
    if status is FigureStatus.UPPER_LIMIT and limit.minimum is not None:
        return "an upper limit can only meet a requirement that has a maximum and no minimum"
    if limit.bounded and limit.decision is Decision.GUARDED and not known.expanded:
        if known.expanded is None:
            return "the uncertainty is missing or not finite, and the decision is guarded"
        return "an uncertainty of zero is not believed where the decision is guarded"
    return ""


def _too_coarse(known: _Known, limit: Limit) -> str:
    """Return why the uncertainty is too large for the limit, an empty string if it is not."""
    if limit.min_tur is not None:
        if known.tur is None:
            return f"the test uncertainty ratio is not known, at least {limit.min_tur} is required"
        if not known.tur >= float(limit.min_tur):
            return f"the test uncertainty ratio is {known.tur:.3g}, at least {limit.min_tur} is required"
    guard = known.guard
    if guard is not None and known.low + guard > known.high - guard:
        return f"the guard band of {guard:.3g} {limit.unit} leaves no acceptance zone"
    return ""


def _between(low: float, high: float, guard: float, unit: str) -> str:
    if guard == 0:
        return f"an upper limit above the maximum of {_with(f'{high:g}', unit)} shows nothing"
    for bound, kind, side in ((high, "maximum", "up"), (-low, "minimum", "down")):
        if 0 <= bound < guard:
            wide, far = _with(f"{guard:.3g}", unit), _with(f"{high if side == 'up' else low:g}", unit)
            told = f"the expanded uncertainty of {wide} alone is larger than the {kind} of {far} allows"
            return f"{told}: no value from zero {side} could pass"
    zone = " and ".join(
        part
        for part, bound in ((f"at least {low + guard:.6g}", low), (f"at most {high - guard:.6g}", high))
        if math.isfinite(bound)
    )
    return f"within the guard band of {_with(f'{guard:.3g}', unit)} around the limit, {_with(zone, unit)} passes"


def _beyond(value: float, limit: Limit, low: float) -> str:
    found = _with(f"{value + 0.0:.6g}", limit.unit)  # no minus zero
    if value < low:
        return f"{found} is below the minimum of {_with(str(limit.minimum), limit.unit)}"
    return f"{found} is above the maximum of {_with(str(limit.maximum), limit.unit)}"


def _with(number: str, unit: str) -> str:
    return number if unit == "1" else f"{number} {unit}"


def _combined(figure: Figure, instrument: float | None) -> tuple[float | None, float]:
    """Combine in quadrature; degrees of freedom by Welch and Satterthwaite (GUM, equation G.2b).

    The instrument's uncertainty comes from a certificate and counts as exact.
    """
    if instrument is not None and not instrument >= 0:
        return math.inf, math.inf
    if figure.uncertainty is None or instrument is None or instrument == 0:
        known = figure.uncertainty if figure.uncertainty is not None else instrument
        return known, figure.dof if figure.uncertainty is not None else math.inf
    combined = math.hypot(figure.uncertainty, instrument)
    if figure.uncertainty == 0 or not math.isfinite(combined):
        return combined, math.inf
    ratio = combined / figure.uncertainty
    return combined, figure.dof * ratio * ratio * ratio * ratio


def _finite(number: float) -> float | None:
    return number if math.isfinite(number) else None


@lru_cache(maxsize=1024)
def _coverage(dof: float) -> float:
    if math.isinf(dof):
        return _NORMAL
    from scipy.special import stdtrit  # noqa: PLC0415 - slow to import, and few values have finite degrees of freedom

    return float(stdtrit(dof, 0.975))
