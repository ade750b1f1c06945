"""Derived quantities of the envelope: what they come to, and that it does not matter how their rows come."""

from __future__ import annotations

from itertools import pairwise
from math import inf, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.bench.derived.quantities import derivation_of
from hil.bench.envelope import Monitor
from hil.bench.self_test import self_test
from hil.clock.port import NANOSECONDS
from hil.executive.watching.feeding import Feed
from hil.model.envelope import EnvelopeLimit
from hil.model.figure import Figure

PLACES = {"voltage": 1, "current": 2, "temperature": 3}
CURRENTS = st.sampled_from([nan, inf, -0.7, -0.05, -0.01, 0.0, 0.0004, 0.05, 0.7, 1.3])
VOLTS = st.sampled_from([nan, -0.1, 3.0, 3.7, 4.2])
DEGREES = st.sampled_from([nan, -5.0, 20.0, 20.1, 20.2, 25.0, 46.0, 60.0])
STEPS = st.integers(1, 40_000)
ROWS = st.lists(st.tuples(STEPS, VOLTS, CURRENTS, DEGREES), min_size=1, max_size=40)
LONG_RUNS = st.lists(st.tuples(st.integers(1, 12), VOLTS, CURRENTS, DEGREES), min_size=1, max_size=6)
CUTS = st.sets(st.integers(1, 60))


def limit(quantity, unit, low=None, high=None, debounce=1, **how):
    """Return a limit on a derived quantity."""
    return EnvelopeLimit(
        id=quantity,
        output="cell",
        quantity=quantity,
        unit=unit,
        minimum=low,
        maximum=high,
        period_s=30.0,
        max_age_s=100.0,
        debounce=debounce,
        **how,
    )


CHARGING = {"flow": "charging", "threshold": 0.02}
LIMITS = {
    "charge": limit("charge", "mA.h", high=20.0, since="phase", **CHARGING),
    "charge since arm": limit("charge", "A.h", high=0.02, since="arm", **CHARGING),
    "energy": limit("energy", "W.h", high=0.05, since="phase", flow="discharging", threshold=0.02),
    "duration": limit("duration", "min", high=1.5, debounce=2, since="phase", **CHARGING),
    "slope": limit("slope", "K/min", low=-30.0, high=8.0, of="temperature", over_s=30.0),
    "slope while charging": limit("slope", "K/min", high=1.0, of="temperature", over_s=60.0, **CHARGING),
    "unchanged": limit("unchanged", "s", high=60.0, of="temperature", band=0.0),
    "unchanged while flowing": limit(
        "unchanged", "min", high=1.2, debounce=2, of="temperature", band=0.15, flow="flowing", threshold=0.02
    ),
    "inhibit": limit("temperature", "degC", low=0.0, high=45.0, debounce=2, **CHARGING),
    "polarity while discharging": limit("voltage", "V", low=0.0, flow="discharging", threshold=0.02),
}


def monitor_of(spec):
    """Return a monitor that is never read."""
    return Monitor(spec, lambda: Figure(value=0.0, unit=spec.unit), 0, derivation_of(spec))


def feed_of(*specs):
    """Return monitors and what judges rows of voltage, current and temperature for them."""
    monitors = [monitor_of(spec) for spec in specs]
    columns = [tuple(PLACES[name] for _, name in monitor.derivation.sources) for monitor in monitors]
    return monitors, Feed(list(zip(columns, monitors, strict=True)), 5.0, "r")


def one_by_one(spec, when_ns, rows):
    """Judge rows as readings would be judged, without any feed; return the first that trips, and its value."""
    monitor = monitor_of(spec)
    for place, (at_ns, row) in enumerate(zip(when_ns, rows, strict=True)):
        numbers = [row[PLACES[name]] for _, name in monitor.derivation.sources]
        unwatched = monitor.stale(at_ns)
        figure = monitor.counted(Figure(value=monitor.derivation.row(at_ns, numbers), unit=spec.unit))
        if trip := monitor.judge(figure, at_ns) or unwatched:
            return place, repr(trip.value)
    return None


def in_blocks(spec, block, cuts, *, as_array):
    """Judge rows in blocks; return the first that trips, and its value."""
    _, feed = feed_of(spec)
    edges = [0, *sorted(cut for cut in cuts if cut < len(block)), len(block)]
    for first, end in pairwise(edges):
        part = block[first:end]
        trip = feed.judge(part if as_array else part.tolist(), round(part[-1, 0] * NANOSECONDS))
        if trip:
            at = float(trip.text.partition(", at ")[2].partition(" s of ")[0])
            return int(np.argmin(abs(block[:, 0] - at))), repr(trip.value)
    return None


@pytest.mark.parametrize("name", LIMITS)
@given(rows=ROWS, cuts=CUTS, as_array=st.booleans())
def test_rows_trip_the_same_in_blocks_of_any_size(name, rows, cuts, as_array):
    """Whatever flows and however rows are cut, the same row trips with the same value as one by one."""
    times = np.cumsum([step for step, *_ in rows]) / 1000
    block = np.column_stack((times, [row[1:] for row in rows]))
    when_ns = [round(time * NANOSECONDS) for time in times.tolist()]
    assert in_blocks(LIMITS[name], block, cuts, as_array=as_array) == one_by_one(LIMITS[name], when_ns, block.tolist())


