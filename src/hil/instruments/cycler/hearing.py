"""Serial line of a cycler: level detection, listening and reset.

A level 1 device starts its test on any byte. So nothing is written before a line has shown the level, and a level 1
device is sent only the one byte that starts it.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

from hil.clock.port import Clock
from hil.instruments.cycler.bare import BareLines
from hil.instruments.cycler.lines import BANNER, Banner, opened, plain_numbers
from hil.instruments.cycler.numbered import NumberedLines
from hil.model.errors import DeviceFault, Garbled, NoReply
from hil.wire.port import Port

__all__ = ["BANNER_S", "FIRMWARE", "MOST_BYTES", "Hearing"]

BANNER_S = 2.5
"""Longest time from a reset to the banner; the bootloader takes 1.6 s."""

_STATUS_S = 5.5
_PIECE_S = 2.0  # longer waits are split into several port operations
_LEAST_S = 1e-9  # rounding can leave a smaller remainder that no clock would get past
MOST_BYTES = 4096
"""Capacity of the line's receive buffer in bytes."""

_NEARLY_FULL = MOST_BYTES - 128

FIRMWARE = "compare its firmware with the protocol's page"
"""Hint for a device that departs from the protocol's page."""


class Hearing:
    """The host's end of the line.

    Args:
        device: the instrument's name, for messages.
        port: the open byte stream.
        clock: the bench's clock.

    Attributes:
        told: the state reported by its lines, None before the level is known.
        banner: its identification, None if it sent none.
        starts: number of starts observed.
        fault: why a running test or stream is over: the device has restarted.
        in_step: whether the device is known to hold no partial line of the host's.
    """

    def __init__(self, device: str, port: Port, clock: Clock) -> None:
        self.device = device
        self.clock = clock
        self.told: NumberedLines | BareLines | None = None
        self.banner: Banner | None = None
        self.starts = 0
        self.fault: DeviceFault | None = None
        self._port = port
        self._rest = b""
        self.in_step = False
        self._resetting = False

    def meet(self) -> NumberedLines | BareLines:
        """Return what the device has reported; if the level is still unknown, listen until a line shows it.

        Raises:
            NoReply: no line did.
        """
        if self.told is None:
            self.poll()
        if self.told is None:
            self.listen(BANNER_S + _STATUS_S, lambda: self.told is not None)
        if self.told is None:
            raise NoReply(
                self.device,
                f"no banner and no line of level 2 within {BANNER_S + _STATUS_S:g} s, and any byte may start it",
                "check its power and its baud rate, 9600; if opening does not reset it, press its reset button now",
            )
        return self.told

    def reopened(self) -> None:
        """Discard all that was received; the next request waits until the device shows its level again."""
        if self.told is not None:
            self.told.recording = False
        self.told = self.banner = self.fault = None
        self.starts += 1
        self.in_step, self._rest = False, b""

    def poll(self) -> float:
        """Take what has arrived, without waiting; return the bench time.

        Raises:
            Garbled: a line with a valid checksum has no meaning.
        """
        port = self._port
        if port.timeout:
            port.timeout = 0.0
        data = port.read(MOST_BYTES)
        now = self.clock.now()
        self._take(data, now)
        if len(data) >= _NEARLY_FULL and self.told is not None:
            self.told.reading = None  # the buffer overflowed: the age of the newest line is unknown
        return now

    def reset(self) -> None:
        """Reset the device through DTR, which opens both relays, and wait for the banner.

        Raises:
            NoReply: no banner came; it was not reset.
        """
        with suppress(Garbled):
            self.poll()
        before = self.starts
        self._resetting, self._rest = True, b""
        try:
            self._port.pulse_dtr()
            self.listen(BANNER_S, lambda: self.starts > before)
        finally:
            self._resetting = False
        if self.starts == before:
            raise NoReply(
                self.device,
                f"DTR was pulsed, and no banner came within {BANNER_S:g} s: it was not reset",
                "cut its supply and its load by hand; check the capacitor between DTR and its reset pin",
            )

    def write(self, data: bytes) -> None:
        """Write bytes."""
        self._port.write(data)

    def nonsense(self, words: str) -> Garbled:
        """Return the fault for a line whose checksum is valid but which has no meaning."""
        return Garbled(self.device, f"it sent '{words}', which means nothing", FIRMWARE)

    def went_back(self, told: NumberedLines, *, running: bool) -> None:
        """Note that its clock or its counters went back: it has restarted, and the banner was lost.

        Args:
            told: what it has reported.
            running: whether a test was running before.
        """
        told.forget()
        self._has_started(told, None, running=running)

    def _has_started(self, told: NumberedLines | BareLines, banner: Banner | None, *, running: bool) -> None:
        """Note that it has started: this ends any test, and any rows in device time, which starts over."""
        self.starts += 1
        self.banner = banner
        self.in_step = False
        timed = told.recording and isinstance(told, NumberedLines)
        if timed or (running and not self._resetting):
            told.recording = False
            reason = f" (boot {banner.boots}, {banner.reset})" if banner else ""
            self.fault = DeviceFault(
                self.device,
                f"it has restarted{reason}: its relays are open, and its test is over",
                "check its power and its USB cable, and start the test again",
            )

    def listen(self, seconds: float, done: Callable[[], bool]) -> None:
        """Take what arrives until `done` holds or the time is up."""
        until = self.clock.now() + seconds
        while not done() and (left := until - self.clock.now()) >= _LEAST_S:
            self._port.timeout = min(left, _PIECE_S)
            data = self._port.read(1)
            if data and (more := self._port.in_waiting):
                data += self._port.read(more)
            self._take(data, self.clock.now())

    def _take(self, data: bytes, now: float) -> None:
        if data:
            lines = (self._rest + data).split(b"\r\n") if self._rest else data.split(b"\r\n")
            self._rest = lines.pop()[-MOST_BYTES:]
            if self.told is None:
                lines = self._learn(lines, now)
            if (told := self.told) is not None:
                running = told.running
                told.take(lines, now)
                self._look_at(told, now, running=running)
        if isinstance(self.told, BareLines):
            self.told.looked(now)

    def _look_at(self, told: NumberedLines | BareLines, now: float, *, running: bool) -> None:
        """Handle what lines report besides readings."""
        if told.started:
            self._has_started(told, told.started[-1], running=running)
            told.started.clear()
        if isinstance(told, BareLines):
            if told.sealed:
                self.told = NumberedLines(now)
        elif told.went_back:
            self.went_back(told, running=running)
        elif told.nonsense:
            nonsense, told.nonsense = told.nonsense, b""
            raise self.nonsense(nonsense.decode("ascii", "replace"))

    def _learn(self, lines: list[bytes], now: float) -> list[bytes]:
        """Detect the level from the first line that shows it, and return the lines from there on."""
        for place, line in enumerate(lines):
            if opened(line) is not None:
                self.told = NumberedLines(now)
            elif line == BANNER or plain_numbers(line) is not None:
                self.told = BareLines(now)
            if self.told is not None:
                return lines[place:]
        return []
