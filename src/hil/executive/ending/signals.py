"""Signals while a run is in progress: requests to stop, and the timer that watches a bench during a case's own code."""

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
"""Who asked for an end where the operating system did, which sends a SIGTERM for a supervisor that is gone."""

_SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))

_UNATTENDED = frozenset(number for number in _SIGNALS if number != signal.SIGINT)
"""Signals that a program sent: nobody is there to ask a second time."""

_PATIENCE_S = 5.0

_AGAIN_S = 0.3

LOOK_S = 0.2
"""How often the executive looks after the bench, and the case, while a case's own code runs."""

_SLACK_S = 0.01


@contextmanager
def handle_signals(flags: StopFlags) -> Iterator[Alarm]:
    """Turn SIGINT, SIGTERM and SIGHUP into requests to stop; the handlers before are put back.

    Given is what rings in the case's own code.

    An ignored SIGHUP stays ignored (`nohup`). A case that does not come to a scheduling point for some seconds after
    a program's signal is cut as by a second one, and is cut again for as long as it continues.
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
    """Looks after the bench and the case."""

    def attend(self, alone_s: float, silent_s: float) -> None:
        """Look after them where the case's own code may be disturbed; see `StopFlags.interlude`."""
        ...

    def between(self) -> None:
        """Look after it wherever it rings."""
        ...


class Alarm:
    """Rings in the case's own code: to look after the bench, to end a case in time, and to cut what does not end.

    Args:
        flags: know whether a case's own code runs, and what is to be done in the middle of it.
    """

    def __init__(self, flags: StopFlags) -> None:
        self._flags = flags
        self._before: tuple[float, float] | None = None
        self._handler: object = None
        self._attendant: Attends | None = None
        self._cut_at = math.inf

    def keep(self, attendant: Attends) -> None:
        """Ring a few times a second from now on.

        A call into C is not disturbed; what rang in the meantime rings after it. See `StopFlags.interlude`.

        Args:
            attendant: looks after the bench then.
        """
        self._attendant = attendant
        self._start(LOOK_S, LOOK_S)

    def set(self, seconds: float) -> None:
        """Begin to cut in `seconds`, again and again."""
        self._cut_at = wall.monotonic() + seconds
        if self._attendant is None:
            self._start(seconds, _AGAIN_S)

    def put_back(self) -> None:
        """End, and let the alarm be whose it was."""
        if self._before is not None:
            signal.setitimer(signal.ITIMER_REAL, *self._before)
            signal.signal(signal.SIGALRM, self._handler)  # type: ignore[arg-type]  # what signal() returned
            self._before = None

    def _start(self, seconds: float, again_s: float) -> None:
        if self._before is None:
            self._handler = signal.signal(signal.SIGALRM, self._ring)
            self._before = signal.setitimer(signal.ITIMER_REAL, seconds, again_s)
        else:
            signal.setitimer(signal.ITIMER_REAL, seconds, again_s)

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
