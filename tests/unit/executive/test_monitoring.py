"""When overdue readings take their turn beside a case that does not wait."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from hil.clock.virtual import VirtualClock
from hil.executive.watching.monitoring import Heartbeat, Monitoring
from hil.model.bench import InstrumentSpec
from hil.model.errors import NoReply, Rejected


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
    """A reading takes 50 ms of a slow line; the samples after it catch up."""
    assert not looked(0.05)


def test_samples_that_come_ever_later_leave_readings_their_turn(looked):
    """A sensor that is asked for more than it gives never lets the case wait."""
    assert looked(0.11)


class Output:
    """An output with a watchdog of 6 s, which answers with these faults in turn."""

    watchdog_s = 6.0

    def __init__(self, *faults):
        self.faults = list(faults)
        self.beats = 0

    def beat(self):
        """Take a heartbeat."""
        self.beats += 1
        if self.faults and (fault := self.faults.pop(0)):
            raise fault


def heart(output):
    """Return its heartbeat, the clock, and what a case at work was told."""
    told, clock = [], VirtualClock()
    case = SimpleNamespace(fault=lambda instrument, fault: told.append((instrument.name, fault)))
    instrument = InstrumentSpec(name="relay1", driver="waveshare-relay", port="/dev/ttyUSB0")
    return Heartbeat(output, instrument, clock, SimpleNamespace(case=case)), clock, told


def test_three_heartbeats_are_due_in_the_time_of_a_watchdog():
    """Two may be lost."""
    heartbeat, clock, told = heart(output := Output())
    assert heartbeat.due_ns == 2_000_000_000
    clock.sleep(2.5)
    heartbeat.take()
    assert (output.beats, heartbeat.due_ns, told) == (1, 4_500_000_000, [])


def test_a_heartbeat_without_answer_is_sent_again_at_its_next_turn():
    """The case is told that the bench has a fault; nothing else ends."""
    heartbeat, clock, told = heart(output := Output(NoReply("relay1", "silence")))
    clock.sleep(2.0)
    heartbeat.take()
    clock.sleep(2.0)
    heartbeat.take()
    assert output.beats == 2
    assert [name for name, _ in told] == ["relay1"]


def test_a_watchdog_that_has_opened_ends_what_the_case_does():
    """The output is not what the case thinks."""
    heartbeat, _, told = heart(Output(Rejected("relay1", "the board opened relay 1 by itself")))
    with pytest.raises(Rejected):
        heartbeat.take()
    assert len(told) == 1
