"""When overdue readings take their turn beside a case that does not wait."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from hil.clock.virtual import VirtualClock
from hil.executive.watching.monitoring import Monitoring


@pytest.fixture
def looked():
    """Return a function of how late a wait begins [s], which returns whether overdue readings had their turn."""
    clock = VirtualClock()
    clock.sleep(60.0)
    turns = []

    class Noting(Monitoring):
        def run(self, until_ns, timeline):
            turns.append(until_ns)

    monitoring = Noting(SimpleNamespace(clock=clock), [], None, None, None)

    def looked(late_s):
        turns.clear()
        monitoring.run_late(clock.now_ns() - round(late_s * 1e9), None)
        return turns == [clock.now_ns()]

    return looked


def test_a_recording_begins_when_it_is_asked_for(looked):
    """Its first sample is due at once: a reading before it would take from the duration of the recording."""
    assert not looked(0.0)


def test_a_sample_that_a_reading_delayed_is_not_delayed_again(looked):
    """A reading takes 50 ms of a slow line; the samples behind it catch up."""
    assert not looked(0.05)


def test_samples_that_come_ever_later_leave_readings_their_turn(looked):
    """A sensor that is asked for more than it gives never lets the case wait."""
    assert looked(0.11)
