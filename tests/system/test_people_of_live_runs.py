"""Runs on a served bench and the people they need: on call where nobody attends, and after a guardian that acted."""

from __future__ import annotations

import json
import os
import re
import signal
from contextlib import contextmanager

import pytest
from battery_runs import BatteryWorkspace, battery_workspace
from live_runs import live_workspace, running, seconds_until, served
from resumed_runs import without_git
from terminals import Terminal
from told_as_json import bodies
from workspaces import ROOT, executive, finish, kill

from hil.bench.lease import clear_latches_of
from hil.clock import wall
from hil.evidence.folder import JOURNAL
from hil.evidence.inbox import post
from hil.evidence.journal.reader import read_journal
from hil.evidence.package.contents import Package

pytestmark = [pytest.mark.system, pytest.mark.alone, pytest.mark.timeout(300)]

NOTIFY = 'notify = ["/bin/cp", "/dev/stdin", "told.json"]\n'
RUN = ("run", "on", "--bench", "battery", "--source", "simulated", "--dut", "SIM-BAT-1")
REQUIREMENTS = """\
schema: hil/requirements/1
document: {id: "LIVE", issue: "1.0", title: The plates have a temperature}
requirements:
- {id: LIVE-010, rev: 1, text: The plates shall have a temperature., kind: limit, method: test,
   limits: [{parameter: temperature, unit: degC, min: "-50", max: "90"}]}
"""
PLAN = """\
import pytest

@pytest.mark.requirement("LIVE-010")
@pytest.mark.max_duration(36000)
@pytest.mark.repeatable("reading the bench does not change it")
def test_plates(supply, thermal, check, clock):
    supply.charge.configure(4.2, 0.7)
    supply.charge.enable()
    clock.sleep(SECONDS)
    check("LIVE-010", "temperature", thermal.temperature())
"""

ASKS = {
    "(supply, thermal,": "(operator, supply, thermal,",
    "    supply.charge.configure(": """\
    operator.confirm("Is the fuse in?", name="fuse", safety=True)
    supply.charge.configure(""",
}
"""What lets the case ask before it drives anything."""

IN_TURNS = {
    "(operator, supply,": "(operator, iterations, supply,",
    "    clock.sleep(20.0)": """\
    for _ in iterations("Turn", 2):
        clock.sleep(20.0)""",
}
"""What lets it go on, once it is resumed, after its question."""


@pytest.fixture
def folder(tmp_path_factory):
    """Return a folder of a short name for the sockets of a served bench."""
    return tmp_path_factory.mktemp("s")


def workspace_of(root, *, seconds=0.0):
    """Return a workspace with the bench, which nobody watches after its safe-off, and one short case."""
    text = (ROOT / "fixtures/benches/battery/bench.yaml").read_text(encoding="utf-8")
    after = re.search(r"^watch_after:\n(- .*\n)+", text, re.MULTILINE)
    copied = battery_workspace(root, "battery_charge", {after[0]: ""})
    plan = root / "testplans/on"
    plan.mkdir()
    (plan / "requirements.yaml").write_text(REQUIREMENTS, encoding="utf-8")
    (plan / "parameters.yaml").write_text("schema: hil/parameters/1\nparameters: []\n", encoding="utf-8")
    (plan / "test_on.py").write_text(PLAN.replace("SECONDS", str(seconds)), encoding="utf-8")
    workspace = BatteryWorkspace(root, plan, copied.environment)
    workspace.lock()
    return workspace


@contextmanager
def started(workspace, folder, *options):
    """Start a run on the bench that is served in the folder; nothing of it is left behind."""
    process = workspace.start(*RUN, "--served", str(folder), *options)
    try:
        yield process
    finally:
        if process.poll() is None:
            kill(process)
            process.communicate()


@contextmanager
def at_a_terminal(workspace, *words):
    """Start a command at a terminal, and give what types there once the run asks, and a second has passed.

    Somebody has typed ahead there, which says nothing of a bench that nobody was asked about.
    """
    keyboard, terminal = os.openpty()
    os.write(keyboard, b"no\n" * 2)
    process = workspace.start(*words, stdin=terminal)
    os.close(terminal)

    def typed(text):
        seconds_until(lambda: "question    " in workspace.hil("status", "latest").out, 60, "a question")
        asked = wall.monotonic()
        seconds_until(lambda: wall.monotonic() > asked + 1, 5, "a second")
        os.write(keyboard, text.encode())

    try:
        yield process, typed
    finally:
        if process.poll() is None:
            kill(process)
            process.communicate()
        os.close(keyboard)


