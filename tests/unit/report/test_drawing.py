import re

import numpy as np
import pytest

from hil.model.verdict import Verdict
from hil.report.drawing.checks import Point, draw_bars
from hil.report.drawing.panel import Band, Scale, finite, spread
from hil.report.drawing.recordings import draw_traces
from hil.report.material import Trace, decimate


def trace(name="x", unit="deg/s", size=1000):
    """Return a channel with one spike."""
    times = np.arange(size) / 10.0
    values = np.sin(times)
    values[size // 3] = 7.0
    return Trace(name=name, unit=unit, times=times, values=values)


def test_a_drawing_that_is_much_taller_than_wide_may_take_a_page():
    """Legends of many channels in three units make it so; on paper it would else be a strip that nobody can read."""
    units = ("deg/s", "degC", "uT")
    many = [trace(name=f"magnetometer.{place}.temperature", unit=units[place % 3]) for place in range(30)]
    assert 'style="max-height:240mm"' in draw_traces("a", many, [])
    assert "style=" not in draw_traces("a", many[:3], [])


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
    for word in ("case · rest", ">x<", ">y<", ">deg/s<", ">t / degC<", "bench time / s", 'class="band"'):
        assert word in svg
    assert 'class="band"' not in draw_traces("a", [trace("x")], [])


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
    svg = "".join(draw_bars(points, Band(unit="A", low=None, high=2.5)))
    for word in ("PASS", "FAIL", "INCONCLUSIVE", "RECORDED", "mark good", "mark bad", "mark open", "mark neutral"):
        assert word in svg
    outlines = re.findall(r'<path class="mark \w+" d="M\d+ \d+(m[^"]*)"', svg)
    assert len(set(outlines)) == 4


def test_checks_stand_where_their_values_are():
    """The drawings of a parameter share one scale: values, uncertainties and limits can be compared from row to row."""
    points = [
        Point(label="a", value=1.0, expanded=None, verdict=Verdict.PASS),
        Point(label="b", value=3.0, expanded=1.0, verdict=Verdict.FAIL),
        None,
    ]
    above, below, nothing = draw_bars(points, Band(unit="A", low=None, high=2.0))
    first, second = (int(re.search(r'<path class="mark \w+" d="M(\d+) \d+m', svg)[1]) for svg in (above, below))
    low, high = (int(x) for x in re.search(r'class="bar bad" d="M(\d+) \d+H(\d+)', below).groups())
    limits = {int(re.search(r'class="limit" d="M(\d+) ', svg)[1]) for svg in (above, below)}
    assert limits == {low}
    assert low == pytest.approx((first + second) / 2, abs=1)
    assert second == pytest.approx((low + high) / 2, abs=1)
    assert 'class="bar' not in above
    assert nothing == ""


def test_titles_cannot_leave_their_text():
    """Markup, formulas and marks in names stay text, and none is obeyed."""
    hostile = "</text><script>$\\frac{1}{2}$\u202e\x07"
    point = Point(label=hostile, value=1.0, expanded=None, verdict=Verdict.PASS)
    svg = "".join(draw_bars([point], Band(unit=hostile, low=0, high=2))) + draw_traces(
        hostile, [trace(hostile, hostile), trace("x", hostile)], []
    )
    assert "<script" not in svg
    assert "\u202e" not in svg
    assert "\x07" not in svg
    assert "$\\frac{1}{2}$" in svg


def test_drawing_brings_nothing_that_a_page_cannot_hold():
    """No address, no style of its own, no fixed colour."""
    svg = draw_traces("a", [trace()], [Band(unit="deg/s", low=None, high=0.5)])
    assert svg.startswith('<svg class="drawing" role=')
    for word in ("http", "style", "<!DOCTYPE", "xmlns", "#"):
        assert word not in svg


def test_gaps_interrupt_the_line():
    """Where there is no number there is no line, and a number alone is still seen."""
    values = np.array([1.0, 2.0, np.nan, 3.0, np.nan, 4.0, 5.0])
    svg = draw_traces("a", [Trace(name="x", unit="V", times=np.arange(7.0), values=values)], [])
    steps = re.search(r'class="line c0 d0" d="([^"]*)"', svg)[1]
    assert steps.count("M") == 3
    assert "h20" in steps


def test_level_stretches_are_short():
    """A channel that stays where it is costs no more than its ends."""
    level = Trace(name="x", unit="V", times=np.arange(1000.0), values=np.full(1000, 3.3))
    steps = re.search(r'class="line c0 d0" d="([^"]*)"', draw_traces("a", [level], []))[1]
    assert len(steps) < 30


def test_channels_without_a_number_get_their_panel():
    """A channel without one valid sample still gets its panel."""
    empty = Trace(name="x", unit="V", times=np.arange(10.0), values=np.full(10, np.nan))
    assert ">x / V<" in draw_traces("a", [empty], [])


def test_sixteen_channels_look_different():
    """No two of sixteen channels of a unit have the same colour and dashes."""
    svg = draw_traces("cells", [trace(f"c{place}", "V") for place in range(16)], [])
    assert len(set(re.findall(r'class="(line c\d d\d)"', svg))) == 16


@pytest.mark.parametrize(
    ("low", "high", "labels"),
    [
        (0.0, 10.0, ["0", "2", "4", "6", "8", "10"]),
        (-0.04, 0.03, ["-0.04", "-0.02", "0.00", "0.02"]),
        (1.2e-5, 3.1e-5, ["15", "20", "25", "30"]),
        (0.0, 2e9, ["0.0", "0.5", "1.0", "1.5", "2.0"]),
        (3.2999, 3.3001, ["3.29990", "3.29995", "3.30000", "3.30005", "3.30010"]),
    ],
)
def test_ticks_are_round(low, high, labels):
    """Ticks stand at round numbers, with as many digits as they need, and a power of ten goes to the title."""
    found = Scale(low=low, high=high, first=0, last=100).ticks(6)
    assert [label for _, label in found] == labels


@pytest.mark.parametrize(("low", "high"), [(-0.49, 0.49), (-0.31, 0.52), (0.9, 2.1), (0.0, 0.99)])
def test_an_axis_has_two_ticks_at_least(low, high):
    """Also where three are room enough: one alone shows no scale."""
    assert 2 <= len(Scale(low=low, high=high, first=0, last=100).ticks(3)) <= 6


def test_powers_of_ten_go_to_the_title():
    """Small and large numbers leave their power of ten to the axis' title."""
    assert Scale(low=1.2e-5, high=3.1e-5, first=0, last=1).titled("deg/s") == "(10⁻⁶ deg/s)"
    assert Scale(low=1.2e-5, high=3.1e-5, first=0, last=1).titled("A") == "µA"
    assert Scale(low=0.0, high=2e9, first=0, last=1).titled("") == "10⁹"
    assert Scale(low=0.0, high=20.0, first=0, last=1).titled("A") == "A"


@pytest.mark.parametrize("values", [[], [0.0], [5.0, 5.0 + 1e-12], [-3.0], [1e299, -1e299], [5e-324, 0.0]])
def test_an_axis_has_an_extent(values):
    """Whatever the values, low is below high, and there are ticks between."""
    low, high = spread(values, 0.05)
    assert low < high
    assert all(low <= value <= high for value in values)
    assert Scale(low=low, high=high, first=0, last=100).ticks(6)


@pytest.mark.parametrize(
    ("value", "drawn"),
    [("0.5", 0.5), (2, 2.0), (None, None), (True, None), ("left", None), (float("nan"), None), (1e305, None)],
)
def test_finite(value, drawn):
    """Decimal strings and finite numbers can be drawn, nothing else."""
    assert finite(value) == drawn
