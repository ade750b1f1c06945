"""How a run ends, whatever a case, a terminal or a disk does: made safe, sealed, and with an exit code that is true."""

from __future__ import annotations

import json
import os
import pty
import signal
import subprocess
import time

import pytest
import sweeps
from told_as_json import bodies, results_as_json
from workspaces import executive, finish, make

from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify

pytestmark = pytest.mark.system

GOOD = """
@pytest.mark.requirement("T-010")
def test_one(check, step):
    with step("Judge"):
        check("T-010", "ratio", 1.0)
"""

LONG = """
@pytest.mark.requirement("T-030")
@pytest.mark.max_duration(1e9)
def test_long(field, record, step):
    for part in range(100_000):
        with step(f"Part {part}"):
            record("field", field, duration=5.0, rate=40.0)


def test_last():
    pass
"""


def case(body, before="", limit="1e9"):
    """Return a case that drives the coil, and then does what `body` says."""
    lines = "\n".join(f"    {line}" for line in body.splitlines())
    return f"""{before}
@pytest.mark.requirement("T-010")
@pytest.mark.max_duration({limit})
def test_one(check, step, clock, coil, field, record):
    check("T-010", "ratio", 1.0)
    with step("Begin"):
        pass
{lines}


@pytest.mark.requirement("T-010")
def test_last(check):
    check("T-010", "ratio", 1.0)
"""


def started(tmp_path, cases, text="1 Begin", **options):
    """Start a run and return its workspace and process once it says `text`."""
    workspace = make(tmp_path / "workspace", cases)
    process = workspace.start_run(**options)
    for line in process.stdout:
        if text in line:
            return workspace, process
    raise AssertionError(process.stderr.read())


def at_a_terminal(workspace):
    """Start a run at a terminal of its own, and return its process id and the terminal's other end."""
    child, terminal = pty.fork()
    if child == 0:
        os.chdir(workspace.root)
        command = workspace.start_run_command()
        os.execve(command[0], command, workspace.environment)  # noqa: S606 - our own Python
    return child, terminal


def package_of(workspace):
    """Return the one package of a workspace, which verifies."""
    (folder,) = workspace.folders()
    assert verify(folder).findings == ()
    package = Package(folder)
    assert results_as_json(package)["safe"] is True
    return package


def verdicts(package):
    """Return the verdicts of the cases in order."""
    return [each["verdict"] for each in results_as_json(package)["cases"]]


SWALLOW = "while True:\n    try:\n        {call}\n    except BaseException:\n        pass"


@pytest.mark.parametrize(
    ("call", "asks"),
    sweeps.sample(
        [
            ("clock.sleep(0.1)", ["SIGINT"]),
            ("clock.sleep(0.1)", ["SIGINT", "SIGINT"]),
            ("coil.drive(0.01)", ["SIGTERM"]),
            ("record('field', field, duration=1.0, rate=40.0)", ["SIGTERM"]),
            ("sum(range(100))", ["SIGINT", "SIGINT"]),
            ("sum(range(100))", ["SIGTERM"]),
        ],
        2,
    ),
)
def test_a_case_that_swallows_every_stop_is_ended(tmp_path, call, asks):
    """The bench is safe, the package sealed, the case ABORTED, the rest NOT_RUN, and the exit code 2."""
    workspace, process = started(tmp_path, case(SWALLOW.format(call=call)))
    for name in asks:
        process.send_signal(signal.Signals[name])
        time.sleep(0.05)
    ended = finish(process)
    package = package_of(workspace)
    assert ended.code == 2, ended.err
    assert ended.last_line == f"reports/{package.name}"
    assert verdicts(package) == ["ABORTED", "NOT_RUN"]


@pytest.mark.parametrize(
    "call",
    sweeps.sample(["clock.sleep(1.0)", "coil.drive(0.01)", "record('field', field, duration=1.0, rate=40.0)"], 2),
)
def test_a_case_that_swallows_its_timeout_is_ended(tmp_path, call):
    """No bench time passes after the case was told; it is an ERROR, and the exit code 1."""
    workspace = make(tmp_path / "workspace", case(f"clock.sleep(9)\n{SWALLOW.format(call=call)}", limit="10"))
    ended = finish(workspace.start_run())
    package = package_of(workspace)
    assert ended.code == 1, ended.err
    assert verdicts(package) == ["ERROR", "NOT_RUN"]
    assert results_as_json(package)["cases"][0]["duration"] < 30


