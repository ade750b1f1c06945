"""Starting a guardian, and what the executive is told when that does not work."""

from __future__ import annotations

import fcntl
import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
from guarded import Instrument, output_of, plan_of, until

import hil.guardian
from hil.guardian import client
from hil.guardian.client import Guardian
from hil.model.errors import GuardianLost, Refused

MAIN = Path(hil.guardian.__file__).with_name("__main__.py")


@pytest.fixture
def psu():
    """Return an instrument."""
    instrument = Instrument()
    yield instrument
    instrument.close()


@pytest.fixture
def plan(tmp_path):
    """Return a plan with one output."""
    return plan_of(tmp_path, output_of("one", "psu"), hang_s=0.2)


def test_a_guardian_that_never_watched_leaves_without_a_trace(plan, psu):
    """An arming that was refused drives nothing and latches nothing; closing twice is harmless."""
    guardian = Guardian.start(plan, {"psu": psu.near})
    process = os.pidfd_open(guardian.pid)
    guardian.close()
    guardian.close()
    assert until(process, 0.0)
    os.close(process)
    assert psu.heard == []
    assert not Path(plan.latches[0]).exists()


def test_nothing_of_its_surroundings_matters(plan, psu, tmp_path, monkeypatch):
    """Modules in the present folder, variables and standard descriptors of the executive change nothing."""
    hostile = tmp_path / "hostile"
    hostile.mkdir()
    for name in ("json", "socket", "hil", "sitecustomize"):
        (hostile / f"{name}.py").write_text("raise SystemExit(9)")
    monkeypatch.setenv("PYTHONPATH", str(hostile))
    monkeypatch.setenv("PYTHONHOME", str(hostile))
    monkeypatch.chdir(hostile)
    guardian = Guardian.start(replace(plan, journal="guardian.jsonl"), {"psu": psu.near})
    assert all(each.ok for each in guardian.drill())
    guardian.close()


class Stop(BaseException):
    """Somebody asked to stop."""


@pytest.mark.parametrize("looks", [1, 4], ids=["while it starts", "while it is drilled"])
def test_a_guardian_that_is_not_needed_any_more_is_gone_at_once(plan, psu, looks):
    """Whoever is asked to stop while it starts or drills does not wait for it; it does nothing any more."""
    left = iter(range(looks))

    def look():
        if next(left, None) is None:
            raise Stop

    began = time.monotonic()
    with pytest.raises(Stop):
        Guardian.start(replace(plan, hang_s=30.0), {"psu": psu.near}, look=look).drill()
    assert time.monotonic() - began < 5.0
    assert not Path(plan.latches[0]).exists()
    assert not Path(plan.journal).exists()


def test_a_lease_outlives_who_took_it(plan, psu, tmp_path):
    """The guardian keeps the lock of a lease until it is done."""
    lease = os.open(tmp_path / "lease", os.O_RDWR | os.O_CREAT)
    fcntl.flock(lease, fcntl.LOCK_EX)
    guardian = Guardian.start(plan, {"psu": psu.near}, [lease])
    os.close(lease)
    other = os.open(tmp_path / "lease", os.O_RDWR)
    with pytest.raises(BlockingIOError):
        fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)
    guardian.close()
    fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)
    os.close(other)


def test_a_port_that_is_not_given_is_named(plan):
    """Nothing is started without every port."""
    with pytest.raises(Refused, match="no port of psu; open every port"):
        Guardian.start(plan, {})


@pytest.mark.parametrize("what", ["journal", "latches", "plan", "locks"])
def test_what_it_could_not_do_later_is_refused_at_the_start(plan, psu, tmp_path, what):
    """A folder that cannot be written, or a plan that cannot be carried out, is told before anything is driven."""
    (tmp_path / "file").touch()
    wrong = {
        "journal": {"journal": str(tmp_path / "nowhere" / "guardian.jsonl")},
        "latches": {"latches": (str(tmp_path / "file" / "one.latch"),)},
        "plan": {"ports": (*plan.ports, *plan.ports), "outputs": (replace(plan.outputs[0], device="other"),)},
        "locks": {},
    }
    locks = [psu.near] * 300 if what == "locks" else []
    with pytest.raises(Refused, match=r"does not start: .*; nothing was driven"):
        Guardian.start(replace(plan, **wrong[what]), {"psu": psu.near}, locks)
    assert psu.heard == []


def test_a_program_that_is_none_is_refused(plan, psu, monkeypatch, tmp_path):
    """An interpreter that is gone, or ends at once, is no traceback."""
    monkeypatch.setattr(client.sys, "executable", "/bin/false")
    with pytest.raises(Refused, match="the guardian is gone"):
        Guardian.start(plan, {"psu": psu.near})
    monkeypatch.setattr(client.sys, "executable", str(tmp_path / "nothing"))
    with pytest.raises(Refused, match="No such file"):
        Guardian.start(plan, {"psu": psu.near})


def test_whoever_lost_its_guardian_is_told_at_everything(plan, psu):
    """Beats, drill, watch and disarming all say so, with a hint."""
    guardian = Guardian.start(plan, {"psu": psu.near})
    os.kill(guardian.pid, 9)
    guardian._process.wait()
    for ask in (guardian.drill, guardian.watch, guardian.disarm, lambda: guardian.beat(0.0)):
        with pytest.raises(GuardianLost, match="the guardian is gone; check whether"):
            ask()
    guardian.close()


@pytest.mark.parametrize("arguments", [[], ["0"], ["x"]])
def test_nobody_starts_it_by_hand(arguments):
    """Without the executive's end of a channel it says so, without a traceback."""
    command = [sys.executable, "-I", "-S", MAIN, *arguments]
    ended = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False)
    assert (ended.returncode, ended.stderr) == (1, b"hil starts its guardian itself; do not start it by hand\n")
