"""A SCPI instrument on its line: program messages in, answers out, text or blocks of bytes."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import ClassVar

from hil.simulation.faults import Faults, Identity
from hil.simulation.peers.scpi import ErrorQueue, ScpiError, keyword, none, units
from hil.simulation.peers.timing import Alarm
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import Line, PeerClock

__all__ = ["Action", "SignalInstrument"]

_LONGEST_LINE = 1024
_MOST_LINES = 256

Action = Callable[[int, Sequence[str]], str | bytes | None]
"""Executes a unit of a message: the number in its header, 1 where it has none, and its parameters."""


class SignalInstrument(Stateful):
    """Lines end with a line feed, are executed one after the other, and are answered in order.

    An error ends a message; what was executed before it stands. A peer says in its `__init__` by `know` what it
    executes.

    Args:
        identity: what `*IDN?` answers.
        command_ns: how long a line takes.
        faults: what goes wrong.
    """

    error_form: ClassVar[str] = '{:+d},"{}"'

    errors: Kept[ErrorQueue]
    _inbox: Kept[bytes]
    _lines: Kept[list[str]]
    _due: Kept[Alarm]

    def __init__(self, identity: str, command_ns: int, faults: Faults) -> None:
        self._identity = identity
        self._command_ns = command_ns
        self._faults = faults
        self._known: list[tuple[re.Pattern[str], bool, Action]] = []
        self.errors = ErrorQueue()
        self._inbox = b""
        self._lines = []
        self._line: Line
        self._clock: PeerClock
        self.know("*IDN?", lambda _, given: none(given, self._identify()))
        self.know("SYSTem:ERRor[:NEXT]?", lambda _, given: none(given, self.errors.pop(self.error_form)))
        self.know("*CLS", self.does(self.errors.codes.clear))

    def know(self, header: str, action: Action) -> None:
        """Execute a header, as manuals print it, by an action; with `?` at its end it is a question."""
        self._known.append((keyword(header.removesuffix("?")), header.endswith("?"), action))

    @staticmethod
    def does(act: Callable[[], None]) -> Action:
        """Return the action of a command without parameters."""

        def action(_: int, given: Sequence[str]) -> None:
            none(given)
            act()

        return action

    def attach(self, line: Line, clock: PeerClock) -> None:
        """Connect the line."""
        self._line, self._clock = line, clock
        self._due = Alarm(clock, self._work)

    def receive(self, data: bytes) -> None:
        """Collect bytes into lines."""
        *lines, self._inbox = (self._inbox + data).split(b"\n")
        if len(self._inbox) > _LONGEST_LINE:
            self._inbox = b""
            self.errors.push(-363)
        for line in lines:
            if len(self._lines) == _MOST_LINES:
                self.errors.push(-363)
                break
            self._lines.append(line.decode("latin-1").strip())
            if len(self._lines) == 1:
                self._due.set(self._clock.now_ns() + self._command_ns)

    def _work(self) -> None:
        if reply := self._execute(self._lines.pop(0)):
            self._line.send(reply + b"\n")
        if self._lines:
            self._due.set(self._clock.now_ns() + self._command_ns)

    def _execute(self, message: str) -> bytes:
        replies: list[bytes] = []
        try:
            for name, query, parameters in units(message):
                action, suffix = self._found(name, query)
                reply = action(suffix, parameters)
                if reply is not None:
                    replies.append(reply if isinstance(reply, bytes) else reply.encode("latin-1", "replace"))
        except ScpiError as error:
            self.errors.push(error.code)
        return b";".join(replies)

    def _found(self, name: str, query: bool) -> tuple[Action, int]:
        for pattern, asks, action in self._known:
            match = pattern.fullmatch(name) if asks == query else None
            if match:
                return action, next((int(digits) for digits in match.groups() if digits), 1)
        raise ScpiError(-113)

    def _identify(self) -> str:
        fault = self._faults.now(Identity, self._clock.now_ns())
        return f"{fault.value} SIMULATED" if fault else self._identity