@pytest.mark.parametrize("name", LIMITS)
@given(runs=LONG_RUNS, cuts=CUTS)
def test_rows_that_stay_alike_trip_the_same_in_blocks_of_any_size(name, runs, cuts):
    """Most rows are like the one before: blocks that are counted at a glance come to the same."""
    rows = [numbers for count, *numbers in runs for _ in range(count)]
    block = np.column_stack((5.0 * np.arange(1, len(rows) + 1), rows))
    when_ns = [round(time * NANOSECONDS) for time in block[:, 0].tolist()]
    assert in_blocks(LIMITS[name], block, cuts, as_array=False) == one_by_one(LIMITS[name], when_ns, block.tolist())


@given(runs=LONG_RUNS, cuts=CUTS)
def test_what_is_left_does_not_depend_on_blocks(runs, cuts):
    """All limits at once: after a block their sums, anchors and windows are those of its rows one by one."""
    rows = [numbers for count, *numbers in runs for _ in range(count)]
    block = np.column_stack((5.0 * np.arange(1, len(rows) + 1), rows))
    (blocks, fed), (singles, single) = feed_of(*LIMITS.values()), feed_of(*LIMITS.values())
    for first, end in pairwise([0, *sorted(cut for cut in cuts if cut < len(block)), len(block)]):
        trips = fed.judge(block[first:end].tolist(), round(block[end - 1, 0] * NANOSECONDS))
        one = [single.judge([row], round(row[0] * NANOSECONDS)) for row in block[first:end].tolist()]
        if trips or any(one):
            assert any(one) is bool(trips)
            return
        for many, few in zip(blocks, singles, strict=True):
            assert (many.good_ns, many._outside, many.due_ns) == (few.good_ns, few._outside, few.due_ns)
    for many, few in zip(blocks, singles, strict=True):
        many.catch_up()
        few.catch_up()
        left = [{**vars(each.derivation), "applies": None} for each in (many, few)]
        assert left[0] == left[1]


@given(
    amperes=st.floats(0.02, 3.0),
    volts=st.floats(2.5, 4.3),
    steps=st.lists(st.integers(1, 3_600_000), min_size=1, max_size=50),
)
def test_a_constant_current_adds_up_to_current_times_time(amperes, volts, steps):
    """Charge is I t, energy is U I t, within what a millionth of the weight is; the duration is exact."""
    specs = [
        limit(quantity, unit, high=1e9, since="phase", **CHARGING)
        for quantity, unit in (("charge", "A.h"), ("energy", "W.h"), ("duration", "s"))
    ]
    derivations = [derivation_of(spec) for spec in specs]
    instants = np.concatenate(([0], np.cumsum(steps)))
    numbers = {"voltage": volts, "current": amperes}
    for at_ms in instants.tolist():
        values = [each.row(at_ms * 1_000_000, [numbers[name] for _, name in each.sources]) for each in derivations]
    hours = instants[-1] / 3_600_000
    charge, energy, duration = values
    assert charge == pytest.approx(amperes * hours, rel=3e-5)
    assert energy == pytest.approx(volts * amperes * hours, rel=3e-5)
    assert duration == pytest.approx(instants[-1] / 1000, rel=1e-12)


@given(
    high=st.floats(1e-3, 1e6),
    debounce=st.integers(1, 5),
    flow=st.sampled_from(["charging", "discharging"]),
    threshold=st.floats(1e-3, 2.0),
    since=st.sampled_from(["phase", "arm"]),
)
def test_the_self_test_holds_for_sums_of_any_size(high, debounce, flow, threshold, since):
    """A monitor of a sum trips beyond its most, on NaN, and on nothing else, whatever its numbers are."""
    for quantity, unit in (("charge", "mA.h"), ("energy", "W.h"), ("duration", "s")):
        how = {"flow": flow, "threshold": threshold, "since": since}
        assert self_test(limit(quantity, unit, high=high, debounce=debounce, **how))


@given(high=st.floats(1e-3, 1e5), debounce=st.integers(1, 5), over=st.floats(0.1, 7200.0))
def test_the_self_test_holds_for_slopes_and_for_what_is_unchanged(high, debounce, over):
    """The same of a slope of any steepness, and of any time without a change."""
    assert self_test(limit("slope", "K/min", high=high, debounce=debounce, of="temperature", over_s=over))
    assert self_test(limit("slope", "K/h", low=-high, debounce=debounce, of="temperature", over_s=over, **CHARGING))
    flowing = {"flow": "flowing", "threshold": 0.02}
    assert self_test(limit("unchanged", "s", high=high, debounce=debounce, of="temperature", band=0.0))
    assert self_test(limit("unchanged", "min", high=high, debounce=debounce, of="temperature", band=0.5, **flowing))
