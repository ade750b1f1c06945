"""Whoever should know is told, and no run waits for it."""

from __future__ import annotations

import fcntl
import json
import os
import subprocess
import sys

import pytest
from case_parts import Written
from typed_events import event_of

from hil.executive.people.notifying import Notifier

KEEPING = """
import json, os, sys
told = {"stdin": json.load(sys.stdin), **{name: os.environ[name] for name in ("HIL_EVENT", "HIL_RUN", "HIL_TEXT")}}
open(os.environ["HIL_EVENT"] + ".json", "w").write(json.dumps({**told, "leader": os.getsid(0) == os.getpid()}))
"""

TRIP = {"kind": "trip", "text": "too hot", "limit": "x"}
LATE = {"kind": "monitor-late", "text": "late", "limit": "x"}


def python(code: str) -> list[str]:
    """Return the command that runs this code."""
    return [sys.executable, "-I", "-c", code]


@pytest.fixture(autouse=True)
def started(monkeypatch):
    """Return the processes that a test starts, and look at its end whether each was reaped."""
    found = []
    start = subprocess.Popen

    def note(*arguments, **options):
        found.append(process := start(*arguments, **options))
        return process

    monkeypatch.setattr("hil.executive.people.notifying.subprocess.Popen", note)
    yield found
    for process in found:
        with pytest.raises(ChildProcessError):
            os.waitpid(process.pid, os.WNOHANG)


def notified(place, command, *events, limit_s=10.0, code=0):
    """Return what was written at the end of a run with these events, and a tick after each."""
    written = Written()
    notifier = Notifier(command, place, limit_s)
    notifier.attach("run-1", written)
    for event in events:
        notifier(event_of(**event))
        notifier.tick()
    notifier.finish(code)
    return [(item["kind"], item["event"], item.get("reason")) for item in written.events]


def test_the_command_is_told_what_happened(tmp_path):
    """As JSON on standard input and as variables, in a session of its own; the order is that of the events."""
    assert notified(tmp_path, python(KEEPING), TRIP, LATE, LATE, code=6) == [
        ("notified", "trip", None),
        ("notified", "stale", None),
        ("notified", "end", None),
    ]
    told = json.loads((tmp_path / "trip.json").read_text())
    assert told["stdin"] == {"event": "trip", "run": "run-1", "text": "too hot"}
    assert (told["HIL_EVENT"], told["HIL_RUN"], told["HIL_TEXT"]) == ("trip", "run-1", "too hot")
    assert told["leader"] is True
    assert json.loads((tmp_path / "end.json").read_text())["HIL_TEXT"] == "the envelope tripped, and the bench is safe"


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        (["/nowhere/tell"], "No such file or directory"),
        (python("raise SystemExit(3)"), "exit code 3"),
        (python("import os; os.kill(os.getpid(), 9)"), "it was ended by signal 9"),
        (["/"], "Permission denied"),
    ],
    ids=["missing", "code", "killed", "folder"],
)
def test_a_failure_is_kept_and_not_raised(tmp_path, capsys, command, reason):
    """The journal and standard error have the reason."""
    assert notified(tmp_path, command) == [("notify-failed", "end", reason)]
    assert f"nobody was notified of 'end': {command[0]}: {reason}" in capsys.readouterr().err


def test_what_takes_too_long_is_killed_with_all_that_it_started(tmp_path):
    """Its children, too: nobody holds the file any more that one of them had locked."""
    lock = tmp_path / "lock"
    child = (
        f"import fcntl; file = open({str(lock)!r}, 'w'); fcntl.flock(file, fcntl.LOCK_EX); import time; time.sleep(60)"
    )
    code = f"import subprocess, sys; subprocess.run([sys.executable, '-I', '-c', {child!r}])"
    told = notified(tmp_path, python(code), limit_s=1.0)
    assert told == [("notify-failed", "end", "it took longer than 1 s")]
    with lock.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)  # the test's timeout ends it if the child lives


def test_a_question_is_told_of_only_while_it_waits(tmp_path):
    """What the simulated person answers at once wakes nobody."""
    question, answer = {"kind": "question", "text": "which way?"}, {"kind": "answer"}
    assert ("notified", "question", None) in notified(tmp_path, ["/bin/true"], question)
    notifier = Notifier(["/nowhere/tell"], tmp_path)
    written = Written()
    notifier.attach("r", written)
    for event in (question, answer):
        notifier(event_of(**event))
    notifier.tick()
    notifier.finish(0)
    assert [event["event"] for event in written.events] == ["end"]


def test_a_question_names_the_command_that_answers_it(tmp_path):
    """Also a long one, whose text is cut."""
    for text in ("which way?", "x" * 5000):
        assert ("notified", "question", None) in notified(tmp_path, python(KEEPING), {"kind": "question", "text": text})
        told = json.loads((tmp_path / "question.json").read_text())["HIL_TEXT"]
        assert told.startswith(text[:900])
        assert told.endswith(
            "x Answer with: hil answer run-1" if "x" in text else "which way? Answer with: hil answer run-1"
        )
        assert len(told) <= 1000


CASES = [{"kind": "planned", "cases": [{"case": name} for name in "abcde"]}]


@pytest.mark.parametrize(
    ("verdicts", "text"),
    [
        (
            ["PASS", "FAIL", "INCONCLUSIVE", "FAIL", None],
            "FAIL: not every case passed: of 5 cases 2 FAIL, 1 NOT_RUN, 1 INCONCLUSIVE",
        ),
        (
            ["PASS", "RECORDED", "PASS", "PASS", "INCONCLUSIVE"],
            "INCONCLUSIVE: not every case passed: of 5 cases 1 INCONCLUSIVE",
        ),
        (["ERROR", "PASS", "PASS", "PASS", "PASS"], "ERROR: not every case passed: of 5 cases 1 ERROR"),
    ],
)
def test_the_end_of_a_run_that_is_no_pass_tells_its_verdict(tmp_path, verdicts, text):
    """And of how many cases how many ended in which."""
    ends = [
        {"kind": "case-end", "case": name, "verdict": verdict} if verdict else {"kind": "not-run", "case": name}
        for name, verdict in zip("abcde", verdicts, strict=True)
    ]
    notified(tmp_path, python(KEEPING), *CASES, *ends, code=1)
    assert json.loads((tmp_path / "end.json").read_text())["HIL_TEXT"] == text


def test_no_text_is_too_long_or_too_odd(tmp_path):
    """A megabyte, zero bytes, and a command that does not read do not hold up the run."""
    events = [{"kind": "trip", "text": "\0" + "ü" * 1_000_000}]
    assert notified(tmp_path, ["/bin/true"], *events)[0] == ("notified", "trip", None)


def test_commands_do_not_pile_up(tmp_path):
    """Of those that hang only a few are there at once."""
    late = [{**LATE, "limit": str(number)} for number in range(6)]
    told = notified(tmp_path, ["/bin/sleep", "60"], *late, limit_s=0.3)
    assert [reason for _, _, reason in told].count("too many commands were still running") == 3


def test_without_a_command_nothing_happens(tmp_path):
    """Nothing is written."""
    assert notified(tmp_path, [], TRIP) == []
