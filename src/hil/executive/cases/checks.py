"""`check`: one evaluated criterion, with limit, unit and decision rule from the catalogue."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from hil.documents.suggest import did_you_mean
from hil.documents.text import one_line
from hil.evidence import events
from hil.evidence.events import EventSink
from hil.executive.cases.certificate import standard_uncertainty, uncovered
from hil.executive.cases.escapes import OfThisProcess
from hil.executive.cases.facade import Facade
from hil.executive.cases.steps import Steps
from hil.model.errors import HilError, Misused
from hil.model.figure import Figure
from hil.model.provenance import Provenance, merged
from hil.model.verdict import Verdict
from hil.requirements.decision import Judgement, combined, given, judge
from hil.requirements.requirement import Decision, Kind, Limit, Requirement
from hil.requirements.units import UnitError

__all__ = ["CheckFailed", "Checks", "Evaluated"]


class CheckFailed(HilError):
    """A required check did not pass; the case stops there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluated:
    """One check that was evaluated."""

    requirement: str
    parameter: str
    of: str | None
    verdict: Verdict
    reason: str


class Checks(OfThisProcess):
    """The `check` fixture of one case.

    Args:
        requirements: the requirements of the case's marker, by id.
        steps: knows case and step.
        journal: where events are written.
        stands: whether a number appears in a source or parameter of the plan, so that a reviewer can read it.

    Attributes:
        refused: why calls were refused, in order: a check that was not made is an error, even if the case ignores it.
    """

    said = "`check`"

    def __init__(
        self,
        requirements: dict[str, Requirement],
        steps: Steps,
        journal: EventSink,
        stands: Callable[[float], bool] = lambda _: True,
    ) -> None:
        self._requirements = requirements
        self._stands = stands
        self._steps = steps
        self._journal = journal
        self._evaluated: list[Evaluated] = []
        self._kept: list[Evaluated] = []
        self.refused: list[HilError] = []

    @property
    def evaluated(self) -> tuple[Evaluated, ...]:
        """Every check so far, including repeated evaluations of the same criterion: the worst counts."""
        return tuple(self._evaluated)

    @property
    def kept(self) -> tuple[Evaluated, ...]:
        """Checks that had failed before the run was interrupted, in a part of it that is void; they count."""
        return tuple(self._kept)

    def keep(self, failed: Sequence[events.Failed]) -> None:
        """Keep checks that had failed before the run was interrupted: repeating them does not undo them."""
        self._kept += [
            Evaluated(
                requirement=each.requirement,
                parameter=each.parameter,
                of=each.of,
                verdict=Verdict.FAIL,
                reason=f"before the run was interrupted{each.reason and f', {each.reason}'}",
            )
            for each in failed
        ]

    def __call__(
        self,
        requirement: str,
        parameter: str,
        value: Figure | float | str,
        *,
        of: str | None = None,
        instrument: Facade | None = None,
        doubts: Sequence[str] = (),
        at: str = "",
        headline: str = "",
    ) -> Verdict:
        """Evaluate one criterion, record it, and continue; the case fails at its end.

        The same criterion may be evaluated repeatedly, such as in every turn of a loop: each is a check of its own, and
        the worst counts.

        Args:
            requirement: an id from the case's marker.
            parameter: a parameter of its limits.
            value: a figure; a bare number only if the unit is `1`; a text if the limit is one.
            of: which member of the limit's denominator (axis, channel).
            instrument: the role whose certificate adds its uncertainty in quadrature, and which then also counts as
                the value's source; readings and recordings of roles already carry theirs.
            doubts: why the data of the value cannot be trusted, a sentence each, such as gates that tripped;
                with any of them the check is INCONCLUSIVE, whatever the value.
            at: the conditions in words, such as `axis z, 25.0 degC`, shown with the value in every table of the
                report.
            headline: the name of the value on the first page of the report; checks of one name share an entry there.

        Raises:
            Misused: if the call does not match the catalogue.
        """
        of = of or None
        try:
            limit = self._limit(requirement, parameter, of)
            found = given(value, limit, f"{requirement} {parameter}")
            added, named = _of_instrument(instrument, found)
            origin = merged(getattr(value, "provenance", None), named)
            own = getattr(value, "provenance", None)
            unproven = (*_unproven(own), *getattr(value, "replaced", ()), *self._unreadable(own))
            stands = _Standing(
                added, origin, unproven, one_line(_text(at, "at")), one_line(_text(headline, "headline"))
            )
            self._evaluate(requirement, limit, of, found, stands, doubts=_sentences(doubts))
        except (Misused, UnitError) as error:
            self.refused.append(error)
            raise
        return self._evaluated[-1].verdict

    def require(
        self,
        requirement: str,
        parameter: str,
        value: Figure | float | str,
        *,
        of: str | None = None,
        instrument: Facade | None = None,
        doubts: Sequence[str] = (),
        at: str = "",
        headline: str = "",
    ) -> None:
        """Evaluate like a call, and stop the case unless it passes.

        Raises:
            CheckFailed: if the verdict is not good.
        """
        verdict = self(
            requirement, parameter, value, of=of, instrument=instrument, doubts=doubts, at=at, headline=headline
        )
        if not verdict.good:
            last = self._evaluated[-1]
            raise CheckFailed(f"{requirement} {parameter} is {verdict}: {last.reason}")

    def data(
        self,
        requirement: Requirement,
        limit: Limit,
        value: Figure | str,
        provenance: Provenance | None,
        reason: str = "",
    ) -> None:
        """Evaluate one criterion that a recording has to meet; if met, it is RECORDED.

        Args:
            requirement: the requirement that asks for the recording.
            limit: the criterion.
            value: the value found.
            provenance: of the recording.
            reason: why it is not met, if that says more than value and limit.
        """
        self._evaluate(requirement.id, limit, None, value, _Standing(None, provenance, _unproven(provenance)), reason)

    def _unreadable(self, provenance: Provenance | None) -> list[str]:
        """Return a sentence about numbers that took part without being readable anywhere, such as 100 / reading."""
        computed = [each for each in provenance.numbers if not self._stands(each)] if provenance else []
        if not computed:
            return []
        named = ", ".join(f"{each:.12g}" for each in computed[:_MOST_NAMED])
        more = " and more" if len(computed) > _MOST_NAMED else ""
        return [f"computed with {named}{more}, which stands neither in the plan's sources nor in its parameters"]

    def _limit(self, requirement: str, parameter: str, of: str | None) -> Limit:
        if requirement not in self._requirements:
            raise Misused(
                f"this case is not marked with requirement '{requirement}'"
                f"{did_you_mean(requirement, self._requirements)}",
                "add it to the marker, so that the plan knows before the case runs",
            )
        limits = {limit.parameter: limit for limit in self._requirements[requirement].limits}
        if parameter not in limits:
            raise Misused(f"{requirement} has no parameter '{parameter}'{did_you_mean(parameter, limits)}")
        limit = limits[parameter]
        if of not in (limit.of or (None,)):
            raise Misused(
                f"{requirement} {parameter} is evaluated of {', '.join(limit.of) or 'nothing in particular'}, not of"
                f" '{of}'{did_you_mean(of or '', limit.of)}"
            )
        return limit

    def _evaluate(
        self,
        requirement: str,
        limit: Limit,
        of: str | None,
        found: Figure | str,
        standing: _Standing,
        reason: str = "",
        doubts: tuple[str, ...] = (),
    ) -> None:
        """Judge a value as it will be recorded, to the digits that will be recorded, so that anybody can rejudge it."""
        judgement = judge(found if isinstance(found, str) else _written(found, limit, standing.added), limit)
        status = found.status.value if isinstance(found, Figure) else ""
        if judgement.verdict is Verdict.INCONCLUSIVE and _too_coarse(judgement, limit):
            judgement = replace(judgement, reason=self._with_place(requirement, judgement.reason))
        if reason and not judgement.verdict.good:
            judgement = replace(judgement, reason=reason)
        missing = standing.provenance.uncovered if standing.provenance else ()
        doubts = tuple(dict.fromkeys((*doubts, *(standing.provenance.doubts if standing.provenance else ()))))
        if missing and limit.bounded and limit.decision is Decision.GUARDED:
            judgement = replace(judgement, verdict=Verdict.INCONCLUSIVE, reason="; ".join(missing))
        if doubts:
            judgement = replace(judgement, verdict=Verdict.INCONCLUSIVE, reason="; ".join(doubts))
        self._note(requirement, limit, of, judgement, status, doubts, standing)

    def _with_place(self, requirement: str, reason: str) -> str:
        """Return a reason, with the place of the requirement that sets the limit."""
        place = self._requirements[requirement].place
        return f"{reason} ({place.path}:{place.line})" if place.path else reason

    def _note(
        self,
        requirement: str,
        limit: Limit,
        of: str | None,
        judgement: Judgement,
        status: str,
        doubts: tuple[str, ...],
        standing: _Standing,
    ) -> None:
        provenance = standing.provenance or Provenance()
        verdict = judgement.verdict
        if verdict is Verdict.PASS and self._requirements[requirement].kind is Kind.RECORD:
            verdict = Verdict.RECORDED
        check = events.Check(
            case=self._steps.case,
            step=self._steps.number,
            requirement=requirement,
            parameter=limit.parameter,
            of=of,
            value=judgement.value if isinstance(judgement.value, str) else _finite(judgement.value),
            unit=judgement.unit,
            uncertainty=_finite(judgement.uncertainty),
            dof=_finite(judgement.dof),
            status=status,
            doubts=doubts,
            limit=events.Bounds(min=limit.minimum, max=limit.maximum, equals=limit.equals),
            limit_unit=limit.unit,
            decision=judgement.decision,
            expanded=_finite(judgement.expanded),
            margin=_finite(judgement.margin),
            tur=_finite(judgement.tur),
            verdict=verdict,
            reason=judgement.reason,
            instruments=provenance.instruments,
            provenance=provenance.told,
            unproven=standing.unproven,
            uncovered=provenance.uncovered,
            at=standing.at,
            headline=standing.headline,
        )
        self._journal.write(check)
        self._evaluated.append(
            Evaluated(
                requirement=requirement, parameter=limit.parameter, of=of, verdict=verdict, reason=judgement.reason
            )
        )