def events(workspace, kind):
    """Return the events of a kind of the workspace's only run, as far as it came."""
    (folder,) = workspace.folders()
    return [event for event in bodies(read_journal(folder / JOURNAL)) if event["kind"] == kind]


GIVEN = """\
    operator.attach("A photo of the plates", name="photo", accepts=("picture",))
    supply.charge.configure("""
SEEN = """\
    operator.witness("quality", "The plates are bare", name="bare")
    supply.charge.configure("""
ANSWERS = "schema: hil/answers/1\nby: Ada\nanswers: {bare: 'yes'}\n"


@pytest.mark.parametrize(
    ("asks", "answers", "told"),
    [
        (GIVEN, "", "there is nobody to answer 'photo' (testplans/on/test_on.py:"),
        (SEEN, "", "there is nobody to answer 'bare' (testplans/on/test_on.py:"),
        (GIVEN, ANSWERS.replace("bare: 'yes'", "photo: none.png"), "none.png: there is no such file; check its path"),
        (SEEN, ANSWERS, "'bare' needs a witness (quality), and none is named"),
        (SEEN, ANSWERS + "witnesses: {bare: Ada}\n", "Ada cannot witness an own answer"),
        (SEEN, ANSWERS + "witnesses: {bare: Zoe}\n", "Zoe is not in fixtures/signers.yaml"),
        (SEEN, ANSWERS + "witnesses: {bare: Tess}\n", "Tess has neither this role on "),
    ],
    ids=["no-file", "no-witness", "missing-file", "unnamed", "own", "stranger", "other-role"],
)
def test_what_nobody_answers_ends_the_command_before_anything_is_switched_on(tmp_path, folder, asks, answers, told):
    """Without a terminal: exit 4, no folder of a run, and every output is as it was."""
    workspace = workspace_of(tmp_path / "w")
    case = workspace.root / "testplans/on/test_on.py"
    text = case.read_text().replace("(supply, thermal,", "(operator, supply, thermal,")
    case.write_text(text.replace("    supply.charge.configure(", asks))
    (workspace.root / "fixtures/signers.yaml").write_text(
        "schema: hil/signers/1\nsigners:\n- {principal: ada@x, name: Ada}\n- {principal: tess@x, name: Tess}\n"
        "- {principal: quinn@x, name: Quinn, roles: [{role: quality, since: '2026-01-01'}]}\n"
    )
    given = ()
    if answers:
        (workspace.root / "answers.yaml").write_text(answers)
        given = ("--answers", "answers.yaml")
    with served(folder) as bench:
        ended = workspace.hil(*RUN, "--served", str(folder), *given)
        assert (ended.code, workspace.folders()) == (4, []), ended.out + ended.err
        assert told in ended.err
        assert bench.on() == set()


def test_an_unattended_run_is_armed_once_somebody_on_call_gave_the_code_back(tmp_path, folder):
    """A wrong code is told and changes nothing; name, hour and people are evidence."""
    workspace = workspace_of(tmp_path / "w")
    (workspace.root / "hil.toml").write_text(NOTIFY)
    told = workspace.root / "told.json"
    with served(folder) as bench, started(workspace, folder, "--unattended", "--on-call", "Ada") as process:
        seconds_until(lambda: told.exists() and told.read_text().endswith("}\n"), 60, "the notification")
        sent = json.loads(told.read_text())
        assert sent["event"] == "test"
        assert bench.on() == set()
        (run,) = workspace.folders()
        code = sent["text"].partition("--code ")[2].split()[0]
        post(run, "reached", by="Bob", text="WRONG")
        post(run, "reached", by="Ada", text=code.lower())
        ended = finish(process)
    assert ended.code == 0, ended.out + ended.err
    package = Package(run)
    assert [(event["by"], event["ok"]) for event in bodies(package, "reached")] == [("Bob", False), ("Ada", True)]
    assert ("person on call", True) in [(gate["name"], gate["ok"]) for gate in bodies(package, "host-gate")]
    assert (bodies(package, "run")[0]["unattended"], bodies(package, "run")[0]["on_call"]) == (True, "Ada")
    assert "on call, was reached on call" in package.text("data/report/report.html")


