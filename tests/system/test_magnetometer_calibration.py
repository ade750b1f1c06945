"""The magnetometer's calibration plan: whole, and everything that must not end in PASS."""

from __future__ import annotations

import json
import shutil

import pytest
import sweeps
from told_as_json import bodies, results_as_json
from workspaces import ROOT, Workspace

from hil.analysis import magnetometer_from_json
from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify

pytestmark = [pytest.mark.system, pytest.mark.timeout(sweeps.chosen(180, 900))]

PLAN = "testplans/magnetometer_calibration"
BENCH = "fixtures/benches/field/bench.yaml"
CASE = "test_calibration"
SOME = ("test_constant_magnitude[bias_1]", "test_varying_magnitude[matrix_3]")
QUICK = {
    'name: upward, values: ["-40", "-20", "0", "20", "40"]': 'name: upward, values: ["-35", "0", "25"]',
}
"""Three fields in place of five: enough of a sphere, and about half of the time."""

MOUNTED = "    board-on-table: cage.mounting\n"
TABLE, MAG1, CAGE = "      truth: {serial: SN1263", '      truth: {noise: ["0.05"', "        ambient: "
DRIFT, GAIN = '["0.00002", "-0.00001", "0.00003"]', 'gain: ["0.0008", "-0.0005", "0.0006"]'
MATRIX = '        soft: ["1.06", "0.03", "-0.02", "0.03", "0.93", "0.04", "-0.02", "0.04", "1.02"]'


def workspace(root, bench=None, parameters=None):
    """Return a workspace with the plan and its bench, changed."""
    others = [each.name for each in (ROOT / "testplans").iterdir() if each.is_dir() and each.name not in PLAN]
    skipped = shutil.ignore_patterns("__pycache__", *others)
    shutil.copytree(ROOT / "fixtures", root / "fixtures", ignore=skipped)
    shutil.copytree(ROOT / "testplans", root / "testplans", ignore=skipped)
    (root / "hil.toml").touch()
    made = Workspace(root, root / PLAN)
    if parameters:
        made.change(f"{PLAN}/parameters.yaml", parameters)
    if bench:
        made.change(BENCH, bench)
    return made


def ran(made, *cases, answers=""):
    """Run some cases, all where none is named, with answers from a file where there are some."""
    if answers:
        (made.root / "answers.yaml").write_text(f"schema: hil/answers/1\nby: Ada\nanswers: {answers}\n")
    named = ("run", PLAN, "--bench", "field", "--dut", "SIM-MAG-1", "--source", "simulated")
    named += ("--answers", "answers.yaml") if answers else ()
    ended = made.hil(*named, *(word for each in cases for word in ("--only", each)), timeout=sweeps.chosen(150, 800))
    assert made.folders(), ended.out + ended.err
    return ended, Package(made.folders()[-1])


def replays(made, package):
    """Assert that the bytes of a run come to the same again."""
    ended = made.hil("replay", str(package.folder), timeout=sweeps.chosen(150, 600))
    assert "no difference" in ended.out, ended.out + ended.err


def verdicts(package):
    """Return the verdict of every case that was run, by its name."""
    cases = results_as_json(package)["cases"]
    return {each["case"].partition("::")[2]: each["verdict"] for each in cases if each["verdict"] != "NOT_RUN"}


def figures(package):
    """Return every check by its parameter, and what it is of."""
    return {(each["parameter"], each.get("of") or ""): each for each in bodies(package, "check")}


@pytest.fixture(scope="module")
def healthy(tmp_path_factory):
    """Calibrate the board as it is, and two of the published distortions."""
    made = workspace(tmp_path_factory.mktemp("field") / "w")
    return made, *ran(made, *sweeps.chosen((CASE, *SOME), ()))


def test_the_calibration_passes_is_exported_and_repeats(healthy):
    """Bias and gain of the board's truth; the export holds them; the bytes give the same again, and no case failed."""
    made, ended, package = healthy
    assert set(verdicts(package).values()) == {"PASS"}, ended.out
    assert len(verdicts(package)) == sweeps.chosen(3, 17)
    assert verify(package.folder).findings == ()
    replays(made, package)
    driven = [each["name"] for each in bodies(package, "effect") if each["effect"] == "drives"]
    assert driven.count("supply.sensor.disable") == len(verdicts(package)), "a case computes with its outputs on"
    found = figures(package)
    for axis, true in zip("xyz", (18.4, -31.2, 9.7), strict=True):
        check = found["bias", axis]
        assert abs(check["value"] - true) < 2.0 * check["uncertainty"] < 1.0
    assert abs(found["raw_magnitude_error", ""]["value"]) > 20.0 * abs(found["magnitude_error", ""]["value"])
    assert found["raw_heading_error", ""]["value"] > 90.0
    (exported,) = (package.folder / "data/attachments").rglob("*calibration.json")
    calibration = magnetometer_from_json(exported.read_text(encoding="utf-8"))
    assert calibration.absolute
    assert calibration.bias == pytest.approx((18.4, -31.2, 9.7), abs=0.2)
    (header,) = (package.folder / "data/attachments").rglob("*calibration.h")
    assert json.loads(exported.read_text(encoding="utf-8"))["fingerprint"] in header.read_text(encoding="utf-8")
    page = package.text("data/report/report.html")
    assert "Directions of the calibrated readings" in page
    assert "Error of the magnitude" in page
    assert "Error of the factor, TWOSTEP" in page


