"""The table of endings: whatever ends a run or a check, and whenever, what is true on the bench is safe soon after.

A row is a phase and an ending; add rows to `ROWS`. A sample is tried once; with `--soak` every row is tried
twenty times, at the bench's own speed and at four times that, on a machine that has other things to do. A try takes
some 20 s and 2 to 5 s of one core: it mostly waits for its bench, so that six can go on at once on two cores, which
then are busy: `pytest --soak -n 6 tests/system/test_endings_table.py`. A run that was stopped is replayed in the first
try of its row: what a replay shows does not depend on the instant.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, chdir, contextmanager
from dataclasses import dataclass, replace
from itertools import count, product
from pathlib import Path

import pytest
import sweeps
from click.testing import CliRunner
from live_runs import guardian_of, live_workspace, seconds_until, served
from resumed_runs import without_git
from workspaces import Ended, executive, finish, kill

from hil.bench.lease import latches_of
from hil.cli.main import cli

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

IN_PHASE = {
    # A question that is read from the code would be refused without a terminal before anything is switched on.
    "prompt": 'begun()\nask = operator.confirm\nask("Is every fan turning?", name="fans")',
    "between cases": "pass",
    "sealing": "clock.sleep(1.0)",
    "resuming": 'for _ in iterations("Turn", 9):\n    begun()\n    clock.sleep(36000.0)',
}
"""What the case does, where that brings the run to a phase: it asks with every output on, or passes, or has turns."""

NEXT_CASE = """\
import pytest

@pytest.mark.requirement("LIVE-010")
@pytest.mark.max_duration(36000)
@pytest.mark.repeatable("reading the bench does not change it")
def test_then(clock, thermal, check):
    clock.sleep(36000.0)
    check("LIVE-010", "temperature", thermal.temperature())
"""
"""The case after the one that has every output on."""

_ASKED = ("ctrl-c", "two ctrl-c", "sigterm", "sighup")
_BROKEN = ("killed", "crashed", "hung", "one instant")
_UNGUARDED = ("killed", "crashed")
"""What can end a run whose guardian has left, because all is safe; a stopped process continues, or is killed."""

ROWS = [
    *product(("arming", "resuming", "check", "case", "prompt", "between cases", "safe-off", "sealing"), _ASKED),
    *product(("arming", "resuming", "check", "case", "prompt", "between cases", "safe-off"), _BROKEN),
    *product(("sealing",), _UNGUARDED),
    *product(("arming", "case"), ("supervisor killed",)),
    ("case", "endless loop"),
    ("case", "endless call"),
]
"""Every phase in which an ending is tried: arming, also of a resumed run, an energised check, a case, a prompt, between
two cases, the way to safe, and sealing."""

FEW = [
    ("arming", "ctrl-c"),
    ("resuming", "ctrl-c"),
    ("check", "sighup"),
    ("check", "killed"),
    ("case", "endless loop"),
    ("case", "endless call"),
    ("case", "supervisor killed"),
    ("prompt", "hung"),
    ("between cases", "killed"),
    ("sealing", "sigterm"),
]
"""Those that are tried without a soak; `test_live_endings` tries more."""


def expected(phase: str, name: str) -> Ending:
    """Return the ending as it is to be in a phase: a run whose bench is safe is sealed, or can be, whatever comes."""
    ending = ENDINGS[name]
    if phase == "sealing":
        kept = replace(ending, code=0, said="")
        return kept if name in _ASKED else replace(ending, latched=False, state="INTERRUPTED")
    return replace(ending, said="") if phase == "safe-off" and name in _ASKED else ending


@pytest.fixture(scope="module", params=SPEEDS, ids=lambda speed: f"{speed:g}x")
def bench(request, tmp_path_factory):
    """The battery bench, served for all rows one after the other, beside other work of the machine."""
    with ExitStack() as stack:
        for _ in range(LOADS):
            busy = subprocess.Popen([sys.executable, "-c", "while True: pass"])
            stack.callback(busy.wait)
            stack.callback(busy.kill)
        yield stack.enter_context(served(tmp_path_factory.mktemp("b") / "e", speed=request.param))


BUSY = (
    ("the bench was not armed", "said nothing"),
    ("the bench was not armed", " was set by ", "reads back"),
    ("was switched on and is off",),
    ("the executive was silent for",),
)
"""What a command says, every part of a row, if a busy machine ended it: a reply or a heartbeat was late, or a KA3005P,
which knows the end of a command by a pause (50 ms at four times the speed), took two commands for one unknown one."""


class NotBegunError(Exception):
    """A busy machine let a reply or the executive's heartbeat wait too long before anything was ended; all is safe."""


@contextmanager
def begun(phase: str, bench, workspace) -> Iterator[Target]:
    """Start what is ended, and give it once it is at this phase."""
    place = ("--source", "simulated", "--served", str(bench.folder))
    check = ("bench", "check", "battery", *place, "--energise")
    run = ("run", "on", "--bench", "battery", "--dut", "SIM-BAT-1", *place)
    process = started(workspace, *(check if phase == "check" else run))
    target = Target(process, supervised=phase != "check")
    sign = workspace.root / "on"
    try:
        if phase not in {"arming", "check", "between cases", "sealing"}:
            until(process, sign.exists, 120.0, "the case's outputs on")
        if phase == "resuming":
            target.send(signal.SIGKILL)
            finish(process)
            acknowledge(workspace, workspace.folders()[-1].name)
            resume = ("resume", workspace.folders()[-1].name, "--served", str(bench.folder))
            process = started(workspace, *resume)
            target = Target(process, supervised=True)
        if phase in {"arming", "check", "resuming"}:
            until(process, bench.on, 60.0, "an output on")
        if phase in MARKS:
            pattern, mark = MARKS[phase]
            until(process, lambda: written(workspace, pattern, mark), 120.0, mark or pattern)
        if phase == "safe-off":
            target.send(signal.SIGINT)
        yield target
    finally:
        if process.poll() is None:
            kill(process)
            process.communicate()
        release(workspace)


