"""The live clock follows boot time, and stands between operations."""

from __future__ import annotations

import pytest

from hil.clock.live import LiveClock
from hil.clock.port import NANOSECONDS, ClockError
from hil.clock.wall import boot_ns

EPOCH = "2026-03-01T00:00:00Z"


class Machine:
    """A machine's boot time that moves where it is told, and by the seconds that somebody pauses."""

    def __init__(self, late_ns=0):
        self.ns, self.pauses, self.late_ns = 5 * NANOSECONDS, [], late_ns

    def real_ns(self):
        """Return boot time."""
        return self.ns

    def pause(self, seconds):
        """Let time pass."""
        self.pauses.append(seconds)
        self.ns += round(seconds * NANOSECONDS) + self.late_ns


def live(machine, speed=1.0):
    """Return the clock of a bench on this machine."""
    clock = LiveClock(EPOCH, speed=speed, real_ns=machine.real_ns, pause=machine.pause)
    clock.begin()
    return clock


def test_it_stands_until_somebody_looks():
    """Between operations no code can learn of time that a record does not tell."""
    machine = Machine()
    clock = live(machine)
    machine.ns += 3 * NANOSECONDS
    assert clock.now_ns() == 0
    assert clock.look() == 3 * NANOSECONDS
    assert clock.now() == 3.0
    assert clock.utc() == "2026-03-01T00:00:03.000000Z"


def test_a_wait_ends_at_its_instant_however_late_it_is():
    """The lateness shows with the next operation, which is in the record."""
    machine = Machine(late_ns=7_000_000)
    clock = live(machine)
    clock.sleep(0.25)
    assert clock.now_ns() == 250_000_000
    assert clock.look() > 250_000_000


def test_an_instant_in_the_past_is_over():
    """A wait that comes late does not wait, and does not turn time back."""
    machine = Machine()
    clock = live(machine)
    machine.ns += NANOSECONDS
    clock.look()
    clock.wait_until(5)
    assert (clock.now_ns(), machine.pauses) == (NANOSECONDS, [])


def test_it_pulses_while_it_waits():
    """Somebody looks after the bench ten times a second."""
    machine = Machine()
    clock = live(machine)
    pulses = []
    clock.pulse = lambda: pulses.append(machine.ns)
    clock.sleep(1.0)
    assert len(pulses) == 10
    clock.look()
    assert len(pulses) == 11


def test_speed_counts_for_waits_and_for_boot_time():
    """At sixty times the speed a minute lasts a second, and an instant has its boot time."""
    machine = Machine()
    clock = live(machine, speed=60.0)
    clock.sleep(60.0)
    assert machine.ns == 6 * NANOSECONDS
    assert clock.boot_s_of(60 * NANOSECONDS) == 6.0
    assert clock.soon_ns() == 66 * NANOSECONDS


def test_before_it_begins_nobody_waits():
    """A resumed run comes to its past again in no time, and goes on from there."""
    machine = Machine()
    clock = LiveClock(EPOCH, real_ns=machine.real_ns, pause=machine.pause)
    clock.pulse = lambda: pytest.fail("nothing is live")
    clock.wait_until(90 * NANOSECONDS)
    assert (clock.look(), clock.began, machine.pauses) == (90 * NANOSECONDS, False, [])
    clock.pulse = lambda: None
    clock.begin()
    machine.ns += NANOSECONDS
    assert (clock.look(), clock.began) == (91 * NANOSECONDS, True)


def test_a_suspended_machine_is_seen_at_the_next_look():
    """Boot time goes on while a machine is suspended."""
    machine = Machine()
    clock = live(machine)
    machine.ns += 7200 * NANOSECONDS
    assert clock.look() == 7200 * NANOSECONDS


def test_a_negative_sleep_is_refused():
    """No time passes backwards."""
    with pytest.raises(ClockError, match="cannot sleep for -1"):
        live(Machine()).sleep(-1)


def test_boot_time_goes_on():
    """The machine's own."""
    assert 0 < boot_ns() <= boot_ns()
