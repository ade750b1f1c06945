"""Sleep and shutdown of the machine are held off: by logind on a real D-Bus, or by a command."""

from __future__ import annotations

import os
import signal
import socket
import sys

import pytest
from logind import private_bus, serving_logind

from hil.executive.watching.inhibitor import Inhibitor
from hil.model.errors import Refused

HOLDER = """\
import sys, pathlib
print("held", flush=True)
sys.stdin.read()
pathlib.Path(sys.argv[1]).write_text("let go")
"""


@pytest.fixture
def bus(tmp_path, monkeypatch):
    """Return the address of a D-Bus that stands for the system's."""
    with private_bus(tmp_path) as address:
        monkeypatch.setenv("DBUS_SYSTEM_BUS_ADDRESS", address)
        yield address


def test_logind_holds_until_the_context_is_left(bus):
    """It is asked for sleep and shutdown, to block, with who and why, and hears at once when it is over."""
    with serving_logind(bus) as logind:
        with Inhibitor("run a of bench b") as inhibitor:
            assert logind.asked == [("sleep:shutdown", "hil", "run a of bench b", "block")]
            assert logind.holds() == 1
            assert inhibitor.lost() == ""
            inhibitor.take()
            assert len(logind.asked) == 1
            assert not os.get_inheritable(inhibitor.descriptor)
        assert logind.let_go()
        assert inhibitor.descriptor is None


def test_a_copy_of_the_descriptor_goes_on_holding(bus):
    """The guardian is passed one: the machine stays awake until it has done its work, too."""
    with serving_logind(bus) as logind:
        with Inhibitor("a run") as inhibitor:
            copy = os.dup(inhibitor.descriptor)
        assert logind.holds() == 1
        os.close(copy)
        assert logind.let_go()


def test_a_hold_that_logind_ends_is_told_and_can_be_taken_again(bus):
    """A logind that was started over may have forgotten it."""
    with serving_logind(bus) as logind, Inhibitor("a run") as inhibitor:
        logind.drop()
        assert inhibitor.lost() == "the inhibitor was released"
        inhibitor.take()
        assert inhibitor.lost() == ""
        assert logind.holds() == 1


@pytest.mark.parametrize(
    ("answer", "told"),
    [
        ("refuse", r"logind refuses: .*AccessDenied.*Permission denied"),
        ("silence", "no answer in time"),
        ("nonsense", "logind gave no descriptor"),
    ],
)
def test_a_logind_that_does_not_hold_is_told(bus, answer, told):
    """Nobody waits for it, and the hint names the way without it."""
    with serving_logind(bus, answer), pytest.raises(Refused, match=told) as refused:
        Inhibitor("a run", limit_s=0.1).take()
    assert "[hardware] inhibitor" in refused.value.hint


@pytest.mark.usefixtures("bus")
def test_a_bus_without_logind_is_told():
    """The bus itself says that nobody has the name."""
    with pytest.raises(Refused, match=r"logind refuses: .*ServiceUnknown"):
        Inhibitor("a run").take()


@pytest.mark.parametrize("address", ["unix:path=/nowhere/bus", "tcp:host=localhost", "nonsense", "unix:path"])
def test_a_machine_without_a_bus_is_told(monkeypatch, address):
    """No address, whatever it is, is more than a sentence."""
    monkeypatch.setenv("DBUS_SYSTEM_BUS_ADDRESS", address)
    with pytest.raises(Refused, match="logind cannot be asked over D-Bus") as refused:
        Inhibitor("a run").take()
    assert "[hardware] inhibitor" in refused.value.hint


def test_a_bus_that_hangs_or_hangs_up_is_told(tmp_path, monkeypatch):
    """A socket that takes bytes and says nothing holds nobody up."""
    monkeypatch.setenv("DBUS_SYSTEM_BUS_ADDRESS", f"unix:path={tmp_path / 'bus'}")
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(tmp_path / "bus"))
        listening.listen()
        with pytest.raises(Refused, match="no answer in time"):
            Inhibitor("a run", limit_s=0.05).take()


def holding(tmp_path, text=HOLDER):
    """Return a command that runs this script."""
    script = tmp_path / "holder.py"
    script.write_text(text, encoding="utf-8")
    return (sys.executable, str(script), str(tmp_path / "told"))


def test_a_command_holds_until_its_input_ends(tmp_path):
    """It says when it holds, and lets go in its own words."""
    with Inhibitor("a run", holding(tmp_path), limit_s=20) as inhibitor:
        assert inhibitor.lost() == ""
        assert not (tmp_path / "told").exists()
    assert (tmp_path / "told").read_text(encoding="utf-8") == "let go"


def test_a_command_that_ends_has_let_go(tmp_path):
    """What it ended with is told, and it can be started again."""
    with Inhibitor("a run", holding(tmp_path), limit_s=20) as inhibitor:
        process = inhibitor._process
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert inhibitor.lost() == "the command of [hardware] inhibitor ended with -9"
        inhibitor.take()
        assert inhibitor.lost() == ""


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "it ended without a line"),
        ("import sys; sys.stdin.read()", "it wrote no line within 0.5 s"),
        ("import signal\nwhile True:\n    signal.pause()", "it wrote no line within 0.5 s"),
    ],
)
def test_a_command_that_does_not_hold_is_told_and_gone(tmp_path, text, told):
    """Also one that does not care for the end of its input is left nowhere."""
    inhibitor = Inhibitor("a run", holding(tmp_path, text), limit_s=0.5 if "within" in told else 20)
    with pytest.raises(Refused, match=told) as refused:
        inhibitor.take()
    assert "writes one line once it holds" in refused.value.hint
    assert inhibitor._process is None


def test_a_command_that_is_not_there_is_told():
    """By its name, with what the system says."""
    with pytest.raises(Refused, match="/nowhere/awake: No such file or directory"):
        Inhibitor("a run", ("/nowhere/awake",)).take()
