"""Criteria files: read strictly, with everything that is wrong at its place."""

from __future__ import annotations

import pytest
from selected import criteria
from workspaces import ROOT

from hil.model.errors import ConfigurationError
from hil.selection.criteria import load_criteria

_GOOD = """\
title: Sensors
confidence: "0.99"
candidates:
  A: {roles: [gyroscope, magnetometer], instances: [a, a2]}
  B: {roles: [gyroscope], duts: [SN1], part: P1}
criteria:
  Noise: {parameter: white_noise, units: {gyroscope: deg/s/sqrt(Hz), magnetometer: uT/sqrt(Hz)}, axes: [x, y]}
  Drift: {parameter: drift, units: {gyroscope: deg/s/K}, combine: mean, weight: "2", plan: imu_lamp}
"""


def test_a_criteria_file_is_a_table_of_roles_and_criteria(tmp_path):
    """A cell has the candidates of its role; a candidate with two units needs the axes of both."""
    found = criteria(tmp_path, _GOOD)
    cells = [(each.role, each.criterion.name, [its.name for its in each.candidates]) for each in found.cells()]
    assert cells == [
        ("gyroscope", "Noise", ["A", "B"]),
        ("gyroscope", "Drift", ["A", "B"]),
        ("magnetometer", "Noise", ["A"]),
    ]
    first, second = found.candidates
    assert first.members("gyroscope", ("x", "y")) == (
        "gyroscope.a.x", "gyroscope.a.y", "gyroscope.a2.x", "gyroscope.a2.y",
    )  # fmt: skip
    assert (second.members("gyroscope", ("x",)), second.members("gyroscope", ())) == (("x",), ("",))
    assert ("drift", "gyroscope.a2") in found.wanted


@pytest.mark.parametrize(
    ("was", "becomes", "message"),
    [
        ("parameter: drift", "paramter: drift", "9:11: unknown key 'paramter', did you mean 'parameter'?"),
        ("combine: mean", "combine: sum", "criteria Drift: 'combine' must be one of worst, mean, found `sum`"),
        ('weight: "2"', 'weight: "0"', "'weight' must be at least 0.001"),
        ('weight: "2"', 'weight: "1e308"', "'weight' must be at most 1000"),
        ("[a, a2]", "[a, a]", "5:52: one of the instances of candidate A is named twice"),
        ("[SN1]", "[SN1, SN1]", "one of the duts of candidate B is named twice"),
        ('"0.99"', '"0.3"', "3:13: selection: 'confidence' must be at least 0.5"),
        (
            "gyroscope: deg/s/K",
            "gyroskop: deg/s/K",
            "9:47: no candidate has the role 'gyroskop', did you mean 'gyroscope'?",
        ),
        ("deg/s/K", "deg/s/kelvins?", "9:48: 'deg/s/kelvins?' is not a unit"),
        ("deg/s/K", "degC", "9:48: temperatures have no magnitude to compare, name a difference in K"),
        ("[gyroscope], duts", "[thermometer], duts", "6:15: no criterion has a unit for the role 'thermometer'"),
        (", duts: [SN1], part: P1", "", "6:3: candidate B: give instances, duts or a part"),
        ("duts: [SN1], part: P1", "instances: [a2]", "6:38: gyroscope.a2 is of candidate A already"),
        ("[x, y]", "[x, x]", "8:104: an axis is named twice"),
    ],
)
def test_what_is_wrong_is_told_at_its_line_and_column(tmp_path, was, becomes, message):
    """With the nearest name, where there is one."""
    with pytest.raises(ConfigurationError) as raised:
        criteria(tmp_path, _GOOD.replace(was, becomes))
    assert message in str(raised.value)


def test_one_candidate_is_no_choice(tmp_path):
    """Two at least, and a criterion."""
    with pytest.raises(ConfigurationError) as raised:
        criteria(tmp_path, "title: T\ncandidates: {A: {roles: [gyroscope], part: P}}\ncriteria: {}\n")
    assert "2 candidates at least" in str(raised.value)
    assert "needs a criterion" in str(raised.value)


def test_the_criteria_of_the_bench_imu_name_its_sensors():
    """Every instance is in the wiring of the bench, in the role that is compared."""
    found = load_criteria(ROOT / "testplans/imu_selection.yaml", "testplans/imu_selection.yaml")
    wiring = (ROOT / "fixtures/benches/imu/bench.yaml").read_text()
    named = {(role, name) for each in found.candidates for role in each.roles for name in each.instances}
    assert [pair for pair in sorted(named) if "role: {}, instance: {},".format(*pair) not in wiring] == []
    assert {each.plan for each in found.criteria} == {"imu_noise", "imu_lamp", "imu_closure"}