def _too_coarse(judgement: Judgement, limit: Limit) -> bool:
    """Return whether a test uncertainty ratio is known, and below what the limit requires."""
    return limit.min_tur is not None and judgement.tur is not None and judgement.tur < float(limit.min_tur)


def _text(value: object, name: str) -> str:
    if not isinstance(value, str):
        raise Misused(f"'{name}' of a check is a text, found a {type(value).__name__}", "describe it in a few words")
    return value


def _sentences(doubts: object) -> tuple[str, ...]:
    if isinstance(doubts, str) or not isinstance(doubts, Sequence) or not all(isinstance(one, str) for one in doubts):
        raise Misused("doubts are a list of sentences", "give [str(gate) for gate in tripped]")
    return tuple(map(one_line, doubts))


@dataclass(frozen=True, slots=True)
class _Standing:
    """Standing of a value: an instrument's uncertainty, provenance, why it proves nothing, and conditions."""

    added: float | None
    provenance: Provenance | None
    unproven: tuple[str, ...]
    at: str = ""
    headline: str = ""


def _unproven(provenance: Provenance | None) -> tuple[str, ...]:
    if provenance is None:
        return (_FROM_NOWHERE,)
    return provenance.unproven if provenance.measured else (_FROM_NOWHERE, *provenance.unproven)


