"""Files as answers in runs of their own: what is missing ends the command before it, and a kill loses nothing."""

from __future__ import annotations

import os
import signal
import time

import pytest
from given_files import CSV, PNG
from told_as_json import bodies
from workspaces import executive, finish, make

from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify
from hil.plugin.rehearsing import replay

CASES = """
import pytest

@pytest.mark.requirement("T-050")
def test_documents(operator, check, supply):
    operator.attach("A photo of the jig", name="photo", accepts=("picture",), witness="quality engineer")
    for _ in range(2):
        supply.coil.voltage()
    curve = operator.attach("The curve", name="curve", accepts=("csv",))
    uncertainty = len(curve.text()) / 2400
    check("T-050", "voltage", operator.measure("Read it", "V", name="meter", uncertainty=uncertainty))
"""
WHOLE = {"photo": "jig.png", "curve": "curve.csv", "meter": "'4.98'"}

pytestmark = pytest.mark.system


def prepared(root, answers=WHOLE):
    """Write an answers file with its files."""
    (root / "jig.png").write_bytes(PNG)
    (root / "curve.csv").write_bytes(CSV)
    lines = "".join(f"  {name}: {said}\n" for name, said in answers.items())
    answered = f"schema: hil/answers/1\nby: Ada\nanswers:\n{lines}witnesses: {{photo: Quinn}}\n"
    (root / "answers.yaml").write_text(answered)


def test_what_is_missing_ends_the_command_before_it_begins(tmp_path):
    """Without a terminal: exit 4, no folder of a run, and the problem; each sentence is in test_foreseen_questions."""
    workspace = make(tmp_path / "workspace", CASES)
    prepared(workspace.root, {"photo": "jig.png", "meter": "'4.98'"})
    ended = workspace.hil(*workspace.run_arguments, "--answers", "answers.yaml")
    assert (ended.code, workspace.folders()) == (4, []), ended.out + ended.err
    assert "answers.yaml: no answer to 'curve' (testplans/" in ended.err
    ended = workspace.hil(*workspace.run_arguments)
    assert (ended.code, workspace.folders()) == (4, [])
    assert "the simulated person has no files, and knows what" in ended.err


def test_a_kill_after_a_file_was_given_loses_nothing(tmp_path):
    """It is resumed with the file that the run holds, although the original is gone; it verifies and replays."""
    workspace = make(tmp_path / "workspace", CASES.replace("range(2)", "range(1000)"))
    prepared(workspace.root)
    process = workspace.start_run("--answers", "answers.yaml")
    journal = None
    until = time.monotonic() + 60
    while journal is None or b'"kind":"answer"' not in journal.read_bytes():
        assert time.monotonic() < until, process.poll()
        journal = next(workspace.reports.glob("2*/data/journal.jsonl"), None)
    os.kill(executive(process), signal.SIGKILL)
    finish(process)
    (folder,) = workspace.folders()
    (folder / "data/attachments/half.png.part").write_bytes(PNG[:20])
    (workspace.root / "jig.png").write_bytes(b"another")
    ended = workspace.hil("resume", folder.name, "--answers", "answers.yaml")
    assert ended.code == 0, ended.out + ended.err
    package = Package(folder)
    photo = next(each for each in bodies(package, "answer") if each["name"] == "photo")
    assert (photo["by"], photo["witness"]) == ("Ada (answers file)", "Quinn")
    assert (folder / "data/attachments" / photo["file"]["file"]).read_bytes() == PNG
    assert not list((folder / "data/attachments").glob("*.part"))
    assert (verify(folder).findings, replay(package).differences) == ((), ())


TWO_CASES = """
import pytest

@pytest.mark.requirement("T-050")
def test_missed(operator, supply):
    operator.attach("A photo of the jig", name="photo", accepts=("picture",))
    for _ in range(300):
        supply.coil.voltage()
    operator.attach("The curve", name="curve", accepts=("csv",))

@pytest.mark.requirement("T-050")
def test_after_it(check, supply):
    for _ in range(1000):
        supply.coil.voltage()
    check("T-050", "voltage", supply.coil.voltage())
"""


def journal_with(workspace, process, word):
    """Return the journal of the run once it holds a word."""
    until = time.monotonic() + 60
    journal = None
    while journal is None or word not in journal.read_bytes():
        assert time.monotonic() < until, process.poll()
        journal = next(workspace.reports.glob("2*/data/journal.jsonl"), None)
    return journal


def test_a_run_in_which_a_file_could_not_be_taken_is_resumed(tmp_path):
    """The case of before the kill ends with the reasons that it had, also where the file is there by now."""
    workspace = make(tmp_path / "workspace", TWO_CASES)
    prepared(workspace.root, {"photo": "jig.png", "curve": "curve.csv"})
    answers = (workspace.root / "answers.yaml").read_text().replace("witnesses: {photo: Quinn}\n", "")
    (workspace.root / "answers.yaml").write_text(answers)
    process = workspace.start_run("--answers", "answers.yaml")
    journal_with(workspace, process, b'"kind":"answer"')
    (workspace.root / "curve.csv").rename(workspace.root / "aside.csv")
    journal_with(workspace, process, b'"raised":"Unfit"')
    os.kill(executive(process), signal.SIGKILL)
    finish(process)
    (folder,) = workspace.folders()
    (workspace.root / "aside.csv").rename(workspace.root / "curve.csv")
    ended = workspace.hil("resume", folder.name, "--answers", "answers.yaml")
    assert ended.code == 1, ended.out + ended.err
    package = Package(folder)
    missed, after = (each for each in bodies(package, "case-end"))
    assert "curve.csv: there is no such file; check its path" in missed["reasons"][0]
    assert after["case"].endswith("test_after_it")
    assert (verify(folder).findings, replay(package).differences) == ((), ())
