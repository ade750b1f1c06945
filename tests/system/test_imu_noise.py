"""The noise plan of the bench `imu`: levels are read back as they were put in, units told apart, axes put in order."""

from __future__ import annotations

import json
import math
import shutil

import pytest
import sweeps
from told_as_json import bodies, results_as_json
from workspaces import ROOT, Workspace

from hil.bench.file.reading import load_bench

pytestmark = [pytest.mark.system, pytest.mark.timeout(sweeps.chosen(180, 7200))]

SECONDS = sweeps.chosen(120, 14400)
PLAN = "testplans/imu_noise"
# Rate of the record [Hz], rate of the samples [Hz], noise bandwidth [Hz], count, and the white noise where the bench
# file says none: N, or of a magnetometer the standard deviation of a sample.
GYROSCOPES = {
    "bno": (27.0, 100.0, 13.329, 1 / 16, 9.9e-3),
    "lsm": (14.9, 14.9, 5.554, 8.75e-3, math.nan),
    "icm": (112.5, 112.5, 35.9, 1 / 16.4, 1.06e-2),
    "bmi": (100.0, 100.0, 35.543, 2000 / 32768, 9.9e-3),
}
MAGNETOMETERS = {
    "bno": (6.0, 1 / 16, 0.5),
    "lsm": (5.0, 0.058, math.nan),
    "icm": (10.0, 0.15, 0.3),
    "lis": (5.0, 100 / 1711, math.nan),
}


def plan_workspace(root, seconds, changes=None):
    """Return a workspace with the bench, and the plan with records of so many seconds."""
    others = [plan.name for plan in (ROOT / "testplans").iterdir() if plan.is_dir() and plan.name != "imu_noise"]
    skipped = shutil.ignore_patterns("__pycache__", *others)
    shutil.copytree(ROOT / "fixtures", root / "fixtures", ignore=skipped)
    shutil.copytree(ROOT / "testplans", root / "testplans", ignore=skipped)
    (root / "hil.toml").touch()
    workspace = Workspace(root, root / PLAN)
    own = {'rest_duration, value: "14400"': f'rest_duration, value: "{seconds}"', 'value: "300"': 'value: "5"'}
    workspace.change(f"{PLAN}/parameters.yaml", own)
    path = root / PLAN / "requirements.yaml"
    path.write_text(path.read_text(encoding="utf-8").replace("duration: 4 h", f"duration: {seconds} s"))
    workspace.lock()
    if changes:
        workspace.change("fixtures/benches/imu/bench.yaml", changes)
    return workspace


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """Run the plan once."""
    workspace = plan_workspace(tmp_path_factory.mktemp("noise") / "workspace", SECONDS)
    return workspace, workspace.run(bench="imu", dut="SIM-IMU-1")


def checks(package, parameter):
    """Return the checks of a parameter by what they are of."""
    return {each["of"]: each for each in bodies(package, "check") if each["parameter"] == parameter}


def truths():
    """Return what the simulated sensors really are."""
    bench = load_bench(ROOT / "fixtures/benches", "imu", ROOT)
    return {peer.device: peer.truth for peer in bench.simulated.peers}


def white_of(axis):
    """Return the white noise that an axis has in its record: what was put in, what folds, and what counts add."""
    role, instance, letter = axis.split(".")
    model, place = instance.rstrip("2"), "xyz".index(letter)
    truth = truths()[f"{model}{'2' if instance.endswith('2') else '1'}"]
    if role == "magnetometer":
        rate, count, usual = MAGNETOMETERS[model]
        levels = truth.get("field_noise")
        rms = float(truth["noise"][place]) if "noise" in truth else usual
        square = float(levels["white"][place]) ** 2 if levels else rms**2 / rate
        return math.sqrt(square + count**2 / 12 / rate)
    rate, own, bandwidth, count, usual = GYROSCOPES[model]
    level = float(truth["white"][place]) if "white" in truth else usual
    ratio = own / (2 * bandwidth)
    left = ((ratio - 1) / (ratio + 1)) ** (own / rate)  # of the correlation, from one sample of the record to the next
    square = 2 * level**2 * bandwidth * (1 + left) / (1 - left) / rate
    return math.sqrt(square + count**2 / 12 / rate)


def test_what_was_put_in_is_read_back(ran):
    """White noise of all 48 axes, within the stated interval; and slow noise is known or bounded from above."""
    _, ended = ran
    white = checks(ended.package, "white_noise")
    assert len(white) == 48
    # In 600 samples the tails of plain noise look heavy once in 300 channels; the three axes of a sensor share a doubt.
    doubts = [each["doubts"] for each in white.values() if each.get("doubts")]
    assert len(doubts) <= sweeps.chosen(3, 0), doubts
    assert all("samples stand out by more than 3 standard" in said for told in doubts for said in told)
    assert {each["verdict"] for each in white.values()} <= sweeps.chosen({"PASS", "INCONCLUSIVE"}, {"PASS"})
    # Of 48 axes in two minutes a model or two are rejected by chance; that says nothing of a level.
    measured = {axis: each for axis, each in white.items() if each["status"] == "measured"}
    assert len(measured) >= sweeps.chosen(46, 48)
    far = {
        axis: (each["value"], each["uncertainty"], white_of(axis))
        for axis, each in measured.items()
        if abs(each["value"] - white_of(axis)) > sweeps.chosen(4.0, 3.5) * each["uncertainty"]
    }
    assert far == {}
    flicker = checks(ended.package, "flicker")
    assert {flicker[axis]["status"] for axis in measured} <= {"measured", "upper limit"}
    assert len(flicker) == 48


