"""Ports outside this process: what it means when they fail."""

from __future__ import annotations

import ctypes
import fcntl
import os
import pty
import select
import socket
import struct
import time
import tty
from contextlib import closing, contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest
from tmpfiles import another_user, as_root

from hil.clock.virtual import VirtualClock
from hil.guardian.ports.opening import opened
from hil.guardian.ports.worker import PortWorker
from hil.model.errors import NoReply
from hil.model.safing import GuardedPort
from hil.wire.live_stream import LiveStream
from hil.wire.tap import TappedPort
from hil.wire.transcript import Transcript


@pytest.fixture
def line():
    """A port with its tap, and the near end of its pseudo-terminal."""
    near, far = pty.openpty()
    tty.setraw(far)
    stream = LiveStream("psu1", os.ttyname(far))
    with closing(SimpleNamespace(close=stream.closed)):
        yield TappedPort("psu1", SimpleNamespace(end=stream), VirtualClock(), Transcript(None)), near, far
    os.close(near)
    os.close(far)


def test_a_port_that_hangs_up_is_gone(line):
    """Whatever is done with it."""
    port, near, far = line
    port.write(b"MEAS?\n")
    os.close(near)
    for use in (lambda: port.write(b"MEAS?\n"), lambda: port.read(1), lambda: port.exchange(b"MEAS?\n")):
        with pytest.raises(NoReply, match="its port is gone") as found:
            use()
        assert found.value.gone
    os.dup2(far, near)


def test_a_port_that_takes_no_more_bytes_is_there(line):
    """An instrument whose flow control stopped us falls silent; nobody has pulled its cable."""
    port, _, _ = line
    port._end._serial.write_timeout = 0.01
    with pytest.raises(NoReply, match="takes no more bytes") as found:
        for _ in range(100):
            port.write(b"x" * 4096)
    assert not found.value.gone


@contextmanager
def connected():
    """Give the URL of a listening socket, and what returns its end of the first connection."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        yield f"socket://127.0.0.1:{listener.getsockname()[1]}", lambda: listener.accept()[0]


def pull_the_cable(end):
    """Let one end of a connection hear nothing any more, and so acknowledge nothing: a filter drops every packet."""
    drop_all = ctypes.create_string_buffer(struct.pack("HBBI", 6, 0, 0, 0))
    program = struct.pack("HxxxxxxQ", 1, ctypes.addressof(drop_all))
    end.setsockopt(socket.SOL_SOCKET, 26, program)  # SO_ATTACH_FILTER, which the module does not name


def seconds_to_the_hang_up(descriptor):
    """Return how long it takes until the system says that nobody is there any more."""
    watch = select.poll()
    watch.register(descriptor, select.POLLRDHUP)
    began = time.monotonic()
    assert watch.poll(15_000), "never"
    return time.monotonic() - began


def both_ways(url):
    """Open a socket as the executive does, and as the guardian does again; give each descriptor and its closing."""
    stream = LiveStream("psu1", url)
    line = opened(GuardedPort(device="psu1", url=url))
    return (stream.fileno(), stream.closed), (line.descriptor, line.close)


@pytest.mark.parametrize("way", [0, 1], ids=["executive", "guardian"])
def test_a_connection_that_takes_no_bytes_any_more_ends(monkeypatch, way):
    """Nothing waits in it for others to come along, and what nobody acknowledges is its end."""
    monkeypatch.setattr("hil.guardian.ports.connection._UNANSWERED_MS", 300)
    with connected() as (url, accepted):
        ways = both_ways(url)
        with accepted() as first, accepted() as second, socket.socket(fileno=os.dup(ways[way][0])) as own:
            pull_the_cable((first, second)[way])
            assert own.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
            own.send(b"*IDN?\n")
            assert seconds_to_the_hang_up(own) < 3.0
        for _, close in ways:
            close()


@pytest.mark.system
@pytest.mark.alone
def test_a_connection_over_which_nobody_speaks_ends_as_well():
    """Within a few seconds, in executive and guardian."""
    with connected() as (url, accepted):
        ways = both_ways(url)
        with accepted() as first, accepted() as second:
            pull_the_cable(first)
            pull_the_cable(second)
            took = [seconds_to_the_hang_up(descriptor) for descriptor, _ in ways]
        for _, close in ways:
            close()
    assert sum(took) < 7.0


@contextmanager
def terminal():
    """Give the far end of a pseudo-terminal, and its name."""
    near, far = pty.openpty()
    try:
        yield far, os.ttyname(far)
    finally:
        os.close(near)
        os.close(far)


def is_alone(descriptor):
    """Return whether the system lets no other program open a terminal."""
    return struct.unpack("i", fcntl.ioctl(descriptor, 0x80045440, b"\0\0\0\0"))[0] == 1  # TIOCGEXCL


def test_a_serial_device_is_opened_by_no_other_program(monkeypatch):
    """Nor by the guardian while its own descriptor is good; once it has lost that one it can reopen the device."""
    with terminal() as (far, name):
        stream = LiveStream("psu1", name)
        assert not is_alone(far), "behind a pseudo-terminal there is nothing real"
        stream.closed()
        monkeypatch.setattr("hil.guardian.ports.identity._PSEUDO_TERMINALS", ())
        by_force = LiveStream("psu1", name, alone=False)
        assert not is_alone(by_force.fileno())
        by_force.closed()
        stream = LiveStream("psu1", name)
        assert is_alone(stream.fileno())
        worker = PortWorker(GuardedPort(device="psu1", url=name), os.dup(stream.fileno()))
        worker._lose("it hung up")
        assert not is_alone(stream.fileno())
        line = opened(GuardedPort(device="psu1", url=name))
        assert is_alone(stream.fileno())
        line.close()
        stream.closed()


@as_root
def test_another_user_gets_no_second_descriptor_of_a_serial_device(monkeypatch):
    """The file lock alone kept out only who asked for it."""
    monkeypatch.setattr("hil.guardian.ports.identity._PSEUDO_TERMINALS", ())
    with terminal() as (_, name):
        Path(name).chmod(0o666)
        stream = LiveStream("psu1", name)
        with another_user(), pytest.raises(OSError, match="busy"):
            os.open(name, os.O_RDWR | os.O_NOCTTY)
        with another_user(), pytest.raises(NoReply, match="psu1: .* cannot be opened: it is in use"):
            LiveStream("psu1", name, alone=False)
        stream.closed()
