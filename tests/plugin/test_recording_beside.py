"""Recordings beside a case on the bench `adcs`: a gyroscope runs by itself while the table turns under it."""

from __future__ import annotations

import shutil

import pytest
from magnetorquer_runs import rows
from told_as_json import bodies
from workspaces import ROOT, make

from hil.evidence.package.verification import verify
from hil.plugin.rehearsing import procedure, replay

pytestmark = pytest.mark.system

REQUIREMENTS = """\
- {id: T-010, rev: 1, text: The board shall turn with the table., kind: limit, method: test,
   limits: [{parameter: ratio, unit: "1", min: "0.9", max: "1.1", decision: simple}]}
- {id: T-030, rev: 1, text: The board shall be recorded during all of the test., kind: record, method: test,
   records: {recording: board, channels: [x, y, z, temperature], rate: 100 Hz, duration: 30 s, max_gap: 0.05 s}}
"""

CASE = """
@pytest.mark.requirement("T-010", "T-030")
def test_turning(gyroscope, supply, magnetometer, rotation_table, thermal, record, check, step, clock):
    with step("Switch on"):
        gyroscope.start()
        clock.sleep(1)
        supply.sensor.configure(3.3, 0.02)
        supply.sensor.enable()
        clock.sleep(0.1)
        magnetometer.start()
    with step("Turn the table"):
        with (
            record.during("board", gyroscope, rate=100.0) as board,
            record.during("field", magnetometer, rate=2.0) as field,
        ):
            clock.sleep(10)
            rotation_table.set_rate(20.0)
            began = board.until("z", above=18.0, within=5.0)
            clock.sleep(3)
            turning = board.latest("z")
            inside = record("inside", magnetometer, duration=2.0, rate=10.0)
            thermal.temperature()
            rotation_table.stop()
            board.until("z", below=1.0, within=5.0)
            clock.sleep(15)
    assert 10.0 < began - board.recording.time[0] < 14.0
    assert board.recording.stream.lost == 0
    assert len(inside) == 20
    assert len(field.recording) > 50
    check("T-010", "ratio", Figure(value=turning.value / 20.0, unit="1"))
"""

LIMIT = "- {id: plate-temperature,"
FED = """\
- {id: board-temperature, output: gyroscope, quantity: temperature, unit: degC, min: "-30", max: "MAXIMUM",
   period: 20 s, max_age: 100 s, debounce: "2"}
"""
OTHER = (
    '- {id: sensor-current, output: supply.sensor, quantity: current, unit: A, max: "0.04", period: 5 s, max_age: 20 s}'
)


def bench(root, *limits, maximum="60", case=CASE):
    """Return a workspace with more limits in the envelope."""
    workspace = make(root / "workspace", case, requirements=REQUIREMENTS)
    shutil.copytree(ROOT / "fixtures", workspace.root / "fixtures", dirs_exist_ok=True)
    text = "".join(limits).replace("MAXIMUM", maximum)
    workspace.change_bench({LIMIT: f"{text}{LIMIT}"})
    return workspace


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """Return a workspace and its run, with a limit that the gyroscope's stream feeds."""
    workspace = bench(tmp_path_factory.mktemp("beside"), FED)
    return workspace, workspace.run()


def test_a_case_records_beside_what_it_does(ran):
    """Both requirements are met, the recordings are whole, and the package verifies."""
    _, run = ran
    assert run.verdicts() == {"test_turning": "PASS"}
    assert all(event["complete"] for event in bodies(run.package, "recording-end"))
    assert verify(run.package.folder).findings == ()
    verdicts = {each["requirement"]: each["verdict"] for each in bodies(run.package, "check")}
    assert verdicts == {"T-010": "PASS", "T-030": "RECORDED"}


def test_what_a_stream_feeds_is_told_and_not_written_twice(ran):
    """The journal names limit and recording once; the report says it where it shows what the envelope watched."""
    _, run = ran
    (fed,) = bodies(run.package, "fed")
    assert (fed["limit"], fed["recording"]) == ("board-temperature", "001-test_turning-board")
    ends = {event["recording"]: event["rows"] for event in bodies(run.package, "recording-end")}
    assert ends["envelope-board-temperature"] < 4
    assert "every row of recording 001-test_turning-board" in run.page()


def test_a_replay_agrees(ran):
    """The same turns at the same instants, from the recorded bytes."""
    _, run = ran
    again = replay(run.package)
    assert again.differences == ()
    assert again.checks == len(list(bodies(run.package, "check")))


def test_two_runs_have_one_digest(ran):
    """Nothing in a recording beside a case depends on the moment or the machine."""
    workspace, run = ran
    assert workspace.run().package.content_digest == run.package.content_digest


def test_one_more_monitor_moves_no_row(ran, tmp_path):
    """A bench that watches one more quantity has the same rows in every recording of the case."""
    _, run = ran
    watched = bench(tmp_path, FED, OTHER + "\n").run()
    assert watched.verdicts() == {"test_turning": "PASS"}
    assert rows(watched.package, of_cases=True) == rows(run.package, of_cases=True)


def test_the_procedure_tells_of_it(ran):
    """`hil plan` lists the recordings where they begin, and keeps no package."""
    workspace, _ = ran
    before = workspace.folders()
    text = "\n".join(procedure(workspace.request()))
    assert workspace.folders() == before
    assert "records  board: x [deg/s], y [deg/s], z [deg/s], temperature [degC], 100 Hz" in text
    assert "records  field: " in text


def test_a_row_beyond_a_limit_trips_the_bench_and_a_replay_agrees(tmp_path):
    """The trip names the row; the recording is kept as incomplete, and the replay trips at the same row."""
    run = bench(tmp_path, FED, maximum="20").run()
    assert run.verdicts() == {"test_turning": "ERROR"}
    (trip,) = bodies(run.package, "trip")
    assert "s of recording 001-test_turning-board" in trip["text"]
    ends = {event["recording"]: event["complete"] for event in bodies(run.package, "recording-end")}
    assert ends["001-test_turning-board"] is False
    assert replay(run.package).differences == ()
