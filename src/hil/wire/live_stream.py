"""Far end of a byte stream outside this process: a serial device or a socket."""

from __future__ import annotations

import errno
import fcntl
import os
import struct
import termios
from typing import Any

import serial
from serial.rs485 import RS485Settings

from hil.clock import wall
from hil.guardian.ports.connection import notice_its_end
from hil.guardian.ports.opening import keep_alone, must_have_taken
from hil.model.errors import NoReply, Refused
from hil.model.serial_line import Rs485, SerialLine
from hil.wire.obstacles import obstacle
from hil.wire.opening import url_of_resource, why_not_opened
from hil.wire.tap import LONGEST_TRANSACTION

__all__ = ["LiveStream"]

_DTR_LOW_S = 0.1


class LiveStream:
    """An open serial device or socket. See `hil.wire.exchange.FarEnd`.

    Args:
        device: the instrument's name.
        url: a path, a URL of pyserial, or a VISA resource name.
        baud: baud rate of a serial line, 9600 if 0.
        line: settings of a serial line.
        alone: whether to open it exclusively; the system enforces that for serial devices, except against root.

    Raises:
        NoReply: if it cannot be opened.
        Refused: the URL's scheme is never opened.
    """

    def __init__(
        self, device: str, url: str, baud: int = 0, line: SerialLine | None = None, *, alone: bool = True
    ) -> None:
        where = url_of_resource(url)
        scheme, is_url, _ = where.partition("://")
        if is_url and scheme != "socket":
            why = why_not_opened(url) or f"{url} leads to nothing outside this process"
            raise Refused(f"{device}: {why}", "correct its port in the bench file")
        options: dict[str, Any] = {} if "://" in where else {"exclusive": alone, **_settings(line or SerialLine())}
        try:
            self._serial = serial.serial_for_url(
                where, baudrate=baud or 9600, timeout=0.0, write_timeout=LONGEST_TRANSACTION, **options
            )
            if is_url:
                notice_its_end(self.fileno())
            elif alone:
                keep_alone(self.fileno())
            if line is not None and not is_url:
                self._must_be_set(line)
        except (serial.SerialException, termios.error, OSError, ValueError) as error:
            why, hint = obstacle(where, error)
            raise NoReply(device, f"{where} cannot be opened: {why}", hint) from error

    def _must_be_set(self, line: SerialLine) -> None:
        """Close a device that does not accept the settings: with others it would receive nothing, or garbage."""
        try:
            must_have_taken(self.fileno(), line)
            if line.rs485 is not None:
                self._switch_direction(line.rs485)
        except OSError:
            self._serial.close()
            raise

    def _switch_direction(self, rs485: Rs485) -> None:
        try:
            self._serial.rs485_mode = RS485Settings(
                rts_level_for_tx=rs485.rts_on_send,
                rts_level_for_rx=not rs485.rts_on_send,
                loopback=rs485.hears_itself,
                delay_before_tx=rs485.before_s,
                delay_before_rx=rs485.after_s,
            )
        except ValueError as error:
            raise OSError(
                f"its driver does not switch the direction of an RS-485 line ({error}): leave out 'rs485' where the"
                " converter does so by itself"
            ) from error

    def fileno(self) -> int:
        """Return the descriptor; a process that receives a copy need not open the port."""
        number: int = self._serial.fileno()
        return number

    def opened(self) -> None:
        """Do nothing: it has been open since its creation."""

    def closed(self) -> None:
        """Close it."""
        # A connection that has ended cannot be shut down, and pyserial then leaves it open.
        connection = getattr(self._serial, "_socket", None)
        self._serial.close()
        if connection is not None:
            connection.close()

    def dtr_rose(self) -> None:
        """Pulse DTR: the caller has already waited, but only the rise is reported to this end."""
        self._serial.dtr = False
        wall.pause(_DTR_LOW_S)
        self._serial.dtr = True

    def write(self, data: bytes) -> None:
        """Write all bytes.

        Raises:
            OSError: EAGAIN if the port does not accept them in time; any other errno if it is gone.
        """
        try:
            self._serial.write(data)
        except serial.SerialTimeoutException as error:
            raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN)) from error

    def exchange(self, data: bytes, timeout: float) -> bytes:
        """Write all bytes, and return what has arrived once the first byte came, within `timeout` s of wall time."""
        end_s = wall.monotonic() + timeout
        self.write(data)
        first = self.read(1, max(0.0, end_s - wall.monotonic()))
        return first + self.read(self.waiting(), 0.0) if first else b""

    def read(self, size: int, timeout: float) -> bytes:
        """Return `size` bytes, or fewer after `timeout` s of wall time."""
        if self._serial.timeout != timeout:
            self._serial.timeout = timeout
        data: bytes = self._serial.read(size)
        return data

    def waiting(self) -> int:
        """Return the number of bytes that can be read without waiting."""
        # pyserial's own count is 0 or 1 for a socket.
        number: int = struct.unpack("i", fcntl.ioctl(self.fileno(), termios.FIONREAD, b"\0\0\0\0"))[0]
        return number

    def discard(self) -> None:
        """Discard received bytes."""
        self._serial.reset_input_buffer()


def _settings(line: SerialLine) -> dict[str, Any]:
    """Return a line's settings as pyserial arguments."""
    return {
        "bytesize": line.data_bits,
        "parity": line.parity[0].upper(),
        "stopbits": float(line.stop_bits),
        "rtscts": line.flow == "rts/cts",
        "xonxoff": line.flow == "xon/xoff",
    }
