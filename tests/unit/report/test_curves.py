"""Charts of the first page, limits that count at times only, and the folding of equal steps: what is drawn is true."""

from __future__ import annotations

import re

import numpy as np
import pytest
import specimen_run
from typed_events import event_of

from hil.evidence.events import Chart, ChartAxis, ChartCurve, ChartLimit
from hil.report.drawing.curves import chart_graphics, draw_chart
from hil.report.drawing.panel import WIDTH, Band, LogScale, width_of
from hil.report.drawing.recordings import _windows, draw_traces
from hil.report.material import Trace
from hil.report.page.as_run import attributed, derived_from
from hil.report.page.grouping import check_groups, headlines
from hil.report.page.steps import step_rows


def chart(*curves, log=False, limits=(), title="Bias over temperature", lines=""):
    """Return a chart of these curves."""
    axes = {"x": ChartAxis(name="temperature", unit="degC"), "y": ChartAxis(name="bias", unit="deg/s")}
    return Chart(case="c", step="", title=title, curves=curves, limits=limits, log=log, lines=lines, **axes)


def places(svg, kind="mark k0"):
    """Return where the points of a curve stand."""
    return [(int(x), int(y)) for x, y in re.findall(rf'<path class="{kind}" d="M(\d+) (\d+)m', svg)]


def test_charts_of_one_title_are_one():
    """Every case adds its curves to the chart of its title; another title is another chart."""
    made = [chart(ChartCurve(name=axis, x=(1.0, 2.0), y=(1.0, 2.0))) for axis in "xy"]
    first, second = chart_graphics([*made, chart(ChartCurve(name="z", x=(1.0,), y=(1.0,)), title="Scale")])
    assert (first.title, second.title) == ("Bias over temperature", "Scale")
    assert first.svg.count(">x<") == first.svg.count(">y<") == 1  # its legend
    assert "bias / deg/s" in first.svg
    assert "temperature / degC" in first.svg


@pytest.mark.parametrize(
    ("lines", "told"), [("", "lines are the model"), ("the fade that fits best", "lines are the fade that fits best")]
)
def test_a_caption_says_what_its_lines_are(lines, told):
    """Where there are lines; of several cases each is said once."""
    curve = ChartCurve(name="x", x=(1.0, 2.0), y=(1.0, 2.0), model_x=(1.0, 2.0), model_y=(1.0, 2.0))
    (drawn,) = chart_graphics([chart(curve, lines=lines)] * 2)
    assert drawn.described == f"2 points; {told}."
    (points,) = chart_graphics([chart(ChartCurve(name="x", x=(1.0, 2.0), y=(1.0, 2.0)), lines=lines)])
    assert points.described == "2 points."


def test_the_last_number_across_is_not_cut():
    """A long one has its room at the right."""
    svg = draw_chart(chart(ChartCurve(name="x", x=(0.0, 19_450.0), y=(1.0, 2.0))))
    place = int(re.search(r'<text[^>]* x="(\d+)"[^>]*>20000<', svg)[1])
    assert place + width_of("20000") // 2 <= WIDTH


def test_pairs_have_one_colour_each_and_are_filled_and_hollow():
    """Heating and cooling of an axis are told apart, and so are the axes; other names take one kind after the other."""

    def kinds(*names):
        svg = draw_chart(chart(*(ChartCurve(name=name, x=(1.0, 2.0), y=(1.0, 2.0)) for name in names)))
        return [*dict.fromkeys(re.findall(r'class="(mark[^"]*)" d="M', svg))]

    assert kinds("x heating", "x cooling", "y heating") == ["mark k0", "mark hollow k0", "mark k1"]
    assert kinds("axis x", "axis y", "axis z") == ["mark k0", "mark k1", "mark k2"]
    assert kinds("axis x", "axis y") == ["mark k0", "mark k1"]
    assert kinds("up", "down") == ["mark k0", "mark k1"]


def test_points_residuals_and_limits_stand_at_their_values():
    """Values and residuals have panels of their own over one lower axis, each with its limit."""
    curve = ChartCurve(
        name="x", x=(0.0, 10.0), y=(1.0, 3.0), model_x=(0.0, 10.0), model_y=(1.5, 2.5), residual=(-0.5, 0.5)
    )
    limits = tuple(
        ChartLimit(requirement="A-1", parameter="bias", min=None, max=3.0, residual=residual)
        for residual in (False, True)
    )
    svg = draw_chart(chart(curve, limits=limits[:1]))
    (left, low), (right, high), (again, below), (_, above) = places(svg)
    assert left == again < right
    assert high < low < above < below
    edge = int(re.search(r'class="limit" d="M\d+ (\d+)L', svg)[1])
    assert edge == high
    assert draw_chart(chart(curve, limits=limits)).count('class="limit"') == 2


