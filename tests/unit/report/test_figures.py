import re

import numpy as np
import pytest

from hil.model.verdict import Verdict
from hil.report.material import Trace
from hil.report.page.figures import Band, Point, decimate, draw_points, draw_traces, finite


def trace(name="x", unit="deg/s", size=1000):
    """Return a channel with one spike."""
    times = np.arange(size) / 10.0
    values = np.sin(times)
    values[size // 3] = 7.0
    return Trace(name=name, unit=unit, times=times, values=values)


def test_decimation_keeps_every_extreme():
    """Few samples remain, in order, and the highest and lowest of the whole are among them."""
    values = np.random.default_rng(3).normal(size=100_003)
    times = np.arange(100_003.0)
    few_times, few = decimate(times, values, 2000)
    assert len(few) <= 2002
    assert few.min() == values.min()
    assert few.max() == values.max()
    assert np.all(np.diff(few_times) > 0)
    assert few_times[-1] == times[-1]
    assert np.array_equal(values[few_times.astype(int)], few)


def test_decimation_leaves_short_channels_alone():
    """What is short enough is drawn as it is."""
    times, values = np.arange(5.0), np.array([1.0, np.nan, 2.0, 3.0, 4.0])
    assert decimate(times, values, 10)[1] is values


def test_decimation_keeps_extremes_beside_invalid_samples():
    """A sample that is no number hides none of its neighbours."""
    values = np.full(10_000, np.nan)
    values[1234] = 5.0
    assert np.nanmax(decimate(np.arange(10_000.0), values, 100)[1]) == 5.0


def test_same_numbers_same_bytes():
    """A drawing made twice is the same text."""
    first, second = (draw_traces("a", [trace()], []) for _ in range(2))
    assert first == second


def test_traces_share_a_panel_per_unit_and_show_limits():
    """Axes are labelled with their unit, channels with their name, limits with a band."""
    band = Band(unit="deg/s", low=-0.5, high=0.5)
    svg = draw_traces("case · rest", [trace("x"), trace("y"), trace("t", "degC")], [band])
    for word in ("case · rest", ">x<", ">y<", ">deg/s<", ">t / degC<", "bench time / s", "var(--band)"):
        assert word in svg
    assert "var(--band)" not in draw_traces("a", [trace("x")], [])


@pytest.mark.parametrize(("size", "word"), [(1000, "s"), (6000, "min"), (100_000, "h")])
def test_time_is_in_a_unit_that_fits(size, word):
    """Seconds, minutes or hours, whichever a person would say."""
    assert f"bench time / {word}<" in draw_traces("a", [trace(size=size)], [])


def test_verdicts_differ_by_colour_and_shape():
    """A failed point is told from a passed one without colour."""
    points = [
        Point(label=verdict.value, value=float(place), expanded=0.1, verdict=verdict)
        for place, verdict in enumerate((Verdict.PASS, Verdict.FAIL, Verdict.INCONCLUSIVE, Verdict.RECORDED))
    ]
    svg = draw_points("A-1 current", points, Band(unit="A", low=None, high=2.5))
    for word in ("PASS", "FAIL", "INCONCLUSIVE", "RECORDED", ">A<", "var(--good)", "var(--bad)", "var(--open)"):
        assert word in svg
    shapes = re.findall(r'<path id="(m[0-9a-f]{10})" d="([^"]*)"', svg)
    assert len({outline for _, outline in shapes}) >= 5


def test_titles_cannot_leave_their_text():
    """Markup, formulas and marks in names stay text, and none is obeyed."""
    hostile = "</text><script>$\\frac{1}{2}$\u202e\x07"
    svg = draw_points(
        hostile,
        [Point(label=hostile, value=1.0, expanded=None, verdict=Verdict.PASS)],
        Band(unit=hostile, low=0, high=2),
    )
    assert "<script" not in svg
    assert "\u202e" not in svg
    assert "\x07" not in svg
    assert "$\\frac{1}{2}$" in svg


def test_drawing_brings_nothing_that_a_page_cannot_hold():
    """No address, no style of its own, no metadata, no fixed colour."""
    svg = draw_traces("a", [trace()], [Band(unit="deg/s", low=None, high=0.5)])
    assert svg.startswith("<svg role=")
    for word in ("http", "<style", "<metadata", "<!DOCTYPE", "xmlns", "#0102"):
        assert word not in svg


def test_unbroken_gaps_are_drawn():
    """A channel without one valid sample still gets its panel."""
    empty = Trace(name="x", unit="V", times=np.arange(10.0), values=np.full(10, np.nan))
    assert ">x / V<" in draw_traces("a", [empty], [])


@pytest.mark.parametrize(
    ("value", "drawn"), [("0.5", 0.5), (2, 2.0), (None, None), (True, None), ("left", None), (float("nan"), None)]
)
def test_finite(value, drawn):
    """Decimal strings and finite numbers can be drawn, nothing else."""
    assert finite(value) == drawn
