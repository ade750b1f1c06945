"""Monitors take their turn wherever a case spends its time, and a replay gives them the same turn."""

from __future__ import annotations

import re
from itertools import pairwise

import pytest
from magnetorquer_runs import run_here, with_faults, workspace
from told_as_json import bodies, results_as_json

from hil.plugin.rehearsing import replay
from hil.requirements.catalogue import load_catalogue
from hil.requirements.lock import lock_text

pytestmark = pytest.mark.system  # each test is a whole run

PLAN = """
import pytest

@pytest.mark.requirement("WATCH-010")
def test_long_recording(field, record, supply, clock):
    \"\"\"A recording whose samples leave no room for monitors, then waits that follow each other.\"\"\"
    record("field", field, duration=20, rate=40)
    clock.sleep(0.02)
    clock.sleep(0.4)
    clock.sleep(3)
    record("after", field, duration=0.5, rate=40)
    record("crowded", field, duration=4, rate=200)
    clock.sleep(3)
"""
GAP = PLAN.partition("    clock.sleep(0.02)")[0]
"""The recording alone."""
REQUIREMENTS = """schema: hil/requirements/1
document: {id: WATCH, issue: "1.0", title: Watching}
requirements:
- id: WATCH-010
  rev: 1
  text: The field shall be recorded for 20 s.
  parents: [ADCS-001]
  source: own requirement
  kind: record
  method: test
  level: equipment
  stage: acceptance
  records: {recording: field, channels: [x, y, z], rate: 40 Hz, duration: 20 s, max_gap: 0.1 s}
"""


def watching(folder, changes=None, source=PLAN):
    """Run the plan that watches, on a bench with changes."""
    root = workspace(folder / "workspace", changes)
    plan = root / "testplans/watching"
    plan.mkdir()
    (plan / "requirements.yaml").write_text(REQUIREMENTS)
    (plan / "parameters.yaml").write_text("schema: hil/parameters/1\nparameters: []\n")
    (plan / "test_watching.py").write_text(source)
    catalogue = load_catalogue(root, [plan], locked=False)
    (plan / "requirements.lock.json").write_text(lock_text(catalogue.of_plan("watching")))
    return run_here(root, plan="watching")


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """The run of a plan that watches."""
    return watching(tmp_path_factory.mktemp("watch"))


def test_no_reading_grows_too_old(ran):
    """Between samples, also where more are asked for than the sensor gives, readings come within two periods."""
    for limit, most in (("coil-current", 2.1), ("sensor-voltage", 4.1)):
        times = ran.package.recording(f"envelope-{limit}").time
        assert max(later - earlier for earlier, later in pairwise(times)) <= most


def test_samples_stay_on_their_grid(ran):
    """A monitor's turn between two samples delays neither by as much as their distance."""
    assert list(ran.verdicts().values()) == ["RECORDED"]
    recording = ran.package.recording("001-test_long_recording-field")
    assert len(recording) == 800
    assert abs(recording.time[-1] - recording.time[0] - 799 / 40) < 1e-2


def test_a_replay_gives_every_monitor_its_turn(ran):
    """Waits without an operation between them end at their instants, so that what follows is recorded at the same."""
    assert replay(ran.package).differences == ()


def test_a_current_that_flows_for_a_second_is_seen(tmp_path):
    """A current above its limit trips while it flows, although its phases are barely longer than the period."""
    root = workspace(tmp_path / "workspace")
    bench = root / "fixtures/benches/adcs/bench.yaml"
    text = bench.read_text()
    assert 'unit: A, max: "0.03", period: 1 s' in text
    bench.write_text(text.replace('unit: A, max: "0.03", period: 1 s', 'unit: A, max: "0.003", period: 1 s'))
    ended = run_here(root)
    assert ended.code == 6
    trips = bodies(ended.package, "trip")
    assert [trip["limit"] for trip in trips] == ["coil-current"]
    assert trips[0]["t"] < 10


@pytest.mark.parametrize(
    ("until", "said"),
    [
        ("13 s", r"psu1: the (current|voltage) of supply\.(coil|sensor) came after [01]\.\d+ s"),
        ("16 s", r"psu1: .*nothing came within 0\.5 s"),
    ],
)
def test_a_gap_that_the_benchs_silence_made_is_no_failure_of_the_dut(tmp_path, until, said):
    """A supply that is silent for a while holds the recording up: ERROR, for the case and for what it verifies."""
    ran = watching(tmp_path, with_faults("psu1", f"{{kind: dead, from: 12 s, until: {until}}}"), GAP)
    (case,) = results_as_json(ran.package)["cases"]
    assert case["verdict"] == "ERROR"
    assert results_as_json(ran.package)["requirements"][0]["verdict"] == "ERROR"
    assert re.search(said, "".join(case["reasons"]))
    assert {fault["device"] for fault in bodies(ran.package, "fault")} == {"psu1"}
    assert replay(ran.package).differences == ()
