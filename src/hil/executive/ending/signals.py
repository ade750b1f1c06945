"""Signals during a run: requests to stop, and the timer by which the bench is watched during a case's own code."""

from __future__ import annotations

import math
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Protocol

from hil.clock import wall
from hil.executive.ending.stop import StopFlags

__all__ = ["LOOK_S", "SUPERVISOR_ENDED", "Alarm", "Attends", "handle_signals"]

SUPERVISOR_ENDED = "the death of its supervisor"
"""Reason of a stop for the SIGTERM that the operating system sends when the supervisor is gone."""

_SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))

_UNATTENDED = frozenset(number for number in _SIGNALS if number != signal.SIGINT)
"""Signals sent by programs: nobody is there to send a second one."""

_PATIENCE_S = 5.0

_AGAIN_S = 0.3

LOOK_S = 0.2
"""Period at which the executive attends to bench and case while a case's own code runs."""

_SLACK_S = 0.01


@contextmanager
def handle_signals(flags: StopFlags) -> Iterator[Alarm]:
    """Turn SIGINT, SIGTERM and SIGHUP into requests to stop; the previous handlers are restored at the end.

    Yields the timer that interrupts the case's own code.

    An ignored SIGHUP stays ignored (`nohup`). A case that reaches no scheduling point for some seconds after a
    program's signal is cut as by a second one, and is cut repeatedly for as long as it continues.
    """
    alarm = Alarm(flags)
    parent = os.getppid()

    def handler(number: int, frame: FrameType | None) -> None:
        name = signal.Signals(number).name
        if number == signal.SIGTERM and os.getppid() != parent:
            name = SUPERVISOR_ENDED
        if not flags.reason == name == "SIGHUP":  # the terminal, the shell and the supervisor report one hang-up each
            flags.request(name)
        if flags.urgent or number in _UNATTENDED:
            alarm.set(_AGAIN_S if flags.urgent else _PATIENCE_S)
        flags.interrupt(frame)

    heard = [number for number in _SIGNALS if number == signal.SIGINT or signal.getsignal(number) != signal.SIG_IGN]
    before = {number: signal.signal(number, handler) for number in heard}
    try:
        yield alarm
    finally:
        alarm.put_back()
        for number, action in before.items():
            signal.signal(number, action)


class Attends(Protocol):
    """Attends to the bench and the case."""

    def attend(self, alone_s: float, silent_s: float) -> None:
        """Attend to them where the case's own code may be interrupted; see `StopFlags.interlude`."""
        ...

    def between(self) -> None:
        """Attend to them at any tick, wherever it interrupts."""
        ...


class Alarm:
    """Timer that interrupts the case's own code: to attend to the bench, enforce time limits, and cut runaway code.

    Args:
        flags: know whether a case's own code runs, and what to do in the middle of it.
    """

    def __init__(self, flags: StopFlags) -> None:
        self._flags = flags
        self._before: tuple[float, float] | None = None
        self._handler: object = None
        self._attendant: Attends | None = None
        self._cut_at = math.inf

    def keep(self, attendant: Attends) -> None:
        """Tick a few times a second from now on.

        A call into C is not interrupted; a tick in the meantime takes effect after it. See `StopFlags.interlude`.

        Args:
            attendant: called at each tick.
        """
        self._attendant = attendant
        self._start(LOOK_S, LOOK_S)

    def set(self, seconds: float) -> None:
        """Begin to cut in `seconds`, repeatedly."""
        self._cut_at = wall.monotonic() + seconds
        if self._attendant is None:
            self._start(seconds, _AGAIN_S)

    def put_back(self) -> None:
        """Stop the timer, and restore the previous alarm handler."""
        if self._before is not None:
            signal.setitimer(signal.ITIMER_REAL, *self._before)
            signal.signal(signal.SIGALRM, self._handler)  # type: ignore[arg-type]  # what signal() returned
            self._before = None

    def _start(self, seconds: float, period_s: float) -> None:
        if self._before is None:
            self._handler = signal.signal(signal.SIGALRM, self._ring)
            self._before = signal.setitimer(signal.ITIMER_REAL, seconds, period_s)
        else:
            signal.setitimer(signal.ITIMER_REAL, seconds, period_s)

    def _ring(self, _number: int, frame: FrameType | None) -> None:
        if self._attendant is not None:
            self._attendant.between()
        if not self._flags.in_case:
            return
        if wall.monotonic() >= self._cut_at - _SLACK_S:
            self._flags.urgent = True
            self._flags.interrupt(frame)
        elif self._attendant is not None:
            self._flags.interlude(self._attendant.attend, frame)
