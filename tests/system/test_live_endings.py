"""Runs on a served bench with every output on, ended in every way: what is true on the bench is safe soon after."""

from __future__ import annotations

import json
import os
import re
import signal
from contextlib import ExitStack
from pathlib import Path

import pytest
import sweeps
from live_runs import live_workspace, running, seconds_until, served
from workspaces import kill

pytestmark = [pytest.mark.system, pytest.mark.alone, pytest.mark.timeout(1200)]

TIMES = int(os.environ.get("HIL_STRESS", sweeps.chosen("1", "3")))
"""How often each ending is tried."""

SPEED = float(os.environ.get("HIL_SPEED", "4"))
LIMIT_S = 2.0
HANG_LIMIT_S = 3.0

HALF_FRAMES = """\
begun()
for fd in map(int, os.listdir("/proc/self/fd")):
    place = os.readlink(f"/proc/self/fd/{fd}") if os.path.exists(f"/proc/self/fd/{fd}") else ""
    if place.startswith("/dev/pts/"):
        os.write(fd, b"\\x01\\x06\\x00:17 STA")
    elif place.startswith("socket:") and stat.S_ISSOCK(os.fstat(fd).st_mode):
        try:
            os.write(fd, b":OUTP CH1,O")
        except OSError:
            pass
os.kill(os.getpid(), signal.SIGKILL)"""


@pytest.fixture(params=range(TIMES), autouse=True)
def _attempt(request):
    """Try each ending so often."""
    return request.param


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """The battery bench, served for all of these runs one after the other."""
    with served(tmp_path_factory.mktemp("b") / "e", speed=SPEED) as bench:
        yield bench


def safe_after(run, limit_s=LIMIT_S):
    """Return after how many seconds every output is in its safe state, by what is true."""
    return seconds_until(lambda: not run.bench.on(), limit_s, lambda: f"safe, {run.bench.on()} still on")


def require_latched(run):
    """Require that the guardian acted and the bench waits for a person, who then takes it over."""
    lines = [json.loads(line) for line in (run.folder / "data/guardian.jsonl").read_text().splitlines()]
    assert lines[-1]["unproven"] == []
    require_acknowledged(run)


def require_acknowledged(run):
    """Require that nobody drives the bench before a named person has looked at it."""
    refused = run.workspace.hil(*run.command)
    assert refused.code == 4
    assert re.search(f"is (latched since .* by|held by) .*{run.folder.name}", refused.err)
    assert run.workspace.hil("ack", run.folder.name, "--by", "Ada", "--text", "everything is off").code == 0


def await_end_of(process):
    """Wait until a process has ended by itself."""
    seconds_until(lambda: not Path(f"/proc/{process}").exists(), 30.0, "the guardian's end")


@pytest.mark.parametrize(
    ("signals", "code"),
    [
        ([signal.SIGINT], 2),
        pytest.param([signal.SIGINT, signal.SIGINT], 2, marks=pytest.mark.soak),
        ([signal.SIGTERM], 2),
        pytest.param([signal.SIGHUP], 2, marks=pytest.mark.soak),
    ],
    ids=["one-ctrl-c", "two-ctrl-c", "sigterm", "sighup"],
)
def test_a_run_that_is_asked_to_end(tmp_path, bench, signals, code):
    """It makes its own bench safe, and the guardian goes without having acted."""
    with running(bench, live_workspace(tmp_path / "w")) as run:
        for number in signals:
            run.send(number)
        safe_after(run)
        assert run.ended().code == code
        assert not (run.folder / "data/guardian.jsonl").exists()


@pytest.mark.soak
def test_an_exception_in_a_case(tmp_path, bench):
    """The bench comes to rest at once; the case is an ERROR."""
    with running(bench, live_workspace(tmp_path / "w", 'raise RuntimeError("an error of the case")')) as run:
        safe_after(run)
        assert run.ended().code == 1


def test_an_executive_that_is_killed(tmp_path, bench):
    """The guardian makes the bench safe and latches it."""
    with running(bench, live_workspace(tmp_path / "w")) as run:
        guardian = run.guardian
        run.send(signal.SIGKILL)
        safe_after(run)
        assert run.ended().code == 3
        await_end_of(guardian)
        require_latched(run)


def test_an_executive_that_is_killed_amid_a_frame(tmp_path, bench):
    """Half a frame on every line keeps the guardian's bytes from nothing."""
    with running(bench, live_workspace(tmp_path / "w", HALF_FRAMES)) as run:
        safe_after(run)
        assert run.ended().code == 3
        seconds_until(lambda: _done(run), 30.0, "the guardian's end")
        require_latched(run)


def test_an_executive_that_hangs(tmp_path, bench):
    """A stopped executive is ended for good; revived it could drive again."""
    with running(bench, live_workspace(tmp_path / "w")) as run:
        guardian = run.guardian
        run.send(signal.SIGSTOP)
        safe_after(run, HANG_LIMIT_S)
        assert run.ended().code == 3
        await_end_of(guardian)
        require_latched(run)