@pytest.mark.parametrize("body", sweeps.sample(["while True:\n    pass", "while True:\n    clock.sleep(0)"], 1))
def test_a_case_that_never_ends_is_ended_and_the_next_one_runs(tmp_path, body):
    """Bench time stands still in it, so that the wall's counts; nobody asks for its end."""
    workspace = make(tmp_path / "workspace", case(body, limit="1"))
    ended = finish(workspace.start_run())
    package = package_of(workspace)
    assert ended.code == 1, ended.err
    assert verdicts(package) == ["ERROR", "PASS"]
    (reason,) = results_as_json(package)["cases"][0]["reasons"]
    assert reason.endswith("s without letting any bench time pass")


LOCKED = """\
import ctypes
library = ctypes.PyDLL(None)
lock = ctypes.create_string_buffer(256)
library.pthread_mutex_lock(lock)
library.pthread_mutex_lock(lock)"""
"""Waits for itself for ever without giving up the interpreter: as a long calculation in C, but no core is kept busy."""


def test_a_case_that_does_not_return_from_a_call_ends_with_its_process(tmp_path):
    """No signal reaches it; the run is left as it is, and says where it was."""
    workspace = make(tmp_path / "workspace", case(LOCKED, limit="1"))
    ended = finish(workspace.start_run())
    (folder,) = workspace.folders()
    assert ended.code == 3
    assert "Timeout (0:00:10)!" in ended.err
    assert "in test_one" in ended.err
    assert f"hil seal {folder}" in ended.err
    assert workspace.hil("seal", str(folder)).code == 0
    assert verify(folder).findings == ()


FIXTURE = """
@pytest.fixture
def source(supply):
    {setup}
    yield supply
    {teardown}


@pytest.mark.requirement("T-010")
@pytest.mark.max_duration(1)
def test_one(source, check):
    check("T-010", "ratio", 1.0)


@pytest.mark.requirement("T-010")
def test_last(check):
    check("T-010", "ratio", 1.0)
"""


@pytest.mark.alone
@pytest.mark.timeout(60)
@pytest.mark.parametrize("phase", ["setup", "teardown"])
def test_a_fixture_that_never_ends_is_ended_and_the_next_case_runs(tmp_path, phase):
    """An endless loop before or after a case held its outputs on for as long as it ran; it is an ERROR of the case."""
    cases = FIXTURE.format(**{"setup": "pass", "teardown": "pass"} | {phase: "while True: pass"})
    workspace = make(tmp_path / "workspace", cases)
    ended = finish(workspace.start_run())
    package = package_of(workspace)
    assert ended.code == 1, ended.err
    assert verdicts(package) == ["ERROR", "PASS"]
    reasons = results_as_json(package)["cases"][0]["reasons"]
    assert any("without letting any bench time pass" in each for each in reasons)


def test_a_stop_that_was_swallowed_once_is_no_pass(tmp_path):
    """A case that goes on to its end after a stop is ABORTED."""
    body = "try:\n    while True:\n        clock.sleep(0.1)\nexcept BaseException:\n    pass"
    workspace, process = started(tmp_path, case(body))
    process.send_signal(signal.SIGINT)
    assert finish(process).code == 2
    assert verdicts(package_of(workspace)) == ["ABORTED", "NOT_RUN"]


def test_a_program_asks_a_computing_case_only_once(tmp_path):
    """Nobody is there to ask a second time after SIGTERM, so the case is cut after some seconds."""
    workspace, process = started(tmp_path, case("while True:\n    pass"))
    process.send_signal(signal.SIGTERM)
    assert finish(process).code == 2
    assert verdicts(package_of(workspace)) == ["ABORTED", "NOT_RUN"]


@pytest.mark.parametrize(
    ("ending", "how"),
    [
        ("import os; os._exit(0)", "ended with exit code 0"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "was ended by SIGSEGV"),
        ("import os; os.closerange(3, 1000); os._exit(0)", "ended with exit code 0"),
    ],
)
def test_a_process_that_vanishes_is_no_pass(tmp_path, ending, how):
    """Without the word of its process a run exits with 3, and the person reads what to do."""
    workspace = make(tmp_path / "workspace", case(ending))
    ended = finish(workspace.start_run())
    (folder,) = workspace.folders()
    assert ended.code == 3
    assert how in ended.err
    assert f"hil status {folder.name}" in ended.err
    assert f"hil seal {folder}" in ended.err
    assert "INTERRUPTED" in workspace.hil("runs").out
    assert workspace.hil("seal", str(folder)).code == 0
    assert verify(folder).findings == ()


