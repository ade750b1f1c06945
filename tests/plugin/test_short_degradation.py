"""What the plan battery_degradation draws and says where there are too few cycles for a fade."""

from __future__ import annotations

import importlib.util
import math
import sys

import pytest
from workspaces import ROOT


@pytest.fixture(scope="module")
def plan():
    """Load the plan's module."""
    spec = importlib.util.spec_from_file_location(
        "degradation_plan", ROOT / "testplans/battery_degradation/test_degradation.py"
    )
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules[spec.name]


def rows_of(cycles, lacking=0):
    """Return rows that fade by 0.01 per cycle; the last ones lack their discharge."""
    columns = ("discharge_energy", "discharge_capacity", "discharge_time")
    whole = [{"cycle": each, **dict.fromkeys(columns, 7.0 - 0.01 * each)} for each in range(1, cycles + 1)]
    for row in whole[cycles - lacking :]:
        row.update(dict.fromkeys(columns, math.nan))
    return whole


@pytest.mark.parametrize(
    ("cycles", "lacking", "skip", "lines"),
    [(1, 0, 1, 0), (1, 0, 0, 0), (2, 0, 100, 0), (3, 0, 1, 0), (4, 2, 1, 0), (3, 0, 0, 3), (4, 0, 1, 3)],
)
def test_there_is_a_line_from_three_cycles_on(plan, cycles, lacking, skip, lines):
    """Fewer are drawn without one, whatever was to be left out."""
    rows, drawn = rows_of(cycles, lacking), []
    fades = plan.fades_of(rows, [], skip)
    plan.draw_fades(rows, [], fades, skip, lambda _, curve, **__: drawn.append(curve))
    assert len(fades) == lines
    assert [curve.model is not None for curve in drawn] == [bool(lines)] * 2
    assert all(list(curve.x) == list(range(1, cycles + 1)) for curve in drawn)
    if lines:
        assert fades["energy_fade"].slope.value == pytest.approx(-0.01)


def test_it_is_said_how_many_cycles_a_fade_needs(plan):
    """And how many the test had."""
    assert plan.fewer(rows_of(1), 1) == "a fade needs 3 whole cycles after 1 of settling, and the test had 1"
    assert plan.fewer(rows_of(2), 0) == "a fade needs 3 whole cycles, and the test had 2"
