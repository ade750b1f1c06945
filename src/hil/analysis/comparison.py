"""Comparison of figures: deviation of two with its significance, and ranking of several.

Two figures are distinguishable where their difference exceeds what their uncertainties explain: t = |b - a| / u with
u^2 = u_a^2 + u_b^2, against Student's distribution with the effective degrees of freedom (JCGM 100:2008, G.4). Their
errors are taken as independent.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from hil.analysis.tracing import traced
from hil.model.errors import Refused
from hil.model.figure import Figure, FigureStatus, effective_dof

__all__ = ["Deviation", "Place", "Ranking", "normalised_error", "rank", "relative_deviation"]

_CONFIDENCE = 0.95
_DECIMALS = 10  # of a deviation: further digits are rounding of the two figures


@dataclass(frozen=True, slots=True, kw_only=True)
class Deviation:
    """Deviation of a second figure from a first.

    Attributes:
        relative: (second - first) / |first|, in unit 1; NOT_OBSERVABLE where one of the two is not measured, or the
            first is indistinguishable from zero.
        difference: second - first, in the unit of the figures, even if the first is indistinguishable from zero;
            NOT_OBSERVABLE where one of the two is not measured.
        probability: p-value: that equal figures differ this much by chance; NaN where it is unknown.
        significant: whether the difference exceeds what the uncertainties explain.
        remark: conclusion on the difference, a sentence without its full stop.
    """

    relative: Figure
    difference: Figure
    probability: float
    significant: bool
    remark: str


@traced
def relative_deviation(first: Figure, second: Figure, *, confidence: float = _CONFIDENCE) -> Deviation:
    """Return the deviation of a second figure from a first, (second - first) / |first|, and its significance.

    Its standard uncertainty is sqrt(u_2^2 + (x_2 / x_1)^2 u_1^2) / |x_1|, to first order, valid while the first figure
    is known to 30 % or better. The probability is that of the difference itself, and is valid for any figures.

    Source: GUM 5.1.2 and G.4.

    Args:
        first: the reference figure.
        second: the figure to compare, in the same unit.
        confidence: confidence level for a difference, and for the first figure being nonzero.

    Raises:
        Refused: the figures are in different units, or the confidence is not between 0 and 1.
    """
    _require_comparable({"first": first, "second": second}, confidence)
    difference = _difference(first, second)
    poor = _unmeasured(first) or _unmeasured(second)
    if poor:
        whose = "first" if _unmeasured(first) else "second"
        return Deviation(
            relative=_nowhere(),
            difference=difference,
            probability=math.nan,
            significant=False,
            remark=f"the {whose} figure is {poor}",
        )
    relative = round((second.value - first.value) / abs(first.value), _DECIMALS) if first.value else math.nan
    if first.uncertainty is None or second.uncertainty is None:
        found = Figure(value=relative, unit="1") if first.value else _nowhere()
        remark = "whether the figures differ cannot be said: an uncertainty is not known"
        return Deviation(relative=found, difference=difference, probability=math.nan, significant=False, remark=remark)
    probability = _probability(first, second)
    significant = bool(probability < 1.0 - confidence)
    explained = "is beyond what the uncertainties explain" if significant else "is within the uncertainties"
    remark = f"the difference {explained} (p = {probability:.2g})"
    if _probability(first, Figure(value=0.0, unit=first.unit, uncertainty=0.0)) >= 1.0 - confidence:
        remark += ", and the first figure cannot be told from zero"
        return Deviation(
            relative=_nowhere(),
            difference=difference,
            probability=probability,
            significant=significant,
            remark=remark,
        )
    parts = [
        ((second.uncertainty / first.value) ** 2, second.dof),
        ((second.value * first.uncertainty / first.value**2) ** 2, first.dof),
    ]
    uncertainty = math.sqrt(sum(variance for variance, _ in parts))
    found = Figure(value=relative, unit="1", uncertainty=uncertainty, dof=effective_dof(parts))
    return Deviation(
        relative=found, difference=difference, probability=probability, significant=significant, remark=remark
    )


@traced
def normalised_error(figure: Figure, expected: Figure | None = None, *, confidence: float = _CONFIDENCE) -> Figure:
    """Return the normalised error |figure - expected| / U, U the expanded uncertainty: at most 1 if they agree.

    Unlike a relative deviation it is meaningful for figures indistinguishable from zero. The coverage factor is that of
    Student's distribution with the effective degrees of freedom. Of n pairs of equal figures n (1 - confidence) exceed
    1 by chance: use more than 95 % to compare many. It is NOT_OBSERVABLE where a figure is not measured or its
    uncertainty is unknown, and infinite where figures without uncertainty differ.

    Source: ISO/IEC 17043:2010, B.3.1.3 (E_n), with GUM G.4 for the coverage factor.

    Args:
        figure: the measured figure.
        expected: the expected figure, in the same unit; zero if None.
        confidence: confidence level of the expanded uncertainty.

    Raises:
        Refused: the figures are in different units, or the confidence is not between 0 and 1.
    """
    from scipy.special import stdtrit  # noqa: PLC0415 - scipy is slow to import

    other = Figure(value=0.0, unit=figure.unit, uncertainty=0.0) if expected is None else expected
    _require_comparable({"figure": figure, "expected": other}, confidence)
    difference = _difference(other, figure)
    if difference.status is not FigureStatus.MEASURED or difference.uncertainty is None:
        return _nowhere()
    if not difference.value:
        return Figure(value=0.0, unit="1")
    expanded = float(stdtrit(difference.dof, 0.5 + confidence / 2.0)) * difference.uncertainty
    return Figure(value=round(abs(difference.value) / expanded, _DECIMALS) if expanded else math.inf, unit="1")


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Place of one figure among several, the lowest first.

    Attributes:
        name: name of the figure.
        figure: the figure.
        rank: best possible place: one more than the number of significantly lower figures.
        last: worst possible place.
        ties: names of the figures indistinguishable from it, in order.
    """

    name: str
    figure: Figure
    rank: int
    last: int
    ties: tuple[str, ...]

    @property
    def said(self) -> str:
        """The place as text: `3`, or `3-5` for a tie."""
        return str(self.rank) if self.rank == self.last else f"{self.rank}-{self.last}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Ranking:
    """Ranking of several figures, with those that cannot be ranked.

    Attributes:
        places: places in ascending order of value.
        unranked: why a figure has no place, by name.
        confidence: confidence level for distinguishing two figures.
    """

    places: tuple[Place, ...]
    unranked: Mapping[str, str]
    confidence: float


