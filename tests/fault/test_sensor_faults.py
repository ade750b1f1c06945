"""What goes wrong with a sensor ends a case that records it as it should: one table of chips, faults and paths.

Nothing passes that a fault touches, whether the host's own bus or that of an OBC leads to the chip, and the reason
names the cause. What drivers do about a FIFO that overflows is in the contract tests of each chip that has one.
"""

from __future__ import annotations

import re
import shutil

import pytest
import sweeps
from told_as_json import results_as_json
from workspaces import ROOT, make

pytestmark = pytest.mark.system

REQUIREMENTS = """\
- {{id: T-100, rev: 1, text: Each axis shall be within its range., kind: limit, method: test,
   limits: [{{parameter: level, of: [x, y, z], unit: {unit}, min: "-9999", max: "9999", decision: simple}}]}}
- {{id: T-110, rev: 1, text: The chip shall be at room temperature., kind: limit, method: test,
   limits: [{{parameter: temperature, unit: degC, min: "15", max: "30", decision: simple}}]}}
- {{id: T-120, rev: 1, text: Rest shall be recorded., kind: record, method: test,
   records: {{recording: rest, channels: [{channels}], rate: {rate} Hz, duration: 18 s, max_gap: 0.5 s}}}}
"""
CASE = """
    @pytest.mark.requirement({asked}"T-110", "T-120")
    def test_rest({role}, record, check):
        {role}.{instance}.start()
        rest = record("rest", {role}.{instance}, duration=20.0, rate={rate})
        {axes}
        check("T-110", "temperature", Figure(value=float(rest["temperature"].mean()), unit="degC"))
"""
EACH_AXIS = """for axis in "xyz":
            check("T-100", "level", Figure(value=float(rest[axis].mean()), unit="{unit}"), of=axis)"""
SENSORS = {
    "gyroscope.bno": ("bno1", "deg/s", 10.0),
    "accelerometer.bno": ("bno1", "m/s2", 10.0),
    "magnetometer.bno": ("bno1", "uT", 6.0),
    "gyroscope.lsm": ("lsm1", "deg/s", 14.9),
    "accelerometer.lsm": ("lsm1", "m/s2", 10.0),
    "magnetometer.lsm": ("lsm1", "uT", 5.0),
    "gyroscope.icm": ("icm1", "deg/s", 112.5),
    "accelerometer.icm": ("icm1", "m/s2", 10.0),
    "magnetometer.icm": ("icm1", "uT", 10.0),
    "magnetometer.lis": ("lis1", "uT", 5.0),
    "gyroscope.bmi": ("bmi1", "deg/s", 100.0),
    "accelerometer.bmi": ("bmi1", "m/s2", 10.0),
    "gyroscope.iim": ("iim1", "deg/s", 100.0),
    "thermometer.reference": ("ref1", "degC", 5.0),
}
"""Every sensor of all seven chips: its device, the unit of its axes, and a rate at which it can be recorded [Hz]."""

PATHS = ("host", "obc")

AXES, TEMPERATURE, RECORD = "T-100", "T-110", "T-120"
NOTHING = dict.fromkeys((AXES, TEMPERATURE, RECORD), "INCONCLUSIVE")
FAULTS = {
    "asleep": (
        "kind: asleep, from: 10 s",
        NOTHING,
        "lost its settings|no new sample|samples are equal|cannot be reached: PWR_MGMT_1|start it again",
    ),
    "stuck": ("kind: stuck, from: 10 s", NOTHING, "consecutive samples are equal, the sensor is stuck"),
    "no acknowledge": ("kind: dead, from: 10 s", NOTHING, "no acknowledge at address"),
    "garbled": ("kind: garbled, from: 10 s", NOTHING, ""),
    "saturated": (
        "kind: saturated, from: 10 s",
        {**NOTHING, TEMPERATURE: "PASS"},
        "T-100 level of z is INCONCLUSIVE: the value is nan",
    ),
    "temperature in raw counts": (
        "kind: temperature-raw, from: 10 s",
        {**NOTHING, AXES: "PASS"},
        "T-110 temperature is INCONCLUSIVE: the value is nan|samples are equal",
    ),
    "wrong identity": (
        'kind: identity, value: "0x3C"',
        dict.fromkeys(NOTHING, "NOT_RUN"),
        "the bench was not armed: identity of ",
    ),
    "bypass not set": ("kind: bypass-off, from: 10 s", NOTHING, "BYPASS_EN is not set"),
    "bypass never set": ("kind: bypass-off", NOTHING, "BYPASS_EN is not set"),
    "clock stretched": ("kind: clock-stretch, from: 10 s", NOTHING, "waits while the sensor holds the clock"),
}
"""Of each fault: its line in a bench file, how the requirements end on axes, temperature and record, and the reason."""

ONLY = {
    "bypass not set": {"magnetometer.icm"},
    "bypass never set": {"magnetometer.icm"},
    "clock stretched": {name for name in SENSORS if name.endswith("bno")},
    "saturated": SENSORS.keys() - {"thermometer.reference"},
}
"""Sensors that can have a fault, where these are not all."""

