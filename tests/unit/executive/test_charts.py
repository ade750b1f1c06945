"""`chart`: what a case draws is kept as data, in the units of its axes, with the catalogue's limits."""

from __future__ import annotations

import math

import pytest
from case_parts import Case
from typed_events import event_of

from hil.executive.cases.charts import Curve
from hil.model.errors import Misused
from hil.model.figure import Figure


@pytest.fixture
def case(tmp_path):
    """A case with one requirement."""
    return Case(tmp_path, "T-020")


@pytest.fixture
def chart(case):
    """Its fixture."""
    return case.run.chart


@pytest.fixture
def written(case):
    """Its journal."""
    return case.written.events


AXES = {"x": ("current", "mA"), "y": ("field", "uT")}


def test_figures_are_converted_and_carry_their_bars(chart, written):
    """Values are in the units of the axes, bars are twice the standard uncertainty, and what is not finite is null."""
    amperes = [Figure(value=0.008, unit="A"), Figure(value=0.016, unit="A")]
    fields = [Figure(value=5.5, unit="uT", uncertainty=0.02), math.nan]
    chart("Field over current", Curve(name="x+", x=amperes, y=fields, residual=[0.1, -0.1]), **AXES)
    event = event_of(**written[0])
    assert (event.kind(), event.step, event.x.unit) == ("chart", "", "mA")
    (curve,) = event.curves
    assert curve.x == (8.0, 16.0)
    assert curve.y == (5.5, None)
    assert curve.expanded == (0.04, None)
    assert curve.residual == (0.1, -0.1)


def test_what_the_lines_are_is_kept(chart, written):
    """In words, for the caption."""
    line = Curve(name="x+", x=[1.0, 2.0], y=[1.0, 2.0], model=([1.0, 2.0], [1.0, 2.0]))
    chart("Field over current", line, lines="the straight lines that fit best", **AXES)
    chart("Field over current", line, **AXES)
    assert [event_of(**each).lines for each in written] == ["the straight lines that fit best", ""]


def test_limits_come_from_the_catalogue(chart, written):
    """A limit is named, never given as a number, and is drawn in the unit of the axis."""
    curve = Curve(name="x", x=[1.0], y=[1.0])
    chart("Rate", curve, x=("time", "s"), y=("rate", "deg/h"), limit=("T-020", "rate"))
    (limit,) = event_of(**written[0]).limits
    assert (limit.requirement, limit.min, limit.max) == ("T-020", None, 1800.0)
    with pytest.raises(Misused, match="no limit 'T-020 rat', did you mean 'T-020 rate'"):
        chart("Rate", curve, x=("t", "s"), y=("d", "deg/s"), limit=("T-020", "rat"))


@pytest.mark.parametrize(
    ("curves", "axes", "words"),
    [
        ([], AXES, "has no curve"),
        ([Curve(name="a", x=[1.0], y=[1.0, 2.0])], AXES, "1 places across for 2 values"),
        ([Curve(name="a", x=[Figure(value=1.0, unit="V")], y=[1.0])], AXES, "do not convert to mA"),
        ([Curve(name="a", x=[1.0], y=[1.0])], {**AXES, "x": "mA/"}, "is a name and a unit"),
        ([Curve(name="a", x=[1.0], y=[1.0])], {**AXES, "x": ("time", "fortnite")}, "x of a chart"),
        (["a"], AXES, "made of curves, found a str"),
    ],
)
def test_what_cannot_be_drawn_is_refused(chart, written, curves, axes, words):
    """Whatever does not fit together is an error of the plan, and nothing is written."""
    with pytest.raises(Misused, match=words):
        chart("Field", *curves, **axes)
    assert not written
