"""The watch after the last safe-off: what holds, what does not, and what is told."""

from __future__ import annotations

from math import isnan, nan

import pytest

from hil.bench.safe_off import watch_after
from hil.clock.virtual import VirtualClock
from hil.model.cutting import WatchAfter
from hil.model.errors import NoReply
from hil.model.figure import Figure

TOWARD = WatchAfter(output="thermal", quantity="temperature", unit="degC", toward=22.0, tolerance=4.0, within_s=60.0)
BOUNDS = WatchAfter(output="cycler", quantity="current", unit="A", minimum=-0.02, maximum=0.02, for_s=20.0)


class Role:
    """Reads what a function of the time says; an exception is raised."""

    def __init__(self, clock, course):
        self._clock, self._course = clock, course

    def temperature(self):
        """Return the temperature, or raise."""
        value = self._course(self._clock.now())
        if isinstance(value, Exception):
            raise value
        return Figure(value=value, unit="degC")

    current = temperature


def watched(*watches, **courses):
    """Watch, and return whether all holds, the results by output, the readings, and the seconds that it took."""
    clock, results, readings = VirtualClock(), {}, []
    roles = {name: Role(clock, course) for name, course in courses.items()}
    held = watch_after(
        watches,
        roles,
        clock,
        lambda watch, t, value: readings.append((watch.output, t, value)),
        lambda result: results.update({result.output: result}),
    )
    return held, results, readings, clock.now()


FALLS = {
    "as warm as the room": lambda _: 23.0,
    "cools down": lambda t: 60.0 - 0.3 * t,
    "warms up": lambda t: -16.0 + 0.3 * t,
    "overshoots, and then cools": lambda t: 40.0 + t if t < 15 else 62.5 - 0.5 * t,
    "comes near": lambda t: 60.0 - 0.6 * t,
}
STAYS = {
    "warms on": lambda t: 40.0 + 0.2 * t,
    "stays hot": lambda _: 50.0,
    "goes through": lambda t: -16.0 + t,
    "warms from the room's": lambda t: 22.0 + 0.1 * t,
    "cools on": lambda t: 10.0 - 0.1 * t,
}


@pytest.mark.parametrize("course", FALLS)
def test_what_goes_where_nothing_drives_it_is_safe(course):
    """It is watched for its whole time, every 5 s."""
    held, results, readings, seconds = watched(TOWARD, thermal=FALLS[course])
    assert held, results
    assert results["thermal"].state == "watched"
    assert seconds == 60.0
    assert [t for _, t, _ in readings] == [5.0 * number for number in range(13)]


@pytest.mark.parametrize("course", STAYS)
def test_what_goes_elsewhere_is_driven(course):
    """Whatever its controller shows."""
    held, results, _, _ = watched(TOWARD, thermal=STAYS[course])
    assert not held
    assert results["thermal"].detail.endswith("and not toward 22 degC: something still drives it")


def test_the_way_is_told():
    """From where, over where it was farthest, to where."""
    _, results, _, _ = watched(TOWARD, thermal=lambda t: 40.0 + t if t < 15 else 62.5 - 0.5 * t)
    assert results["thermal"].detail == "its temperature went 40 degC to 55 degC to 32.5 degC"


def test_what_stays_between_its_bounds_is_safe():
    """To the end of its time."""
    held, results, _, seconds = watched(BOUNDS, cycler=lambda _: 0.001)
    assert (held, seconds) == (True, 20.0)
    assert results["cycler"].detail == "its current went 0.001 A, -0.02 to 0.02 A was safe"


def test_what_leaves_its_bounds_ends_the_watch_of_it_at_once():
    """The other line goes on."""
    held, results, readings, seconds = watched(
        BOUNDS, TOWARD, cycler=lambda t: -0.7 if t >= 10 else 0.0, thermal=lambda _: 22.0
    )
    assert not held
    assert (results["cycler"].ok, results["cycler"].seconds) == (False, 10.0)
    assert results["cycler"].detail == "its current went 0 A to -0.7 A, -0.02 to 0.02 A is safe"
    assert results["thermal"].ok
    assert seconds == 60.0
    assert len([output for output, _, _ in readings if output == "cycler"]) == 3


@pytest.mark.parametrize("watch", [TOWARD, BOUNDS])
@pytest.mark.parametrize(
    ("course", "words"),
    [(lambda _: NoReply("tec1", "nothing came", "look"), "tec1: nothing came"), (lambda _: nan, "no number came")],
)
def test_what_cannot_be_read_is_not_safe(watch, course, words):
    """Silence, and a sensor that is broken, prove nothing."""
    held, results, readings, _ = watched(watch, **{watch.output: course})
    assert not held
    assert f"could not be read: {words}" in results[watch.output].detail
    assert all(isnan(value) for _, _, value in readings)


def test_a_silence_in_between_is_none_in_the_end():
    """What is read again counts."""
    held, results, readings, _ = watched(
        TOWARD, thermal=lambda t: NoReply("tec1", "nothing came", "look") if t < 30 else 40.0 - 0.3 * t
    )
    assert held, results
    assert len([value for _, _, value in readings if isnan(value)]) == 6


def test_no_line_is_no_watch():
    """A bench without the section is left at once."""
    assert watched() == (True, {}, [], 0.0)
