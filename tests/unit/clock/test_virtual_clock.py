"""The virtual clock jumps from event to event and keeps their order."""

from __future__ import annotations

import pytest

from hil.clock.port import ClockError
from hil.clock.virtual import VirtualClock


def test_sleep_moves_time_exactly():
    """A thousand sleeps of 0.1 s are exactly 100 s, because time is an integer."""
    clock = VirtualClock()
    for _ in range(1000):
        clock.sleep(0.1)
    assert clock.now_ns() == 100_000_000_000


def test_events_of_one_instant_follow_device_then_number():
    """The order at one instant does not depend on the order of asking alone."""
    clock, order = VirtualClock(), []
    clock.at(5, lambda: order.append("second device"), device=2)
    clock.at(5, lambda: order.append("first device"), device=1)
    clock.at(5, lambda: order.append("second device, later"), device=2)
    clock.wait_until(5)
    assert order == ["first device", "second device", "second device, later"]


def test_a_wait_ends_with_the_event_that_satisfies_it():
    """Time stops at the last byte and does not go on to the deadline."""
    clock, box = VirtualClock(), []
    clock.at(300, lambda: box.append(1))
    assert clock.run(1000, lambda: bool(box))
    assert clock.now_ns() == 300
    assert not clock.run(2000, lambda: len(box) > 1)
    assert clock.now_ns() == 2000


def test_a_cancelled_event_does_not_happen():
    """What is taken back never happens, and time does not stop for it."""
    clock, box = VirtualClock(), []
    clock.at(10, lambda: box.append(1)).cancel()
    clock.wait_until(20)
    assert box == []


def test_a_storm_of_events_at_one_instant_names_who_waits():
    """Two peers that answer each other for ever are found, not waited for."""
    clock = VirtualClock()

    def again() -> None:
        clock.at(clock.now_ns(), again)

    again()
    with pytest.raises(ClockError, match="psu1 waits"):
        clock.run(1, lambda: False, "psu1")
    again()
    with pytest.raises(ClockError, match="nobody waits"):
        clock.sleep(1)


def test_negative_and_nan_sleeps_are_refused():
    """Time never goes backwards."""
    for seconds in (-1.0, float("nan")):
        with pytest.raises(ClockError):
            VirtualClock().sleep(seconds)


def test_simulated_utc_is_epoch_plus_virtual_time():
    """The bench's calendar follows its clock."""
    clock = VirtualClock("2026-01-01T00:00:00Z")
    clock.sleep(86_400.5)
    assert clock.utc() == "2026-01-02T00:00:00.500000Z"


def test_the_next_event_is_told_and_cancelled_ones_are_not():
    """Whoever paces the clock learns when something is due; what was taken back is not due."""
    clock = VirtualClock()
    assert clock.next_ns() is None
    first = clock.at(5, lambda: None)
    clock.at(9, lambda: None)
    assert clock.next_ns() == 5
    first.cancel()
    assert clock.next_ns() == 9
    clock.wait_until(9)
    assert clock.next_ns() is None
