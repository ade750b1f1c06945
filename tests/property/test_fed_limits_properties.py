"""Limits that a stream feeds: a block of rows is judged as its rows would be one by one."""

from __future__ import annotations

from itertools import pairwise
from math import inf, nan

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hil.bench.envelope import Monitor
from hil.clock.port import NANOSECONDS
from hil.executive.watching.feeding import Feed
from hil.model.envelope import EnvelopeLimit
from hil.model.figure import Figure

VALUES = st.sampled_from([nan, inf, -inf, -1.5, -1.0, 0.0, 1.0, 1.0000000000000002, 7.0]) | st.floats()
STEPS = st.integers(0, 7_000_000_000)
ROWS = st.lists(st.tuples(STEPS, VALUES), min_size=1, max_size=40)
BOUND = st.sampled_from([None, 1.0])


def limit(low, high, debounce):
    """Return a limit with a maximum age of 5 s."""
    return EnvelopeLimit(
        id="v",
        output="cell",
        quantity="voltage",
        unit="V",
        minimum=None if low is None else -low,
        maximum=high,
        period_s=1.0,
        max_age_s=5.0,
        debounce=debounce,
    )


def one_by_one(monitor, when, values):
    """Judge rows as `Monitor.take` would have judged readings; return the first that trips."""
    for place, (when_ns, value) in enumerate(zip(when, values, strict=True)):
        unwatched = monitor.stale(when_ns)
        if trip := monitor.judge(Figure(value=value, unit="V"), when_ns) or unwatched:
            return place, trip
    return None


def told(monitor, found):
    """Return everything that is left of a judgement."""
    return (
        found and (found[0], found[1].text, found[1].limit, repr(found[1].value)),
        monitor.good_ns,
        monitor._outside,
    )


@given(rows=ROWS, cuts=st.sets(st.integers(1, 39)), low=BOUND, high=BOUND, debounce=st.integers(1, 4))
def test_a_block_is_judged_as_its_rows_one_by_one(rows, cuts, low, high, debounce):
    """Debounce, numbers that are none, the age between rows: the same row trips, in the same words, in any blocks."""
    when = np.cumsum([step for step, _ in rows], dtype=np.int64)
    values = np.array([value for _, value in rows])
    spec = limit(low, high, debounce)
    plain, single, fed = (Monitor(spec, lambda: Figure(value=0.0, unit="V"), 0) for _ in range(3))
    expected = told(plain, one_by_one(plain, when.tolist(), values.tolist()))
    edges = [0, *sorted(cut for cut in cuts if cut < len(rows)), len(rows)]
    found = None
    for first, end in pairwise(edges):
        found = fed.judge_rows(when[first:end], values[first:end])
        if found:
            found = (found[0] + first, found[1])
            break
    assert told(fed, found) == expected
    tripped = None
    for place, (when_ns, value) in enumerate(zip(when.tolist(), values.tolist(), strict=True)):
        if trip := single.judge_row(when_ns, value):
            tripped = (place, trip)
            break
    assert told(single, tripped) == expected


@given(rows=ROWS, cuts=st.sets(st.integers(1, 39)), low=BOUND, debounce=st.integers(1, 4), later=STEPS)
def test_few_rows_are_judged_as_many(rows, cuts, low, debounce, later):
    """Plain numbers or an array, good or not, several limits at once: the same trip, and the same is left."""
    when = np.cumsum([step for step, _ in rows], dtype=np.int64)
    block = np.column_stack((when / NANOSECONDS, [value for _, value in rows], np.zeros(len(rows))))
    spec = limit(low, 1.0, debounce)
    monitors = [Monitor(spec, lambda: Figure(value=0.0, unit="V"), 0) for _ in range(4)]
    few, many = (Feed(list(enumerate(pair, start=1)), 1.0, "r") for pair in (monitors[:2], monitors[2:]))
    for first, end in pairwise([0, *sorted(cut for cut in cuts if cut < len(rows)), len(rows)]):
        now_ns = int(when[end - 1]) + later
        trips = few.judge(block[first:end].tolist(), now_ns), many.judge(block[first:end], now_ns)
        assert repr(trips[0]) == repr(trips[1])
        if trips[0]:
            return
        left = [(each.good_ns, each._outside) for each in monitors]
        assert left[:2] == left[2:]


@given(rows=ROWS, after=st.integers(0, 20_000_000_000))
def test_rows_that_stop_coming_grow_old(rows, after):
    """The age counts from the last good row, as it does from the last good reading."""
    when = np.cumsum([step for step, _ in rows], dtype=np.int64)
    values = np.array([value for _, value in rows])
    spec = limit(1.0, 1.0, 50)
    plain, fed = (Monitor(spec, lambda: Figure(value=0.0, unit="V"), 0) for _ in range(2))
    one_by_one(plain, when.tolist(), values.tolist())
    fed.judge_rows(when, values)
    now_ns = int(when[-1]) + after
    assert fed.stale(now_ns) == plain.stale(now_ns)
