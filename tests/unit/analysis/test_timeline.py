"""How the times of a log are understood."""

from __future__ import annotations

import numpy as np
import pytest

from hil.analysis.timeline import time_unit, timeline, unwrapped


@pytest.mark.parametrize("modulus", [2.0**16, 2.0**24, 2.0**31, 2.0**32, 2.0**32 / 1e3, 86400.0, 3600.0, 60.0])
def test_counters_that_wrap_are_continued(modulus):
    """Steps of a thousandth of the range, across its end twice."""
    even = modulus * (0.9 + 0.001 * np.arange(1500))
    raw, told = unwrapped(even % modulus)
    assert np.allclose(np.diff(raw), 0.001 * modulus, rtol=1e-6)
    assert "start over 2 times, at sample 101, 1101" in told[0]


@pytest.mark.parametrize("back", [2.0, 17.0, 49.0])
def test_a_clock_that_is_set_back_is_no_counter(back):
    """What no range explains stays, and the gate on order is left to say so."""
    times = np.arange(6000) / 100.0
    raw, told = unwrapped(times - back * (times > 50.0))
    assert told == ()
    assert (np.diff(raw) < 0.0).any()


def test_rows_out_of_order_are_put_back():
    """Neighbours that changed places: times rise, and each row keeps its values."""
    order = np.arange(100)
    order[[40, 41]] = order[[41, 40]]
    line = timeline(order / 10.0)
    assert (np.diff(line.seconds) > 0.0).all()
    assert line.rows is not None
    assert line.rows.tolist() == order.tolist()
    assert "2 rows stand out of order" in line.remarks[0]


def test_rows_that_are_written_twice_are_left_out_with_a_remark():
    """Time and values repeat: one row goes; with other values it stays."""
    times = np.arange(100) / 10.0
    twice, values = np.insert(times, 50, times[50]), np.insert(np.arange(100.0), 50, 50.0)
    assert timeline(twice, values=values[:, None]).seconds.size == 100
    values[51] = -1.0
    line = timeline(twice, values=values[:, None])
    assert line.seconds.size == 101
    assert line.report.duplicates == 1


def test_a_timestamp_that_is_no_number_is_taken_from_its_neighbours():
    """One of a thousand is told, twenty trip the gate."""
    times = np.arange(1000) / 10.0
    times[30] = np.nan
    line = timeline(times)
    assert line.seconds[30] == pytest.approx(3.0)
    assert [gate.ok for gate in line.gates if gate.name == "times"] == [True]
    times[100:120] = np.nan
    assert [gate.ok for gate in timeline(times).gates if gate.name == "times"] == [False]


@pytest.mark.parametrize(
    ("column", "start", "unit"),
    [
        ("t_ms", 0.0, "ms"),
        ("Time [us]", 0.0, "us"),
        ("timestamp(ns)", 0.0, "ns"),
        ("Time (Hours)", 0.0, "h"),
        ("Time", 0.0, "s"),
        ("1", 0.0, "s"),
        ("s", 0.0, "s"),
        ("t", 1.7e9, "s"),
        ("t", 1.7e12, "ms"),
        ("t", 1.7e15, "us"),
        ("t", 1.7e18, "ns"),
    ],
)
def test_the_unit_follows_from_the_name_or_the_size(column, start, unit):
    """A name that ends in a unit, or an epoch; what is typed wins."""
    assert time_unit(None, column, [start])[0] == unit
    assert time_unit("min", column, [start]) == ("min", "")


@pytest.mark.parametrize(("step", "asks"), [(10.0, "ms"), (1e4, "us"), (1e7, "ns"), (1e-6, "h")])
def test_an_interval_that_no_sensor_has_asks_for_the_unit(step, asks):
    """Only if nobody typed it."""
    gate = timeline(step * np.arange(100), typed=False).gates[0]
    assert gate.ok is False
    assert f"type --time-unit {asks} if" in gate.reason
    assert timeline(step * np.arange(100)).gates[0].ok is True


def test_a_unit_that_a_size_or_a_name_says_may_be_wrong():
    """An interval that no sensor has trips with them as well, and every unit that would do is named."""
    raw = 1.7e12 + 1e7 * np.arange(100)
    gate = timeline(raw, time_unit(None, "t", raw)[0], typed=False).gates[0]
    assert gate.ok is False
    assert "with times taken in ms, is unlikely: type --time-unit ns if they are in ns" in gate.reason
    days = timeline(46000.0 + np.arange(100) / 8.64e6, typed=False).gates[0]
    assert "--time-unit h if they are in h, --time-unit d if they are in d, --time-unit s if" in days.reason
    named = timeline(np.arange(100) / 100.0, time_unit(None, "t_ms", [0.0])[0], typed=False).gates[0]
    assert "type --time-unit s if they are in s" in named.reason


@pytest.mark.parametrize("column", ["sample", "PacketCounter", "Record No.", "seq [1]", "IMU_IDX"])
def test_a_column_that_counts_samples_is_no_time(column):
    """Its name says it, unless somebody typed the unit or the name speaks of a time."""
    counts = np.arange(100.0)
    gate = timeline(counts, typed=False, column=column).gates[0]
    assert gate.ok is False
    assert f"column '{column}' counts samples" in gate.reason
    assert timeline(counts, column=column).gates[0].ok is True
    assert timeline(counts, typed=False, column=f"time_{column}").gates[0].ok is True


def test_times_that_may_be_counts_are_told():
    """Of a table without names, where nobody typed the unit."""
    assert "if they count samples" in timeline(np.arange(100.0), typed=False, column="1").remarks[0]
    for times, column in ((np.arange(100.0), "t"), (0.5 * np.arange(100.0), "1")):
        assert timeline(times, typed=False, column=column).remarks == ()
    assert timeline(np.arange(100.0), column="1").remarks == ()


@pytest.mark.parametrize("rate", [90.0, 150.0])
def test_a_rate_that_changes_half_way_trips(rate):
    """From 100 Hz; a gap, jitter that adds up and lost samples are no change of rate."""
    even, generator = np.arange(4000) / 100.0, np.random.default_rng(3)
    late = np.maximum(np.arange(4000) - 2000, 0)
    changed = timeline(np.where(late > 0, 20.0 + late / rate, even))
    assert [gate.name for gate in changed.gates if gate.ok is False] == ["one_rate"]
    walk = np.cumsum(np.abs(1.0 + generator.standard_normal(4000) / 3.0)) / 100.0
    for times in (even, even + 7.0 * (late > 0), even[generator.random(4000) > 0.05], walk):
        assert next(gate for gate in timeline(times).gates if gate.name == "one_rate").ok is not False