@traced
def rank(
    figures: Mapping[str, Figure],
    *,
    doubts: Mapping[str, Sequence[str]] | None = None,
    confidence: float = _CONFIDENCE,
) -> Ranking:
    """Rank figures, the lowest value first; for drifts and other signed figures pass magnitudes.

    A figure's rank is one more than the number of significantly lower figures, so that indistinguishable figures share
    ranks. Ties are not transitive: of three, the first may differ from the last while the middle one ties with both.
    Pairs are compared one by one: of twenty pairs of equal figures one differs significantly by chance at
    95 %.

    Figures that are not measured, not finite, doubtful, or of unknown uncertainty are not ranked.

    Args:
        figures: figures by name, in one unit.
        doubts: reasons not to trust a figure, by name; missing or empty for none.
        confidence: confidence level for distinguishing two figures.

    Raises:
        Refused: the figures are in different units, or the confidence is not between 0 and 1.
    """
    _require_comparable(figures, confidence)
    doubted = {name: "; ".join(said) for name, said in (doubts or {}).items() if said}
    unranked = {name: doubted.get(name) or _unrankable(figure) for name, figure in figures.items()}
    ranked = sorted((name for name, reason in unranked.items() if not reason), key=lambda name: figures[name].value)
    apart = {
        (low, high): _probability(figures[low], figures[high]) < 1.0 - confidence
        for place, low in enumerate(ranked)
        for high in ranked[place + 1 :]
    }
    return Ranking(
        places=tuple(_place(name, figures[name], ranked, apart) for name in ranked),
        unranked={name: reason for name, reason in unranked.items() if reason},
        confidence=confidence,
    )


def _place(name: str, figure: Figure, ranked: Sequence[str], apart: Mapping[tuple[str, str], bool]) -> Place:
    lower = sum(apart.get((other, name), False) for other in ranked)
    higher = sum(apart.get((name, other), False) for other in ranked)
    ties = tuple(
        other
        for other in ranked
        if other != name and not apart.get((other, name), False) and not apart.get((name, other), False)
    )
    return Place(name=name, figure=figure, rank=1 + lower, last=len(ranked) - higher, ties=ties)


def _require_comparable(figures: Mapping[str, Figure], confidence: float) -> None:
    units = dict.fromkeys(figure.unit for figure in figures.values())
    if len(units) > 1:
        raise Refused(f"figures in {' and '.join(units)} cannot be compared", "bring them to one unit")
    if not 0.0 < confidence < 1.0:
        raise Refused(f"a confidence of {confidence:g} is not between 0 and 1", "give 0.95 for 95 %")


def _unmeasured(figure: Figure) -> str:
    """Return why a figure is not a measured number, empty if it is."""
    if figure.status is FigureStatus.UPPER_LIMIT:
        return f"an upper limit of {figure.value:.3g} {figure.unit}"
    if figure.status is not FigureStatus.MEASURED:
        return {
            FigureStatus.NOT_OBSERVABLE: "not observable",
            FigureStatus.MODEL_REJECTED: "of a model that the record rejects",
        }[figure.status]
    return "" if math.isfinite(figure.value) else "no finite number"


def _unrankable(figure: Figure) -> str:
    return _unmeasured(figure) or ("of unknown uncertainty" if figure.uncertainty is None else "")


def _nowhere(unit: str = "1") -> Figure:
    return Figure(value=math.nan, unit=unit, status=FigureStatus.NOT_OBSERVABLE)


def _difference(first: Figure, second: Figure) -> Figure:
    """Return second - first, with independent errors."""
    if _unmeasured(first) or _unmeasured(second):
        return _nowhere(first.unit)
    value = second.value - first.value
    if first.uncertainty is None or second.uncertainty is None:
        return Figure(value=value, unit=first.unit)
    spread, dof = _spread(first, second)
    return Figure(value=value, unit=first.unit, uncertainty=spread, dof=dof)


def _spread(first: Figure, second: Figure) -> tuple[float, float]:
    """Return the standard uncertainty of the difference of two figures, and its effective degrees of freedom."""
    parts = [((each.uncertainty or 0.0) ** 2, each.dof) for each in (first, second)]
    return math.sqrt(sum(variance for variance, _ in parts)), effective_dof(parts)


def _probability(one: Figure, other: Figure) -> float:
    """Return the p-value of the difference of two figures of known uncertainty."""
    from scipy.special import stdtr  # noqa: PLC0415 - scipy is slow to import

    spread, dof = _spread(one, other)
    difference = abs(one.value - other.value)
    if not spread:
        return 0.0 if difference else 1.0
    return 2.0 * float(stdtr(dof, -difference / spread))
