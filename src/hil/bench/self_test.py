"""The self-test of a limit: does its monitor trip on readings outside it, and only on those?"""

from __future__ import annotations

import math
from collections.abc import Iterator

from hil.bench.derived.derivation import INTEGRALS, TIMES, UNITS, Derivation
from hil.bench.derived.quantities import derivation_of
from hil.bench.envelope import Monitor
from hil.clock.port import NANOSECONDS
from hil.model.envelope import EnvelopeLimit
from hil.model.figure import Figure

__all__ = ["self_test"]

_BEYOND, _WITHIN = 1.001, 0.999
_STEP_NS = 1_000
_VOLTS = 4.0

_Row = tuple[int, tuple[float, ...]]


def _rehearsals(limit: EnvelopeLimit, derivation: Derivation) -> Iterator[tuple[list[_Row], bool]]:
    """Yield sequences of rows (an instant in ns, a value per source), and whether the limit must trip on them."""
    builder = _RowBuilder(limit, derivation)
    yield [(0, builder.at(math.nan, builder.amperes))] * limit.debounce, True
    yield from _sums(builder) if limit.quantity in INTEGRALS else _levels(builder)


class _RowBuilder:
    """Builds the rows that test one limit."""

    def __init__(self, limit: EnvelopeLimit, derivation: Derivation) -> None:
        self.limit = limit
        self._sources = derivation.sources
        self.amperes = max(1.0, 2 * (limit.threshold or 0.0)) * (-1 if limit.flow == "discharging" else 1)

    def at(self, number: float, amperes: float) -> tuple[float, ...]:
        """Return values of all sources: the watched one first, a current carries the flow, any other is 4 V or 0."""
        first = () if self.limit.quantity in INTEGRALS else (number,)
        others = self._sources[len(first) :]
        rest = [amperes if name == "current" else _VOLTS for _, name in others]
        if self.limit.against:
            rest[-1] = 0.0
        if not first and math.isnan(number):
            rest[0] = number
        return (*first, *rest)

    def lasting(self, seconds: float, amperes: float, began_ns: int = 0) -> list[_Row]:
        """Return rows of a constant current from an instant on, with as many final rows as the debounce needs."""
        ends_ns = began_ns + round(seconds * NANOSECONDS)
        rows = [began_ns, *(ends_ns + place * _STEP_NS for place in range(self.limit.debounce))]
        return [(at_ns, self.at(0.0, amperes)) for at_ns in rows]

    def moving(self, slope: float, amperes: float) -> list[_Row]:
        """Return rows of a quantity that changes at `slope`, in the limit's unit."""
        over_s = self.limit.over_s or 0.0
        unit_s = TIMES[self.limit.unit.partition("/")[2]]
        seconds = [0.0, *(over_s * (1 + place) for place in range(self.limit.debounce))]
        return [(round(each * NANOSECONDS), self.at(slope * each / unit_s, amperes)) for each in seconds]

    def staying(self, number: float, amperes: float) -> list[_Row]:
        """Return rows of a constant value."""
        return [(place * _STEP_NS, self.at(number, amperes)) for place in range(self.limit.debounce)]


def _sums(builder: _RowBuilder) -> Iterator[tuple[list[_Row], bool]]:
    """Yield a current up to the maximum, the same in the other direction, and both with a reversal in between."""
    limit, most = builder.limit, builder.limit.maximum or 0.0
    per_s = {"charge": abs(builder.amperes), "energy": abs(builder.amperes) * _VOLTS, "duration": 1.0}[limit.quantity]
    seconds = most * UNITS[limit.quantity][limit.unit] / per_s
    yield builder.lasting(seconds * _BEYOND, builder.amperes), True
    yield builder.lasting(seconds * _WITHIN, builder.amperes), False
    yield builder.lasting(seconds * _BEYOND, -builder.amperes), False
    yield builder.lasting(seconds * _BEYOND, 0.0), False
    half = builder.lasting(seconds * 0.6, builder.amperes)
    turned = half[-1][0] + _STEP_NS
    again = builder.lasting(seconds * 0.6, builder.amperes, turned + _STEP_NS)
    yield [*half, (turned, builder.at(0.0, -builder.amperes)), *again], builder.limit.since == "arm"
    yield [*half, (turned, builder.at(0.0, 0.0)), *again], True