@pytest.mark.parametrize(
    ("bench", "parameters", "verdict", "said"),
    sweeps.sample(
        [
            ({CAGE: '        iron: ["6", "-4", "3"]\n        iron_from: "45"\n' + CAGE}, {}, "INCONCLUSIVE", "iron"),
            ({CAGE: "        winding: left\n" + CAGE}, {}, "ERROR", "the coils add -22"),
            ({MATRIX: MATRIX.replace('"1.06", "0.03"', '"0.03", "1.06"').replace('"0.03", "0.93"', '"0.93", "0.03"')},
             {}, "FAIL", "MAG-CAL-032"),
            ({}, {**dict.fromkeys(QUICK, 'name: upward, values: ["-35"]'),
                  'name: mountings, value: "3"': 'name: mountings, value: "1"'}, "INCONCLUSIVE", "coverage"),
            ({TABLE: "      faults: [{kind: stalled, from: 10 s}]\n" + TABLE}, {}, "ERROR", "its encoder shows"),
            ({CAGE: "        broken: true\n" + CAGE}, {}, None, "reduced level of supply.coil"),
            ({'resistance: "6.4"': 'resistance: "24"'}, {}, "ERROR", "flow in mode CV"),
            ({'resistance: "6.4"': 'resistance: "4"'}, {}, "ERROR", "the coils have 4 ohm"),
            ({MAG1: "      faults: [{kind: saturated, from: 40 s}]\n" + MAG1}, {}, "INCONCLUSIVE", "not finite"),
            ({MAG1: "      faults: [{kind: stuck, from: 40 s}]\n" + MAG1}, {}, "INCONCLUSIVE", "consecutive"),
            ({MATRIX: MATRIX.replace('"-0.02", "0.04", "1.02"', '"0", "0", "0"')}, {}, "INCONCLUSIVE", "sphere"),
            ({CAGE: '        motor_field: ["0", "0", "3"]\n' + CAGE}, {}, "INCONCLUSIVE", "its motor disturbs them"),
            ({CAGE: '        iron: ["8", "-5", "4"]\n        iron_at_reference: "0"\n' + CAGE}, {},
             "INCONCLUSIVE", "the surroundings disturb it"),
            ({DRIFT: '["0.006", "-0.001", "0.003"]'}, {}, "INCONCLUSIVE", "the ambient field at the reference"),
            ({GAIN: 'gain: ["0.05", "0.05", "0.05"]'}, {}, "ERROR", "uT/A upwards at the reference"),
        ],
        2,
    ),
)  # fmt: skip
def test_what_must_not_pass(tmp_path, bench, parameters, verdict, said):
    """Iron, polarity, axes swapped or dead, few attitudes, drift, table, motor, coils, a sick sensor or reference."""
    made = workspace(tmp_path / "w", bench, {**QUICK, **parameters})
    ended, package = ran(made, CASE)
    assert verdicts(package) == ({CASE: verdict} if verdict else {}), ended.out
    assert said in ended.out
    assert ended.code != 0
    if verdict:
        replays(made, package)


@pytest.mark.parametrize(
    ("said", "bench", "among", "told"),
    [
        ("yes", {}, {"PASS"}, "1 passed"),
        ("yes", {MOUNTED: ""}, {"FAIL", "INCONCLUSIVE"}, "MAG-CAL-032"),
        ("no", {}, {"ERROR"}, "answers 'no' to 'board-on-table'"),
    ],
)
def test_a_file_answers(tmp_path, said, bench, among, told):
    """Its yes is done by the simulated hands; without them the board stays as it was, and nothing passes.

    Whether readings that contradict each other are fitted to a mirror image or to nothing is up to their noise.
    """
    made = workspace(tmp_path / "w", bench, QUICK)
    answers = f'{{distortion: none, board-on-table: "{said}", table-may-start: "yes"}}'
    ended, package = ran(made, CASE, answers=answers)
    assert verdicts(package)[CASE] in among, ended.out
    assert told in ended.out
    assert {each["by"] for each in bodies(package, "answer")} == {"Ada (answers file)"}
    replays(made, package)


def test_nobody_answers(tmp_path):
    """Without a file and the simulated person's knowledge the run exits 4 before anything is switched on."""
    made = workspace(tmp_path / "w", {MOUNTED: ""})
    ended = made.hil("run", PLAN, "--bench", "field", "--dut", "SIM-MAG-1", "--source", "simulated", "--only", CASE)
    assert ended.code == 4, ended.out + ended.err
    assert "there is nobody to answer 'board-on-table'" in ended.err
    ended = made.hil("run", PLAN, "--bench", "field", "--dut", "SIM-MAG-1", "--source", "simulated", "--ask")
    assert ended.code == 4, ended.out + ended.err
    for name in ("distortion", "board-on-table", "table-may-start"):
        assert f"'{name}'" in ended.err
    assert made.folders() == []
