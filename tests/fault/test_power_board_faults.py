"""What can be wrong with a power board or its bench: FAIL or INCONCLUSIVE, and ERROR where the bench is to blame."""

from __future__ import annotations

import shutil
from dataclasses import dataclass

import pytest
import sweeps
from workspaces import ROOT, Workspace

pytestmark = [pytest.mark.system, pytest.mark.timeout(120)]

CASES = ("rail_under_load", "power_on_time", "inrush", "quiescent_current", "efficiency")
BENCH = "fixtures/benches/eps/bench.yaml"
SCOPE = 'channels: {"1": {probe: "10"}, "2": {probe: "10"}}}'


@dataclass(frozen=True)
class Fault:
    """One thing that is wrong: what changes in the bench file, what is not PASS then, and a word of the reason."""

    changes: dict[str, str]
    verdicts: dict[str, str]
    said: str


FAULTS = {
    "high output resistance": Fault(
        {'output_resistance: "0.02"': 'output_resistance: "0.12"'}, {"rail_under_load": "FAIL"}, "voltage of full"
    ),
    "foldback in overload": Fault(
        {'current_limit: "3"': 'current_limit: "1.5"'},
        {"rail_under_load": "FAIL", "efficiency": "FAIL"},
        "voltage of full",
    ),
    "slow start": Fault({'rise: "0.025"': 'rise: "0.1"'}, {"power_on_time": "FAIL"}, "is above the maximum"),
    "no start": Fault(
        {"truth: {limiter": 'truth: {starts: "9", limiter'},
        {"rail_under_load": "FAIL", "power_on_time": "INCONCLUSIVE", "efficiency": "FAIL"},
        "not met within 2 s; it read electronic_load.voltage",
    ),
    "large inrush": Fault({'limiter: "3"': 'limiter: "1.2"'}, {"inrush": "FAIL"}, "EPS-PWR-040 peak is FAIL"),
    "no limiter": Fault({'limiter: "3"': 'limiter: "0"'}, {"inrush": "INCONCLUSIVE"}, "inrush of scope1 is clipped"),
    "missing capacitor": Fault(
        {"truth: {limiter": 'truth: {capacitance: "0.00001", limiter'}, {"inrush": "FAIL"}, "EPS-PWR-040 charge is FAIL"
    ),
    "leakage": Fault({'quiescent: "0.006"': 'quiescent: "0.02"'}, {"quiescent_current": "FAIL"}, "quiescent is FAIL"),
    "losses": Fault(
        {"truth: {limiter": 'truth: {loss_resistance: "0.5", limiter'}, {"efficiency": "FAIL"}, "efficiency of full"
    ),
    "meter beyond its range": Fault(
        {"range: 3 A": "range: 0.001 A"}, {"quiescent_current": "INCONCLUSIVE"}, "not a finite number"
    ),
    "no trigger": Fault(
        {"    scope1:\n": "    scope1:\n      faults: [{kind: deaf}]\n"},
        {"inrush": "INCONCLUSIVE"},
        "oscilloscope was not triggered within 1 s",
    ),
    "factor of the probe": Fault(
        {SCOPE: SCOPE.replace('"1": {probe: "10"}', '"1": {probe: "1"}')},
        {"inrush": "INCONCLUSIVE"},
        "look at its factor",
    ),
    "factor of the clamp": Fault(
        {SCOPE: SCOPE.replace('"2": {probe: "10"}', '"2": {probe: "20"}')},
        {"inrush": "INCONCLUSIVE"},
        "charge is INCONCLUSIVE",
    ),
    "load without numbers": Fault(
        {"load1: {connects": "load1: {faults: [{kind: not-a-number, from: 5 s, until: 9 s}], connects"},
        {"rail_under_load": "ERROR", **dict.fromkeys(CASES[1:], "NOT_RUN")},
        "voltage is not a number; the bench was made safe",
    ),
    "meter falls silent": Fault(
        {"dmm1: {connects": "dmm1: {faults: [{kind: dead, from: 22 s}], connects"},
        {"quiescent_current": "ERROR", "efficiency": "NOT_RUN"},
        "dmm1",
    ),
}
TOGETHER = (
    ("high output resistance", "slow start", "large inrush", "leakage", "losses"),
    ("no start", "meter beyond its range", "no trigger"),
    ("foldback in overload", "factor of the clamp", "meter falls silent"),
)
"""Faults that can be tried in one run: they are to be seen in different cases."""

ALONE = tuple((name,) for name in FAULTS)


def workspace(root):
    """Return a copy of the plan with its bench."""
    shutil.copytree(ROOT / "fixtures", root / "fixtures", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(ROOT / "testplans/eps", root / "testplans/eps", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "testplans/requirements.yaml", root / "testplans")
    (root / "hil.toml").touch()
    return Workspace(root, root / "testplans/eps")


@pytest.mark.parametrize("names", [*TOGETHER, *sweeps.chosen((("no limiter",),), ALONE)], ids="+".join)
def test_each_fault_shows(tmp_path, names):
    """In the case that looks for it, with the verdict that it deserves, and the others pass."""
    made = workspace(tmp_path / "workspace")
    expected = {f"test_{case}": "PASS" for case in CASES}
    for name in names:
        made.change(BENCH, FAULTS[name].changes)
        expected |= {f"test_{case}": verdict for case, verdict in FAULTS[name].verdicts.items()}
    ran = made.run(bench="eps", dut="SIM-EPS-1")
    assert ran.verdicts() == expected, ran.out
    for name in names:
        reasons = [ran.reasons(f"test_{case}") for case in FAULTS[name].verdicts]
        assert any(FAULTS[name].said in reason for reason in reasons), (name, reasons)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('relay1: {connects: {"1": board.contact}}', "relay1: {}"),
        ("relay1: {connects", "relay1: {faults: [{kind: welded, contact: '1'}], connects"),
    ],
    ids=["always closed", "welded"],
)
def test_a_contact_that_does_not_separate_is_found_before_anything_is_tested(tmp_path, old, new):
    """At a reduced level a current flows where none may."""
    made = workspace(tmp_path / "workspace")
    made.change(BENCH, {old: new})
    ran = made.run(bench="eps", dut="SIM-EPS-1")
    assert ran.code != 0
    assert set(ran.verdicts().values()) == {"NOT_RUN"}, ran.out