def _levels(builder: _RowBuilder) -> Iterator[tuple[list[_Row], bool]]:
    """Yield values beyond and within each bound, with the current that the limit is about and without it."""
    limit = builder.limit
    if limit.quantity == "unchanged":
        yield from _stuck(builder)
        return
    lowest = -math.inf if limit.minimum is None else limit.minimum
    highest = math.inf if limit.maximum is None else limit.maximum
    course = builder.moving if limit.quantity == "slope" else builder.staying
    for bound, way in ((limit.minimum, -1.0), (limit.maximum, 1.0)):
        if bound is not None:
            margin = abs(bound) * (_BEYOND - 1) or _BEYOND - 1
            beyond, within = bound + way * margin, bound - way * margin
            yield course(beyond, builder.amperes), True
            if lowest <= within <= highest:
                yield course(within, builder.amperes), False
            if builder.limit.flow:
                yield course(beyond, 0.0), False
            if builder.limit.flow in {"charging", "discharging"}:
                yield course(beyond, -builder.amperes), False


def _stuck(builder: _RowBuilder) -> Iterator[tuple[list[_Row], bool]]:
    """Yield constant values for the longest time, with and without a current, and ones that leave the band midway."""
    seconds = (builder.limit.maximum or 0.0) * UNITS["unchanged"][builder.limit.unit]
    yield builder.lasting(seconds * _BEYOND, builder.amperes), True
    yield builder.lasting(seconds * _WITHIN, builder.amperes), False
    if builder.limit.flow:
        yield builder.lasting(seconds * _BEYOND, 0.0), False
    half = builder.lasting(seconds * 0.6, builder.amperes)
    left = half[-1][0] + _STEP_NS
    moved = (left, builder.at(2 * (builder.limit.band or 0.0) + 1.0, builder.amperes))
    yield [*half, moved, *builder.lasting(seconds * 0.6, builder.amperes, left + _STEP_NS)], False


def self_test(limit: EnvelopeLimit) -> bool:
    """Return whether a monitor of this limit trips on readings outside it, and only on those.

    Tried are a value beyond each bound, one that is not a number, and a value inside; for a derived quantity, sequences
    of rows that lead to such values, and sequences that only look like them.
    """
    if limit.is_derived:
        return _derived_self_test(limit)
    low = limit.minimum if limit.minimum is not None else -math.inf
    high = limit.maximum if limit.maximum is not None else math.inf
    inside = min(max(0.0, low), high)
    bad = [math.nan] + [
        math.nextafter(bound, away) for bound, away in ((low, -math.inf), (high, math.inf)) if math.isfinite(bound)
    ]
    return all(_trips(limit, value) for value in bad) and not _trips(limit, inside)


def _derived_self_test(limit: EnvelopeLimit) -> bool:
    for rows, trips in _rehearsals(limit, derivation_of(limit)):
        derivation = derivation_of(limit)
        monitor = Monitor(limit, lambda: Figure(value=math.nan, unit=limit.unit), 0, derivation)
        found = [monitor.judge(monitor.counted(Figure(value=derivation.row(*row), unit=limit.unit)), 0) for row in rows]
        if any(found) is not trips:
            return False
    return True


def _trips(limit: EnvelopeLimit, value: float) -> bool:
    monitor = Monitor(limit, lambda: Figure(value=value, unit=limit.unit), 0)
    return any(monitor.judge(Figure(value=value, unit=limit.unit), 0) for _ in range(limit.debounce))
