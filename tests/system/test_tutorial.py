"""Pages with commands do what they say, from the first line to the last."""

from __future__ import annotations

import contextlib
import shutil
from pathlib import Path

import pytest
from told_pages import Command, follow, steps_of

from hil.model.errors import HilError
from hil.simulation.served.folder import ask

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"

# A copy has no virtual environment of its own, and no history to go back to.
NOT_IN_A_COPY = ("make setup", ". .venv/bin/activate", "git checkout fixtures testplans")


@pytest.mark.system
@pytest.mark.timeout(1200)
def test_the_first_run_goes_as_told(tmp_path):
    """Every command of the tutorial gives the output and the exit code that the page shows."""
    for name in ("fixtures", "testplans"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    steps = steps_of(DOCS / "tutorials" / "first-run.md")
    assert set(NOT_IN_A_COPY) <= {step.text for step in steps if isinstance(step, Command)}
    assert follow(steps, tmp_path, without=NOT_IN_A_COPY) == ""


@pytest.mark.system
@pytest.mark.timeout(600)
def test_a_power_board_is_accepted_as_told(tmp_path):
    """In an empty folder: bench, requirements and cases of an EPS board, a dry run, a run, and boards that fail."""
    assert follow(steps_of(DOCS / "tutorials" / "accept-a-power-board.md"), tmp_path) == ""


@pytest.mark.system
@pytest.mark.timeout(300)
def test_a_heater_is_tested_as_told(tmp_path):
    """In an empty folder: a heater that passes, one whose foil came loose, and one whose thermostat never opens."""
    assert follow(steps_of(DOCS / "how-to" / "test-a-heater.md"), tmp_path) == ""


@pytest.mark.system
@pytest.mark.timeout(300)
@pytest.mark.skipif(shutil.which("ssh-keygen") is None, reason="ssh-keygen is not installed")
def test_persons_and_documents_are_asked_as_told(tmp_path):
    """In an empty folder: a witness who is missing, one who is there, and an analysis that is approved and changes."""
    assert follow(steps_of(DOCS / "how-to" / "ask-a-person.md"), tmp_path) == ""


@pytest.mark.system
@pytest.mark.timeout(600)
def test_a_workspace_is_started_as_told(tmp_path):
    """In an empty folder, the commands of the guide make a workspace whose plan passes."""
    steps = steps_of(DOCS / "how-to" / "start-a-workspace.md")
    assert follow(steps, tmp_path) == ""


@pytest.mark.system
@pytest.mark.timeout(600)
def test_a_plan_is_written_as_told(tmp_path):
    """In an empty folder, the files and commands of the guide make a plan that runs."""
    steps = steps_of(DOCS / "how-to" / "write-a-plan.md")
    assert follow(steps, tmp_path) == ""


@pytest.mark.system
@pytest.mark.timeout(360)
@pytest.mark.parametrize(
    "page",
    [
        ROOT / "README.md",
        DOCS / "how-to" / "analyse-a-log.md",
        DOCS / "how-to" / "check-a-published-table.md",
    ],
    ids=lambda page: page.stem,
)
def test_logs_are_analysed_as_told(page, tmp_path):
    """The commands that analyse the example files give what the pages show."""
    shutil.copytree(DOCS / "data", tmp_path / "docs" / "data")
    steps = [
        step
        for step in steps_of(page)
        if isinstance(step, Command) and step.text.startswith(("hil analyse", "echo $?"))
    ]
    assert steps
    assert follow(steps, tmp_path) == ""


@pytest.mark.system
@pytest.mark.timeout(360)
@pytest.mark.parametrize("page", ["measure-a-solar-panel", "calibrate-a-photodiode"])
def test_light_is_measured_as_told(page, tmp_path):
    """The plan with a simulated person, with a file and with nobody; documents; an analysis of readings from a file."""
    for name in ("fixtures", "testplans", "docs/data"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    assert follow(steps_of(DOCS / "how-to" / f"{page}.md"), tmp_path) == ""


@pytest.mark.system
@pytest.mark.timeout(360)
def test_recordings_are_exported_as_told(tmp_path):
    """The commands of the guide export the reference package, and show what the page shows."""
    shutil.copytree(ROOT / "reports" / "reference", tmp_path / "reports" / "reference")
    assert follow(steps_of(DOCS / "how-to" / "export-recordings.md"), tmp_path) == ""


@pytest.mark.system
@pytest.mark.timeout(120)
def test_the_audit_tells_of_a_new_clone_what_the_page_shows(tmp_path):
    """The first command of the guide; the others need a history of their own."""
    for name in ("fixtures", "testplans", "reports/reference"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    steps = [step for step in steps_of(DOCS / "how-to" / "audit.md") if isinstance(step, Command)]
    assert steps[0].text == "hil audit"
    assert follow(steps[:1], tmp_path) == ""


@pytest.mark.system
@pytest.mark.timeout(300)
@pytest.mark.parametrize("page", ["degradation-run", "interrupted-run"])
def test_a_run_ends_as_told(page, tmp_path):
    """Eleven cycles with the fade that the page shows; a run that is killed, and passes when it is resumed."""
    for name in ("fixtures", "testplans"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    steps = [step for step in steps_of(DOCS / "how-to" / f"{page}.md") if isinstance(step, Command)]
    last = next(n for n, step in enumerate(steps) if "PASS  1 case: 1 passed." in step.shown or "latest" in step.text)
    assert follow(steps[: last + 1], tmp_path) == ""


@pytest.mark.system
@pytest.mark.alone
@pytest.mark.timeout(600)
def test_a_real_bench_is_rehearsed_as_told(tmp_path):
    """On a served bench: looked at, tried, a run ended in order and one killed, latched, acknowledged, gone on with."""
    for name in ("fixtures", "testplans"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    try:
        assert follow(steps_of(DOCS / "how-to" / "first-hour-on-a-real-bench.md"), tmp_path) == ""
    finally:
        with contextlib.suppress(HilError):  # a page that was left in its middle leaves the bench behind
            ask(tmp_path / "ends", {"stop": True})
