"""A run that died tells nobody, so whoever waited for it does."""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import time

import pytest

from hil.bench.lease import Lease, latch_bench
from hil.cli import supervision
from hil.cli.died import not_proven, tell_of_death
from hil.evidence.folder import GUARDIAN, create, hold
from hil.guardian.latch import Latch

KEEPING = """
import json, os, signal, sys
blocked = sorted(signal.pthread_sigmask(signal.SIG_BLOCK, ()))
open("told.json", "w").write(json.dumps({**json.load(sys.stdin), "blocked": blocked}))
"""


@pytest.fixture
def place(tmp_path, monkeypatch):
    """Return a workspace that keeps what is notified, as the present folder."""
    command = json.dumps([sys.executable, "-I", "-c", KEEPING])
    (tmp_path / "hil.toml").write_text(f"notify = {command}\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run_of(place):
    """Return the folder of a run of that workspace, with nothing in its journal."""
    folder = create(place / "reports", bench="b", dut="d")
    (folder / "data/journal.jsonl").touch()
    return folder


def told(place):
    """Return what was notified."""
    return json.loads((place / "told.json").read_text(encoding="utf-8"))


def test_who_waited_tells_of_the_death(place, capsys):
    """Run, how it ended, and the next commands; the command has no signals blocked that its parent has."""
    folder = run_of(place)
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM, signal.SIGCHLD})
    try:
        assert supervision._believed(signal.SIGKILL, {"begun": (0, str(folder))}) == 3
        os.kill(os.getpid(), 0)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    found = told(place)
    assert (found["event"], found["run"], found["blocked"]) == ("died", folder.name, [])
    assert found["text"].startswith("the process of the run was ended by SIGKILL before the run was sealed; ")
    assert f"hil status {folder.name}" in found["text"]
    assert f"hil seal {folder}" in found["text"]
    assert "guardian" not in found["text"]
    assert "nobody was notified" not in capsys.readouterr().err


def test_a_run_that_died_right_after_its_seal_is_not_called_unsealed(place, capsys):
    """Nothing is resumed or sealed as it is: the package is verified, and entered in the ledger."""
    folder = run_of(place)
    (folder / "bagit.txt").touch()
    assert supervision._believed(signal.SIGKILL, {"begun": (0, str(folder))}) == 3
    said = "the process of the run was ended by SIGKILL after the run was sealed and before its package was verified"
    way = f"verify the package, and enter its seal in the ledger: hil seal {folder.name}"
    assert capsys.readouterr().err == f"hil: {said}\n     {way}\n"
    assert told(place)["text"] == f"{said}; {way}"


@pytest.mark.parametrize(
    ("code", "others", "notified"),
    [(3, {}, True), (3, {"sealed": (3, "/r")}, False), (2, {}, False), (0, {}, False)],
    ids=["unsealed", "sealed", "stopped", "good"],
)
def test_a_process_that_leaves_its_run_unsealed_by_an_error_is_told_of_as_well(place, capsys, code, others, notified):
    """It has said itself what went wrong, and on the terminal nothing is added; whoever is not there is notified."""
    folder = run_of(place)
    assert supervision._believed(code << 8, {"begun": (0, str(folder)), **others, "ended": (code, "")}) == code
    assert (place / "told.json").exists() is notified
    if notified:
        assert told(place)["text"].startswith(
            "the process of the run ended with exit code 3 before the run was sealed;"
        )
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("words", [{}, {"begun": (0, "x"), "sealed": (0, "x")}, {"begun": (0, "x"), "ended": (1, "x")}])
def test_nobody_is_told_of_what_did_not_die(place, words):
    """A run that had not begun, was sealed, or ended by itself has told what there was to tell."""
    supervision._believed(signal.SIGKILL, words)
    assert not (place / "told.json").exists()


