"""The self-test of a limit: does its monitor trip on what it must trip on, and only on that?"""

from __future__ import annotations

import math

from hil.bench.derived.making import derivation_of
from hil.bench.derived.rehearsal import rehearsals
from hil.bench.envelope import Monitor
from hil.model.envelope import Derived, EnvelopeLimit
from hil.model.figure import Figure

__all__ = ["self_test"]


def self_test(limit: EnvelopeLimit) -> bool:
    """Return whether a monitor of this limit trips on what it must trip on, and only on that.

    Tried are a value beyond each bound, a value that is no number, and a value inside; where the quantity is derived,
    courses of numbers that come to such values, and such as look like them.
    """
    if limit.derived is not None:
        return _derived_self_test(limit, limit.derived)
    low = limit.minimum if limit.minimum is not None else -math.inf
    high = limit.maximum if limit.maximum is not None else math.inf
    inside = min(max(0.0, low), high)
    bad = [math.nan] + [
        math.nextafter(bound, away) for bound, away in ((low, -math.inf), (high, math.inf)) if math.isfinite(bound)
    ]
    return all(_trips(limit, value) for value in bad) and not _trips(limit, inside)


def _derived_self_test(limit: EnvelopeLimit, how: Derived) -> bool:
    for rows, trips in rehearsals(limit, how, derivation_of(limit, how)):
        derivation = derivation_of(limit, how)
        monitor = Monitor(limit, lambda: Figure(value=math.nan, unit=limit.unit), 0, derivation)
        found = [monitor.judge(monitor.counted(Figure(value=derivation.row(*row), unit=limit.unit)), 0) for row in rows]
        if any(found) is not trips:
            return False
    return True


def _trips(limit: EnvelopeLimit, value: float) -> bool:
    monitor = Monitor(limit, lambda: Figure(value=value, unit=limit.unit), 0)
    return any(monitor.judge(Figure(value=value, unit=limit.unit), 0) for _ in range(limit.debounce))
