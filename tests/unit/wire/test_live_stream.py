"""Ports outside this process: what it means when they fail."""

from __future__ import annotations

import os
import pty
import tty
from contextlib import closing
from types import SimpleNamespace

import pytest

from hil.clock.virtual import VirtualClock
from hil.model.errors import NoReply
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
