"""The table of endings: whatever ends a run or a check, and whenever, what is true on the bench is safe soon after.

A row is a phase and an ending; add rows to `ROWS`. A sample is tried once; with `--soak` every row is tried
twenty times, at the bench's own speed and at four times that, on a machine that has other things to do.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import product

import pytest
import sweeps
from live_runs import guardian_of, live_workspace, seconds_until, served
from workspaces import executive, finish, kill

from hil.bench.lease import latches_of

pytestmark = [pytest.mark.system, pytest.mark.alone, pytest.mark.timeout(600)]

TRIES = range(sweeps.chosen(1, 20))
SPEEDS = sweeps.chosen([4.0], [1.0, 4.0])
BESIDE = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1")) > (os.cpu_count() or 1)
LOADS = 0 if BESIDE else sweeps.chosen(0, os.cpu_count() or 1)
"""Processes that keep every core busy; more tries at once than there are cores load the machine by themselves."""
NO_SAFER = frozenset({"one instant"})
"""Endings after which nobody is left: that is said, and the exit code is that of an unsafe end."""


@dataclass(frozen=True)
class Target:
    """What is ended: the command that a person started, and the process that drives the bench."""

    process: subprocess.Popen[str]
    supervised: bool

    @property
    def executive(self) -> int:
        """The process that drives the bench."""
        return executive(self.process) if self.supervised else self.process.pid

    def send(self, *numbers: signal.Signals) -> None:
        """Send signals to the process that drives the bench."""
        for number in numbers:
            os.kill(self.executive, number)


@dataclass(frozen=True)
class Ending:
    """One way to end.

    Attributes:
        end: does it.
        code: the exit code of a run; of a check, which nobody supervises, where it is another one.
        latched: whether a person has to look at the bench before it is driven again.
        state: what `hil status` calls the run.
        said: what standard output and error say somewhere.
        limit_s: within which everything is safe.
    """

    end: Callable[[Target], None]
    code: int
    of_check: int | None = None
    latched: bool = False
    state: str = "SEALED"
    said: str = ""
    limit_s: float = 2.0


def kill_supervisor(target: Target) -> None:
    """Kill the process that waits; whoever reads its output waits for the other one."""
    target.process.kill()


def kill_both(target: Target) -> None:
    """Kill whoever drives the bench, and its guardian."""
    processes = guardian_of(target.executive), target.executive
    for each in processes:
        os.kill(each, signal.SIGKILL)


def stopped(*numbers: signal.Signals) -> Ending:
    """Return an ending by request."""
    return Ending(lambda target: target.send(*numbers), 2, said=f"stopped by {numbers[0].name}")


def nothing(_: Target) -> None:
    """Let the case end itself."""


ENDINGS = {
    "ctrl-c": stopped(signal.SIGINT),
    "two ctrl-c": stopped(signal.SIGINT, signal.SIGINT),
    "sigterm": stopped(signal.SIGTERM),
    "sighup": stopped(signal.SIGHUP),
    "killed": Ending(lambda target: target.send(signal.SIGKILL), 3, -9, latched=True, state="SAFED"),
    "crashed": Ending(lambda target: target.send(signal.SIGSEGV), 3, -11, latched=True, state="SAFED"),
    "hung": Ending(lambda target: target.send(signal.SIGSTOP), 3, -9, latched=True, state="SAFED", limit_s=3.0),
    "one instant": Ending(kill_both, 7, -9, latched=True, state="INTERRUPTED"),
    "supervisor killed": Ending(kill_supervisor, -9, said="stopped by the death of its supervisor"),
    "endless loop": Ending(nothing, 1, said="came to no scheduling point for", limit_s=5.0),
    "endless call": Ending(nothing, 3, latched=True, state="SAFED", limit_s=4.0),
}

BODIES = {
    "endless loop": "begun()\nwhile True:\n    pass",
    "endless call": "import collections, itertools\nbegun()\ncollections.deque(itertools.repeat(0), maxlen=0)",
}
"""What the case does, where that is what ends it."""

ASKING = 'begun()\noperator.confirm("Is every fan turning?", name="fans")'
"""A case that waits for a person, with every output on."""

_ASKED = ("ctrl-c", "two ctrl-c", "sigterm", "sighup")
_BROKEN = ("killed", "crashed", "hung", "one instant")

ROWS = [
    *product(("arming", "check", "case", "prompt", "safe-off"), _ASKED),
    *product(("arming", "check", "case", "prompt", "safe-off"), _BROKEN),
    *product(("arming", "case"), ("supervisor killed",)),
    ("case", "endless loop"),
    ("case", "endless call"),
]
"""Every phase in which an ending is tried: arming, an energised check, a case, a prompt, the way to safe."""

FEW = [
    ("arming", "ctrl-c"),
    ("check", "sighup"),
    ("check", "killed"),
    ("case", "endless loop"),
    ("case", "endless call"),
    ("case", "supervisor killed"),
    ("prompt", "hung"),
]
"""Those that are tried without a soak; `test_live_endings` tries more."""


@pytest.fixture(scope="module", params=SPEEDS, ids=lambda speed: f"{speed:g}x")
def bench(request, tmp_path_factory):
    """The battery bench, served for all rows one after the other, beside other work of the machine."""
    with ExitStack() as stack:
        for _ in range(LOADS):
            busy = subprocess.Popen([sys.executable, "-c", "while True: pass"])
            stack.callback(busy.wait)
            stack.callback(busy.kill)
        yield stack.enter_context(served(tmp_path_factory.mktemp("b") / "e", speed=request.param))


@contextmanager
def begun(phase: str, bench, workspace) -> Iterator[Target]:
    """Start what is ended, and give it once it is at this phase with an output on."""
    place = ("--source", "simulated", "--served", str(bench.folder))
    check = ("bench", "check", "battery", *place, "--energise")
    run = ("run", "on", "--bench", "battery", "--dut", "SIM-BAT-1", *place)
    process = workspace.start(*(check if phase == "check" else run), stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    target = Target(process, supervised=phase != "check")
    sign = workspace.root / "on"
    try:
        if phase in {"arming", "check"}:
            seconds_until(bench.on, 60.0, "an output on")
        else:
            seconds_until(sign.exists, 120.0, "the case's outputs on")
        if phase == "prompt":
            journal = workspace.folders()[-1] / "data/journal.jsonl"
            seconds_until(lambda: '"kind":"question"' in journal.read_text(), 10.0, "a question")
        if phase == "safe-off":
            target.send(signal.SIGINT)
        yield target
    finally:
        if process.poll() is None:
            kill(process)
        release(workspace)


def release(workspace) -> None:
    """Leave no latch of a try that failed: every later one would be refused."""
    for run in [*workspace.root.glob("reports/*"), *workspace.root.glob("reports/.visits/*")]:
        if latches_of(run.name) and sys.exc_info()[0] is not None:
            seconds_until(lambda run=run: acknowledged(workspace, run.name), 60.0, "acknowledged")


def remains_safe(bench) -> None:
    """Require that nothing comes on again."""
    until = time.monotonic() + 1.0
    while time.monotonic() < until:
        assert not bench.on()
        time.sleep(0.05)


def name_of(phase: str, workspace, out: str) -> str:
    """Return the name under which the bench is acknowledged."""
    if phase != "check":
        return workspace.folders()[-1].name
    visits = list((workspace.root / "reports/.visits").glob("*-check-*"))
    assert len(visits) == 1, out
    return visits[0].name


@pytest.mark.parametrize("attempt", TRIES)
@pytest.mark.parametrize(("phase", "name"), sweeps.chosen(FEW, ROWS), ids=lambda part: part)
def test_an_ending(tmp_path, bench, phase, name, attempt):
    """What is true of every output soon after, and what exit code, status and acknowledgement say of it."""
    del attempt
    ending = ENDINGS[name]
    changes = {'dew_point: "4"': 'dew_point: "4"\n  longest_computation: 1 s'}
    body = ASKING if phase == "prompt" else BODIES.get(name, "clock.sleep(36000.0)")
    workspace = live_workspace(tmp_path / "w", body, changes)
    with begun(phase, bench, workspace) as target:
        ending.end(target)
        if name not in NO_SAFER:
            seconds_until(lambda: not bench.on(), ending.limit_s, lambda: f"safe, {bench.on()} still on")
            remains_safe(bench)
        ended = finish(target.process)
        out = ended.out + (ended.err or "")
    unseen = phase == "safe-off" and name in _ASKED
    code = ending.of_check if phase == "check" and ending.of_check is not None else ending.code
    assert ended.code == code, out
    assert unseen or ending.said in out, out
    if not ending.latched:
        return
    run = name_of(phase, workspace, out)
    seconds_until(lambda: acknowledged(workspace, run), 60.0, "acknowledged")
    assert not latches_of(run)
    if name in NO_SAFER:
        place = ("--source", "simulated", "--served", str(bench.folder))
        assert workspace.hil("bench", "safe", "battery", *place).code == 0
    if phase != "check":
        told = workspace.hil("status", run).out
        assert re.search(rf"state +{ending.state}\b", told), told


def acknowledged(workspace, run) -> bool:
    """Tell whether a person could acknowledge what happened; a guardian that is at work comes first."""
    return workspace.hil("ack", run, "--by", "Ada", "--text", "looked at").code == 0
