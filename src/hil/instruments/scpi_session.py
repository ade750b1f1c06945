"""SCPI session on a port: strict replies, each matched to its own query.

Every exchange is bounded by the port's timeout. Queries only read, so they are retried;
settings are written once and verified by the error queue and by reading back.

Unsolicited bytes are never expected. Bytes waiting before a query while the session is in step are a fault
in themselves: they may be the reply to the previous query. Bytes that come between a query and its reply are
told apart by a frame: the query shares its line with an identification query, and only a line that begins
with the identification is a reply.

A query without a reply, or with a malformed one, leaves the session out of step: its reply may still
come. Instruments answer in order, so the session then sends `*IDN?` and discards every line before the
fields that only this query returns.

Firmware varies in notation. Blanks around a reply are ignored, a switch is a digit or a word, a number may carry its
unit, and the text of the `no error` entry may lack its quotes. A banner may be waiting before the first `*IDN?`, and
where one line is echoed before its reply, every line is expected to be.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import TypeVar

from hil.instruments.safing import LONGEST_REPLY_S
from hil.model.errors import DeviceFault, Garbled, NoReply, Rejected
from hil.wire.port import Port

__all__ = [
    "ClosedSession",
    "ScpiSession",
    "as_identification",
    "as_number",
    "as_quantity",
    "as_register",
    "as_switch",
    "as_text",
]

_ATTEMPTS = 3
_FIELDS = 4  # of an identification, IEEE 488.2-1992, 10.14.3
_LONGEST_ERROR_QUEUE = 32
_MOST_LINES_OUT_OF_STEP = 4
_MOST_SHOWN = 60
_SILENCE_S = 0.1
_MOST_LISTENED = 5
_MOST_BYTES = 4096
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[Ee][+-]?\d+)?", re.ASCII)
_ERROR = re.compile(r'([+-]?\d+)(?: *, *| +)(?:"(.*)"|([^"]*[^" ]))', re.ASCII)
_REGISTER = re.compile(r"\+?\d{1,10}", re.ASCII)
_SWITCH = {"1": True, "+1": True, "ON": True, "0": False, "+0": False, "OFF": False}
_NO_NUMBER_FROM = 9.9e37  # SCPI-1999 volume 1, 7.2.1: 9.9E37 is infinity, 9.91E37 is not a number

_T = TypeVar("_T")


class ScpiSession:
    """The host's end of a SCPI dialogue.

    Args:
        device: the instrument's name in the bench file, for messages.
        port: the open byte stream.
        terminator: line terminator in both directions.
        timeout: longest wait for one reply in seconds.
        error_query: the query that takes the oldest entry from the error queue.
        framed: whether queries share a line with `*IDN?`, for instruments that accept several in a line.
        fields: maximum number of fields of an identification; firmware may add one to the standard's four.
    """

    def __init__(
        self,
        device: str,
        port: Port,
        *,
        terminator: bytes = b"\n",
        timeout: float = LONGEST_REPLY_S,
        error_query: str = "SYST:ERR?",
        framed: bool = False,
        fields: int = _FIELDS,
    ) -> None:
        self._device = device
        self._port = port
        self._terminator = terminator
        self._timeout = timeout
        self._error_query = error_query
        self._framed = framed
        self._fields = fields
        self._frame = ""
        self._echoes = False
        self._in_step = True
        self._queue_known = False
        self._discarded = 0

    @property
    def terminator(self) -> bytes:
        """Line terminator."""
        return self._terminator

    @property
    def timeout(self) -> float:
        """Longest wait for one reply [s]."""
        return self._timeout

    @property
    def model(self) -> str:
        """Model of the last identification, empty before the first."""
        return self._frame.split(",")[1].strip() if self._frame else ""

    @property
    def discarded(self) -> int:
        """Number of unsolicited bytes received."""
        return self._discarded

    def query(self, command: str, parse: Callable[[str], _T]) -> _T:
        """Send a query, and return the parsed reply; silence and malformed replies are retried.

        Args:
            command: the query, without its terminator.
            parse: converts the reply's text, or raises ValueError naming what it expected.

        Raises:
            NoReply: no attempt got a complete line.
            Garbled: `parse` does not accept the line, or unsolicited bytes came.
        """
        return self._query(lambda: self._ask(command, parse))

    def identification(self) -> tuple[str, str, str, str]:
        """Query `*IDN?` and return manufacturer, model, serial number and firmware.

        Bytes waiting before the first query, such as a banner, answer nothing and are discarded.

        Raises:
            NoReply, Garbled: see `query`.
        """
        return self._query(lambda: self._bare("*IDN?", self._identified), banner=not self._frame)

    def setting(self, command: str, *, urgent: bool = False) -> None:
        """Send a setting once, and empty the error queue.

        Older entries are not held against this setting.

        Args:
            command: the setting, without its terminator.
            urgent: send it before any query, even out of step: for switching off.

        Raises:
            Rejected: the instrument queued an error.
            NoReply, Garbled: see `query`; an urgent setting was sent first all the same.
        """
        if not urgent:
            if not self._queue_known:
                self.errors()
            self._must_be_quiet()
        ours = self._queue_known
        self._send(command)
        self._take_echo(command)
        queued = self.errors()
        if queued and ours:
            raise Rejected(
                self._device,
                f"`{command}` was answered with {'; '.join(queued)}",
                "compare the setting with the instrument's ratings and its programming guide",
            )

    def errors(self) -> tuple[str, ...]:
        """Empty the error queue, and return its entries, oldest first."""
        queued: list[str] = []
        while len(queued) < _LONGEST_ERROR_QUEUE:
            number, text = self.query(self._error_query, _as_error)
            if number == 0:
                self._queue_known = True
                return tuple(queued)
            queued.append(f'{number:+d} "{text}"')
        raise Garbled(
            self._device,
            f"`{self._error_query}` gave {_LONGEST_ERROR_QUEUE} errors without an end, the newest {queued[-1]}",
            "switch the instrument off and on, and check what else talks to it",
        )

    def _query(self, ask: Callable[[], _T], *, banner: bool = False) -> _T:
        """Retry until there is a reply, three attempts at most; unsolicited bytes but a banner are raised at once."""
        self._must_be_quiet(banner=banner)
        faults: list[DeviceFault] = []
        while len(faults) < _ATTEMPTS:
            try:
                if not self._in_step:
                    self._resynchronise()
                return ask()
            except (NoReply, Garbled) as fault:
                self._in_step = self._queue_known = False
                faults.append(fault)
        raise faults[0]

    def _ask(self, command: str, parse: Callable[[str], _T]) -> _T:
        if not self._framed:
            return self._bare(command, parse)
        separator = "" if command.startswith("*") else ":"
        return self._bare(f"*IDN?;{separator}{command}", lambda line: parse(self._unframed(line)))

    def _unframed(self, line: str) -> str:
        """Return the text after the identification, which must be the one learnt last."""
        frame, separator, reply = line.partition(";")
        if not separator or frame != (self._frame or frame):
            raise ValueError(f"a reply that begins with {self._frame or 'the identification'};")
        if frame != self._frame:
            self._identified(frame)
        return reply.strip()

    def _identified(self, line: str) -> tuple[str, str, str, str]:
        fields = as_identification(line, self._fields)
        self._frame = line
        return fields

    def _bare(self, command: str, parse: Callable[[str], _T]) -> _T:
        self._send(command)
        line = self._line(command)
        if line == command:
            self._echoes = True
            line = self._line(command)
        try:
            return parse(line)
        except ValueError as error:
            raise self._garbled(command, str(error), line) from None

    def _take_echo(self, command: str) -> None:
        """Read the echo of a setting from an instrument that echoes; without it the session is out of step."""
        if self._echoes and self._in_step:
            self._in_step = False
            if (line := self._line(command)) != command:
                raise self._garbled(command, "its echo", line)
            self._in_step = True

    def _garbled(self, command: str, expected: str, line: str) -> Garbled:
        return Garbled(
            self._device,
            f"asked `{command}`, expected {expected}, got {line!r}",
            "check the driver that the bench file names, the line's speed and its shielding",
        )

    def _send(self, command: str) -> None:
        try:
            self._port.timeout = self._timeout
            self._port.write(command.encode("ascii") + self._terminator)
        except OSError as error:
            raise self._port_failed(command, error) from error

    def _line(self, command: str) -> str:
        try:
            line = self._port.read_line(self._terminator)
        except OSError as error:
            raise self._port_failed(command, error) from error
        if not line.endswith(self._terminator):
            came = f"only {line!r} came" if line else "nothing came"
            raise NoReply(
                self._device,
                f"asked `{command}`, {came} within {self._timeout:g} s",
                "check the instrument's power, cable and remote settings",
            )
        return line.removesuffix(self._terminator).decode("ascii", errors="backslashreplace").strip()

    def _port_failed(self, command: str, error: OSError) -> NoReply:
        return NoReply(self._device, f"the port failed at `{command}`: {error}", "check cable and power")

    def _resynchronise(self) -> None:
        """Resynchronise queries and replies by the identification, the one unmistakable reply."""
        self._waiting()
        self._send("*IDN?")
        for _ in range(_MOST_LINES_OUT_OF_STEP):
            line = self._line("*IDN?")
            try:
                self._identified(line)
            except ValueError:
                self._discarded += len(line) + len(self._terminator)
            else:
                self._in_step = True
                return
        raise Garbled(self._device, "unsolicited lines keep coming", "check what else talks to it")

    def _must_be_quiet(self, *, banner: bool = False) -> None:
        """Refuse unsolicited bytes; out of step late replies are expected, and resynchronising discards them."""
        if self._in_step and (stray := self._waiting()) and not banner:
            self._in_step = self._queue_known = False
            raise Garbled(
                self._device,
                f"{stray[:_MOST_SHOWN]!r} arrived unsolicited",
                "check what else talks to it, and switch it off and on",
            )

    def _waiting(self) -> bytes:
        """Read unsolicited bytes, so that the transcript shows them."""
        try:
            waiting = self._port.in_waiting
            stray = self._port.read(waiting) if waiting else b""
        except OSError as error:
            raise self._port_failed("*IDN?", error) from error
        self._discarded += len(stray)
        return stray


class ClosedSession(ScpiSession):
    """The host's end of a SCPI dialogue with one query per line. See `ScpiSession`.

    A reply does not show which query it answers, and here the query cannot share a line with `*IDN?`. So the
    identification is queried right after it. Instruments answer in order: if the next line is the identification, then
    exactly one line answered the query. A stray line pushes the true reply to where the identification should
    be.

    After a fault identifications may be outstanding too, so that receiving one would not prove that the session is in
    step. The session then listens until the port is silent for longer than the instrument takes to answer.
    """

    def _ask(self, command: str, parse: Callable[[str], _T]) -> _T:
        reply = self._bare(command, parse)
        self._bare("*IDN?", self._closes)
        return reply

    def _closes(self, line: str) -> None:
        """Accept the identification learnt last, or learn it."""
        if self._frame and line != self._frame:
            raise ValueError(self._frame)
        self._identified(line)

    def _resynchronise(self) -> None:
        """Resynchronise: listen until the line is silent; then the first line must be the identification."""
        for _ in range(_MOST_LISTENED):
            if not self._silence():
                break
        else:
            raise Garbled(self._device, "unsolicited bytes keep coming", "check what else talks to it")
        self._bare("*IDN?", self._identified)
        self._in_step = True

    def _silence(self) -> bytes:
        """Discard the bytes that come within a tenth of a second, and return them."""
        try:
            self._port.timeout = _SILENCE_S
            stray = self._port.read(_MOST_BYTES)
        except OSError as error:
            raise self._port_failed("*IDN?", error) from error
        self._discarded += len(stray)
        return stray


def as_text(reply: str) -> str:
    """Accept printable text unchanged."""
    if not reply or not reply.isascii() or not reply.isprintable() or "\\x" in reply:
        raise ValueError("printable text")
    return reply


def as_identification(reply: str, most: int = _FIELDS) -> tuple[str, str, str, str]:
    """Parse the fields of `*IDN?`: manufacturer, model, serial number, firmware; extra fields belong to the last."""
    fields = [field.strip() for field in as_text(reply).split(",")]
    if not _FIELDS <= len(fields) <= most or not fields[0] or not fields[1] or ";" in reply:
        raise ValueError("manufacturer, model, serial number and firmware")
    return fields[0], fields[1], fields[2], " ".join(fields[3:])


def as_number(reply: str) -> float:
    """Parse a decimal number; SCPI's infinities and not-a-number become NaN."""
    if not _NUMBER.fullmatch(reply):
        raise ValueError("a number")
    value = float(reply)
    return math.nan if abs(value) >= _NO_NUMBER_FROM else value


def as_quantity(unit: str) -> Callable[[str], float]:
    """Return the parser of a decimal number with or without this unit, as in `4.200V`; any other unit is refused."""

    def parse(reply: str) -> float:
        return as_number(reply.removesuffix(unit).rstrip())

    return parse


def as_register(reply: str) -> int:
    """Parse a status register as a non-negative integer."""
    if not _REGISTER.fullmatch(reply):
        raise ValueError("a whole number")
    return int(reply)


def as_switch(reply: str) -> bool:
    """Parse a switch: ON or 1, OFF or 0."""
    state = _SWITCH.get(reply.upper())
    if state is None:
        raise ValueError("ON, OFF, 1 or 0")
    return state


def _as_error(reply: str) -> tuple[int, str]:
    match = _ERROR.fullmatch(reply)
    if not match:
        raise ValueError('a number and a text like +0,"No error"')
    return int(match[1]), match[3] if match[2] is None else match[2]
