"""What the guardian thinks of beats and clocks, on clocks that a test moves."""

from __future__ import annotations

import math

import pytest

from hil.guardian.watchdog import Clocks, Watchdog


class Times:
    """Clocks that stand."""

    def __init__(self) -> None:
        self.boot = 5000.0
        self.awake = 3000.0

    def pass_by(self, seconds: float) -> None:
        """Let time pass, awake."""
        self.boot += seconds
        self.awake += seconds


@pytest.fixture
def times():
    """Return clocks."""
    return Times()


@pytest.fixture
def watchdog(times):
    """Return a watchdog of one second."""
    return Watchdog(1.0, Clocks(boot=lambda: times.boot, awake=lambda: times.awake))


def test_beats_in_time_keep_it_calm(times, watchdog):
    """Nothing is wrong while fresh beats come."""
    for _ in range(10):
        times.pass_by(0.9)
        assert watchdog.why() == ""
        watchdog.beat(times.boot + 0.95)


def test_silence_is_a_hang(times, watchdog):
    """Silence longer than the limit counts, by how long it was."""
    watchdog.beat(math.inf)
    times.pass_by(1.0)
    assert watchdog.why() == ""
    times.pass_by(0.01)
    assert watchdog.why() == "the executive was silent for 1.01 s"
    assert watchdog.silent_s == pytest.approx(1.01)


@pytest.mark.parametrize("fresh_for", [-1.0, 0.0, 0.3, math.nan])
def test_beats_over_a_hung_loop_do_not_help(times, watchdog, fresh_for):
    """A thread that beats while nobody looks at the envelope keeps nobody calm."""
    fresh_until = times.boot + fresh_for
    for _ in range(5):
        times.pass_by(0.1)
        watchdog.beat(fresh_until)
    assert "did not check the envelope" in watchdog.why()


def test_a_wake_counts_as_a_hang(times, watchdog):
    """Time that passed while the machine was suspended is found, also where a beat came first."""
    times.boot += 7200.0
    watchdog.beat(times.boot + 10.0)
    assert watchdog.why() == "this machine was suspended for 7200.0 s"


def test_a_small_difference_of_the_clocks_is_none(times, watchdog):
    """Reading two clocks one after the other is not a suspend."""
    times.boot += 0.5
    watchdog.beat(times.boot + 1.0)
    assert watchdog.why() == ""


def test_who_had_to_wait_is_excused(times, watchdog):
    """After a disarming that did not hold the next beat is due from then on, suspends before that are of the past."""
    times.boot += 3.0
    watchdog.restart()
    assert watchdog.why() == ""
    times.pass_by(1.01)
    assert watchdog.why()


def test_it_looks_again_when_something_is_due(times, watchdog):
    """It sleeps until silence or staleness could be found, at most a tenth of a second, and never spins."""
    watchdog.beat(times.boot + 0.05)
    assert watchdog.next_s() == pytest.approx(0.05)
    watchdog.beat(math.inf)
    assert watchdog.next_s() == 0.1
    times.pass_by(5.0)
    assert watchdog.next_s() == 0.01