@pytest.mark.parametrize(
    ("unproven", "said"),
    [
        ([], "the guardian finished: every output is proven safe"),
        (["supply.a"], "the guardian finished: NOT PROVEN SAFE: supply.a"),
    ],
)
def test_what_the_guardian_wrote_down_is_told(place, unproven, said):
    """Whether everything is safe, and that somebody has to acknowledge it."""
    folder = run_of(place)
    lines = [{"event": "acting", "why": "the executive died"}, {"event": "done", "unproven": unproven}]
    (folder / GUARDIAN).write_text("".join(f"{json.dumps(line)}\n" for line in lines), encoding="utf-8")
    tell_of_death(folder, "was ended by SIGKILL", [])
    assert said in told(place)["text"]
    assert f"the bench is latched and waits for hil ack {folder.name}" in told(place)["text"]


def test_a_guardian_that_takes_long_is_not_waited_for_for_ever(place):
    """It is told that it is not done; its run's folder is held as long as it works."""
    folder = run_of(place)
    with hold(folder):
        tell_of_death(folder, "was ended by SIGKILL", [], guardian_s=0.2)
    assert "the guardian has not finished yet" in told(place)["text"]


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ("", ""),
        ('notify = ["/nowhere/tell"]', "nobody was notified of 'died': /nowhere/tell: No such file or directory"),
        ('notify = ["/bin/sleep", "60"]', "nobody was notified of 'died': /bin/sleep: it took longer than 0.2 s"),
        ("notify = 1", "nobody was notified of 'died': hil.toml"),
    ],
    ids=["nobody", "missing", "slow", "wrong"],
)
def test_a_command_that_fails_is_said_and_holds_nothing_up(place, capsys, settings, said):
    """Nothing is run where nobody is named; the ending goes on within the stated time."""
    folder = run_of(place)
    (place / "hil.toml").write_text(f"{settings}\n", encoding="utf-8")
    began = time.monotonic()
    tell_of_death(folder, "was ended by SIGKILL", [], command_s=0.2)
    assert time.monotonic() - began < 10.0
    assert said in capsys.readouterr().err
    assert not (place / "told.json").exists()


@pytest.fixture
def latches(tmp_path, monkeypatch):
    """Return a folder of latches, and one of leases, of this test's own."""
    monkeypatch.setattr("hil.guardian.latch.PLACES", (tmp_path / "latches",))
    monkeypatch.setattr("hil.bench.lease._FOLDER", tmp_path / "leases")
    return tmp_path / "latches"


def latch_of(run, *outputs):
    """Return the latch of a run's bench."""
    return Latch(bench="b", run=str(run), why="armed", since="2026-01-01T00:00:00Z", outputs=outputs)


def test_what_nobody_proved_safe_is_an_unsafe_end(place, latches, capsys):
    """The guardian was killed, too: the outputs are named, and the exit code is that of an unsafe end."""
    folder = run_of(place)
    latch_bench(["psu1", "psu2"], latch_of(folder, "supply.charge", "cycler"), latches)
    assert supervision._believed(signal.SIGKILL, {"begun": (0, str(folder))}) == 7
    assert "NOT PROVEN SAFE: supply.charge, cycler; go to the bench" in capsys.readouterr().err
    assert supervision._believed(0, {"begun": (0, str(folder)), "ended": (3, str(folder))}) == 7
    assert supervision._believed(0, {"begun": (0, str(folder)), "ended": (1, str(folder))}) == 1


def test_a_guardian_that_proved_everything_leaves_an_interrupted_run(place, latches):
    """It is latched, and nothing is on."""
    folder = run_of(place)
    latch_bench(["psu1"], latch_of(folder), latches)
    assert not_proven(folder) == ()
    assert supervision._believed(signal.SIGKILL, {"begun": (0, str(folder))}) == 3


def test_a_guardian_at_work_is_waited_for(place, latches):
    """What it proves meanwhile counts; what it does not prove in time is told."""
    folder = run_of(place)
    latch_bench(["psu1"], latch_of(folder, "supply"), latches)
    lease = Lease(["psu1"], "a run")
    lease.name(folder.name)
    assert not_proven(folder, guardian_s=0.1) == ("supply",)
    proven = threading.Timer(0.2, lambda: latch_bench(["psu1"], latch_of(folder), latches))
    proven.start()
    assert not_proven(folder, guardian_s=20.0) == ()
    proven.join()
    lease.release()