def test_a_hole_and_what_a_logarithm_has_no_place_for_are_left_out():
    """Numbers that are not finite, and on logarithmic axes those that are not above zero, leave a hole."""
    curve = ChartCurve(name="x", x=(1.0, 10.0, 100.0, 1000.0), y=(1.0, None, -1.0, 0.1))
    assert len(places(draw_chart(chart(curve, log=True)))) == 2
    assert len(places(draw_chart(chart(curve)))) == 3
    scale = LogScale(low=0.01, high=100.0, first=0, last=400)
    assert [scale.at(value) for value in (0.01, 1.0, 100.0)] == [0, 200, 400]
    assert [label for _, label in scale.ticks(6)] == ["10⁻²", "10⁻¹", "1", "10", "100"]


def test_a_limit_on_a_density_falls_over_the_averaging_time():
    """N / sqrt(tau) passes through the limit at one second and half of it at four."""
    limit = ChartLimit(requirement="A-1", parameter="noise", min=None, max=1.0, power=-0.5)
    svg = draw_chart(chart(ChartCurve(name="x", x=(1.0, 100.0), y=(1.0, 0.1)), log=True, limits=(limit,)))
    begin, end = places(svg)
    steps = re.search(r'class="limit" d="M(\d+) (\d+)l([^"]*)"', svg)
    moves = [int(each) for each in re.findall(r"-?\d+", steps[3])]
    xs = np.cumsum([int(steps[1]), *moves[::2]])
    ys = np.cumsum([int(steps[2]), *moves[1::2]])
    assert np.interp([begin[0], end[0]], xs, ys) == pytest.approx([begin[1], end[1]], abs=2)