_MOST_NAMED = 3
_FROM_NOWHERE = "no reading, recording or answer stands behind this value"


def _of_instrument(instrument: Facade | None, found: Figure | str) -> tuple[float | None, Provenance | None]:
    """Return the uncertainty that an instrument's certificate adds, and the value's provenance from it."""
    if instrument is None or isinstance(found, str):
        return None, None
    if not isinstance(instrument, Facade):
        raise Misused(f"instrument is a role of this case, found a {type(instrument).__name__}", "give supply.coil")
    spec = instrument.instrument
    added = standard_uncertainty(spec.calibration, found.unit, found.value)
    missing = uncovered(spec, found.unit, found.value)
    return added, Provenance(instruments=(spec.name,), sources=(instrument.wire.name,), uncovered=missing)


def _digits(number: float) -> float:
    """Return a number to the 12 digits that every machine agrees on."""
    return float(f"{number:.12g}")


def _written(found: Figure, limit: Limit, added: float | None) -> Figure:
    """Return a figure in the limit's unit and with the digits that will be recorded."""
    figure = combined(found, limit, added)
    if not math.isfinite(figure.value):
        return figure
    uncertainty = figure.uncertainty
    return Figure(
        value=_digits(figure.value),
        unit=figure.unit,
        uncertainty=None if uncertainty is None or not math.isfinite(uncertainty) else _digits(uncertainty),
        dof=_digits(figure.dof),
        status=figure.status,
    )


def _finite(number: float | None) -> float | None:
    """Return a number for the journal, None if it is not finite."""
    return None if number is None or not math.isfinite(number) else _digits(number)
