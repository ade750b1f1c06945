"""Figure: a number with unit, uncertainty and provenance, and its JSON form."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from numbers import Integral, Real

from hil.model.provenance import BY_ITSELF, TEMPERATURES, TIMES_ZERO, Issued, Provenance, Word, merged

__all__ = ["Figure", "FigureStatus", "decoded", "effective_dof", "encoded"]

_DIFFERENCES = frozenset({"K", "kelvin", "delta_degC"})


class FigureStatus(StrEnum):
    """Status of a figure, as assigned by the analysis."""

    MEASURED = "measured"
    UPPER_LIMIT = "upper limit"
    NOT_OBSERVABLE = "not observable"
    MODEL_REJECTED = "model rejected"


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """A value with unit and standard uncertainty.

    Figures can be added, subtracted, multiplied and divided, also with plain numbers, which count as exact.
    Uncertainties propagate to first order (GUM 5.1.2), degrees of freedom by Welch-Satterthwaite (GUM G.2b). Figures of
    different instruments or units are independent. Those of one instrument in one unit share an unknown part of their
    errors: they are combined as fully correlated where errors would add, and as independent where they would cancel.
    The difference of two temperatures in degC is in K, and a difference in K can be added to a temperature in degC.

    Attributes:
        value: the number, in `unit`; NaN is allowed and never passes a check.
        unit: a unit string of the catalogue's notation (`deg/s/sqrt(Hz)`, `1` for a plain number).
        uncertainty: standard uncertainty (k = 1) in the same unit, None if unknown.
        dof: degrees of freedom of the uncertainty, infinite where it is taken as exact.
        status: status assigned by the analysis; only MEASURED and UPPER_LIMIT can pass.
        provenance: origin of the number, None if written by hand; a modified copy states what was changed.
    """

    value: float
    unit: str
    uncertainty: float | None = None
    dof: float = math.inf
    status: FigureStatus = FigureStatus.MEASURED
    provenance: Provenance | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        if self.uncertainty is not None and not self.uncertainty >= 0:
            raise ValueError(f"uncertainty must be a number not below zero, got {self.uncertainty}")
        if not self.dof > 0:
            raise ValueError(f"degrees of freedom must be above zero, got {self.dof}")
        if self.provenance is None or not _same(self.provenance.issued, self._numbers):
            self._trace()

    @property
    def written_by_hand(self) -> str:
        """The figure as text if it was written by hand rather than measured, otherwise empty."""
        if self.provenance is not None or self.status in {FigureStatus.NOT_OBSERVABLE, FigureStatus.MODEL_REJECTED}:
            return ""
        return f"the figure {self.value:.6g} {self.unit}".removesuffix(" 1")

    @property
    def replaced(self) -> tuple[str, ...]:
        """The numbers that were changed directly since it was issued, one sentence each."""
        if self.provenance is None or self.provenance.issued is None:
            return ()
        return tuple(_changed(self.provenance.issued, self._numbers))

    def without_reading(self, reason: str) -> Figure:
        """Return it with the reason why no reading is left in it."""
        return self if self.provenance is None else self.with_provenance(self.provenance.but(reason))

    def with_provenance(self, provenance: Provenance) -> Figure:
        """Return it as issued with this provenance; only the executive and the library call this."""
        bare = (float(self.value), self.unit, _plain(self.uncertainty), float(self.dof), self.status)
        value, unit, uncertainty, dof, status = bare
        issued = replace(provenance, issued=bare, recorded=None)
        return Figure(value=value, unit=unit, uncertainty=uncertainty, dof=dof, status=status, provenance=issued)

    @property
    def _numbers(self) -> Issued:
        return self.value, self.unit, self.uncertainty, self.dof, self.status

    def _trace(self) -> None:
        """Determine the origin of numbers that the provenance was not issued for."""
        own = getattr(self.value, "provenance", None)
        of_uncertainty = getattr(self.uncertainty, "provenance", None)
        for each, difference in ((own, False), (of_uncertainty, True)):
            if each is not None and each.recorded is not None:
                each.recorded.require(self.unit, difference=difference)
        before = None if self.provenance is None else self.provenance.issued
        found: Provenance | None = merged(own, of_uncertainty) if own is not None else None
        if self.provenance is not None and found is None:
            found = self.provenance.but(*_changed(before, self._numbers))
        elif found is not None and self.uncertainty is not None and of_uncertainty is None:
            exact = not self.uncertainty and not found.measured  # a parameter of the plan is exact
            found = found if exact else found.but("its uncertainty was written by hand")
        if found is not None:
            value, uncertainty = self.value, self.uncertainty
            object.__setattr__(self, "value", float(value) if hasattr(value, "provenance") else value)
            object.__setattr__(self, "uncertainty", uncertainty if of_uncertainty is None else _plain(uncertainty))
            object.__setattr__(self, "provenance", replace(found, issued=self._numbers, recorded=None))

    def __neg__(self) -> Figure:
        return self._made(-self.value, self.unit, [(-1.0, self)])

    def __abs__(self) -> Figure:
        return self if self.value >= 0 else -self

    def __add__(self, other: Figure | float) -> Figure:
        if not isinstance(other, Figure):
            return self._shifted(other)
        unit = self._changed(other) or other._changed(self) or self._common(other)
        return self._made(self.value + other.value, unit, [(1.0, self), (1.0, other)])

    __radd__ = __add__

    def __sub__(self, other: Figure | float) -> Figure:
        if not isinstance(other, Figure):
            return self._shifted(-other)
        unit = self._changed(other) or self._common(other)
        unit = "K" if other.unit in TEMPERATURES else unit
        made = self._made(self.value - other.value, unit, [(1.0, self), (-1.0, other)])
        return made.without_reading(BY_ITSELF) if other is self else made

    def __rsub__(self, other: float) -> Figure:
        return (-self)._shifted(other)

    def __mul__(self, other: Figure | float) -> Figure:
        if not isinstance(other, Figure):
            made = self._made(self.value * other, self.unit, [(float(other), self)], other)
            return made if other else made.without_reading(TIMES_ZERO)
        parts = [(other.value, self), (self.value, other)]
        return self._made(self.value * other.value, _product(self.unit, other.unit), parts)

    __rmul__ = __mul__

    def __truediv__(self, other: Figure | float) -> Figure:
        if not isinstance(other, Figure):
            return self._made(self.value / other, self.unit, [(1.0 / other, self)], other)
        if not other.value:
            return self._made(math.nan, _quotient(self.unit, other.unit), [(math.nan, self), (math.nan, other)])
        ratio = self.value / other.value
        parts = [(1.0 / other.value, self), (-ratio / other.value, other)]
        made = self._made(ratio, _quotient(self.unit, other.unit), parts)
        return made.without_reading(BY_ITSELF) if other is self else made

    def __rtruediv__(self, other: float) -> Figure:
        value = float(other) / self.value if self.value else math.nan
        parts = [(-value / self.value if self.value else math.nan, self)]
        return self._made(value, _quotient("1", self.unit), parts, other)

    def _shifted(self, constant: float) -> Figure:
        if self.unit != "1":
            raise ValueError(f"a plain number cannot be added to a figure in {self.unit!r}: give a Figure in that unit")
        return self._made(self.value + constant, self.unit, [(1.0, self)], constant)

    def _changed(self, other: Figure) -> str:
        """Return the unit of a temperature changed by a difference, empty in other cases."""
        return self.unit if self.unit in TEMPERATURES and other.unit in _DIFFERENCES else ""

    def _common(self, other: Figure) -> str:
        if self.unit != other.unit:
            raise ValueError(f"figures in {self.unit!r} and {other.unit!r} cannot be added: bring them to one unit")
        return self.unit

    def _made(self, value: float, unit: str, parts: list[tuple[float, Figure]], written: float | None = None) -> Figure:
        statuses = [figure.status for _, figure in parts]
        poor = (FigureStatus.MODEL_REJECTED, FigureStatus.NOT_OBSERVABLE, FigureStatus.UPPER_LIMIT)
        status = next((each for each in poor if each in statuses), FigureStatus.MEASURED)
        if status is FigureStatus.UPPER_LIMIT:
            status = FigureStatus.NOT_OBSERVABLE  # an upper limit need not be one after arithmetic
        uncertainty, dof = _propagated(parts)
        made = Figure(value=value, unit=unit, uncertainty=uncertainty, dof=dof, status=status)
        found = merged(*(_of_operand(figure) for _, figure in parts), getattr(written, "provenance", None))
        if found is not None:
            found = found.with_numbers(written)
        return made if found is None else made.with_provenance(found.through("arithmetic of figures"))


def _of_operand(figure: Figure) -> Provenance | None:
    if figure.written_by_hand:
        return Provenance(unproven=(f"the plan itself wrote {figure.written_by_hand}, which stands behind it",))
    return None if figure.provenance is None else replace(figure.provenance, issued=None).but(*figure.replaced)


def _propagated(parts: list[tuple[float, Figure]]) -> tuple[float | None, float]:
    """Return uncertainty and degrees of freedom of a sum of figures, each with its sensitivity."""
    if any(figure.uncertainty is None for _, figure in parts):
        return None, math.inf
    shares = [(abs(sensitivity) * (figure.uncertainty or 0.0), figure.dof) for sensitivity, figure in parts]
    if any(math.isnan(share) for share, _ in shares):
        return None, math.inf
    if len(parts) == 1:
        return shares[0]
    if parts[0][0] * parts[1][0] > 0 and _share_instrument(parts[0][1], parts[1][1]):
        return sum(share for share, _ in shares), min(dof for _, dof in shares)
    return math.hypot(*(share for share, _ in shares)), effective_dof((share**2, dof) for share, dof in shares)


def _share_instrument(one: Figure, other: Figure) -> bool:
    if one.provenance is None or other.provenance is None or one.unit != other.unit:
        return False
    return not set(one.provenance.instruments).isdisjoint(other.provenance.instruments)


def effective_dof(parts: Iterable[tuple[float, float]]) -> float:
    """Return the effective degrees of freedom of a sum of variances (Welch-Satterthwaite; GUM G.2b).

    Args:
        parts: pairs of variance and its degrees of freedom; all variances in one unit.
    """
    pairs = list(parts)
    total = sum(variance for variance, _ in pairs)
    # Shares of the total, because squares of small variances would underflow.
    spread = sum((variance / total) ** 2 / dof for variance, dof in pairs) if total > 0 else 0.0
    return 1.0 / spread if spread > 0 else math.inf


def _product(one: str, other: str) -> str:
    return other if one == "1" else one if other == "1" else f"{_factor(one)}.{_factor(other)}"


def _quotient(above: str, below: str) -> str:
    if above == below:
        return "1"
    return above if below == "1" else f"{_factor(above)}/{_factor(below)}"


def _factor(unit: str) -> str:
    return unit if unit.isalpha() or unit == "1" else f"({unit})"


_NAMES = ("value was", "unit was", "uncertainty was", "degrees of freedom were", "status was")


def _same(one: Issued | None, other: Issued) -> bool:
    return one is not None and not _different(one, other)


def _different(one: Issued, other: Issued) -> list[str]:
    pairs = zip(_NAMES, one, other, strict=True)
    return [name for name, before, now in pairs if before != now and (before == before or now == now)]  # noqa: PLR0124 - NaN


def _changed(before: Issued | None, now: Issued) -> list[str]:
    """Return a sentence for each number that differs from the issued one."""
    if before is None:
        return ["its value was written by hand"]
    return [f"its {name} replaced by hand" for name in _different(before, now)]


def _plain(number: float | None) -> float | None:
    return None if number is None else float(number)


def encoded(value: object) -> object:
    """Encode a value for JSON: figures as mappings, tuples as lists, NumPy numbers as plain, NaN and inf as None."""
    if isinstance(value, Figure):
        return {
            "value": encoded(value.value),
            "unit": value.unit,
            "uncertainty": encoded(value.uncertainty),
            "dof": encoded(value.dof),
            "status": value.status.value,
        }
    if isinstance(value, Real) and not isinstance(value, bool):  # type: ignore[unreachable]
        return _number(value)
    if isinstance(value, Mapping):
        return {str(key): encoded(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [encoded(item) for item in value]
    return str(value) if type(value) is Word else value


def _number(value: Real) -> int | float | None:
    if isinstance(value, Integral):
        return int(value)
    return float(value) if math.isfinite(value) else None


def decoded(value: object) -> object:
    """Decode what `encoded` returned, to a value equivalent for a case."""
    if isinstance(value, Mapping) and set(value) == {"value", "unit", "uncertainty", "dof", "status"}:
        return Figure(
            value=math.nan if value["value"] is None else float(value["value"]),
            unit=str(value["unit"]),
            uncertainty=value["uncertainty"],
            dof=math.inf if value["dof"] is None else float(value["dof"]),
            status=FigureStatus(value["status"]),
        )
    if isinstance(value, list):
        return tuple(decoded(item) for item in value)
    return value
