"""What can be wrong with a solar panel, its lamp, its reference cell and its load: none of it ends in PASS."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
import sweeps
from solar_plans import ON_BENCH, solar_workspace

pytestmark = [pytest.mark.system, pytest.mark.timeout(120)]

BENCH = "fixtures/benches/solar/bench.yaml"
TRUTH = 'irradiance: "1290"}'


@dataclass(frozen=True)
class Fault:
    """What changes in the bench file, the verdict of the case, and a word of its reason."""

    changes: dict[str, str]
    verdict: str
    said: str


def truth(text):
    """Return the change that adds to the truth of the panel or its lamp."""
    return {TRUTH: f"{TRUTH[:-1]}, {text}}}"}


FAULTS = {
    "broken string": Fault(truth('broken: "1"'), "FAIL", "short_circuit_current of forward is FAIL"),
    "shaded reference cell": Fault(truth('shade: "0.12"'), "INCONCLUSIVE", "W/m^2 of the survey"),
    "load stops before short circuit": Fault(truth('least: "3"'), "INCONCLUSIVE", "short circuit of voltage"),
    "reversed leads": Fault(truth("reversed: true"), "FAIL", "EPS-SOL-011 voltage is FAIL"),
    "lamp does not light": Fault({TRUTH: 'irradiance: "1"}'}, "FAIL", "EPS-SOL-011 voltage is FAIL"),
    "drooping lamp": Fault(truth('droop: "2"'), "INCONCLUSIVE", "W/m^2 of the survey"),
    "lamp that falls within a sweep": Fault(truth('droop: "8.4"'), "INCONCLUSIVE", "along the sweep"),
    "shunted cell": Fault({'shunt: "900"': 'shunt: "25"'}, "FAIL", "shunt_conductance of forward is FAIL"),
    "high series resistance": Fault({'series: "0.12"': 'series: "0.6"'}, "FAIL", "series_resistance of forward"),
    "low voltage": Fault({'open_voltage: "2.7"': 'open_voltage: "2.5"'}, "FAIL", "open_circuit_voltage of forward"),
    "light from elsewhere": Fault(truth('stray: "20"'), "FAIL", "EPS-SOL-010 irradiance is FAIL"),
    "thermometer off the panel": Fault(
        {"temperature: panel.temperature": "temperature: panel.ambient"},
        "INCONCLUSIVE",
        "look whether it sits on the panel",
    ),
    "load without numbers": Fault(
        {"load1: {connects": "load1: {faults: [{kind: not-a-number, from: 420 s, until: 425 s}], connects"},
        "INCONCLUSIVE",
        "finite of voltage",
    ),
    "panel too hot": Fault(truth('rise: "70"'), "ERROR", "is above 65 degC"),
}


@pytest.mark.parametrize("name", sweeps.sample(FAULTS, 3))
def test_each_fault_shows(tmp_path, name):
    """With the verdict that it deserves, and a reason that leads to it; the bench is left safe."""
    made, fault = solar_workspace(tmp_path / "workspace"), FAULTS[name]
    made.change(BENCH, fault.changes)
    ran = made.run(**ON_BENCH)
    assert ran.verdicts() == {"test_curve": fault.verdict}, ran.out
    assert fault.said in ran.reasons("test_curve"), ran.reasons("test_curve")
    assert "bench safe" in ran.out
