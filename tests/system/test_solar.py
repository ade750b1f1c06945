"""Solar cells: the whole plan, simulated and live with an answers file, and the inspection of the documents."""

from __future__ import annotations

import csv
import hashlib
import json
import shutil

import pytest
import sweeps
from given_files import JPEG
from live_runs import served
from told_as_json import bodies, results_as_json
from workspaces import ROOT, Workspace

from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify
from hil.model.errors import ConfigurationError
from hil.plugin.rehearsing import replay

pytestmark = [pytest.mark.system, pytest.mark.timeout(180)]

TRUTH = {
    "short_circuit_current": 0.39995,
    "open_circuit_voltage": 2.6993,
    "maximum_power": 0.89751,
    "fill_factor": 0.83135,
    "series_resistance": 0.12,
    "shunt_conductance": 1000 / 900,
}
"""Of the simulated panel at 1367 W/m^2 and 28 degC, by `tests/numeric/test_solar.py`."""

DOCUMENTS = "fixtures/documents/solar"
SERVED = ("--bench", "solar", "--dut", "SIM-SOL-1", "--source", "simulated")


def workspace(root, plan):
    """Return a copy of one of the two plans with its bench."""
    for each in ("fixtures", f"testplans/{plan}"):
        shutil.copytree(ROOT / each, root / each, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "testplans/requirements.yaml", root / "testplans")
    (root / "hil.toml").touch()
    return Workspace(root, root / "testplans" / plan)


def checks_of(package, case):
    """Return the checks of a case."""
    found = next(each for each in results_as_json(package)["cases"] if each["case"].endswith(case))
    return found["checks"]


@pytest.mark.parametrize("seed", sweeps.sample(range(20261123, 20261143), 1))
def test_the_curve_is_the_panel_s(tmp_path, seed):
    """Every figure covers the truth, of all three sweeps; every point is attached; verified, and the same replayed."""
    made = workspace(tmp_path / "w", "solar_cells")
    made.change("fixtures/benches/solar/bench.yaml", {'seed: "20261123"': f'seed: "{seed}"'})
    ran = made.run(bench="solar", dut="SIM-SOL-1")
    assert ran.verdicts() == {"test_curve": "PASS"}, ran.out
    checks = [each for each in checks_of(ran.package, "test_curve") if each["parameter"] in TRUTH]
    assert len(checks) == 3 * len(TRUTH)
    for each in checks:
        off = abs(each["value"] - TRUTH[each["parameter"]])
        assert off < 2.0 * each["expanded"], each
    (table,) = (ran.package.folder / "data/attachments").glob("*current-voltage.csv")
    rows = list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))
    assert [len([row for row in rows if row["sweep"] == name]) for name in ("forward", "reverse", "repeat")] == [41] * 3
    assert verify(ran.package.folder).findings == ()
    assert replay(ran.package).differences == ()
    assert "Current-voltage curve" in ran.page()


def test_the_documents_are_evidence(tmp_path):
    """Each with kind, hash and inspector, at the check that it is of; the bench stays dark; the same replayed."""
    made = workspace(tmp_path / "w", "solar_inspection")
    ran = made.run(bench="solar", dut="SIM-SOL-1", answers=made.root / DOCUMENTS / "answers.yaml")
    assert ran.verdicts() == {"test_documents": "PASS", "test_damage": "PASS"}, ran.out
    answered = {each["name"]: each for each in bodies(ran.package, "answer")}
    assert {each["by"] for each in answered.values()} == {"Specimen Inspector (answers file)"}
    for name, file, kind in (
        ("datasheet", "datasheet.pdf", "pdf"),
        ("model", "cell.step", "step"),
        ("panel", "panel.png", "png"),
    ):
        digest = hashlib.sha256((ROOT / DOCUMENTS / file).read_bytes()).hexdigest()
        assert digest in json.dumps(answered[name])
        assert f"SHA-256 {digest[:16]}" in ran.page()
        assert kind in json.dumps(answered[name])
    assert verify(ran.package.folder).findings == ()
    assert replay(ran.package).differences == ()


@pytest.mark.parametrize(
    ("old", "new", "case", "verdict"),
    [
        ("datasheet-agrees: agrees", "datasheet-agrees: differs", "test_documents", "FAIL"),
        ("panel-damage: none", "panel-damage: crack", "test_damage", "FAIL"),
    ],
    ids=["another data sheet", "a crack"],
)
def test_it_is_open_until_every_document_is_there_and_agrees(tmp_path, old, new, case, verdict):
    """And the other case is as it was."""
    made = workspace(tmp_path / "w", "solar_inspection")
    (made.root / DOCUMENTS / "panel.jpg").write_bytes(JPEG)
    made.change(f"{DOCUMENTS}/answers.yaml", {old: new})
    ran = made.run(bench="solar", dut="SIM-SOL-1", answers=made.root / DOCUMENTS / "answers.yaml")
    assert ran.verdicts() == {"test_documents": "PASS", "test_damage": "PASS", case: verdict}, ran.out


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("  model: cell.step\n", "", "no answer to 'model'"),
        ("model: cell.step", "model: panel.jpg", "this is a JPEG file; give STEP"),
    ],
    ids=["no model", "a picture for a model"],
)
def test_it_does_not_begin_without_its_documents(tmp_path, old, new, told):
    """What is missing is told before anything is opened."""
    made = workspace(tmp_path / "w", "solar_inspection")
    (made.root / DOCUMENTS / "panel.jpg").write_bytes(JPEG)
    made.change(f"{DOCUMENTS}/answers.yaml", {old: new})
    with pytest.raises(ConfigurationError, match=told):
        made.run(bench="solar", dut="SIM-SOL-1", answers=made.root / DOCUMENTS / "answers.yaml")
    assert made.folders() == []


@pytest.mark.alone
@pytest.mark.soak
@pytest.mark.timeout(400)
def test_a_live_run_is_answered_by_a_file(tmp_path):
    """On a served bench, in wall time, with a short warm-up: a minute, so that it runs in the soak only."""
    made = workspace(tmp_path / "w", "solar_cells")
    answers = made.root / "answers.yaml"
    answers.write_text('schema: hil/answers/1\nby: Ada\nanswers: {box: "yes"}\n', encoding="utf-8")
    short = ("--parameter", "longest_warm_up=10", "--parameter", "least_warming=0.5")
    with served(tmp_path / "s", made.root, "solar", speed=1.0) as bench:
        ended = made.hil(
            "run", "solar_cells", *SERVED, "--served", str(bench.folder), "--answers", str(answers), *short
        )
    package = Package(made.folders()[-1])
    verdicts = {case["case"].partition("::")[2]: case["verdict"] for case in results_as_json(package)["cases"]}
    assert verdicts == {"test_curve": "PASS"}, ended.out
    assert verify(package.folder).findings == ()
    assert replay(package).differences == ()