def test_a_safety_confirmation_is_given_at_another_terminal(tmp_path, folder):
    """An unattended run waits for it; it is typed there, by name, and is no word of a command line."""
    workspace = workspace_of(tmp_path / "w")
    workspace.change("testplans/on/test_on.py", ASKS)
    (workspace.root / "hil.toml").write_text(NOTIFY)
    told = workspace.root / "told.json"
    with served(folder) as bench, started(workspace, folder, "--unattended", "--on-call", "Ada") as process:
        seconds_until(lambda: told.exists() and told.read_text().endswith("}\n"), 60, "the notification")
        (run,) = workspace.folders()
        post(run, "reached", by="Ada", text=json.loads(told.read_text())["text"].partition("--code ")[2].split()[0])
        seconds_until(lambda: "question    Is the fuse in?" in workspace.hil("status", "latest").out, 60, "a question")
        assert bench.on() == set()
        refused = workspace.hil("answer", "latest", "yes", "--by", "Eve")
        assert (refused.code, "is a safety confirmation" in refused.err) == (4, True)
        asked = "Is the fuse in? [yes or no]: "
        terminal = Terminal((asked, "perhaps"), (asked, "yes"), ("Your name: ", "Ada"))
        terminal.type("no\nEve\n")
        there = workspace.start("answer", "latest", stdin=terminal.near, stderr=terminal.near)
        terminal.sit()
        answered = finish(there)
        terminal.leave()
        assert answered.code == 0, answered.out + terminal.shown
        assert "input typed before this question was asked is discarded" in terminal.shown
        assert answered.out.splitlines()[-1] == "answered fuse: yes (Ada)"
        ended = finish(process)
    assert ended.code == 0, ended.out + ended.err
    assert "answer it with hil answer" in ended.err
    (answer,) = bodies(Package(run), "answer")
    assert (answer["name"], answer["value"], answer["by"]) == ("fuse", True, "Ada")
    again = workspace.hil("replay", "latest")
    assert again.code == 0, again.out + again.err


@pytest.mark.parametrize("said", ["yes", pytest.param("no", marks=pytest.mark.soak)])
def test_a_run_is_resumed_whose_person_took_time_to_answer(tmp_path, folder, said):
    """Its bench was looked after meanwhile, which the resumed run comes to again.

    What was confirmed is asked again; who says no then has taken no time from the safe-off that follows, and the run
    can be resumed once that is put right. A replay takes that answer from the record, too, and asks nobody.
    """
    workspace = without_git(workspace_of(tmp_path / "w", seconds=20.0))
    workspace.change("testplans/on/test_on.py", ASKS)
    workspace.change("testplans/on/test_on.py", IN_TURNS)
    with served(folder) as bench:
        with at_a_terminal(workspace, *RUN, "--served", str(folder), "--operator", "Ada") as (killed, typed):
            typed("yes\n")
            seconds_until(lambda: events(workspace, "step"), 60, "its first turn")
            os.kill(executive(killed), signal.SIGKILL)
            finish(killed)
        (run,) = workspace.folders()
        try:
            acknowledge = ("ack", run.name, "--by", "Ada", "--text", "cold")
            seconds_until(lambda: workspace.hil(*acknowledge).code == 0, 30, "ack")
            with at_a_terminal(workspace, "resume", run.name, "--served", str(folder), "--ask") as (again, typed):
                typed(f"{said}\n")
                ended = finish(again)
        finally:
            clear_latches_of(run.name)
        assert bench.on() == set()
    assert ended.code == (0 if said == "yes" else 2), ended.out + ended.err
    assert "input typed before this question was asked is discarded" in ended.err
    assert "NOT SAFE" not in ended.out
    package = Package(run)
    (question, answer) = bodies(package, "question", "answer")
    assert answer["t"] - question["t"] > 1
    assert [(told["by"], told["value"]) for told in bodies(package, "confirmed")] == [("Ada", said == "yes")]
    replayed = workspace.hil("replay", run.name)
    assert replayed.code == 0, replayed.out + replayed.err


