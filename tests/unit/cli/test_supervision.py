"""What is said of a process that did not come to its end."""

from __future__ import annotations

import io
import signal
import subprocess
import sys

import pytest

from hil.cli import supervision


class Terminal(io.StringIO):
    """A stream at which a person sits."""

    def isatty(self) -> bool:
        """Return that one does."""
        return True


@pytest.mark.parametrize(("stream", "begun"), [(Terminal, "[1/2] 0:01:00.0\n"), (io.StringIO, "[1/2] 0:01:00.0")])
def test_what_is_said_of_a_killed_run_begins_a_line(monkeypatch, capsys, stream, begun):
    """Its progress is left half-written at the foot of a terminal; nowhere else is there a foot."""
    shown = stream()
    shown.write("[1/2] 0:01:00.0")
    monkeypatch.setattr(sys, "stdout", shown)
    assert supervision._believed(signal.SIGKILL, {}) == 3
    assert shown.getvalue() == begun
    assert capsys.readouterr().err.startswith("hil: the process of the run was ended by SIGKILL")


def test_nothing_is_added_after_a_run_that_ended_by_itself(monkeypatch):
    """It has taken its line away."""
    monkeypatch.setattr(sys, "stdout", shown := Terminal())
    assert supervision._believed(0, {"ended": (1, "")}) == 1
    assert shown.getvalue() == ""


def test_the_exit_code_of_a_sealed_run_stands(monkeypatch):
    """Whatever ends its process afterwards, such as Ctrl-C while it leaves."""
    monkeypatch.setattr(sys, "stdout", io.StringIO())
    assert supervision._believed(0, {"begun": (0, "run"), "sealed": (1, "run"), "ended": (130, "run")}) == 1


OVER = """
import atexit, signal
from hil.cli import entry, main, supervision

heard = supervision._heard

def after(reader):
    signal.raise_signal(signal.{name})
    return heard(reader)

supervision._heard = after
atexit.register(signal.raise_signal, signal.{name})
entry.main()
"""


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_request_to_end_changes_nothing_once_the_run_is_over(tmp_path, name):
    """Its package may be sealed with this exit code, and an audit compares them."""
    program = [sys.executable, "-c", OVER.format(name=name), "run", "--bench", "b", "--dut", "d", "p.py"]
    done = subprocess.run(program, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout) == (4, "")
    assert done.stderr.startswith("hil: ")


LOST = """
import os, signal, sys, time, weakref
from hil.cli.supervision import Word

class Thing:
    pass

Word(os.open(os.devnull, os.O_WRONLY)).listen()
thing = Thing()
callback = weakref.ref(thing, lambda _: signal.raise_signal(signal.SIGINT))
try:
    del thing
    for _ in range(500):
        time.sleep(0.01)
    print("went on")
except KeyboardInterrupt:
    signal.raise_signal(signal.SIGINT)
    print("ended")
"""


def test_a_request_to_end_amid_a_callback_is_not_lost():
    """What the interpreter swallows there is raised again after it, without a word; a second one changes nothing."""
    done = subprocess.run([sys.executable, "-c", LOST], capture_output=True, text=True, timeout=60, check=True)
    assert (done.stdout, done.stderr) == ("ended\n", "")


def test_other_lost_errors_are_told():
    """They are nobody's request."""
    code = LOST.replace("signal.raise_signal(signal.SIGINT))", "1 / 0)").replace("500", "1")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout == "went on\n"
    assert "ZeroDivisionError" in done.stderr


STUCK = """
import collections, itertools, os, signal
from hil.cli.supervision import Word

signal.pthread_sigmask(signal.SIG_BLOCK, range(1, signal.NSIG))
word = Word(os.open(os.devnull, os.O_WRONLY))
word.expect(0.05)
word.expect({last})
collections.deque(itertools.repeat(0, {times}), maxlen=0)
print("came back")
"""


@pytest.mark.parametrize(
    ("last", "times", "code", "said"), [("0.2", "10**12", 1, ""), ("None", "10**7", 0, "came back\n")]
)
def test_a_process_that_does_not_return_from_a_call_ends_itself(last, times, code, said):
    """No signal and no line of Python is needed for that, and where it was is printed."""
    program = STUCK.format(last=last, times=times)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout) == (code, said)
    assert ("Timeout" in done.stderr and 'File "<string>", line 9' in done.stderr) == (code == 1)


def test_the_process_that_waits_does_not_load_what_a_run_needs():
    """It stays for as long as the run does."""
    program = (
        "import sys, hil.cli.main, hil.cli.commands.run, hil.executive.setup.pins\n"
        "heavy = {'email', 'importlib.metadata', 'json', 'msgspec', 'numpy', 'pydantic'}\n"
        "sys.exit(' '.join(heavy & set(sys.modules)) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