def test_a_run_that_cannot_be_sealed_is_notified_of(tmp_path):
    """Who is not at the terminal learns that no package came of it, after they learned of the end."""
    losing = "import pathlib; [each.unlink() for each in pathlib.Path('reports').glob('*/data/journal.jsonl')]"
    workspace = make(tmp_path / "workspace", case(losing))
    (workspace.root / "hil.toml").write_text('notify = ["/usr/bin/tee", "-a", "told.json"]\n', encoding="utf-8")
    ended = finish(workspace.start_run())
    told = [json.loads(line) for line in (workspace.root / "told.json").read_text(encoding="utf-8").splitlines()]
    assert ended.code == 3
    assert [each["event"] for each in told] == ["end", "died"]
    assert "ended with exit code 3 before the run was sealed" in told[1]["text"]


def test_sys_exit_where_modules_load_is_no_pass(tmp_path):
    """A fixture module that ends the process ends no run well."""
    workspace = make(tmp_path / "workspace", GOOD, fixtures={"bad.py": "import sys\nsys.exit(0)\n"})
    ended = finish(workspace.start_run())
    assert ended.code not in {0, 1}
    assert "Traceback" not in ended.err
    assert workspace.folders() == []


def test_a_thread_that_never_ends_does_not_hold_up_the_end(tmp_path):
    """The process leaves with the run's code, which is that of an ERROR: the thread outlived its case."""
    body = "import threading\nthreading.Thread(target=threading.Event().wait).start()"
    workspace = make(tmp_path / "workspace", case(body))
    assert finish(workspace.start_run()).code == 1
    package = package_of(workspace)
    assert verdicts(package) == ["ERROR", "PASS"]
    assert "outlives the case" in results_as_json(package)["cases"][0]["reasons"][0]


def test_the_run_ends_in_order_when_its_supervisor_is_killed(tmp_path):
    """Whoever kills the process that waits has asked the one that runs to end."""
    workspace, process = started(tmp_path, LONG, "1 Part")
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()  # the pipes are closed when the other one has ended, too
    package = package_of(workspace)
    assert verdicts(package) == ["ABORTED", "NOT_RUN"]
    assert [event["reason"] for event in bodies(package, "stop")] == ["the death of its supervisor"]


LOST = {
    "full": "exec >/dev/full",
    "full, both": "exec >/dev/full 2>&1",
    "closed": "exec >&-",
    "closed, both": "exec >&- 2>&- <&-",
}


@pytest.mark.parametrize("how", sweeps.sample(LOST, 2))
def test_a_run_whose_output_goes_nowhere_is_sealed(tmp_path, how):
    """What becomes of the display changes neither the verdict nor the exit code."""
    workspace = make(tmp_path / "workspace", GOOD)
    process = subprocess.run(
        ["bash", "-c", f'{LOST[how]}; "$@"', "bash", *workspace.start_run_command()],
        cwd=workspace.root,
        env=workspace.environment,
        check=False,
        capture_output=True,
        text=True,
    )
    package = package_of(workspace)
    assert (process.returncode, verdicts(package)) == (0, ["PASS"])
    if how == "full":
        assert str(package.folder) in process.stderr


@pytest.mark.parametrize("encoding", sweeps.sample(["ascii", "latin-1", "utf-16"], 2))
def test_a_terminal_of_any_encoding_shows_the_run(tmp_path, encoding):
    """Characters that it does not have are escapes."""
    cases = case('print("\\u2126 \\udc80")').replace("Begin", "Measure 1 k\u2126")
    workspace = make(tmp_path / "workspace", cases)
    workspace.environment["PYTHONIOENCODING"] = encoding
    process = workspace.start_run(text=False)
    out, err = process.communicate()
    package = package_of(workspace)
    assert (process.returncode, err) == (0, b"")
    assert out.decode(encoding).rstrip().endswith(package.name)


def test_a_case_that_closes_standard_output_is_sealed(tmp_path):
    """What a case closes, by Python or below it, is not the run's."""
    body = "import os, sys\nsys.stdout.close()\nsys.stderr.close()\nos.close(1)\nos.close(2)\nprint('gone')"
    workspace = make(tmp_path / "workspace", case(body))
    ended = finish(workspace.start_run())
    package = package_of(workspace)
    assert (ended.code, verdicts(package)) == (0, ["PASS", "PASS"])
    assert ended.last_line == f"reports/{package.name}"


