"""The rotation table in a run: a person's word before it moves, its true rate, its harness, and its safe end."""

from __future__ import annotations

import re

import pytest
import sweeps
from rotation_bench import rotation_workspace
from told_as_json import bodies

pytestmark = pytest.mark.system  # each test is a whole run

REQUIREMENTS = """\
- {id: T-010, rev: 1, text: The rate shall be what was asked for., kind: limit, method: test,
   limits: [{parameter: rate, unit: deg/s, min: "29.9", max: "30.1", decision: guarded}]}
"""

TURNING = """
@pytest.mark.requirement("T-010")
def test_turning(rotation, clock, check, step):
    for axis in "xz":
        with step(f"Turn about {axis}"):
            rotation.mount(axis)
            rotation.turn(30.0)
            before = rotation.mark()
            clock.sleep(20)
            rate = rotation.true_rate(before)
            rotation.turn(-30.0)
            rotation.stop()
    check("T-010", "rate", rate)
"""

FORGETTING = """
@pytest.mark.requirement("T-010")
def test_forgetting(rotation, clock):
    rotation.turn(50.0)
    clock.sleep(200)
"""

LEAVING = """
@pytest.mark.requirement("T-010")
def test_leaving(rotation):
    rotation.turn(50.0)
"""


def ran(root, case, *changes, **request):
    """Return a run of one case on the bench `table`."""
    workspace = rotation_workspace(root / "workspace", case, requirements=REQUIREMENTS, changes=changes)
    return workspace.run(bench="table", **request)


def slips(*fault):
    """Return the change that gives the table a fault."""
    return ("      connects: {rate", f"      faults: [{', '.join(fault)}]\n      connects: {{rate")


def effects(run):
    """Return the names of the effects of a run, in order."""
    return [each["name"] for each in bodies(run.package, "effect")]


def test_a_board_is_turned_both_ways_after_a_persons_word(tmp_path):
    """Mounted, confirmed once, turned; the guarded check passes with the encoder's uncertainty."""
    run = ran(tmp_path, TURNING)
    assert (run.code, run.verdicts()) == (0, {"test_turning": "PASS"}), run.out
    named = effects(run)
    assert named.count("operator.table-may-start") == 1
    assert named.index("operator.table-may-start") < named.index("rotation_table.set_rate")
    assert [each["value"] for each in bodies(run.package, "answer")] == ["x", True, "z"]


def test_a_person_who_says_no_keeps_the_table_standing(tmp_path):
    """Declined before the first movement: nothing was ever set."""
    path = tmp_path / "answers.yaml"
    path.write_text('schema: hil/answers/1\nanswers: {table-may-start: "no", board-on-table: "x"}\n')
    run = ran(tmp_path, TURNING, answers=path)
    assert run.code != 0
    assert "was not confirmed" in run.reasons("test_turning")
    assert "rotation_table.set_rate" not in effects(run)


def test_a_forgotten_table_stops_within_its_harness(tmp_path):
    """The envelope's reading finds the end of the turns, stops the table, and the run is an error."""
    run = ran(tmp_path, FORGETTING)
    assert run.verdicts() == {"test_forgetting": "ERROR"}
    assert re.search("turns 10[.][12]", run.reasons("test_forgetting"))
    turns = run.package.recording("envelope-table-turns")["turns"]
    assert 9 < max(turns) < 10


def test_a_case_that_leaves_it_turning_finds_it_stopped(tmp_path):
    """The rest state stops it: proven by the encoder, nothing of it is left to the case."""
    run = ran(tmp_path, LEAVING)
    (stop,) = bodies(run.package, "rest")
    assert (stop["ok"], stop["output"]) == (True, "rotation_table")
    assert stop["duration"] > 1


@pytest.mark.parametrize(
    ("fault", "code", "reason"),
    sweeps.sample(
        [
            ("{kind: slipping, share: '0.9'}", 1, "encoder shows"),
            ("{kind: stalled}", 1, "encoder shows"),
            ("{kind: no-stop}", 1, "went on"),
            ("{kind: no-stop, power: stays}", 7, "went on"),
            ("{kind: dead, from: 30 s}", 7, "nothing came"),
        ],
        2,
    ),
)
def test_faults_end_in_errors_of_the_bench(tmp_path, fault, code, reason):
    """A fault of the table is never a pass; one that nothing stops is an unsafe end."""
    run = ran(tmp_path, TURNING, slips(fault))
    assert run.verdicts() == {"test_turning": "ERROR"}
    assert (run.code, reason in run.reasons("test_turning")) == (code, True), run.out + run.reasons("test_turning")
