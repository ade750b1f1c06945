"""One port by its descriptor: bytes out and in up to a deadline, and never an endless wait.

The executive shares the descriptor. What belongs to the open file (flags, a terminal's settings) stays as it is; a
call that could block is polled for first, and asks for little.
"""

from __future__ import annotations

import errno
import fcntl
import os
import select
import socket
import stat
import struct
import termios
import time
from threading import Event

from hil.model.safing import GuardedPort
from hil.model.serial_line import Rs485, SerialLine

__all__ = ["Gone", "Interrupted", "Line", "must_have_taken", "opened"]

_SLICE_S = 0.02
_CONNECT_S = 0.5
_AT_ONCE = 4096
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
_DEAD = select.POLLHUP | select.POLLERR | select.POLLNVAL


class Gone(Exception):
    """This descriptor is dead for good."""


class Interrupted(Exception):
    """The port is needed for something more urgent."""


class Line:
    """One open port.

    Args:
        descriptor: of a terminal, or of a connected socket.
        baud: of a serial device, 0 if unknown: bytes then count as sent once they are written.
        interrupt: ends any wait when it is set.

    Attributes:
        busy_until: when the last byte went or came, on the monotonic clock [s].
    """

    def __init__(self, descriptor: int, baud: int = 0, interrupt: Event | None = None) -> None:
        self.descriptor = descriptor
        self._byte_s = 10 / baud if baud else 0.0
        self._interrupt = interrupt or Event()
        is_socket = stat.S_ISSOCK(os.fstat(descriptor).st_mode)
        self._socket = socket.socket(fileno=os.dup(descriptor)) if is_socket else None
        self._waits = not is_socket and os.get_blocking(descriptor)
        self.busy_until = time.monotonic()

    def now(self) -> float:
        """Return the time on the clock of deadlines [s]."""
        return time.monotonic()

    def hear(self, until: float) -> bytes:
        """Return the first bytes that come, empty if none come by the deadline.

        Raises:
            Gone: if none ever will.
        """
        while True:
            events = self._poll(select.POLLIN, until)
            data = self._read() if events else b""
            if data:
                self.busy_until = time.monotonic()
                return data
            if events & _DEAD or (events and self._socket):
                raise Gone("the other end hung up")
            if time.monotonic() >= until:
                return b""

    def say(self, data: bytes, until: float) -> int:
        """Write until all is out or the deadline has passed; return how many bytes were taken.

        Raises:
            Gone: if none ever will be.
        """
        done = 0
        while done < len(data):
            events = self._poll(select.POLLOUT, until)
            if events & (select.POLLERR | select.POLLNVAL) or (events & select.POLLHUP and not self._socket):
                raise Gone("the other end hung up")
            done += self._write(data[done:]) if events else 0
            if time.monotonic() >= until:
                break
        self.busy_until = time.monotonic() + done * self._byte_s
        return done

    def close(self) -> None:
        """Close the descriptor; the open file may live on in other processes."""
        if self._socket:
            self._socket.close()
        os.close(self.descriptor)

    def _poll(self, wanted: int, until: float) -> int:
        poll = select.poll()
        poll.register(self.descriptor, wanted)
        while True:
            if self._interrupt.is_set():
                raise Interrupted
            left = min(until - time.monotonic(), _SLICE_S)
            events = sum(event for _, event in poll.poll(max(left, 0) * 1000))
            if events or left <= 0:
                return events

    def _read(self) -> bytes:
        try:
            if self._socket:
                return self._socket.recv(_AT_ONCE, socket.MSG_DONTWAIT)
            return os.read(self.descriptor, _AT_ONCE)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise Gone(error.strerror) from error

    def _write(self, data: bytes) -> int:
        try:
            if self._socket:
                return self._socket.send(data, socket.MSG_DONTWAIT | socket.MSG_NOSIGNAL)
            return os.write(self.descriptor, data[:1] if self._waits else data)
        except BlockingIOError:
            return 0
        except OSError as error:
            raise Gone(error.strerror) from error


def opened(port: GuardedPort, interrupt: Event | None = None) -> Line:
    """Reopen a port.

    Raises:
        OSError, ValueError: if that fails.
    """
    if port.url.startswith("socket://"):
        host, _, number = port.url.removeprefix("socket://").rpartition(":")
        connected = socket.create_connection((host.strip("[]"), int(number)), _CONNECT_S)
        connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return Line(connected.detach(), 0, interrupt)
    descriptor = os.open(port.url, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        _make_raw(descriptor, port)
        return Line(descriptor, port.baud, interrupt)
    except BaseException:
        os.close(descriptor)
        raise


def _make_raw(descriptor: int, port: GuardedPort) -> None:
    """Set the frame and the flow control of the bench file, raw mode otherwise; closing does not drop DTR."""
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
    """Compare the frame that a serial device has with the one that it must have; a driver may leave parts out.

    Raises:
        OSError: if it is another one.
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
