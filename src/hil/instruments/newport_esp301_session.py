"""Session with an ESP301: every exchange ends with the error buffer, whose timestamp proves that the reply is fresh.

The controller answers line by line, and a reply does not show which query it answers. So `TB?` follows every command:
its reply has a distinct form, empties the error buffer, and gives the controller's time in ticks of 0.4 ms. A stray
line before a query is refused, one between query and reply displaces the reply of `TB?`, and in a stale reply the
controller's clock has not advanced with the bench's.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from hil.clock.port import Clock
from hil.instruments.safing import LONGEST_REPLY_S
from hil.model.errors import DeviceFault, Garbled, NoReply, Rejected
from hil.wire.port import Port

__all__ = ["EspRefused", "EspSession", "Exchange", "as_code", "as_decimal", "as_flag", "as_words"]

_ATTEMPTS = 3
_QUIET_S = 0.05
_UNKNOWN_QUIET_S = 0.5
_END = b"\r\n"
_TICK_S = 4e-4
_SLACK_S = 0.02
_SLACK = 1e-3
"""Largest relative difference of the clocks of controller and bench; a quartz has a tenth of it."""

_DEEPEST = 12
_MOST_SHOWN = 60
_STATUS = re.compile(r"(\d{1,3}), *(\d{1,15}), *([ -~]+)", re.ASCII)
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[Ee][+-]?\d{1,2})?", re.ASCII)

_T = TypeVar("_T")


@dataclass(frozen=True, slots=True)
class Exchange:
    """Bench times in s at which sending a query began and its reply was complete; it was answered in between."""

    sent: float
    received: float


@dataclass(frozen=True, slots=True)
class _Status:
    code: int
    ticks: int
    text: str


class EspRefused(Rejected):
    """The controller refused a command; `codes` are the numbers of its errors, oldest first."""

    codes: tuple[int, ...] = ()


class EspSession:
    """The host's end of the line.

    Queries are retried on silence or malformed replies. Settings are sent once.

    Args:
        device: the instrument's name in the bench file, for messages.
        port: the open byte stream.
        clock: the bench's clock.
        timeout: longest wait for one reply [s].
    """

    def __init__(self, device: str, port: Port, clock: Clock, *, timeout: float = LONGEST_REPLY_S) -> None:
        self.timeout = timeout
        self._device = device
        self._port = port
        self._clock = clock
        self._in_step = True
        self._reference: tuple[Exchange, int] | None = None
        self._discarded = 0

    @property
    def discarded(self) -> int:
        """Number of unsolicited bytes received."""
        return self._discarded

    def query(self, command: str, parse: Callable[[str], _T]) -> _T:
        """Send a query, and return the parsed reply.

        Raises:
            NoReply: no attempt got a complete line.
            Garbled: the line is not a reply to this query, or unsolicited bytes came.
            Rejected: the controller had an error in its buffer.
        """
        return self.timed(command, parse)[0]

    def timed(self, command: str, parse: Callable[[str], _T]) -> tuple[_T, Exchange]:
        """Send a query, and return the parsed reply and the times of query and reply; errors as for `query`."""

        def ask() -> tuple[_T, Exchange]:
            text, times = self._exchange(command, replies=True)
            try:
                return parse(text), times
            except ValueError as error:
                raise self._garbled(command, str(error), text) from None

        self._must_be_known()
        return self._with_retries(ask)

    def setting(self, command: str) -> None:
        """Send a setting once.

        Raises:
            Rejected: the controller has refused it.
            NoReply, Garbled: see `query`.
        """
        self._must_be_known()
        self._must_be_quiet()
        try:
            self._exchange(command, replies=False)
        except (NoReply, Garbled):
            self._in_step = False
            raise

    def urgent(self, command: str) -> tuple[str, ...]:
        """Send a setting before anything else, and return the entries of the error buffer after it."""
        self._write(command)
        # Stray bytes are dealt with afterwards: a stop does not wait.
        self._in_step = False
        return self.errors()

    def errors(self) -> tuple[str, ...]:
        """Empty the error buffer, and return its entries, oldest first."""
        queued: list[str] = []
        while len(queued) < _DEEPEST:
            status = self._with_retries(self._status_alone)
            if not status.code:
                return tuple(queued)
            queued.append(_told(status))
        raise Garbled(self._device, f"errors keep coming, the newest {queued[-1]}", "switch it off and on")

    def _must_be_known(self) -> None:
        """Empty the error buffer before the first exchange, so that old entries are not held against our commands."""
        if self._reference is None:
            self.errors()

    def _with_retries(self, ask: Callable[[], _T]) -> _T:
        self._must_be_quiet()
        faults: list[DeviceFault] = []
        while len(faults) < _ATTEMPTS:
            try:
                if not self._in_step:
                    self._settle()
                return ask()
            except (NoReply, Garbled) as fault:
                self._in_step = False
                faults.append(fault)
        raise faults[0]

    def _exchange(self, command: str, *, replies: bool) -> tuple[str, Exchange]:
        """Send a command and `TB?`, and return the reply; entries of the error buffer are raised."""
        sent = self._clock.now()
        self._write(f"{command}\rTB?")
        text = self._line(command) if replies else ""
        times = Exchange(sent, self._clock.now())
        # A refused query has no reply: the first line is already that of `TB?`.
        refused = replies and _STATUS.fullmatch(text) is not None
        status = self._status(text if refused else self._line("TB?"), sent)
        if status.code:
            told = (_told(status), *self.errors())
            error = EspRefused(
                self._device,
                f"`{command}` was answered with {'; '.join(told)}",
                "compare it with the stage's ratings and the controller's manual",
            )
            error.codes = tuple(int(each.partition(" ")[0]) for each in told)
            raise error
        if refused:
            raise self._garbled(command, "a reply before that of `TB?`", text)
        return text, times

    def _status_alone(self) -> _Status:
        sent = self._clock.now()
        self._write("TB?")
        return self._status(self._line("TB?"), sent)

    def _status(self, line: str, sent: float) -> _Status:
        """Parse a reply of `TB?`; without an error its time must have advanced with the bench's."""
        match = _STATUS.fullmatch(line)
        if match is None:
            raise self._garbled("TB?", "code, time and text", line)
        status = _Status(int(match[1]), int(match[2]), match[3])
        if not status.code:
            self._must_be_fresh(status.ticks, Exchange(sent, self._clock.now()))
        return status

    def _must_be_fresh(self, ticks: int, now: Exchange) -> None:
        if self._reference is not None:
            before, reference = self._reference
            went = (ticks - reference) * _TICK_S
            least, most = now.sent - before.received, now.received - before.sent
            slack = _SLACK_S + _SLACK * most
            if not least - slack <= went <= most + slack:
                raise Garbled(
                    self._device,
                    f"its clock went {went:.3f} s while the bench's went {most:.3f} s",
                    "check what else talks to it, and whether it was power-cycled; then arm again",
                )
        self._reference = (now, ticks)

    def _settle(self) -> None:
        """Discard late replies; until the controller's time is known, only a long silence proves that none is left."""
        gap = _QUIET_S if self._reference is not None else _UNKNOWN_QUIET_S
        deadline = self._clock.now() + 2 * self.timeout
        try:
            self._port.timeout = gap
            while (stray := self._port.read(1)) and self._clock.now() < deadline:
                self._discarded += len(stray) + len(self._port.read(self._port.in_waiting))
        except OSError as error:
            raise self._port_failed("TB?", error) from error
        self._in_step = True

    def _must_be_quiet(self) -> None:
        if not self._in_step:
            return
        try:
            waiting = self._port.in_waiting
            stray = self._port.read(waiting) if waiting else b""
        except OSError as error:
            raise self._port_failed("TB?", error) from error
        if stray:
            self._discarded += len(stray)
            self._in_step = False
            raise Garbled(
                self._device,
                f"{stray[:_MOST_SHOWN]!r} arrived unsolicited",
                "check what else talks to it, and switch it off and on",
            )

    def _write(self, text: str) -> None:
        try:
            self._port.timeout = self.timeout
            self._port.write(text.encode("ascii") + b"\r")
        except OSError as error:
            raise self._port_failed(text, error) from error

    def _line(self, command: str) -> str:
        try:
            line = self._port.read_line(_END)
        except OSError as error:
            raise self._port_failed(command, error) from error
        if not line.endswith(_END):
            came = f"only {line!r} came" if line else "nothing came"
            raise NoReply(
                self._device,
                f"asked `{command}`, {came} within {self.timeout:g} s",
                "check the controller's power, its cable and its speed",
            )
        return line.removesuffix(_END).decode("ascii", errors="backslashreplace").strip()

    def _garbled(self, command: str, expected: str, got: str) -> Garbled:
        return Garbled(
            self._device,
            f"asked `{command}`, expected {expected}, got {got[:_MOST_SHOWN]!r}",
            "check the line's speed and shielding, and what else talks on it",
        )

    def _port_failed(self, command: str, error: OSError) -> NoReply:
        shown = command.partition("\r")[0]
        return NoReply(self._device, f"the port failed at `{shown}`: {error}", "check cable and power")


def as_decimal(reply: str) -> float:
    """Parse a decimal number."""
    if not _NUMBER.fullmatch(reply) or not math.isfinite(float(reply)):
        raise ValueError("a number")
    return float(reply)


def as_code(reply: str) -> int:
    """Parse a small whole number."""
    if not re.fullmatch(r"\d{1,2}", reply, re.ASCII):
        raise ValueError("a small whole number")
    return int(reply)


def as_flag(reply: str) -> bool:
    """Parse a 0 or 1."""
    if reply not in {"0", "1"}:
        raise ValueError("0 or 1")
    return reply == "1"


def as_words(reply: str) -> str:
    """Accept printable text unchanged."""
    if not reply or not reply.isascii() or not reply.isprintable() or "\\x" in reply:
        raise ValueError("printable text")
    return reply


def _told(status: _Status) -> str:
    return f"{status.code} {status.text}"