def test_a_guardian_that_dies(tmp_path, bench):
    """The executive goes on with nothing that nobody watches over; it proves the bench safe, and can be resumed."""
    with running(bench, live_workspace(tmp_path / "w")) as run:
        os.kill(run.guardian, signal.SIGKILL)
        safe_after(run)
        ended = run.ended()
        assert ended.code == 2
        assert "stopped by a lost guardian: the guardian is gone" in ended.out
        shown = run.workspace.hil("status", run.folder.name).out
        assert re.search(rf"state +INTERRUPTED\n(.*\n)*next +hil resume {run.folder.name}\n", shown)


def _done(run):
    journal = run.folder / "data/guardian.jsonl"
    return journal.exists() and '"done"' in journal.read_text()


def test_executive_and_guardian_in_one_instant(tmp_path, bench):
    """Nobody is left to make it safe, but the bench was latched when it was armed: a person has to look at it."""
    with running(bench, live_workspace(tmp_path / "w")) as run:
        for process in (run.guardian, run.executive):
            os.kill(process, signal.SIGKILL)
        assert run.ended().code == 7
        require_acknowledged(run)
        at = ("--source", "simulated", "--served", str(bench.folder))
        assert run.workspace.hil("bench", "safe", "battery", *at).code == 0
        assert not bench.on()


def test_a_port_that_is_pulled(tmp_path, bench):
    """What is reachable is safe at once; the charger, whose port is gone, is cut off by the tester's open relays.

    The supply of the coolers and the tester's relays are reached by ports of their own.
    """
    with running(bench, live_workspace(tmp_path / "w")) as run:
        bench.ask(unplug="psu1")
        reachable = {"psu2.output.on", "contact charge", "contact discharge", "coolers"}
        seconds_until(lambda: not bench.on() & reachable, LIMIT_S, lambda: f"safe, {bench.on()} still on")
        ended = run.ended()
        assert ended.code == 7
        assert "stopped by a lost port: psu1: its port is gone" in ended.out
        shown = run.workspace.hil("status", run.folder.name).out
        assert re.search(r"state +INTERRUPTED\n(.*\n)*guardian +trying since .*; NOT PROVEN SAFE: .*apparatus", shown)
        assert re.search(rf"next +hil ack .*, then hil resume {run.folder.name}\n", shown)
        bench.ask(plug="psu1")
        seconds_until(lambda: not bench.on(), LIMIT_S, lambda: f"safe, {bench.on()} still on")
        journal = run.folder / "data/guardian.jsonl"
        seconds_until(lambda: '"event": "done"' in journal.read_text(), 30.0, "the guardian's proof")
        assert re.search(r"state +SAFED\n", run.workspace.hil("status", run.folder.name).out)
        require_acknowledged(run)
        assert run.workspace.hil("seal", run.folder.name).code == 0
        replayed = run.workspace.hil("replay", run.folder.name)
        assert "no recorded case ran to its end" in replayed.out


def test_a_served_bench_that_is_killed(tmp_path):
    """The run ends as with any lost port, and nobody writes to the programs that get the terminals of the dead bench.

    The guardian, which tries on, would type into somebody's shell, or switch off another bench.
    """
    with served(tmp_path / "e", speed=SPEED) as bench, running(bench, live_workspace(tmp_path / "w")) as run:
        names = {str(each.readlink()) for each in bench.folder.iterdir() if each.is_symlink()}
        kill(bench.process)
        with ExitStack() as stack:
            others = taken_over(names, stack)
            ended = run.ended()
            assert ended.code == 7
            assert re.search(r"^stopped by a lost port: .*: its port is gone$", ended.out, re.MULTILINE)
            assert "Traceback" not in ended.out + ended.err
            journal = run.folder / "data/guardian.jsonl"
            refused = [f"{name} leads to a terminal that another program has opened since" for name in ("tec1", "psu2")]
            seconds_until(lambda: all(each in journal.read_text() for each in refused), 60.0, "tried at each terminal")
            assert {name: heard_by(near) for name, near in others.items()} == dict.fromkeys(names, b"")
        assert run.workspace.hil("ack", run.folder.name, "--by", "Ada", "--text", "it was simulated").code == 0


def taken_over(names, stack):
    """Open terminals of these names once they are free; return the near side of each by the far one's name."""
    others = {}

    def opens():
        near, far = os.openpty()
        with ExitStack() as closing:
            closing.callback(os.close, near)
            closing.callback(os.close, far)
            if os.ttyname(far) in names:
                os.set_blocking(near, False)
                others[os.ttyname(far)] = near
                stack.push(closing.pop_all())
        return others.keys() == names

    seconds_until(opens, 30.0, "the names of the dead bench")
    return others


def heard_by(terminal):
    """Return what was written to the far side of a terminal."""
    try:
        return os.read(terminal, 4096)
    except BlockingIOError:
        return b""


def test_a_supply_that_refuses(tmp_path):
    """An output that stays on is an unsafe end with its own exit code, and latches the bench."""
    with served(tmp_path / "e", speed=SPEED) as bench, running(bench, live_workspace(tmp_path / "w")) as run:
        bench.ask(fault={"device": "psu1", "kind": "refuse-off"})
        run.send(signal.SIGINT)
        ended = run.ended()
        assert ended.code == 7
        assert re.search(r"NOT SAFE|not safe|is not off", ended.out)
        assert "psu1.channels.1.on" in bench.on()
        require_acknowledged(run)
