"""Limits on derived quantities in a run: what feeds them, what is read where nothing does, and what is counted when."""

from __future__ import annotations

import pytest

from hil.bench.derived.quantities import derivation_of
from hil.bench.envelope import Monitor
from hil.clock.port import NANOSECONDS
from hil.executive.watching.feeding import Feeds, monitors_of
from hil.model.envelope import EnvelopeLimit
from hil.model.figure import Figure

COLUMNS = {("voltage", "V"): 1, ("current", "A"): 2, ("temperature", "degC"): 3}
CHARGING = {"flow": "charging", "threshold": 0.02}


def limit(quantity, unit, low=None, high=None, **how):
    """Return a limit on a derived quantity of a cell."""
    return EnvelopeLimit(
        id=quantity,
        output="cycler.cell",
        quantity=quantity,
        unit=unit,
        minimum=low,
        maximum=high,
        period_s=30.0,
        max_age_s=90.0,
        **how,
    )


CHARGED = limit("charge", "mA.h", high=1000.0, since="phase", **CHARGING)
INHIBIT = limit("temperature", "degC", low=0.0, high=45.0, **CHARGING)
AGAINST = limit("voltage", "V", high=0.03, against="charger", **CHARGING)


class Bench:
    """A cell that is read, and the bench's time."""

    def __init__(self, spec):
        self.now_ns = 0
        self.numbers = []
        self.derivation = derivation_of(spec)
        self.monitor = Monitor(spec, self.read, 0, self.derivation)

    def read(self):
        """Return the quantity from the numbers that are true now."""
        return Figure(value=self.derivation.row(self.now_ns, self.numbers), unit=self.monitor.limit.unit)

    def take(self, at, *numbers):
        """Take a reading at a second; return its value and its trip."""
        self.now_ns, self.numbers = at * NANOSECONDS, list(numbers)
        figure, trip = self.monitor.take(lambda: self.now_ns)
        return figure.value, trip


def rows(first, last, volts, amperes, degrees=25.0, every=5):
    """Return rows of a stream."""
    return [[float(at), volts, amperes, degrees] for at in range(first, last + 1, every)]


def test_a_stream_feeds_what_it_has_all_sources_of():
    """What is held against another output, or needs another quantity, is read as ever."""
    monitors = [Bench(spec).monitor for spec in (CHARGED, INHIBIT, AGAINST)]
    fed = monitors_of("cycler.cell", COLUMNS, 30.0, monitors)
    assert [(columns, monitor.limit.id) for columns, monitor in fed] == [((2,), "charge"), ((3, 2), "temperature")]
    assert monitors_of("cycler.cell", {("current", "A"): 2}, 30.0, monitors) == [((2,), monitors[0])]
    assert monitors_of("other", COLUMNS, 30.0, monitors) == []
    assert monitors_of("cycler.cell", COLUMNS, 61.0, monitors) == []


def test_readings_add_up_where_no_stream_feeds():
    """From reading to reading by trapezoids; the other direction starts again."""
    bench = Bench(CHARGED)
    assert [bench.take(at, 0.72)[0] for at in (0, 30, 60)] == pytest.approx([0.0, 6.0, 12.0])
    assert bench.take(90, 0.0)[0] == pytest.approx(15.0)
    assert bench.take(120, -0.7)[0] == 0.0


def test_a_reading_that_does_not_count_is_told_and_is_good():
    """Without a current a cell may be hot; its temperature is what is recorded."""
    bench = Bench(INHIBIT)
    assert bench.take(0, 60.0, 0.0) == (60.0, None)
    assert bench.monitor.good_ns == 0
    value, trip = bench.take(30, 60.0, 0.7)
    assert value == 60.0
    assert trip.text == "cycler.cell: temperature while charging 60 degC is above 45 degC"


def test_nothing_is_counted_over_a_time_in_which_nobody_looked():
    """Watching that begins again goes on with the sum, and does not fill the gap."""
    bench = Bench(CHARGED)
    bench.take(0, 0.72)
    assert bench.take(50, 0.72)[0] == pytest.approx(10.0)
    bench.monitor.restart(5000 * NANOSECONDS)
    assert bench.take(5000, 0.72)[0] == pytest.approx(10.0)
    assert bench.take(5050, 0.72)[0] == pytest.approx(20.0)


def test_rows_that_wait_are_counted_before_a_reading():
    """Rows that nothing followed from are counted together; a reading that comes finds them counted."""
    bench, feeds = Bench(CHARGED), Feeds()
    feed = feeds.begin(monitors_of("cycler.cell", COLUMNS, 30.0, [bench.monitor]), 30.0, "r")
    for first in (5, 35, 65):
        assert feed.judge(rows(first, first + 25, 3.7, 0.72), (first + 25) * NANOSECONDS) is None
    assert bench.derivation._at_ns == 30 * NANOSECONDS
    assert bench.take(90, 0.72)[0] == pytest.approx(17.0)
    assert bench.monitor.good_ns == 90 * NANOSECONDS


def test_a_stream_that_ended_leaves_what_it_counted():
    """After the last row the bench's time counts again, whatever the device's clock has shown."""
    bench, feeds = Bench(CHARGED), Feeds()
    feed = feeds.begin(monitors_of("cycler.cell", COLUMNS, 30.0, [bench.monitor]), 30.0, "r")
    feed.judge(rows(5, 55, 3.7, 0.72), 60 * NANOSECONDS)
    feeds.end(feed, 60 * NANOSECONDS)
    assert bench.take(60, 0.72)[0] == pytest.approx(10.0)
    assert bench.take(90, 0.72)[0] == pytest.approx(16.0)


@pytest.mark.parametrize("before", [True, False])
def test_void_rows_have_flowed(before):
    """Rows of a run that was stopped count for sums, whether their recording goes on or begins again, unjudged."""
    bench, feeds = Bench(limit("charge", "mA.h", high=15.0, since="phase", **CHARGING)), Feeds()

    class Void:
        @staticmethod
        def tolist():
            return rows(5, 55, 3.7, 0.72)

    if before:
        feeds.pass_over("r", Void)
    feed = feeds.begin(monitors_of("cycler.cell", COLUMNS, 30.0, [bench.monitor]), 30.0, "r")
    if not before:
        feeds.pass_over("r", Void)
    bench.monitor.restart(1000 * NANOSECONDS)
    assert feed.judge(rows(1005, 1025, 3.7, 0.72), 1025 * NANOSECONDS) is None
    trip = feed.judge(rows(1030, 1050, 3.7, 0.72), 1050 * NANOSECONDS)
    assert trip.text == "cycler.cell: charge while charging 16 mA.h is above 15 mA.h, at 1035 s of recording r"
