"""Solar cells: the whole plan, simulated and live, answered by a simulated person, by a file, or by nobody."""

from __future__ import annotations

import csv

import pytest
import sweeps
from live_runs import served
from solar_plans import COMMAND, ON_BENCH, solar_workspace
from told_as_json import results_as_json

from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify
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

ANSWERS = 'schema: hil/answers/1\nby: Ada\nanswers: {box: "yes"}\n'


def checks_of(package, case):
    """Return the checks of a case."""
    found = next(each for each in results_as_json(package)["cases"] if each["case"].endswith(case))
    return found["checks"]


@pytest.mark.parametrize("seed", sweeps.sample(range(20261123, 20261143), 1))
def test_the_curve_is_the_panel_s(tmp_path, seed):
    """Every figure covers the truth, of all three sweeps; every point is attached; verified, and the same replayed."""
    made = solar_workspace(tmp_path / "w")
    made.change("fixtures/benches/solar/bench.yaml", {'seed: "20261123"': f'seed: "{seed}"'})
    ran = made.run(**ON_BENCH)
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


@pytest.mark.parametrize(("plan", "asked"), [("solar_cells", "box"), ("solar_inspection", "datasheet")])
def test_an_unanswered_question_ends_the_command_before_anything_is_switched_on(tmp_path, plan, asked):
    """Without a terminal and answers: exit 4, and no run."""
    made = solar_workspace(tmp_path / "w", plan)
    ended = made.hil("run", plan, *COMMAND, "--ask")
    assert (ended.code, made.folders()) == (4, []), ended.out + ended.err
    assert f"there is nobody to answer '{asked}'" in ended.err
    assert "each needs a person: give answers with --answers FILE" in ended.err


def test_nobody_is_asked_where_a_file_answers(tmp_path):
    """All is well, and the package verifies."""
    made = solar_workspace(tmp_path / "w")
    (made.root / "answers.yaml").write_text(ANSWERS, encoding="utf-8")
    ended = made.hil("run", "solar_cells", *COMMAND, "--answers", "answers.yaml")
    assert ended.code == 0, ended.out + ended.err
    assert "answered box: yes (Ada (answers file))" in ended.out
    (folder,) = made.folders()
    assert verify(folder).findings == ()


@pytest.mark.alone
@pytest.mark.soak
@pytest.mark.timeout(400)
def test_a_live_run_is_answered_by_a_file(tmp_path):
    """On a served bench, in wall time, with a short warm-up: a minute, so that it runs in the soak only."""
    made = solar_workspace(tmp_path / "w")
    (made.root / "answers.yaml").write_text(ANSWERS, encoding="utf-8")
    short = ("--parameter", "longest_warm_up=10", "--parameter", "least_warming=0.5")
    with served(tmp_path / "s", made.root, "solar", speed=1.0) as bench:
        ended = made.hil(
            "run", "solar_cells", *COMMAND, "--served", str(bench.folder), "--answers", "answers.yaml", *short
        )
    package = Package(made.folders()[-1])
    verdicts = {case["case"].partition("::")[2]: case["verdict"] for case in results_as_json(package)["cases"]}
    assert verdicts == {"test_curve": "PASS"}, ended.out
    assert verify(package.folder).findings == ()
    assert replay(package).differences == ()
