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
    """Yield courses of rows, and whether the limit must trip on them: instants in ns, and a number per source."""
    told = _Course(limit, derivation)
    yield [(0, told.at(math.nan, told.amperes))] * limit.debounce, True
    yield from _sums(told) if limit.quantity in INTEGRALS else _levels(told)


class _Course:
    """Builds rows of one limit."""

    def __init__(self, limit: EnvelopeLimit, derivation: Derivation) -> None:
        self.limit = limit
        self._sources = derivation.sources
        self.amperes = max(1.0, 2 * (limit.threshold or 0.0)) * (-1 if limit.flow == "discharging" else 1)

    def at(self, number: float, amperes: float) -> tuple[float, ...]:
        """Return numbers of all sources: what is watched comes first, a current is the flow, anything else 4 V or 0."""
        first = () if self.limit.quantity in INTEGRALS else (number,)
        others = self._sources[len(first) :]
        rest = [amperes if name == "current" else _VOLTS for _, name in others]
        if self.limit.against:
            rest[-1] = 0.0
        if not first and math.isnan(number):
            rest[0] = number
        return (*first, *rest)

    def lasting(self, seconds: float, amperes: float, began_ns: int = 0) -> list[_Row]:
        """Return rows of one current from some instant on, the last ones as many as the debounce needs."""
        ends_ns = began_ns + round(seconds * NANOSECONDS)
        rows = [began_ns, *(ends_ns + place * _STEP_NS for place in range(self.limit.debounce))]
        return [(at_ns, self.at(0.0, amperes)) for at_ns in rows]

    def moving(self, slope: float, amperes: float) -> list[_Row]:
        """Return rows of a quantity that goes up by `slope` of the limit's unit."""
        over_s = self.limit.over_s or 0.0
        unit_s = TIMES[self.limit.unit.partition("/")[2]]
        seconds = [0.0, *(over_s * (1 + place) for place in range(self.limit.debounce))]
        return [(round(each * NANOSECONDS), self.at(slope * each / unit_s, amperes)) for each in seconds]

    def staying(self, number: float, amperes: float) -> list[_Row]:
        """Return rows of one number."""
        return [(place * _STEP_NS, self.at(number, amperes)) for place in range(self.limit.debounce)]


def _sums(told: _Course) -> Iterator[tuple[list[_Row], bool]]:
    """A current of one direction until the most, the same of the other, and both with a change of direction between."""
    limit, most = told.limit, told.limit.maximum or 0.0
    per_s = {"charge": abs(told.amperes), "energy": abs(told.amperes) * _VOLTS, "duration": 1.0}[limit.quantity]
    seconds = most * UNITS[limit.quantity][limit.unit] / per_s
    yield told.lasting(seconds * _BEYOND, told.amperes), True
    yield told.lasting(seconds * _WITHIN, told.amperes), False
    yield told.lasting(seconds * _BEYOND, -told.amperes), False
    yield told.lasting(seconds * _BEYOND, 0.0), False
    half = told.lasting(seconds * 0.6, told.amperes)
    turned = half[-1][0] + _STEP_NS
    again = told.lasting(seconds * 0.6, told.amperes, turned + _STEP_NS)
    yield [*half, (turned, told.at(0.0, -told.amperes)), *again], told.limit.since == "arm"
    yield [*half, (turned, told.at(0.0, 0.0)), *again], True


def _levels(told: _Course) -> Iterator[tuple[list[_Row], bool]]:
    """What is beyond each bound, and what is not, with the current that the limit is about and without it."""
    limit = told.limit
    if limit.quantity == "unchanged":
        yield from _stuck(told)
        return
    lowest = -math.inf if limit.minimum is None else limit.minimum
    highest = math.inf if limit.maximum is None else limit.maximum
    course = told.moving if limit.quantity == "slope" else told.staying
    for bound, way in ((limit.minimum, -1.0), (limit.maximum, 1.0)):
        if bound is not None:
            margin = abs(bound) * (_BEYOND - 1) or _BEYOND - 1
            beyond, within = bound + way * margin, bound - way * margin
            yield course(beyond, told.amperes), True
            if lowest <= within <= highest:
                yield course(within, told.amperes), False
            if told.limit.flow:
                yield course(beyond, 0.0), False
            if told.limit.flow in {"charging", "discharging"}:
                yield course(beyond, -told.amperes), False


def _stuck(told: _Course) -> Iterator[tuple[list[_Row], bool]]:
    """Numbers that stay for the longest time, with and without a current, and such as leave the band in between."""
    seconds = (told.limit.maximum or 0.0) * UNITS["unchanged"][told.limit.unit]
    yield told.lasting(seconds * _BEYOND, told.amperes), True
    yield told.lasting(seconds * _WITHIN, told.amperes), False
    if told.limit.flow:
        yield told.lasting(seconds * _BEYOND, 0.0), False
    half = told.lasting(seconds * 0.6, told.amperes)
    left = half[-1][0] + _STEP_NS
    moved = (left, told.at(2 * (told.limit.band or 0.0) + 1.0, told.amperes))
    yield [*half, moved, *told.lasting(seconds * 0.6, told.amperes, left + _STEP_NS)], False


def self_test(limit: EnvelopeLimit) -> bool:
    """Return whether a monitor of this limit trips on readings outside it, and only on those.

    Tried are a value beyond each bound, one that is not a number, and a value inside; where the quantity is derived,
    courses of numbers that come to such values, and such as look like them.
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
