"""The envelope's monitors: what trips, when it is read, and how old a reading may get."""

from __future__ import annotations

from dataclasses import replace
from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.bench import envelope
from hil.bench.envelope import Monitor, Trip
from hil.bench.self_test import self_test
from hil.model.envelope import EnvelopeLimit
from hil.model.figure import Figure

LIMIT = EnvelopeLimit(
    id="coil-current",
    output="supply.coil",
    quantity="current",
    unit="A",
    minimum=-0.01,
    maximum=0.03,
    period_s=1.0,
    max_age_s=5.0,
    debounce=2,
)
SECOND = 1_000_000_000


class Readings:
    """Gives one reading after another; each takes some bench time."""

    def __init__(self, *values: float, takes_ns: int = 0) -> None:
        self.values = list(values)
        self.takes_ns = takes_ns
        self.time_ns = 0

    def now(self) -> int:
        """Return the bench's time."""
        return self.time_ns

    def read(self) -> Figure:
        """Return the next reading."""
        self.time_ns += self.takes_ns
        return Figure(value=self.values.pop(0), unit="A")


def trips(limit, *values):
    """Return what each reading, a second apart, does to a monitor."""
    readings = Readings(*values)
    monitor = Monitor(limit, readings.read, 0)
    results = []
    for _ in values:
        results.append(monitor.take(readings.now)[1] is not None)
        readings.time_ns += SECOND
    return results


def test_trip_after_the_debounce_only():
    """The second reading in a row outside trips; a good one between starts the count again."""
    assert trips(LIMIT, 0.04, 0.04) == [False, True]
    assert trips(LIMIT, 0.04, 0.02, 0.04, 0.04) == [False, False, False, True]
    assert trips(replace(LIMIT, debounce=1), 0.04) == [True]


def test_trip_goes_on_while_it_is_outside():
    """A third reading outside is a trip, too: nothing is forgotten."""
    assert trips(LIMIT, 0.04, 0.04, 0.04) == [False, True, True]


def test_number_that_is_none_counts_as_outside():
    """NaN and infinities count towards the debounce like any other reading outside."""
    assert trips(LIMIT, nan, nan) == [False, True]
    assert trips(LIMIT, inf, -inf) == [False, True]
    assert trips(replace(LIMIT, maximum=None), inf, inf) == [False, True]


@pytest.mark.parametrize(
    ("value", "shown", "text"),
    [
        (0.04, 0.04, "supply.coil: current 0.04 A is above 0.03 A"),
        (-0.02, -0.02, "supply.coil: current -0.02 A is below -0.01 A"),
        (nan, None, "supply.coil: current is not a number"),
    ],
)
def test_trip_tells_what_was_read(value, shown, text):
    """Limit, value, unit and a sentence; what is no number has no value."""
    monitor = Monitor(replace(LIMIT, debounce=1), lambda: Figure(value=value, unit="A"), 0)
    assert monitor.take(lambda: 0)[1] == Trip("coil-current", shown, "A", text)


def test_zero_has_no_sign():
    """A reading that is zero from below is told as zero."""
    monitor = Monitor(replace(LIMIT, minimum=0.01, debounce=1), lambda: Figure(value=-0.0, unit="A"), 0)
    assert monitor.take(lambda: 0)[1].text == "supply.coil: current 0 A is below 0.01 A"


def test_readings_stay_on_their_grid():
    """A late or slow reading does not move those after it; turns that were missed are not made up."""
    readings = Readings(0, 0, 0, takes_ns=300_000_000)
    monitor = Monitor(LIMIT, readings.read, 0)
    assert monitor.due_ns == 0
    monitor.take(readings.now)
    assert (readings.now(), monitor.due_ns, monitor.good_ns) == (300_000_000, SECOND, 300_000_000)
    readings.time_ns = 1_200_000_000
    monitor.take(readings.now)
    assert monitor.due_ns == 2 * SECOND
    readings.time_ns = 4_700_000_000
    monitor.take(readings.now)
    assert monitor.due_ns == 5 * SECOND


def test_no_good_reading_for_too_long_is_a_trip():
    """Exactly the maximum age is allowed, a nanosecond more is not."""
    monitor = Monitor(LIMIT, lambda: Figure(value=0.0, unit="A"), 0)
    assert monitor.stale(5 * SECOND) is None
    trip = monitor.stale(5 * SECOND + 1)
    assert trip == Trip("coil-current", None, "A", "supply.coil: no good current for 5 s, 5 s allowed")


