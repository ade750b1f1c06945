"""What goes wrong with a sensor ends a case that records it as it should: none passes, and the reasons name it."""

from __future__ import annotations

import shutil

import pytest
import sweeps
from told_as_json import results_as_json
from workspaces import ROOT, make

from hil.evidence.package.contents import Package
from hil.executive.setup.configuration import configure
from hil.plugin.launch import launch
from hil.plugin.opening import open_new

pytestmark = pytest.mark.system

REQUIREMENTS = """\
- {{id: T-100, rev: 1, text: Each axis shall be within its range., kind: limit, method: test,
   limits: [{{parameter: level, of: [x, y, z], unit: {unit}, min: "-9999", max: "9999", decision: simple}}]}}
- {{id: T-110, rev: 1, text: The chip shall be at room temperature., kind: limit, method: test,
   limits: [{{parameter: temperature, unit: degC, min: "15", max: "30", decision: simple}}]}}
"""
CASE = """
    @pytest.mark.requirement("T-100", "T-110")
    def test_rest({role}, record, check):
        {role}.{instance}.start()
        rest = record("rest", {role}.{instance}, duration=20.0, rate={rate})
        for axis in "xyz":
            check("T-100", "level", Figure(value=float(rest[axis].mean()), unit="{unit}"), of=axis)
        check("T-110", "temperature", Figure(value=float(rest["temperature"].mean()), unit="degC"))
"""
SENSORS = [
    ("gyroscope", "bno", "deg/s", 10.0),
    ("magnetometer", "bno", "uT", 10.0),
    ("gyroscope", "lsm", "deg/s", 10.0),
    ("accelerometer", "lsm", "m/s2", 10.0),
    ("magnetometer", "lsm", "uT", 10.0),
    ("gyroscope", "icm", "deg/s", 112.5),
    ("accelerometer", "icm", "m/s2", 10.0),
    ("magnetometer", "icm", "uT", 10.0),
    ("magnetometer", "lis", "uT", 10.0),
    ("gyroscope", "bmi", "deg/s", 100.0),
    ("accelerometer", "bmi", "m/s2", 10.0),
]
"""Every sensor of the bench but the reference thermometer, and a rate at which it can be recorded."""

FAULTS = {
    "asleep": ("lost its settings", "no new sample", "consecutive samples are equal", "cannot be reached: PWR_MGMT_1"),
    "stuck": ("consecutive samples are equal, the sensor is stuck",),
    "dead": ("no acknowledge at address",),
    "saturated": ("T-100 level of z is INCONCLUSIVE: the value is nan",),
    "temperature-raw": ("T-110 temperature is INCONCLUSIVE: the value is nan", "its temperature"),
    "garbled": ("",),
}
"""Kinds of faults, and what the reasons say, one of these."""

UNTOUCHED = {"saturated": {"T-110": "PASS"}, "temperature-raw": {"T-100": "PASS"}}
"""Requirements that do not speak of what is wrong."""


def ended(tmp_path, sensor, fault=""):
    """Record a sensor with a fault; return exit code, verdict of the case, those of its requirements, and reasons."""
    role, instance, unit, rate = sensor
    case = CASE.format(role=role, instance=instance, unit=unit, rate=rate)
    workspace = make(tmp_path / "workspace", case, requirements=REQUIREMENTS.format(unit=unit))
    shutil.copytree(ROOT / "fixtures/benches/imu", workspace.root / "fixtures/benches/imu")
    if fault:
        device = f"    {instance}1:\n"
        workspace.change("fixtures/benches/imu/bench.yaml", {device: f"{device}      faults: [{fault}]\n"})
    launched = launch(configure(workspace.request(bench="imu")), open_new)
    assert launched.session is not None
    code = launched.session.exit_code(launched.code)
    launched.session.abandon()
    (found,) = results_as_json(Package(launched.session.folder))["cases"]
    return code, found["verdict"], found["requirements"], "\n".join(found["reasons"])


@pytest.mark.parametrize("sensor", sweeps.sample(SENSORS, 2), ids=lambda sensor: ".".join(sensor[:2]))
def test_without_a_fault_it_passes(tmp_path, sensor):
    """What the other tests show comes from their faults."""
    assert ended(tmp_path, sensor) == (0, "PASS", {"T-100": "PASS", "T-110": "PASS"}, "")


@pytest.mark.parametrize(
    ("sensor", "kind"),
    sweeps.sample([(sensor, kind) for kind in FAULTS for sensor in SENSORS], 4),
    ids=lambda value: value if isinstance(value, str) else ".".join(value[:2]),
)
def test_a_fault_within_a_recording_is_inconclusive(tmp_path, sensor, kind):
    """The sensor is the article, and no requirement speaks of its silence: nothing passes that it touches."""
    code, verdict, requirements, reasons = ended(tmp_path, sensor, f"{{kind: {kind}, from: 10 s}}")
    assert (code, verdict) == (1, "INCONCLUSIVE")
    assert any(said in reasons for said in FAULTS[kind])
    if kind != "garbled":  # a bus has no check sum: a number with a wrong bit may be one within the limits
        assert requirements == {"T-100": "INCONCLUSIVE", "T-110": "INCONCLUSIVE"} | UNTOUCHED.get(kind, {})


@pytest.mark.parametrize("sensor", sweeps.sample(SENSORS, 1), ids=lambda sensor: ".".join(sensor[:2]))
def test_another_chip_is_not_recorded(tmp_path, sensor):
    """Arm compares it before anything is driven."""
    code, verdict, requirements, reasons = ended(tmp_path, sensor, '{kind: identity, value: "0x3C"}')
    assert (code, verdict, requirements) == (1, "NOT_RUN", {"T-100": "NOT_RUN", "T-110": "NOT_RUN"})
    assert "the bench was not armed: identity of " in reasons


def test_a_bypass_that_stays_shut(tmp_path):
    """The magnetometer of the ICM-20948 is then not there, and the reason says why."""
    _, verdict, _, reasons = ended(tmp_path, ("magnetometer", "icm", "uT", 10.0), "{kind: bypass-off}")
    assert verdict == "INCONCLUSIVE"
    assert "icm1: its magnetometer cannot be reached" in reasons or "BYPASS" in reasons
