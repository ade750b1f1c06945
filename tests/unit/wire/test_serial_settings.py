"""Settings of a serial line reach the kernel, alike from the executive and from the guardian that reopens a port."""

from __future__ import annotations

import fcntl
import os
import pty
import termios
from contextlib import contextmanager

import pytest

from hil.guardian.ports.opening import opened
from hil.model.errors import NoReply
from hil.model.safing import GuardedPort
from hil.model.serial_line import Rs485, SerialLine
from hil.wire.live_stream import LiveStream

FRAME = termios.CSIZE | termios.PARENB | termios.PARODD | termios.CSTOPB | termios.CRTSCTS | 0o10000000000
SET_RS485 = 0x542F


@contextmanager
def line():
    """Give the name of a terminal."""
    ours, theirs = pty.openpty()
    yield os.ttyname(theirs)
    os.close(ours)
    os.close(theirs)


@pytest.fixture
def told(monkeypatch):
    """Return what the kernel was told: a pseudo-terminal itself keeps neither parity nor direction."""
    heard = []
    set_attributes, get_attributes, control = termios.tcsetattr, termios.tcgetattr, fcntl.ioctl

    def note(descriptor, when, attributes):
        heard.append((attributes[0] & (termios.IXON | termios.IXOFF), attributes[2] & FRAME, attributes[4]))
        set_attributes(descriptor, when, [*attributes[:2], attributes[2] & ~FRAME | termios.CS8, *attributes[3:]])

    def kept(descriptor):
        attributes = get_attributes(descriptor)
        settings = [each for each in heard if isinstance(each, tuple)]
        return [*attributes[:2], attributes[2] & ~FRAME | (settings[-1][1] if settings else 0), *attributes[3:]]

    def switch(descriptor, request, data=0, *more):
        if request != SET_RS485:
            return 0 if request == SET_RS485 - 1 else control(descriptor, request, data, *more)
        heard.append(bytes(data))
        return 0

    monkeypatch.setattr("termios.tcsetattr", note)
    monkeypatch.setattr("termios.tcgetattr", kept)
    monkeypatch.setattr("fcntl.ioctl", switch)
    return heard


@pytest.mark.parametrize(
    ("settings", "input_flags", "frame"),
    [
        (SerialLine(), 0, termios.CS8),
        (SerialLine(parity="even", data_bits=7), 0, termios.CS7 | termios.PARENB),
        (SerialLine(parity="odd", stop_bits="2"), 0, termios.CS8 | termios.PARENB | termios.PARODD | termios.CSTOPB),
        (SerialLine(parity="mark"), 0, termios.CS8 | termios.PARENB | termios.PARODD | 0o10000000000),
        (SerialLine(parity="space", data_bits=6), 0, termios.CS6 | termios.PARENB | 0o10000000000),
        (SerialLine(stop_bits="1.5", data_bits=5), 0, termios.CS5 | termios.CSTOPB),
        (SerialLine(flow="rts/cts"), 0, termios.CS8 | termios.CRTSCTS),
        (SerialLine(flow="xon/xoff"), termios.IXON | termios.IXOFF, termios.CS8),
    ],
)
def test_executive_and_guardian_set_a_line_alike(told, settings, input_flags, frame):
    """After a replug the instrument must understand the guardian as it understood the executive."""
    expected = (input_flags, frame, termios.B19200)
    with line() as name:
        LiveStream("psu", name, 19200, settings).closed()
        assert told[-1] == expected
        opened(GuardedPort(device="psu", url=name, baud=19200, line=settings)).close()
        assert told[-1] == expected


def test_both_let_the_kernel_switch_the_direction(told):
    """Both write the same structure, and its flags are those of linux/serial.h."""
    rs485 = Rs485(rts_on_send=True, before_s=0.002, after_s=0.001, hears_itself=True)
    settings = SerialLine(rs485=rs485)
    with line() as name:
        LiveStream("relay", name, 9600, settings).closed()
        opened(GuardedPort(device="relay", url=name, baud=9600, line=settings)).close()
    executives, guardians = (each for each in told if isinstance(each, bytes))
    assert executives == guardians
    assert [int.from_bytes(guardians[at : at + 4], "little") for at in (0, 4, 8)] == [0b10011, 2, 1]


def test_the_other_level_of_rts(told):
    """Converters differ in it."""
    with line() as name:
        opened(GuardedPort(device="relay", url=name, line=SerialLine(rs485=Rs485(rts_on_send=False)))).close()
        LiveStream("relay", name, 9600, SerialLine(rs485=Rs485(rts_on_send=False))).closed()
    assert [each[0] for each in told if isinstance(each, bytes)] == [0b101, 0b101]


def test_a_driver_that_cannot_switch_the_direction_is_not_used():
    """A pseudo-terminal cannot: without the direction nothing would be heard, or two would send at once."""
    settings = SerialLine(rs485=Rs485())
    with line() as name:
        with pytest.raises(NoReply, match="does not switch the direction of an RS-485 line"):
            LiveStream("relay", name, 9600, settings)
        with pytest.raises(OSError, match="ioctl"):
            opened(GuardedPort(device="relay", url=name, baud=9600, line=settings))


def test_a_frame_that_the_port_does_not_take_is_not_used():
    """A pseudo-terminal has no parity; a UART that lacks a setting answers alike."""
    with line() as name, pytest.raises(NoReply, match="psu: .* cannot be opened: it does not take the settings"):
        LiveStream("psu", name, 9600, SerialLine(parity="even"))