def test_bad_readings_within_the_debounce_grow_old_too():
    """With a long debounce the age trips first."""
    assert trips(replace(LIMIT, debounce=50), *[nan] * 7) == [False] * 6 + [True]


def test_reading_that_is_a_period_late_does_not_wait_for_its_place():
    """A period after it was due, or a period before the last good one is too old, waiting is no choice any more."""
    monitor = Monitor(LIMIT, lambda: Figure(value=0.0, unit="A"), 2 * SECOND)
    assert monitor.overdue_ns == 3 * SECOND
    monitor.take(lambda: 3 * SECOND)
    assert monitor.overdue_ns == 5 * SECOND
    hurried = Monitor(replace(LIMIT, max_age_s=1.5), lambda: Figure(value=0.0, unit="A"), 2 * SECOND)
    assert hurried.overdue_ns == 5 * SECOND // 2


def test_reading_outside_is_confirmed_soon():
    """After a reading outside, the next is due after a tenth of the period; after a good one, on the grid again."""
    values = iter([1.0, 0.0])
    monitor = Monitor(LIMIT, lambda: Figure(value=next(values), unit="A"), 0)
    monitor.take(lambda: 0)
    assert monitor.due_ns == SECOND // 10
    monitor.take(lambda: SECOND // 10)
    assert monitor.due_ns == SECOND


def test_room_follows_what_readings_last():
    """A wait has room for a reading if it is a quarter longer than the last one lasted."""
    instants = iter([0, 8_000_000, 8_000_000])
    monitor = Monitor(LIMIT, lambda: Figure(value=0.0, unit="A"), 0)
    monitor.take(lambda: next(instants))
    assert monitor.room_ns == 10_000_000


def test_restart_forgets_count_and_age():
    """After a safe-off, watching begins as if nothing had been."""
    values = iter([1.0, 1.0, 0.0])
    monitor = Monitor(LIMIT, lambda: Figure(value=next(values), unit="A"), 0)
    monitor.take(lambda: 0)
    monitor.restart(100 * SECOND + 7)
    assert (monitor.due_ns, monitor.good_ns) == (100 * SECOND + 7,) * 2
    assert monitor.stale(105 * SECOND) is None
    assert monitor.take(lambda: 100 * SECOND + 7)[1] is None
    monitor.take(lambda: 100 * SECOND + 8)
    assert monitor.due_ns == 101 * SECOND + 7


def test_turns_of_long_periods_fall_together():
    """From 10 s on, readings are due at whole multiples of the period; more frequent ones keep their phase."""
    for period_s, first_s in ((5.0, 8), (10.0, 10), (60.0, 60)):
        limit = replace(LIMIT, period_s=period_s, max_age_s=5 * period_s)
        monitor = Monitor(limit, lambda: Figure(value=0.0, unit="A"), 3 * SECOND)
        monitor.take(lambda: 3 * SECOND)
        assert monitor.due_ns == first_s * SECOND
        monitor.restart(3 * SECOND)
        monitor.take(lambda: 3 * SECOND)
        assert monitor.due_ns == first_s * SECOND


def test_self_test_holds_for_every_form_of_limit():
    """One bound, both, and a single allowed value."""
    for low, high in ((None, 3.5), (-1.0, None), (-1.0, 3.5), (2.0, 2.0), (-3.0, -2.0)):
        assert self_test(replace(LIMIT, minimum=low, maximum=high))


@pytest.mark.parametrize("blind", [lambda *_: "", lambda *_: "always"])
def test_self_test_notices_a_monitor_that_is_blind_or_never_content(monkeypatch, blind):
    """A comparison that never, or always, finds something fails the self-test."""
    monkeypatch.setattr(envelope, "_problem", blind)
    assert not self_test(LIMIT)


BOUND = st.floats(-1e6, 1e6)


@given(bounds=st.tuples(BOUND, BOUND), value=st.floats(allow_nan=True, allow_infinity=True), debounce=st.integers(1, 4))
def test_trips_exactly_outside(bounds, value, debounce):
    """Whatever the bounds, `debounce` readings trip if and only if the value is not within them."""
    low, high = sorted(bounds)
    limit = replace(LIMIT, minimum=low, maximum=high, debounce=debounce)
    inside = low <= value <= high  # no infinity is
    assert trips(limit, *[value] * debounce) == [False] * (debounce - 1) + [not inside]
    assert self_test(limit)