def test_spectrum_and_allan_deviation_agree(ran):
    """Within their uncertainties: a factor of two-sided or of the rate would be seen."""
    _, ended = ran
    found = {axis: each for axis, each in checks(ended.package, "psd_agreement").items() if each["value"] is not None}
    assert len(found) >= sweeps.chosen(20, 24)
    for axis, each in found.items():
        assert abs(each["value"]) <= 4.0 * each["uncertainty"], axis


def test_a_unit_that_differs_is_told_from_one_that_does_not(ran):
    """The z axis of the second ICM-20948 is 15 % louder; that of the BMI088 is within 2 %."""
    _, ended = ran
    found = checks(ended.package, "white_noise_unit_deviation")
    assert len(found) == 24
    assert "is beyond what the uncertainties explain" in found["gyroscope.icm.z"]["at"]
    assert "is within the uncertainties" in found["gyroscope.icm.y"]["at"]
    assert found["gyroscope.icm.z"]["value"] == pytest.approx(0.151, abs=4 * found["gyroscope.icm.z"]["uncertainty"])


def test_the_order_is_a_table_with_ties(ran):
    """The three gyroscope axes of the LSM9DS1 are the quietest, and tied with each other only."""
    _, ended = ran
    folder = ended.package.folder / "data/attachments"
    document = json.loads((folder / "test_gyroscopes-ranking-gyroscope.json").read_text(encoding="utf-8"))
    rows = document["rows"]
    assert [row["model"] for row in rows[:3]] == ["LSM9DS1"] * 3
    assert all(set(row["ties"]) <= {f"gyroscope.lsm.{axis}" for axis in "xyz"} for row in rows[:3])
    assert all(row["white_noise_uncertainty"] > 0 for row in rows)
    for kind, count in (("gyroscope", 12), ("magnetometer", 12)):
        table = (folder / f"test_{kind}s-ranking-{kind}.csv").read_text(encoding="utf-8").splitlines()
        assert len(table) == 1 + count
    ranks = checks(ended.package, "white_noise_rank")
    assert {each["verdict"] for each in ranks.values()} == {"RECORDED"}


def test_the_plan_is_replayed_from_its_bytes(ran):
    """The same figures and verdicts, with less than 600 MB."""
    workspace, ended = ran
    replayed, peak = workspace.hil_measured("replay", str(ended.package.folder), timeout=sweeps.chosen(150, 6000))
    assert "no difference" in replayed.out, replayed.out + replayed.err
    assert peak < 600_000


def test_folded_noise_closes_nothing(tmp_path):
    """A filter that is too wide for the rate: every check of that sensor says so, whatever the value."""
    wide = {
        f"instance: {name}, instrument: {unit}, settings: {{range: 2000 deg/s, bandwidth: 12 Hz}}": (
            f"instance: {name}, instrument: {unit}, settings: {{range: 2000 deg/s, bandwidth: 32 Hz}}"
        )
        for name, unit in (("bno", "bno1"), ("bno2", "bno2"))
    }
    workspace = plan_workspace(tmp_path / "workspace", 40, wide)
    ended = workspace.run(bench="imu", dut="SIM-IMU-1", skips={"test_magnetometers": "not asked here"})
    white = checks(ended.package, "white_noise")
    folded = {axis for axis, each in white.items() if "aliased: the bandwidth, 35.5431 Hz" in each["reason"]}
    assert folded == {f"gyroscope.{unit}.{axis}" for unit in ("bno", "bno2") for axis in "xyz"}
    assert {white[axis]["verdict"] for axis in folded} == {"INCONCLUSIVE"}
    assert ended.code != 0


@pytest.mark.parametrize(
    "fault", sweeps.sample(["saturated, until: 26 s", "stuck", "asleep", "dead", "garbled", "temperature-raw"], 2)
)
def test_a_fault_in_the_middle_of_a_record_passes_no_axis(tmp_path, fault):
    """Whatever the part before it shows: no check of an axis of that sensor passes, and none is recorded."""
    changes = {"    bno1:\n": f"    bno1:\n      faults: [{{from: 25 s, kind: {fault}}}]\n"}
    workspace = plan_workspace(tmp_path / "workspace", 40, changes)
    ended = workspace.run(bench="imu", dut="SIM-IMU-1", skips={"test_magnetometers": "not asked here"})
    touched = [each for each in bodies(ended.package, "check") if str(each["of"]).startswith("gyroscope.bno.")]
    assert {each["verdict"] for each in touched} <= {"FAIL", "INCONCLUSIVE", "ERROR"}
    (found,) = [each for each in results_as_json(ended.package)["cases"] if "gyroscopes" in each["case"]]
    assert found["verdict"] in {"FAIL", "INCONCLUSIVE", "ERROR"}
    assert found["requirements"]["IMU-NOI-011"] in {"FAIL", "INCONCLUSIVE", "ERROR"}
    assert ended.code != 0
