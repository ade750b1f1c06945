"""What decides the evidence of a simulated run: the seed and the bench's physics, and nothing else."""

from __future__ import annotations

import pytest
import sweeps
from magnetorquer_runs import BOARDS, rows, run_here, workspace
from told_as_json import bodies

from hil.plugin.rehearsing import replay

pytestmark = pytest.mark.system

SEED = 'seed: "20260101"'
SENSOR_VOLTAGE = "- {id: sensor-voltage,"
SENSOR_CURRENT = (
    '- {id: sensor-current, output: supply.sensor, quantity: current, unit: A, max: "0.04", period: 1 s, max_age: 5 s}'
)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Return a maker of whole runs on copies of the bench with these changes, each made once."""
    made = {}

    def make(name, changes):
        if name not in made:
            made[name] = run_here(workspace(tmp_path_factory.mktemp("equal") / "workspace", changes))
        return made[name]

    return make


def checks(ran):
    """Return every check's place, value, uncertainty and verdict."""
    fields = ("case", "requirement", "parameter", "of", "value", "uncertainty", "verdict")
    return [tuple(event[field] for field in fields) for event in bodies(ran.package, "check")]


def test_the_whole_plan_passes(runs):
    """Eighteen cases on a healthy bench."""
    ran = runs("usual", {})
    assert ran.code == 0
    assert len(ran.verdicts()) == 18
    assert set(ran.verdicts().values()) == {"PASS"}


def test_another_seed_is_another_run(runs):
    """Other noise gives other rows in every recording of a case, and the same verdicts."""
    usual, other = runs("usual", {}), runs("seed", {SEED: 'seed: "7"'})
    before, after = rows(usual.package, of_cases=True), rows(other.package, of_cases=True)
    assert before.keys() == after.keys()
    assert not set(before.values()) & set(after.values())
    assert usual.package.content_digest != other.package.content_digest
    assert usual.verdicts() == other.verdicts()


def test_one_more_monitor_changes_no_recording_of_a_case(runs):
    """A bench that watches one more quantity has the same physics: the same rows and the same values."""
    usual, watched = runs("usual", {}), runs("watched", {SENSOR_VOLTAGE: f"{SENSOR_CURRENT}\n{SENSOR_VOLTAGE}"})
    assert rows(usual.package, of_cases=True) == rows(watched.package, of_cases=True)
    assert checks(usual) == checks(watched)
    assert "envelope-sensor-current" in rows(watched.package, of_cases=False)


def test_a_reversed_coil_fails_on_its_board_alone(runs):
    """Wound the other way, one board fails polarity and compass; its linearity and all other boards pass."""
    board = BOARDS[3]
    ran = runs("reversed", {f"{board}: {{": f"{board}: {{winding: left, "})
    assert ran.code == 1
    failed = {case for case, verdict in ran.verdicts().items() if verdict != "PASS"}
    assert failed == {f"test_polarity[{board}]", f"test_direction_by_compass[{board}]"}
    assert {ran.verdicts()[case] for case in failed} == {"FAIL"}


@pytest.mark.parametrize(
    ("name", "changes"),
    sweeps.sample([("usual", {}), ("reversed", {f"{BOARDS[3]}: {{": f"{BOARDS[3]}: {{winding: left, "})], 1),
)
def test_every_verdict_follows_from_the_recorded_bytes(runs, name, changes):
    """The replay of a run, passed or failed, gives every verdict, value and row again."""
    replayed = replay(runs(name, changes).package)
    assert (replayed.cases, replayed.differences) == (18, ())
