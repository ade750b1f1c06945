"""Why a device file cannot be opened: which group, which program, which other device."""

from __future__ import annotations

import errno
import grp
import os
import pty
import subprocess
import sys

import pytest

from hil.model.errors import NoReply
from hil.wire.live_stream import LiveStream
from hil.wire.obstacles import obstacle, users_of
from hil.wire.opening import hardware_bus

DENIED = OSError(errno.EACCES, "Permission denied")


def device(monkeypatch, mode, group="dialout"):
    """Let /dev/ttyUSB0 exist, with this mode and group, for a user in no group of any use."""
    number = grp.getgrnam(group).gr_gid
    status = os.stat_result((0o020000 | mode, 0, 0, 1, 0, number, 0, 0, 0, 0))
    monkeypatch.setattr("hil.wire.obstacles.Path.stat", lambda _: status)
    monkeypatch.setattr("os.getgroups", lambda: [65534])
    monkeypatch.setattr("getpass.getuser", lambda: "ada")


def test_the_missing_group_is_named(monkeypatch):
    """With the command that adds the user to it, and what has to be done after it."""
    device(monkeypatch, 0o660)
    why, hint = obstacle("/dev/ttyUSB0", DENIED)
    assert why == "permission denied: you are not in group dialout"
    assert hint == "sudo usermod -aG dialout ada, then log out and in again"


@pytest.mark.parametrize(("mode", "group"), [(0o600, "dialout"), (0o660, "root")])
def test_a_device_that_no_group_may_open_needs_a_rule(monkeypatch, mode, group):
    """Joining a group would not help, and root is no group to join."""
    device(monkeypatch, mode, group)
    why, hint = obstacle("/dev/ttyUSB0", DENIED)
    assert why == f"permission denied: it belongs to group {group}, mode {mode:o}"
    assert "hil bench setup NAME --print udev" in hint


def test_who_has_a_port_open_is_named():
    """A program of the same user, by its name and number; not this one."""
    ours, theirs = pty.openpty()
    name = os.ttyname(theirs)
    program = "import sys; file = open(sys.argv[1]); print(1, flush=True); sys.stdin.read()"
    with subprocess.Popen([sys.executable, "-c", program, name], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as it:
        it.stdout.readline()
        assert any(each.endswith(f"(process {it.pid})") for each in users_of(name))
        assert not any(f"process {os.getpid()})" in each for each in users_of(name))
        why, _ = obstacle(name, OSError(errno.EBUSY, "busy"))
        assert why.startswith("it is in use by python")
        it.stdin.close()
    assert list(users_of(name)) == []
    for each in (ours, theirs):
        os.close(each)


def test_what_is_there_instead_is_told(monkeypatch, tmp_path):
    """Another port after a replug is usually the one that is meant."""
    for name in ("ttyUSB1", "ttyACM0", "i2c-0", "null"):
        (tmp_path / name).touch()
    monkeypatch.setattr("hil.wire.obstacles._DEVICES", tmp_path)
    missing = OSError(errno.ENOENT, "No such file or directory")
    assert obstacle("/dev/ttyUSB0", missing)[0] == f"it does not exist; there is {tmp_path}/ttyACM0, {tmp_path}/ttyUSB1"
    assert obstacle("/dev/i2c-1", missing)[0] == f"it does not exist; there is {tmp_path}/i2c-0"
    assert obstacle("/dev/usbtmc0", missing)[0] == "it does not exist; there is none of its kind"
    (tmp_path / "i2c-0").unlink()
    assert "modprobe i2c-dev" in obstacle("/dev/i2c-1", missing)[1]


def test_a_port_that_is_not_there_tells_so():
    """The error of an opening has all of it."""
    with pytest.raises(NoReply, match=r"psu: /dev/ttyUSB99 cannot be opened: it does not exist; there is"):
        LiveStream("psu", "/dev/ttyUSB99")
    with pytest.raises(NoReply, match="the bus /dev/i2c-99 cannot be opened"):
        hardware_bus("gyro", "/dev/i2c-99")


def test_a_bus_without_its_module_names_it(monkeypatch):
    """It is there on Linux only."""
    monkeypatch.setitem(sys.modules, "smbus2", None)
    with pytest.raises(NoReply, match="needs the module smbus2"):
        hardware_bus("gyro", "/dev/i2c-1")