WORST = ("NOT_RUN", "ERROR", "FAIL", "INCONCLUSIVE")

OTHERWISE = {
    ("gyroscope.icm", "temperature in raw counts"): {AXES: "PASS", TEMPERATURE: "INCONCLUSIVE", RECORD: "FAIL"},
}
"""How it ends where a chip is special: packets of an ICM-20948 are told by their temperature, and these are missing."""

CELLS = [
    (name, fault, path) for fault in FAULTS for name in SENSORS for path in PATHS if name in ONLY.get(fault, SENSORS)
]

IIM = {
    "  ref1:\n    driver: bme680\n": "  iim1:\n    {driver: iim42652, bus: i2c4, address: '0x68',"
    " identity: {model: IIM-42652}, dut: true}\n  ref1:\n    driver: bme680\n",
    "  adcs: {instrument": "  i2c4: {port: /dev/i2c-4, frequency: 400 kHz}\n  adcs: {instrument",
    "- {role: thermometer, instance: reference": "- {role: gyroscope, instance: iim, instrument: iim1}\n"
    "- {role: accelerometer, instance: bno, instrument: bno1, settings: {range: 4 g}}\n"
    "- {role: thermometer, instance: reference",
    "- {output: thermometer.reference": "- {output: gyroscope.iim, state: asleep, within: 2 s}\n"
    "- {output: accelerometer.bno, state: asleep, within: 2 s}\n- {output: thermometer.reference",
    "    ref1: {truth": "    iim1:\n      truth: {temperature: '22'}\n    ref1: {truth",
}
"""What the bench does not have, and the table does."""


def ended(tmp_path, name, path, fault=""):
    """Record a sensor with a fault; return exit code, verdict of the case, those of its requirements, and reasons."""
    (role, instance), (device, unit, rate) = name.split("."), SENSORS[name]
    axes = () if role == "thermometer" else tuple("xyz")
    case = CASE.format(
        role=role,
        instance=instance,
        rate=rate,
        axes=EACH_AXIS.format(unit=unit) if axes else "",
        asked='"T-100", ' if axes else "",
    )
    channels = ", ".join((*axes, "temperature"))
    requirements = REQUIREMENTS.format(unit=unit, channels=channels, rate=rate)
    workspace = make(tmp_path / "workspace", case, requirements=requirements)
    shutil.copytree(ROOT / "fixtures/benches/imu", workspace.root / "fixtures/benches/imu")
    bench = workspace.root / "fixtures/benches/imu/bench.yaml"
    workspace.change("fixtures/benches/imu/bench.yaml", IIM)
    text = bench.read_text(encoding="utf-8")
    bus = {"host": "i2c4" if instance in {"bno", "iim"} else "i2c1", "obc": "adcs"}[path]
    text = re.sub(rf"(?m)^(  {device}:(?:\s+\{{driver: \w+,|\n    driver: \w+\n   ) bus: )\w+", rf"\g<1>{bus}", text)
    if fault:
        text = re.sub(rf"(?m)^    {device}:\n", rf"\g<0>      faults: [{{{fault}}}]\n", text)
        text = re.sub(rf"(?m)^    {device}: \{{", rf"\g<0>faults: [{{{fault}}}], ", text)
        assert fault in text
    bench.write_text(text, encoding="utf-8")
    ran = workspace.run(bench="imu")
    (found,) = results_as_json(ran.package)["cases"]
    return ran.code, found["verdict"], found["requirements"], "\n".join(found["reasons"])


def of(name, requirements):
    """Return how requirements end of a sensor: the thermometer has no axes, and is the bench's, not the article's."""
    if name != "thermometer.reference":
        return requirements
    return {id_: each.replace("INCONCLUSIVE", "ERROR") for id_, each in requirements.items() if id_ != AXES}


@pytest.mark.parametrize(("name", "path"), sweeps.sample([(name, path) for name in SENSORS for path in PATHS], 3))
def test_without_a_fault_it_passes(tmp_path, name, path):
    """What the other tests show comes from their faults."""
    code, verdict, requirements, reasons = ended(tmp_path, name, path)
    assert (code, verdict, reasons) == (0, "PASS", "")
    assert requirements == of(name, {AXES: "PASS", TEMPERATURE: "PASS", RECORD: "RECORDED"})


@pytest.mark.parametrize(("name", "fault", "path"), sweeps.sample(CELLS, 9))
def test_a_fault_ends_as_the_table_says(tmp_path, name, fault, path):
    """The sensor is the article, and no requirement speaks of its silence: nothing passes that the fault touches."""
    line, ends, said = FAULTS[fault]
    ends = of(name, OTHERWISE.get((name, fault), ends))
    code, verdict, requirements, reasons = ended(tmp_path, name, path, line)
    assert (requirements, code) == (ends, 1), reasons
    assert verdict == next(each for each in WORST if each in ends.values())
    assert re.search(said, reasons), reasons
