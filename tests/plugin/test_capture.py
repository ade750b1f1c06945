"""A run with an oscilloscope: captured, reported, exported, replayed; clipped, and without a trigger."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from told_as_json import bodies
from workspaces import make

from hil.evidence.package.verification import verify
from hil.plugin.rehearsing import replay
from hil.report.export.csv_table import TableFormat
from hil.report.export.package import ExportRequest, export_package

pytestmark = pytest.mark.system  # each test is a whole run

REQUIREMENTS = """\
- {id: T-110, rev: 1, text: The coil's current shall rise within its time., kind: limit, method: test,
   limits: [{parameter: rise_time, unit: us, min: "20", max: "40", decision: guarded}]}
- {id: T-120, rev: 1, text: The coil's current shall be recorded., kind: record, method: test,
   records: {recording: switch_on, channels: [current], rate: 10 MHz, duration: 110 us}}
"""

CASES = """
from hil.analysis import rise_time

def capture(oscilloscope, supply, record, scale, level):
    oscilloscope.vertical("current", scale=scale, offset=2 * scale)
    oscilloscope.window(before=20e-6, after=100e-6)
    oscilloscope.trigger("current", level=level)
    supply.coil.configure(1.0, 0.02)
    oscilloscope.arm()
    supply.coil.enable()
    return record.capture("switch_on", oscilloscope, within=1.0)

def judged(check, taken):
    found = rise_time(taken.time, taken["current"], resolution=taken.resolution("current"))
    check("T-110", "rise_time", found)

@pytest.mark.requirement("T-110", "T-120")
def test_switch_on(oscilloscope, supply, record, check, step):
    with step("Switch the coil on"):
        taken = capture(oscilloscope, supply, record, 2e-3, 5e-3)
    judged(check, taken)

@pytest.mark.requirement("T-110", "T-120")
def test_clipped(oscilloscope, supply, record, check):
    judged(check, capture(oscilloscope, supply, record, 1e-3, 2e-3))

@pytest.mark.requirement("T-110")
def test_no_trigger(oscilloscope, supply, record, check):
    judged(check, capture(oscilloscope, supply, record, 10e-3, 50e-3))
"""


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """One run of three cases, on the magnetorquer's bench with an oscilloscope at the coil."""
    workspace = make(tmp_path_factory.mktemp("captured") / "workspace", CASES, requirements=REQUIREMENTS)
    workspace.change_bench(
        {
            "instruments:\n  psu1:": """instruments:
  scope1:
    driver: rigol-ds1000z
    port: TCPIP::192.168.10.40::5555::SOCKET
    identity: {model: DS1054Z}
    calibration:
      certificate: certificates/psu1.txt
      due: "2027-09-30"
      ranges:
      - {quantity: current, unit: A, from: "-1", to: "1", absolute: "0.0005", relative: "0.03"}
  psu1:""",
            "wiring:\n": """wiring:
- {role: oscilloscope, instrument: scope1, settings: {ch1: current, unit1: A}}
""",
            "  peers:\n": """  peers:
    scope1: {connects: {"1": coil.winding_current}, truth: {channels: {"1": {noise: "0.04"}}}}
""",
        }
    )
    return workspace.run()


def test_verdicts(ran):
    """What was seen is judged, what was clipped is not, and without a trigger nothing is decided."""
    assert ran.verdicts() == {
        "test_switch_on": "PASS",
        "test_clipped": "INCONCLUSIVE",
        "test_no_trigger": "INCONCLUSIVE",
    }
    (good,) = [check for check in bodies(ran.package, "check") if check["verdict"] == "PASS"]
    ohms = 98.4 * (1 + 0.00393 * 2.5)
    assert good["unit"] == "us"
    assert good["value"] == pytest.approx(1200 / ohms * np.log(9), abs=3 * good["uncertainty"])
    assert good["instruments"] == ["scope1"]
    assert "current of scope1 is clipped" in ran.reasons("test_clipped")
    assert "clipped" in {check["parameter"] for check in bodies(ran.package, "check")}
    assert "oscilloscope was not triggered within 1 s" in ran.reasons("test_no_trigger")


def test_the_package_says_what_was_captured(ran):
    """The HDF5 file has its own time axis, and everything that samples need to be read."""
    assert verify(ran.package.folder).findings == ()
    first = next(iter(event for event in bodies(ran.package, "recording") if event["name"] == "switch_on"))
    with h5py.File(ran.package.folder / f"data/recordings/{first['recording']}.h5") as file:
        facts, time, current = file.attrs, file["time"], file["channels/current"]
        assert (facts["trigger_channel"], facts["trigger_slope"], facts["trigger_level"]) == ("current", "rising", 5e-3)
        assert facts["interval"] == pytest.approx(1.0 / facts["rate"])
        assert (time.attrs["meaning"], time[0]) == ("time after the trigger", pytest.approx(-20e-6, abs=1e-7))
        assert (current.attrs["probe"], current.attrs["unit"], current.attrs["instrument"]) == (1, "A", "scope1")
        assert current.attrs["resolution"] == pytest.approx(2e-3 / 25)


def test_it_is_drawn_over_its_own_time(ran):
    """In microseconds, without the limits of figures that were made of it."""
    page = ran.page()
    assert page.count("time after the trigger / µs") == 2
    assert "triggered by current, rising through 0.005 A" in page


def test_it_is_exported(ran, tmp_path):
    """The first column counts from the trigger, and the facts say so."""
    request = ExportRequest(output=tmp_path, table=TableFormat(), recordings=("switch_on",))
    first, _ = export_package(ran.package.folder, request)
    assert first.facts["time"] == "time in s after the trigger"
    assert first.facts["capture"]["channel"] == "current"
    table = np.genfromtxt(tmp_path / first.files[0], delimiter=",", skip_header=1)
    recorded = ran.package.recording(first.facts["recording"])
    assert np.array_equal(table[:, 0], recorded.time)
    assert np.array_equal(table[:, 1], recorded["current"])


def test_it_replays_to_the_same_bytes(ran):
    """From the recorded bytes of the transfer."""
    assert replay(ran.package).differences == ()
