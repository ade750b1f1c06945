"""Opening of ports as lines: on a descriptor that was passed, or by reopening."""

from __future__ import annotations

import errno
import fcntl
import os
import struct
import termios
import time
from contextlib import suppress
from threading import Event

from hil.guardian.ports.connection import connected
from hil.guardian.ports.hislip import HISLIP_PORT, HiSlip
from hil.guardian.ports.hosted import connected_to
from hil.guardian.ports.identity import is_pseudo_terminal
from hil.guardian.ports.line import Line
from hil.guardian.ports.messages import MessageLine, Messenger
from hil.guardian.ports.telnet import TelnetLine
from hil.guardian.ports.usbtmc import UsbTmc
from hil.guardian.ports.vxi11 import Vxi11
from hil.model.safing import GuardedPort
from hil.model.serial_line import Rs485, SerialLine

__all__ = ["keep_alone", "let_others_open", "line_on", "must_have_taken", "opened"]

_CONNECT_S = 0.5
_AGREE_S = 2.0
_STICKY_PARITY = 0o10000000000  # CMSPAR of asm-generic/termbits.h, which termios does not name
_PARITY = {
    "none": 0,
    "even": termios.PARENB,
    "odd": termios.PARENB | termios.PARODD,
    "mark": termios.PARENB | termios.PARODD | _STICKY_PARITY,
    "space": termios.PARENB | _STICKY_PARITY,
}
_DATA_BITS = {5: termios.CS5, 6: termios.CS6, 7: termios.CS7, 8: termios.CS8}
_FRAME = termios.CSIZE | termios.PARENB | termios.PARODD | _STICKY_PARITY | termios.CSTOPB | termios.CRTSCTS
_NOT_TAKEN = "it does not take the settings of serial_line"
_SET_RS485 = 0x542F  # TIOCSRS485 of asm-generic/ioctls.h


def line_on(descriptor: int, port: GuardedPort, interrupt: Event | None = None) -> Line:
    """Return the line on a port whose descriptor is open.

    Raises:
        OSError, ValueError: if the port needs a session of its own, and none can be opened.
    """
    if port.apart or port.speaks in {"hislip", "vxi11"}:  # message numbers of a session are known to its owner only
        os.close(descriptor)
        return opened(port, interrupt)
    if port.speaks == "usbtmc":
        return MessageLine(UsbTmc(descriptor))
    kind = TelnetLine if port.speaks == "telnet" else Line
    return kind(descriptor, port.baud, interrupt)


def opened(port: GuardedPort, interrupt: Event | None = None) -> Line:
    """Reopen a port.

    Raises:
        OSError, ValueError: if that fails.
    """
    if port.url.startswith("socket://"):
        return Line(_connected(port.url), 0, interrupt)
    if port.speaks == "hosted":
        return Line(connected_to(port.url), 0, interrupt)
    if port.speaks in {"usbtmc", "hislip", "vxi11"}:
        return MessageLine(_messenger(port))
    if port.speaks == "telnet":
        line = TelnetLine(_connected(port.url), port.baud, interrupt)
        try:
            line.begin(port.line, time.monotonic() + _AGREE_S)
        except BaseException:
            line.close()
            raise
        return line
    descriptor = os.open(port.url, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        keep_alone(descriptor)
        _make_raw(descriptor, port)
        return Line(descriptor, port.baud, interrupt)
    except BaseException:
        os.close(descriptor)
        raise


def _messenger(port: GuardedPort) -> Messenger:
    if port.speaks == "usbtmc":
        return UsbTmc.opened(port.url)
    place, _, name = port.url.partition("://")[2].partition("/")
    host, separator, number = place.rpartition(":")
    if not separator or "]" in number:
        host, number = place, ""
    if port.speaks == "hislip":
        return HiSlip(host, int(number or HISLIP_PORT), name)
    return Vxi11(host, name, int(number or 0))


def _connected(url: str) -> int:
    """Connect to `scheme://host:port` and return the descriptor."""
    host, _, number = url.partition("://")[2].rpartition(":")
    return connected(host, int(number), _CONNECT_S).detach()


def keep_alone(descriptor: int) -> None:
    """Let no other program, except root's, open a serial device as long as anybody has it open (TIOCEXCL).

    A pseudo-terminal is left as it is: it drives nothing real.
    """
    if not is_pseudo_terminal(os.fstat(descriptor)):
        fcntl.ioctl(descriptor, termios.TIOCEXCL)


def let_others_open(descriptor: int) -> None:
    """Undo `keep_alone`, so that a device can be reopened while another process has the lost one open."""
    with suppress(OSError):
        fcntl.ioctl(descriptor, termios.TIOCNXCL)


def _make_raw(descriptor: int, port: GuardedPort) -> None:
    """Set frame and flow control as in the bench file, and raw mode otherwise; closing does not drop DTR."""
    _, _, control, _, in_speed, out_speed, characters = termios.tcgetattr(descriptor)
    if port.baud:
        in_speed = out_speed = getattr(termios, f"B{port.baud}", 0)
        if not in_speed:
            raise OSError(errno.EINVAL, f"this system does not support {port.baud} baud")
    control = control & ~(_FRAME | termios.HUPCL) | _frame(port.line) | termios.CREAD | termios.CLOCAL
    taken = termios.IXON | termios.IXOFF if port.line.flow == "xon/xoff" else 0
    characters[termios.VMIN], characters[termios.VTIME] = 0, 0
    try:
        termios.tcsetattr(descriptor, termios.TCSANOW, [taken, 0, control, 0, in_speed, out_speed, characters])
    except termios.error as error:
        raise OSError(errno.EINVAL, _NOT_TAKEN) from error
    if port.line.rs485 is not None:
        fcntl.ioctl(descriptor, _SET_RS485, _rs485(port.line.rs485))
    termios.tcflush(descriptor, termios.TCIOFLUSH)


def must_have_taken(descriptor: int, line: SerialLine) -> None:
    """Compare the frame of a serial device with the one that was set; a driver may ignore parts of it.

    Raises:
        OSError: if they differ.
    """
    if termios.tcgetattr(descriptor)[2] & _FRAME != _frame(line):
        raise OSError(errno.EINVAL, _NOT_TAKEN)


def _frame(line: SerialLine) -> int:
    stop = termios.CSTOPB if line.stop_bits != "1" else 0
    return _DATA_BITS[line.data_bits] | _PARITY[line.parity] | stop | (termios.CRTSCTS if line.flow == "rts/cts" else 0)


def _rs485(rs485: Rs485) -> bytes:
    """Return Linux' `struct serial_rs485` (linux/serial.h): flags, two delays [ms], and five words for other kinds."""
    flags = 1 << 0 | (1 << 1 if rs485.rts_on_send else 1 << 2) | (1 << 4 if rs485.hears_itself else 0)
    return struct.pack("8I", flags, round(rs485.before_s * 1000), round(rs485.after_s * 1000), *[0] * 5)
