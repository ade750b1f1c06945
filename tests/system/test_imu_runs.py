"""A run with every sensor of the bench `imu`, one case after the other, and its replay from the bytes."""

from __future__ import annotations

import shutil

import pytest
from workspaces import ROOT, make

pytestmark = pytest.mark.system

SENSORS = {
    "gyroscope": ("deg/s", {"bno": 10.0, "lsm": 14.9, "icm": 112.5, "bmi": 100.0}),
    "accelerometer": ("m/s2", {"lsm": 10.0, "icm": 10.0, "bmi": 10.0}),
    "magnetometer": ("uT", {"bno": 5.0, "lsm": 5.0, "icm": 10.0, "lis": 5.0}),
}
"""Unit of the axes, and a rate at which each can be recorded; the gyroscopes of `icm` and `bmi` stream."""

REQUIREMENT = """\
- {{id: T-{number}, rev: 1, text: The sensor shall be within its range., kind: limit, method: test,
   limits: [{{parameter: level, of: [x, y, z], unit: {unit}, min: "-200", max: "200", decision: simple}}]}}
"""
CASE = """
    @pytest.mark.requirement("T-{number}")
    def test_{role}_{instance}({role}, thermometer, record, check):
        {role}.{instance}.start()
        thermometer.reference.start()
        rest = record("rest", {role}.{instance}, duration=5.0, rate={rate})
        assert abs(rest["temperature"].mean() - thermometer.reference.temperature().value) < 1.5
        for axis in "xyz":
            check("T-{number}", "level", Figure(value=float(rest[axis].mean()), unit=rest.unit(axis)), of=axis)
"""


def test_every_sensor_is_recorded_and_replayed(tmp_path):
    """Each case finds its sensors asleep, and leaves them so; the bytes give the same numbers and verdicts."""
    requirements, cases = "", []
    for role, (unit, rates) in SENSORS.items():
        for instance, rate in rates.items():
            number = 100 + len(cases)
            requirements += REQUIREMENT.format(number=number, unit=unit)
            cases.append(CASE.format(number=number, role=role, instance=instance, rate=rate))
    workspace = make(tmp_path / "workspace", *cases, requirements=requirements)
    shutil.copytree(ROOT / "fixtures/benches/imu", workspace.root / "fixtures/benches/imu")
    ran = workspace.run(bench="imu")
    assert set(ran.verdicts().values()) == {"PASS"}, ran.out
    replayed = workspace.hil("replay", str(ran.package.folder))
    assert replayed.code == 0
    assert "11 cases with 33 checks replayed from their bytes: no difference" in replayed.out
