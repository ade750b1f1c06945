"""What the clocks of the machine do while a run goes on."""

from __future__ import annotations

import pytest
from case_parts import Written

from hil.clock.wall import Clocks
from hil.executive.journaling.record import Timekeeping


def events(*moments):
    """Return what is written down over these moments: time of day, time since boot, and the same without suspends."""
    clocks = iter([Clocks(*moment) for moment in moments])
    written = Written()
    timekeeping = Timekeeping(written, lambda: next(clocks))
    for _ in moments[1:]:
        timekeeping.tick()
    return [(event["kind"], event["seconds"]) for event in written.events]


@pytest.mark.parametrize(
    ("after", "expected"),
    [
        ((1060.0, 160.0, 60.0), []),
        ((1060.5, 160.0, 59.5), []),
        ((8260.0, 7360.0, 60.0), [("suspended", 7200.0)]),
        ((4660.0, 160.0, 60.0), [("clock-jump", 3600.0)]),
        ((1057.0, 160.0, 60.0), [("clock-jump", -3.0)]),
        ((4660.0, 7360.0, 60.0), [("suspended", 7200.0), ("clock-jump", -3600.0)]),
    ],
)
def test_a_suspend_and_a_jump_are_events(after, expected):
    """A suspend moves the clock since boot alone, a jump the time of day alone; drift below a second is neither."""
    assert events((1000.0, 100.0, 0.0), after) == expected


def test_each_is_told_once():
    """What was written down at one look is not written down at the next."""
    assert events((0.0, 0.0, 0.0), (10.0, 10.0, 0.0), (11.0, 11.0, 1.0)) == [("suspended", 10.0)]