def test_limits_are_drawn_while_they_count():
    """A limit on charging has an area for each charge, and no line in between."""
    times = np.arange(100.0)
    current = Trace(name="current", unit="A", times=times, values=np.where((times // 20) % 2 == 1, 0.7, -0.7))
    windows = _windows(current, "charging", 0.02)
    assert windows == ((20.0, 39.0), (60.0, 79.0))
    assert _windows(current, "discharging", 0.02)[0] == (0.0, 19.0)
    assert _windows(None, "charging", 0.02) == ()
    band = Band(unit="degC", low=0.0, high=45.0, channel="temperature", windows=windows)
    trace = Trace(name="temperature", unit="degC", times=times, values=times / 4)
    svg = draw_traces("a", [trace], [band])
    assert svg.count('class="band"') == 2
    assert len(re.findall(r"M\d+ \d+H", re.search(r'class="limit" d="([^"]*)"', svg)[1])) == 4
    assert 'class="band"' not in draw_traces("a", [Trace(name="other", unit="degC", times=times, values=times)], [band])


def test_a_plain_number_has_no_unit_at_its_axis():
    """An axis of a plain number is called by its quantity alone."""
    trace = Trace(name="cycle", unit="1", times=np.arange(9.0), values=np.arange(9.0))
    svg = draw_traces("a", [trace], [])
    assert ">cycle<" in svg
    assert "/ 1<" not in svg


def stepped(*titles):
    """Return the rows of steps one after the other, each a title or a title with those inside it; `!` marks a raise."""
    events = []

    def run(names, before):
        for place, name in enumerate(names, 1):
            title, inner = name if isinstance(name, tuple) else (name, ())
            about = {"case": "c", "path": [title.rstrip("!")], "number": f"{before}{place}"}
            events.append(event_of("step", t=1.0, **about))
            run(inner, f"{before}{place}.")
            outcome = "raised" if title.endswith("!") else "done"
            events.append(event_of("step-end", t=2.0, outcome=outcome, duration=1.0, **about))

    run(titles, "")
    return step_rows(attributed(events))


def test_runs_of_equal_steps_are_folded():
    """Steps that differ in numbers only are one row, with what is inside them folded once."""
    cycles = [(f"Cycle {number} of 115", ("Charge", "Discharge")) for number in (1, 2)]
    rows = stepped("Begin", *cycles, "End")
    assert [(row.number, row.title, row.count) for row in rows] == [
        ("1", "Begin", 1),
        ("2 to 3", "Cycle 1, 2 of 115", 2),
        ("2.1 to 3.1", "Charge", 2),
        ("2.2 to 3.2", "Discharge", 2),
        ("4", "End", 1),
    ]
    many = stepped(*(f"Measure at {current} mA" for current in (8, 12, 16, 20, 24)))
    assert [(row.title, row.duration) for row in many] == [("Measure at 8 to 24 mA", "each 1 s")]


def test_a_step_that_did_not_end_well_stands_alone():
    """What raised an exception is not hidden among what did not."""
    rows = stepped("Cycle 1 of 4", "Cycle 2 of 4", "Cycle 3 of 4!", "Cycle 4 of 4")
    assert [(row.title, row.outcome) for row in rows] == [
        ("Cycle 1, 2 of 4", "done"),
        ("Cycle 3 of 4", "raised"),
        ("Cycle 4 of 4", "done"),
    ]


def driven(*calls):
    """Return what the report says of one step that makes these calls."""
    about = {"case": "c", "number": "1"}
    events = [event_of("step", t=1.0, path=["Sweep"], **about)]
    for name, arguments in calls:
        events.append(event_of("effect", t=1.0, case="c", step="1", effect="drives", name=name, arguments=arguments))
    events.append(event_of("step-end", t=2.0, path=["Sweep"], outcome="done", duration=1.0, **about))
    (row,) = step_rows(attributed(events))
    return row.effects


def test_many_calls_of_a_step_that_differ_in_numbers_are_one():
    """A sweep of 40 points is one entry with its range at the place of its first call; words are never merged."""
    sweep = [("load.constant_voltage", {"voltage": place / 10, "lead": 2}) for place in reversed(range(40))]
    pair = [("relays.close", {"contact": "lamp"}), ("relays.close", {"contact": "dryer"})]
    assert driven(("load.enable", {}), *sweep, *pair) == (
        "load.enable(); load.constant_voltage(voltage=0 to 3.9, lead=2) 40 times; "
        "relays.close(contact=lamp); relays.close(contact=dryer)"
    )


def test_a_few_calls_of_a_step_stand_one_by_one():
    """Up to four calls alike keep their numbers and their order."""
    calls = [("supply.set", {"voltage": volts}) for volts in (3.3, 5, 3.3, 0)]
    assert driven(*calls) == "; ".join(f"supply.set(voltage={volts})" for volts in ("3.3", "5", "3.3", "0"))


def checked(**fields):
    """Return one check as it stands in a journal."""
    return event_of("check", **specimen_run.check(1.0, "c", "A-1", "error", **fields)[2])


def test_the_first_page_shows_the_value_nearest_its_limit():
    """Of several checks of one name that with the least margin counts, with its conditions; of bad ones the first."""
    near, far = (
        checked(headline="Error", at=f"axis {axis}", margin=margin) for axis, margin in (("x", 0.1), ("y", 0.4))
    )
    (tile,) = headlines(attributed([far, near, checked()]))
    assert (tile.name, tile.at, tile.among) == ("Error", "axis x", "closest to the limit, of 2")
    bad = checked(headline="Error", at="axis z", margin=-0.1, verdict="FAIL")
    (tile,) = headlines(attributed([far, near, bad]))
    assert (tile.verdict, tile.at, tile.among) == ("FAIL", "axis z", "1 of 3 not good")


def test_nearness_is_a_part_of_what_each_limit_allows():
    """A margin of 0.1 is more within a limit of 0.2 than one of 0.4 within a limit of 2, of two sides or of one."""
    wide, narrow = {"min": "-2", "max": "2", "equals": None}, {"min": "-0.2", "max": "0.2", "equals": None}
    for others in ({}, {"min": None}):
        far = checked(headline="Drift", at="far", margin=0.1, limit=narrow | others)
        near = checked(headline="Drift", at="near", margin=0.4, limit=wide | others)
        assert headlines(attributed([far, near]))[0].at == "near"


def test_every_row_says_its_conditions():
    """Checks of one parameter are a group, each with the conditions that the case told, or else its member."""
    (group,) = check_groups(attributed([checked(at="axis z, 45.0 deg/s", of="z"), checked(of="y")]), {})
    assert [row.at for row in group.rows] == ["axis z, 45.0 deg/s", "y"]
    assert all(row.bar for row in group.rows)


def test_values_that_one_step_recorded_are_a_list():
    """Ten cycles without a limit take three lines; what has a limit, a reason or another step has a row of its own."""
    bare = {"verdict": "RECORDED", "limit": {"min": None, "max": None, "equals": None}, "margin": None, "reason": ""}

    def listed(*changes):
        return check_groups(
            attributed([checked(at=f"cycle {n}", **{**bare, **each}) for n, each in enumerate(changes)]), {}
        )

    assert [group.listed for group in listed({}, {}, {}, {})] == [True]
    assert [group.listed for group in listed({}, {}, {})] == [False]
    assert [group.listed for group in listed({}, {}, {}, {"reason": "its rate was not met"})] == [False]
    assert [group.listed for group in listed({}, {}, {}, {"step": "9"})] == [False]


def test_a_recording_is_named_once():
    """With all its channels, also where several checks used them; what is no recording stands as it is."""
    names = [
        "recording test",
        "recording test, voltage",
        "series",
        "recording test, current",
        "recording test, voltage",
    ]
    assert derived_from(names) == "recording test (voltage, current), series"


def test_what_low_panels_are_called_does_not_meet():
    """Five panels leave no room for a long name with its unit in one line: they stand side by side."""
    times = np.array([0.0, 1.0])
    units = {"voltage": "V", "current": "A", "energy": "W.h", "temperature": "degC"}
    traces = [Trace(name=name, unit=unit, times=times, values=times) for name, unit in units.items()]
    upright = r'y="(\d+)" transform="[^"]*">([^<]*)<'
    (name, unit) = re.findall(upright, draw_traces("a", traces, []))[-2:]
    assert (name[1], unit[1], name[0]) == ("temperature", "degC", unit[0])
    assert re.findall(upright, draw_traces("a", traces[3:], []))[0][1] == "temperature / degC"