def test_an_unattended_run_that_reaches_nobody_is_not_armed(tmp_path, folder):
    """It ends as any run whose bench was not armed, and nothing was ever on."""
    workspace = workspace_of(tmp_path / "w")
    (workspace.root / "hil.toml").write_text(NOTIFY)
    with (
        served(folder),
        started(workspace, folder, "--unattended", "--on-call", "Ada", "--acknowledge-within", "0.005") as process,
    ):
        ended = finish(process)
    assert ended.code == 1, ended.out + ended.err
    assert "nobody gave the code of the notification back within 0.3 s" in ended.out
    assert events(workspace, "armed") == []
    assert [end["verdict"] for end in events(workspace, "results")] == ["NOT_RUN"]
    replayed = workspace.hil("replay", "latest")
    assert replayed.code == 0, replayed.out + replayed.err


def test_a_detached_run_on_a_live_bench_is_an_unattended_one(tmp_path, folder):
    """It is refused with all that it lacks, before it leaves a folder."""
    workspace = workspace_of(tmp_path / "w")
    with served(folder), started(workspace, folder, "--detach") as process:
        ended = finish(process)
    assert ended.code == 4
    assert "name who is on call with --on-call NAME; name a command that notifies people" in ended.err
    assert workspace.folders() == []


def test_after_the_guardian_acted_a_named_person_comes_first(tmp_path, folder):
    """SAFED and latched: no run, no resume, no energised check, until somebody looked at the bench and says so."""
    workspace = workspace_of(tmp_path / "w", seconds=36000.0)
    check = ("bench", "check", "battery", "--source", "simulated", "--served", str(folder))
    with served(folder) as bench:
        with started(workspace, folder) as killed:
            seconds_until(bench.on, 100, "the supply on in the case")
            os.kill(executive(killed), signal.SIGKILL)
            finish(killed)
        (run,) = workspace.folders()
        try:
            seconds_until(lambda: "SAFED" in workspace.hil("status", "latest").out, 20, "SAFED")
            status = workspace.hil("status", "latest").out
            assert f"latched until hil ack {run.name}" in status
            with started(workspace, folder) as again:
                refused = finish(again)
            assert refused.code == 4
            assert "bench 'battery' is latched since" in refused.err
            assert f'hil ack {run} --by NAME --text "what was seen and done"' in refused.err
            assert workspace.hil("resume", "latest", "--served", str(folder)).code == 4
            assert workspace.hil(*check, "--energise").code == 4
            looked_at = workspace.hil(*check)
            assert looked_at.code == 1
            assert "NOT OK  not latched: bench 'battery' is latched since" in looked_at.out
            seconds_until(lambda: workspace.hil("ack", "latest", "--by", "Ada", "--text", "cold").code == 0, 30, "ack")
            assert "is latched" not in workspace.hil(*check, "--energise").err
        finally:
            clear_latches_of(run.name)
    assert workspace.hil("seal", "latest").code == 0
    (said,) = events(workspace, "acknowledged")
    assert (said["by"], said["text"]) == ("Ada", "cold")
    assert workspace.hil("verify", "latest").out.splitlines()[0].endswith("SEALED, the run is incomplete")


@pytest.mark.soak
def test_whoever_is_notified_of_a_death_learns_what_the_guardian_did(tmp_path_factory):
    """The process that waited for the run waits for the guardian, too, and tells that the bench is safe and latched."""
    workspace = live_workspace(tmp_path_factory.mktemp("w") / "w")
    (workspace.root / "hil.toml").write_text(NOTIFY, encoding="utf-8")
    with served(tmp_path_factory.mktemp("b") / "e", speed=4.0) as bench, running(bench, workspace) as run:
        (workspace.root / "told.json").unlink(missing_ok=True)
        name = run.folder.name
        run.send(signal.SIGKILL)
        ended = run.ended()
        told = json.loads((workspace.root / "told.json").read_bytes())
        assert workspace.hil("ack", name, "--by", "Ada", "--text", "everything is off").code == 0
    assert (ended.code, told["event"], told["run"]) == (3, "died", name)
    assert (
        "was ended by SIGKILL before the run was sealed; the guardian finished: every output is proven safe; "
        in told["text"]
    )
    assert f"the bench is latched and waits for hil ack {name}; " in told["text"]
    assert f"hil resume {workspace.root}" in told["text"]
