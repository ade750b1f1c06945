"""What goes wrong with a sensor of the bench `imu` ends its case: no fault passes, and the reason names the cause."""

from __future__ import annotations

import re
import shutil

import pytest
import sweeps
from workspaces import ROOT, make

pytestmark = pytest.mark.system

CASE = """
    @pytest.mark.requirement("T-010", "T-020", "T-030")
    @pytest.mark.max_duration(60)
    def test_at_rest({role}, record, check):
        {role}.{instance}.start()
        rest = record("rest", {role}.{instance}, duration=8, rate={rate})
        for axis in "xyz":
            check("T-010", "mean", Figure(value=rest[axis].mean(), unit="{unit}"), of=axis)
        check("T-030", "temperature", Figure(value=rest["temperature"].mean(), unit="degC"))
"""
REQUIREMENTS = """
- {{id: T-010, rev: 1, text: Each axis shall be small., kind: limit, method: test,
   limits: [{{parameter: mean, of: [x, y, z], unit: {unit}, min: "-100", max: "100", decision: simple}}]}}
- {{id: T-020, rev: 1, text: Rest shall be recorded., kind: record, method: test,
   records: {{recording: rest, channels: [x, y, z, temperature], rate: {rate} Hz, duration: 7 s, max_gap: 0.3 s}}}}
- {{id: T-030, rev: 1, text: The temperature shall be known., kind: limit, method: test,
   limits: [{{parameter: temperature, unit: degC, min: "-40", max: "85", decision: simple}}]}}
"""
SENSORS = {
    "gyroscope.icm": ("icm1", "112.5", "deg/s"),
    "magnetometer.icm": ("icm1", "10", "uT"),
    "gyroscope.bno": ("bno1", "20", "deg/s"),
    "magnetometer.bno": ("bno1", "6", "uT"),
    "gyroscope.bmi": ("bmi1", "100", "deg/s"),
    "gyroscope.lsm": ("lsm1", "14.9", "deg/s"),
    "magnetometer.lsm": ("lsm1", "5", "uT"),
    "magnetometer.lis": ("lis1", "5", "uT"),
}
FAULTS = [
    ("kind: asleep, from: 5 s", "started again|its settings|start it again"),
    ("kind: stuck, from: 4 s", "consecutive samples are equal"),
    ("kind: dead, from: 5 s", "no acknowledge|its settings"),
    ("kind: saturated, from: 4 s", "not finite|not a number|is nan|are missing|has no value"),
    ("kind: temperature-raw", "no valid data|not finite|not a number|is nan|marked invalid|has no value"),
    ('kind: identity, value: "0x47"', "expected model"),
]
OWN = [
    ("magnetometer.icm", "kind: bypass-off", "BYPASS_EN is not set"),
    ("magnetometer.icm", "kind: bypass-off, from: 5 s", "BYPASS_EN is not set"),
    ("gyroscope.bno", "kind: clock-stretch, from: 5 s", "waits while the sensor holds the clock"),
]
NOT_OF_LIS = ("kind: asleep, from: 5 s", "kind: temperature-raw")
ALL = [
    *((name, *fault) for name in SENSORS for fault in FAULTS if not (name.endswith("lis") and fault[0] in NOT_OF_LIS)),
    *OWN,
]


def ran(tmp_path, name, fault=""):
    """Run the case of one sensor on the bench with a fault."""
    device, rate, unit = SENSORS[name]
    role, instance = name.split(".")
    workspace = make(
        tmp_path / "workspace",
        CASE.format(role=role, instance=instance, rate=rate, unit=unit),
        requirements=REQUIREMENTS.format(rate=rate, unit=unit),
    )
    shutil.copytree(ROOT / "fixtures/benches/imu", workspace.root / "fixtures/benches/imu")
    place = f"    {device}:\n      truth:"
    if fault:
        wrong = f"    {device}:\n      faults: [{{{fault}}}]\n      truth:"
        workspace.change("fixtures/benches/imu/bench.yaml", {place: wrong})
    return workspace.run(bench="imu")


@pytest.mark.parametrize("name", sweeps.sample(SENSORS, 2))
def test_without_a_fault_a_sensor_passes(tmp_path, name):
    """What the other tests show comes from their faults."""
    ended = ran(tmp_path, name)
    assert (ended.verdicts(), ended.code) == ({"test_at_rest": "PASS"}, 0), ended.reasons("test_at_rest")


@pytest.mark.parametrize(("name", "fault", "said"), sweeps.sample(ALL, 9))
def test_no_fault_passes(tmp_path, name, fault, said):
    """It is the fault of the device under test, or of the bench; nothing that was measured with it counts."""
    ended = ran(tmp_path, name, fault)
    reasons = ended.reasons("test_at_rest")
    assert ended.verdicts()["test_at_rest"] in {"FAIL", "INCONCLUSIVE", "NOT_RUN", "ERROR"}
    assert ended.code != 0
    assert re.search(said, reasons), reasons
