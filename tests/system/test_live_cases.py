"""Cases on a served bench that ask, compute, are held and are stopped: looked after all the while, and replayed."""

from __future__ import annotations

import subprocess
from contextlib import contextmanager

import pytest
from live_runs import LiveRun, live_workspace, put_away, seconds_until, served
from resumed_runs import without_git
from told_as_json import bodies, results_as_json

from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify

pytestmark = [pytest.mark.system, pytest.mark.alone, pytest.mark.timeout(400)]

SPEED = 4.0
SIGNATURE = {"clock, check, step, operator)": "clock, record, iterations, operator, check, step)"}
ANSWERS = 'schema: hil/answers/1\nanswers: {ready: "yes"}\n'
NO_ANSWERS = "schema: hil/answers/1\nanswers: {}\n"

ASKS_AND_COMPUTES = """\
operator.confirm("Is the box closed?", name="ready")
total = 0.0
until = time.monotonic() + 1.5
while time.monotonic() < until:
    total += sum(range(1000))
with step("Wait after it"):
    clock.sleep(120.0)
    clock.sleep(90.0)"""
"""The controller of the coolers looks at its setpoint once a minute."""

ONE_LONG_CALL = """\
signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGALRM})
time.sleep(SECONDS)
signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGALRM})"""
"""What comes of a call into C: no signal is handled before it returns. This one takes no part of a busy machine."""

TURNS = """\
for turn in iterations("Turn", 3):
    if cycler.state() != "charge":
        cycler.prepare(1, time=7200.0)
        cycler.start()
    Path(f"turn{turn}").touch()
    clock.sleep(20.0)"""


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """The battery bench, served for all of these runs one after the other."""
    with served(tmp_path_factory.mktemp("b") / "e", speed=SPEED) as bench:
        yield bench


@contextmanager
def going(bench, root, body):
    """Start a run whose case does this with every output on; nothing of it is left behind."""
    workspace = without_git(live_workspace(root, body))
    workspace.change("testplans/on/test_on.py", SIGNATURE)
    answers = ANSWERS if '"ready"' in body else NO_ANSWERS
    (root / "answers.yaml").write_text(answers, encoding="utf-8")
    words = ("run", "on", "--bench", "battery", "--dut", "SIM-BAT-1", "--source", "simulated", "--answers")
    process = workspace.start(
        *words, "answers.yaml", "--served", str(bench.folder), stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    run = LiveRun(bench, workspace, process)
    try:
        yield run
    finally:
        put_away(process, workspace)
        process.stdout.close()


def come_to(run, what):
    """Wait until what a case tells by a file is told."""
    path = run.workspace.root / what

    def told():
        if run.process.poll() is not None:
            raise AssertionError(run.process.communicate()[0])
        return path.exists()

    seconds_until(told, 120.0, what)


def replays(run):
    """Assert that a run's bytes come to the same again, where its case finds the files that it makes."""
    ended = run.workspace.hil("replay", run.folder.name)
    assert ended.code == 0, ended.out + ended.err


@pytest.mark.soak
def test_a_case_that_asks_computes_and_is_held(tmp_path, bench):
    """Limits are looked at in computations and while it is held; the release drives again, and its bytes replay."""
    with going(bench, tmp_path / "w", ASKS_AND_COMPUTES) as run:
        come_to(run, "on")
        name, hil = run.folder.name, run.workspace.hil
        seconds_until(lambda: "coolers" in bench.on(), 30.0, "coolers on")
        assert hil("hold", name, "--by", "Ada", "--reason", "open the door").code == 0
        assert "coolers" not in bench.on()
        until = bench.ask(time=None)["bench"] + 80.0
        seconds_until(lambda: bench.ask(time=None)["bench"] > until, 60.0, "some time of the bench")
        assert hil("note", name, "the door is open", "--by", "Ada").code == 0
        guardian = run.guardian
        assert hil("hold", name, "--release", "--by", "Ada").code == 0
        seconds_until(lambda: "coolers" in bench.on(), 30.0, "coolers on again")
        assert guardian == run.guardian
        ended = run.ended()
    assert ended.code == 0, ended.out
    package = Package(run.folder)
    assert verify(package.folder).findings == ()
    (hold,), (end,) = bodies(package, "hold"), bodies(package, "hold-end")
    assert (end["how"], end["duration"]) == ("released", pytest.approx(end["t"] - hold["t"], abs=10.0))
    assert end["duration"] > 60.0
    plates = package.recording("envelope-plate-temperature").time
    assert [t for t in plates if hold["t"] < t < end["t"]]
    assert "the door is open" in package.text("data/report/report.html")
    replays(run)


@pytest.mark.parametrize(("seconds", "verdict"), [pytest.param(0.3, "PASS", marks=pytest.mark.soak), (0.8, "ERROR")])
def test_one_call_that_lets_nobody_look_after_the_bench(tmp_path, bench, seconds, verdict):
    """With outputs on, more than half a second is an error of the case, in words; and so it is when it is replayed."""
    body = ONE_LONG_CALL.replace("SECONDS", f"{seconds}")
    with going(bench, tmp_path / "w", f"import signal\n{body}") as run:
        ended = run.ended()
    package = Package(run.folder)
    (case,) = results_as_json(package)["cases"]
    assert case["verdict"] == verdict, ended.out
    if verdict == "ERROR":
        assert any("without letting anybody look after the bench, with outputs on" in why for why in case["reasons"])
        assert ended.code == 1
    replays(run)


def test_a_run_that_is_stopped_to_be_resumed(tmp_path, bench):
    """Its bench is safe and not latched; resumed it makes the interrupted turn again, and no other."""
    with going(bench, tmp_path / "w", TURNS) as run:
        come_to(run, "turn2")
        name, hil = run.folder.name, run.workspace.hil
        assert hil("stop", name, "--to-resume", "--by", "Ada", "--reason", "bench needed").code == 0
        assert run.ended().code == 2
        assert bench.on() == set()
        assert not (run.folder / "data/guardian.jsonl").exists()
        ended = hil("resume", name, "--served", str(bench.folder), "--answers", "answers.yaml")
    assert ended.code == 0, ended.out
    package = Package(run.folder)
    assert verify(package.folder).findings == ()
    turns = [event["turn"] for event in bodies(package, "step") if "turn" in event]
    assert turns == [1, 2, 3]
    (resumed,) = bodies(package, "resumed")
    assert resumed["entry"]
    replays(run)


@pytest.mark.soak
def test_a_run_that_is_stopped_for_good(tmp_path, bench):
    """It makes its bench safe, says by whom it was stopped and why, and seals."""
    with going(bench, tmp_path / "w", TURNS) as run:
        come_to(run, "turn1")
        assert run.workspace.hil("stop", run.folder.name, "--by", "Ada", "--reason", "smoke").code == 0
        ended = run.ended()
    assert ended.code == 2, ended.out
    package = Package(run.folder)
    assert bench.on() == set()
    assert "Ada: smoke" in bodies(package, "stop")[0]["reason"]
    assert verify(package.folder).findings == ()
