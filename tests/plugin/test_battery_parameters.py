"""What the battery plans allow their parameters to be: a wrong one costs no bench time."""

from __future__ import annotations

from itertools import pairwise

import pytest
from battery_runs import battery_workspace
from workspaces import ROOT

from hil.executive.setup.configuration import configure
from hil.model.errors import Refused
from hil.requirements.parameters import load_parameters

PLANS = ("battery_charge", "battery_degradation")


@pytest.mark.parametrize(
    ("plan", "name", "value"),
    [
        ("battery_charge", "iterations", "11"),
        ("battery_charge", "iterations", "0"),
        ("battery_charge", "iterations", "-1"),
        ("battery_charge", "iterations", "1.5"),
        ("battery_charge", "mean_voltages", "3.4"),
        ("battery_charge", "mean_voltages", "3.95, 3.4"),
        ("battery_charge", "relaxation", "-100"),
        ("battery_charge", "declared_capacity", "0"),
        ("battery_charge", "declared_energy", "0"),
        ("battery_degradation", "cycles", "0"),
        ("battery_degradation", "cycles", "2.5"),
        ("battery_degradation", "rest", "0"),
        ("battery_degradation", "settling", "-1"),
    ],
)
def test_a_wrong_parameter_is_refused_before_anything_is_armed(tmp_path, plan, name, value):
    """With its name, its value, and what is allowed."""
    workspace = battery_workspace(tmp_path / "workspace", plan)
    with pytest.raises(Refused, match=f"parameter '{name}' is {value}.*, allowed is .* from .*; the plan has "):
        configure(workspace.request(overrides={name: value}))
    assert workspace.folders() == []


@pytest.mark.parametrize("plan", PLANS)
def test_every_number_has_bounds(plan):
    """A parameter that is added is bounded, too."""
    for row in load_parameters(ROOT, ROOT / "testplans" / plan).rows():
        assert None not in {row.allowed.minimum, row.allowed.maximum}, row.name


@pytest.mark.parametrize("plan", PLANS)
def test_settings_within_their_bounds_have_the_order_that_the_cycler_asks_for(plan):
    """No two values that are allowed are refused by the tester, when the bench is armed already."""
    rows = {row.name: row.allowed for row in load_parameters(ROOT, ROOT / "testplans" / plan).rows()}
    order = ("lowest_voltage", "end_voltage", "full_voltage", "highest_voltage")
    for lower, higher in pairwise(order):
        assert rows[lower].maximum < rows[higher].minimum
    assert rows["full_voltage"].maximum <= rows["charge_voltage"].minimum


def test_a_soak_fits_into_every_rest_that_is_allowed():
    """Something is left of the shortest rest for the way to the next temperature."""
    rows = {row.name: row.allowed for row in load_parameters(ROOT, ROOT / "testplans/battery_degradation").rows()}
    assert rows["rest"].minimum >= rows["soak"].maximum + rows["soak_margin"].maximum + 60
