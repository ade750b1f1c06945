"""A run that is killed in the middle of a capture: resumed, it is whole, replays, and its scan is recorded after it."""

from __future__ import annotations

import subprocess
import time

import numpy as np
import pytest
from resumed_runs import without_git
from told_as_json import bodies
from workspaces import STARTED, Ran, finish, kill, make

from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify
from hil.plugin.rehearsing import replay

pytestmark = pytest.mark.system

REQUIREMENTS = """\
- {id: T-120, rev: 1, text: The coil's current shall be recorded., kind: record, method: test,
   records: {recording: switch_on, channels: [current]}}
- {id: T-130, rev: 1, text: The coil's temperature shall be recorded., kind: record, method: test,
   records: {recording: temps, channels: [coil, volts], rate: 4 Hz, duration: 5 s, max_gap: 0.3 s}}
- {id: T-140, rev: 1, text: The jig's temperature shall be recorded., kind: record, method: test,
   records: {recording: temps, channels: [jig]}}
- {id: T-150, rev: 1, text: The jig shall be cool., kind: limit, method: test,
   limits: [{parameter: temperature, unit: degC, max: "40"}]}
"""
CASES = """
@pytest.mark.requirement("T-120")
def test_switch_on(oscilloscope, supply, record, step):
    oscilloscope.vertical("current", scale=2e-3, offset=4e-3)
    oscilloscope.window(before=20e-6, after=50.5e-3, points=400_000)
    oscilloscope.trigger("current", level=5e-3)
    supply.coil.configure(1.0, 0.02)
    oscilloscope.arm()
    with step("Switch the coil on"):
        supply.coil.enable()
        record.capture("switch_on", oscilloscope, within=3.0)

@pytest.mark.requirement("T-130")
def test_temperature(data_acquisition, record, check):
    assert data_acquisition.read("volts").value == pytest.approx(0.0, abs=1e-3)
    record("temps", data_acquisition, duration=5.0, rate=4.0)

@pytest.mark.requirement("T-140", "T-150")
def test_open_thermocouple(data_acquisition, record, check):
    record("temps", data_acquisition, duration=1.0, rate=4.0)
    check("T-150", "temperature", data_acquisition.read("jig"))
"""
TRIPS = """
@pytest.mark.requirement("T-130", "T-140")
def test_hot(data_acquisition, supply, record, clock):
    clock.sleep(4.0)
    with record.during("temps", data_acquisition, rate=4.0) as temps:
        clock.sleep(6.0)
    supply.coil.configure(1.0, 0.02)
    supply.coil.enable()
    with record.during("temps", data_acquisition, rate=4.0) as temps:
        clock.sleep(600.0)
"""
LIMITS = {
    "read": 'quantity: volts, unit: V, max: "0.5"',
    "derived": 'quantity: slope, of: volts, over: 2 s, unit: V/s, max: "0.1"',
}
LIMIT = """envelope:
- {{id: coil-volts, output: data_acquisition, {}, period: 1 s, max_age: 6 s}}
"""
BENCH = {
    "instruments:\n  psu1:": """instruments:
  scope1: {driver: rigol-ds1000z, port: TCPIP::192.168.10.40::5555::SOCKET, identity: {model: DS1054Z}}
  daq1: {driver: keysight-34970a, port: TCPIP::192.168.10.41::5025::SOCKET, identity: {model: 34970A}}
  psu1:""",
    "wiring:\n": """wiring:
- {role: oscilloscope, instrument: scope1, settings: {ch1: current, unit1: A}}
- {role: data_acquisition, instrument: daq1, settings: {"101": coil degC K, "102": volts V 10, "103": jig degC T}}
""",
    "  peers:\n": """  peers:
    scope1: {connects: {"1": coil.winding_current}}
    daq1: {connects: {"101": coil.temperature, "102": coil.voltage}}
""",
}


@pytest.mark.timeout(300)
def test_a_run_that_is_killed_within_a_capture_is_whole_once_resumed(tmp_path):
    """Every row is there, once; the open thermocouple decides nothing; the recorded bytes give the same again."""
    workspace = without_git(make(tmp_path / "workspace", CASES, requirements=REQUIREMENTS))
    workspace.change_bench(BENCH)
    STARTED.append(process := workspace.start(*workspace.run_arguments, stdout=subprocess.DEVNULL))
    while not any(path.stat().st_size for path in workspace.reports.glob("[!.]*/data/recordings/*")):
        assert process.poll() is None, finish(process).err
        time.sleep(0.002)
    kill(process)
    process.communicate()
    (folder,) = workspace.folders()
    assert not list(bodies(Package(folder), "recording-end"))
    resumed = workspace.hil("resume", folder.name)
    ran = Ran(resumed.code, resumed.out, Package(folder))
    assert ran.verdicts() == {
        "test_switch_on": "RECORDED", "test_temperature": "RECORDED", "test_open_thermocouple": "INCONCLUSIVE",
    }, resumed.out + resumed.err  # fmt: skip
    assert "samples are not finite: jig" in ran.reasons("test_open_thermocouple")
    assert verify(folder).findings == ()
    first, second, _ = [event["recording"] for event in bodies(ran.package, "recording")][-3:]
    capture, temps = ran.package.recording(first), ran.package.recording(second)
    assert len(capture) >= 400_000
    assert np.diff(capture.time) == pytest.approx((capture.time[-1] - capture.time[0]) / (len(capture) - 1), rel=1e-3)
    assert np.diff(temps.time) == pytest.approx(0.25, abs=2e-3)
    assert (temps["volts_after"] > 0.05).all()
    assert replay(ran.package).differences == ()


@pytest.mark.parametrize("limit", LIMITS)
def test_a_channel_is_a_limit_of_the_envelope(tmp_path, limit):
    """It is read by itself before, its rows are judged while it is recorded, and the row beyond the limit trips."""
    workspace = without_git(make(tmp_path / "workspace", TRIPS, requirements=REQUIREMENTS))
    workspace.change_bench({**BENCH, "envelope:\n": LIMIT.format(LIMITS[limit])})
    ran = workspace.run()
    assert ran.code == 6, ran.out
    (trip,) = bodies(ran.package, "trip")
    assert (trip["limit"], trip["unit"]) == ("coil-volts", {"read": "V", "derived": "V/s"}[limit])
    assert " s of recording " in trip["text"]
    assert len(ran.package.recording("envelope-coil-volts")) > 1
    assert replay(ran.package).differences == ()