MARKS = {
    "prompt": ("data/journal.jsonl", '"kind":"question"'),
    "between cases": ("data/journal.jsonl", '"kind":"case-end"'),
    "sealing": ("data/recordings/*.h5", ""),
}
"""By which file of the run, and which text in it, a phase is recognised."""


def written(workspace, pattern: str, mark: str) -> bool:
    """Tell whether the run has written that."""
    found = [file for run in workspace.folders()[-1:] for file in run.glob(pattern)]
    return any(mark in file.read_text(errors="replace") for file in found) if mark else bool(found)


def started(workspace, *words: str) -> subprocess.Popen[str]:
    """Start a command."""
    return workspace.start(*words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)


def until(process, true: Callable[[], object], limit_s: float, what: str) -> None:
    """Wait until something is true, unless the command ends before; what it said is told then.

    Asking a served bench a hundred times a second costs as much of the machine as the run itself.
    """
    seconds_until(lambda: true() or process.poll() is not None, limit_s, what, every_s=0.05)
    if process.poll() is not None:
        told = process.communicate()[0]
        safe = "every output proven" in told or "all outputs are safe" in told
        if safe and any(all(word in told for word in words) for words in BUSY):
            raise NotBegunError(told)
        pytest.fail(f"it ended before {what}: {told}")


def hil(workspace, *words: str) -> Ended:
    """Call a command in this process, which costs a tenth of a process of its own."""
    with chdir(workspace.root):
        told = CliRunner().invoke(cli, words)
    return Ended(told.exit_code, told.output, repr(told.exception))


def acknowledge(workspace, run: str) -> None:
    """Acknowledge what the guardian did once it has ended."""
    seconds_until(lambda: hil(workspace, "ack", run, "--by", "Ada", "--text", "looked at").code == 0, 60.0, "ack")


def release(workspace) -> None:
    """Leave no latch of a try that failed: every later one would be refused."""
    for run in [*workspace.root.glob("reports/[!.]*"), *workspace.root.glob("reports/.visits/*")]:
        if latches_of(run.name) and sys.exc_info()[0] is not None:
            acknowledge(workspace, run.name)


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
    for start in count():
        try:
            end(phase, name, bench, prepared(tmp_path / f"w{start}", phase, name), replayed=attempt == 0)
        except NotBegunError:
            # It was made safe before it could be ended; three times in a row is no matter of a busy machine.
            assert not bench.on()
            if start == 2:
                raise
        else:
            return


def prepared(root: Path, phase: str, name: str):
    """Return a workspace whose plan comes to that phase, and ends in that way where the case itself does it."""
    changes = {'dew_point: "4"': 'dew_point: "4"\n  longest_computation: 1 s'} if name == "endless loop" else {}
    body = IN_PHASE.get(phase) or BODIES.get(name, "clock.sleep(36000.0)")
    workspace = live_workspace(root, body, changes, watched=False)
    if phase == "resuming":
        workspace = without_git(workspace)
        workspace.change("testplans/on/test_on.py", {"step, operator):": "step, iterations):"})
    if phase == "between cases":
        (workspace.plan / "test_then.py").write_text(NEXT_CASE)
    return workspace


def end(phase: str, name: str, bench, workspace, *, replayed: bool) -> None:
    """Bring a run or a check to that phase, end it, and require what is true and what is said then."""
    ending = expected(phase, name)
    with begun(phase, bench, workspace) as target:
        ending.end(target)
        if name not in NO_SAFER:
            seconds_until(lambda: not bench.on(), ending.limit_s, lambda: f"safe, {bench.on()} still on")
            remains_safe(bench)
        ended = finish(target.process)
        out = ended.out + (ended.err or "")
        code = ending.of_check if phase == "check" and ending.of_check is not None else ending.code
        assert ended.code == code, out
        assert ending.said in out, out
        assert "INTERNALERROR" not in out
        if ending.latched:
            require_latched(phase, name, bench, workspace, out)
        elif phase != "check":
            require_left(name, ending, workspace, replayed=replayed)


def require_latched(phase: str, name: str, bench, workspace, out: str) -> None:
    """Require that a person has to look at the bench, and can say so; the state of the run is told."""
    run = name_of(phase, workspace, out)
    seconds_until(lambda: latches_of(run), 10.0, "a latch")
    acknowledge(workspace, run)
    assert not latches_of(run)
    if name in NO_SAFER:
        place = ("--source", "simulated", "--served", str(bench.folder))
        assert hil(workspace, "bench", "safe", "battery", *place).code == 0
    if phase != "check":
        require_state(ENDINGS[name].state, workspace, run)


def require_left(name: str, ending: Ending, workspace, *, replayed: bool) -> None:
    """Require that nothing is latched, and that what is told of a run that was stopped can be replayed."""
    run = workspace.folders()[-1].name
    assert not latches_of(run)
    require_state(ending.state, workspace, run)
    if replayed and (workspace.root / "on").exists() and name == "ctrl-c":
        told = workspace.hil("replay", run)
        assert "INTERNALERROR" not in told.out + told.err


def require_state(state: str, workspace, run: str) -> None:
    """Require what `hil status` calls the run."""
    told = hil(workspace, "status", run).out
    assert re.search(rf"state +{state}\b", told), told