def test_a_reader_that_goes_away_does_not_end_the_run(tmp_path):
    """`hil run | head` runs to its seal."""
    workspace, process = started(tmp_path, case("clock.sleep(100)\nprint('x')"), "plan small")
    process.stdout.close()
    assert process.wait(150) == 0
    package = package_of(workspace)
    assert verdicts(package) == ["PASS", "PASS"]
    with process.stderr as said:
        assert str(package.folder) in said.read()


def test_a_reader_that_does_not_read_holds_up_nothing(tmp_path):
    """The run goes on to its seal while its lines wait."""
    body = "for part in range(2000):\n    with step(f'Part {part} ' + 100 * 'x'):\n        pass"
    workspace = make(tmp_path / "workspace", case(body))
    process = workspace.start_run()
    sealed = [False]
    deadline = time.monotonic() + 40
    while not sealed[0] and time.monotonic() < deadline:
        time.sleep(0.05)
        sealed[0] = any((folder / "bagit.txt").exists() for folder in workspace.folders())
    assert sealed[0]
    ended = finish(process)
    assert ended.code == 0
    assert ended.last_line == f"reports/{package_of(workspace).name}"


def test_a_terminal_that_hangs_up_ends_the_run_in_order(tmp_path):
    """The run is stopped by the hang-up, made safe and sealed, although nobody can read a word."""
    workspace = make(tmp_path / "workspace", LONG)
    child, terminal = at_a_terminal(workspace)
    seen = b""
    while b"1 Part" not in seen:
        seen += os.read(terminal, 4096)
    os.close(terminal)
    _, status = os.waitpid(child, 0)
    package = package_of(workspace)
    assert os.waitstatus_to_exitcode(status) == 2
    assert [stop["reason"] for stop in bodies(package, "stop")] == ["SIGHUP"]


def test_ctrl_c_at_the_terminal_is_one_request(tmp_path):
    """The terminal tells the process that waits and the one that runs; the run is asked once."""
    workspace = make(tmp_path / "workspace", LONG)
    child, terminal = at_a_terminal(workspace)
    seen = b""
    while b"1 Part" not in seen:
        seen += os.read(terminal, 4096)
    os.write(terminal, b"\x03")
    try:
        while more := os.read(terminal, 4096):
            seen += more
    except OSError:
        pass
    _, status = os.waitpid(child, 0)
    package = package_of(workspace)
    assert os.waitstatus_to_exitcode(status) == 2
    assert [(stop["reason"], stop["urgent"]) for stop in bodies(package, "stop")] == [("SIGINT", False)]
    os.close(terminal)


@pytest.mark.timeout(360)
def test_ctrl_c_at_any_moment_gives_no_traceback(tmp_path):
    """From the first moments to the closing words: a documented code, and a seal wherever there is a folder."""
    workspace = make(tmp_path / "workspace", GOOD)
    for number in sweeps.sample(range(24), 4):
        place = tmp_path / f"reports-{number}"
        process = workspace.start_run("--output", str(place))
        time.sleep(0.2 + number * 0.05)  # before that it is Python's own start
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGINT)
        ended = finish(process)
        assert "Traceback" not in ended.err, (number, ended.err)
        assert ended.code in {0, 2, 130, -signal.SIGINT}, (number, ended.code, ended.err)
        for folder in place.glob("[!.]*"):
            assert verify(folder).findings == (), (number, ended)
            code = [event["exit_code"] for event in bodies(Package(folder), "end")]
            assert code == [ended.code]


def test_the_word_is_the_truth_about_the_last_words(tmp_path):
    """Killed while its last lines wait for their reader, a run keeps the exit code of its sealed package."""
    body = "for part in range(3000):\n    with step(f'Part {part} ' + 100 * 'x'):\n        pass"
    workspace = make(tmp_path / "workspace", case(body))
    process = workspace.start_run()
    while not any((folder / "bagit.txt").exists() for folder in workspace.folders()):
        time.sleep(0.05)
    time.sleep(0.5)
    os.kill(executive(process), signal.SIGKILL)
    ended = finish(process)
    assert ended.code == 0
    assert str(package_of(workspace).folder) in ended.err
