"""Level 1: bare lines without line number, timestamp or checksum, dated by their arrival."""

from __future__ import annotations

import math

from hil.instruments.cycler.lines import BANNER, LINE_S, Reading, Told, opened, plain_numbers

__all__ = ["Arrivals", "BareLines"]

_TOLERANCE = 0.005  # of the device's resonator
_SHORTEST_S, _LONGEST_S = LINE_S * (1 - _TOLERANCE), LINE_S * (1 + _TOLERANCE)
_ON_THE_LINE_S = 0.05  # a line of 30 bytes takes 31 ms; part of it may have come before the poll
_CAPITAL = frozenset(b"ABCDEFGHIJKLMNOPQRSTUVWXYZ")
_ITERATION = b"TEST ITERATION "
_LEAST_SHARE = 0.0004
"""Least energy per line in W.h at which rounding to 0.0001 cannot hide how many lines it stands for."""

_CLEAR_A = 0.02
"""A current beyond this identifies the half-cycle: marks may be missing, and not every mark is known."""


class Arrivals:
    """Bounds on the instant at which the newest line was sent, in s of bench time.

    A line arrives between two polls of the port, and 5 s after the line before it by a clock accurate to 0.5 %.
    Both bounds hold, so the narrower ones count. Where they contradict each other, lines are missing.

    Attributes:
        uncertainty: standard uncertainty of the newest instant, for a uniform distribution between its bounds.
    """

    def __init__(self) -> None:
        self._low: float | None = None
        self._high = 0.0

    @property
    def uncertainty(self) -> float | None:
        """Standard uncertainty of the newest instant in s, None before the first."""
        return None if self._low is None else (self._high - self._low) / math.sqrt(12)

    def begin(self, low: float, high: float) -> None:
        """Start counting at the start of a test, which lies between these instants."""
        self._low, self._high = low, high

    def place(self, since: float, until: float, later: int, lost: int) -> tuple[float, int]:
        """Return when a line was sent, and how many lines before it are missing.

        Args:
            since: last poll that did not find it.
            until: the poll that found it.
            later: number of later lines found by the same poll.
            lost: least number of lines missing before it, by its content.
        """
        since, until = since - _ON_THE_LINE_S, until - later * _SHORTEST_S
        since = min(since, until)
        if self._low is None:
            self._low, self._high = since, until
            return (since + until) / 2, 0
        low, high = self._low + (1 + lost) * _SHORTEST_S, self._high + (1 + lost) * _LONGEST_S
        while high < since:
            low, high, lost = low + _SHORTEST_S, high + _LONGEST_S, lost + 1
        low, high = (max(low, since), min(high, until)) if low <= until else (since, until)
        self._low, self._high = low, high
        return (low + high) / 2, lost


class BareLines(Told):
    """Everything a level 1 device has reported.

    Attributes:
        waiting: whether it has started and has been sent no byte since.
        sealed: whether level 2 lines arrive, so that it is not a level 1 device.
        uncertainty: largest standard uncertainty of the row times in s, None before the first row.
        begun_s: bench time from which rows count.
    """

    level = "1"

    def __init__(self, now: float) -> None:
        super().__init__(now)
        self.waiting = False
        self.sealed = False
        self.uncertainty: float | None = None
        self.begun_s = now
        self._arrivals = Arrivals()
        self._looked_s = now
        self._energy: float | None = None  # of the last line
        self._torn = 0  # unreadable lines since then

    def take(self, lines: list[bytes], now: float) -> None:
        """Take complete lines, line ends stripped, in order; the port was polled at `now`."""
        later = sum(map(_is_data, lines))
        for line in lines:
            if _is_data(line):
                later -= 1
                self._data(line, now, later)
            elif line:
                self._mark(line, now)

    def looked(self, now: float) -> None:
        """Note that the port held nothing more."""
        self._looked_s = now

    def begin_test(self, low: float, high: float) -> None:
        """Note that the start byte was sent between these instants."""
        self.waiting = False
        self.charging(1.0)
        self.reading, self.heard_s, self._energy = None, high, None
        self._arrivals.begin(low, high)

    def _data(self, line: bytes, now: float, later: int) -> None:
        numbers = plain_numbers(line)
        missing = self._missing(numbers)
        at_s, lost = self._arrivals.place(self._looked_s, now, later, missing)
        if numbers is None:
            self.sealed = self.sealed or opened(line) is not None
            self.damaged += 1
        if self.recording:
            self.lost += lost + (numbers is None)
        if numbers is None:
            return
        self.heard_s = now
        self.waiting = False
        self._judge_phase(numbers[1])
        self.reading, self.read_s = numbers, now
        if self.recording:
            self.frames += 1
            self.uncertainty = max(self.uncertainty or 0.0, self._arrivals.uncertainty or 0.0)
            self.rows += (at_s - self.begun_s, *numbers, self.phase, self.cycle)

    def _missing(self, numbers: Reading | None) -> int:
        """Return how many lines are missing before this one, by its energy: each line adds 5 s of its power."""
        if numbers is None:
            self._torn += 1
            return 0
        voltage, current, energy, _ = numbers
        last, self._energy = self._energy, energy
        torn, self._torn = self._torn, 0
        share = abs(voltage * current) * LINE_S / 3600
        if last is None or share < _LEAST_SHARE:
            return 0
        return max(0, round((energy - last if energy >= last else energy) / share) - 1 - torn)

    def _judge_phase(self, current: float) -> None:
        """Infer the half-cycle from the current where that is unambiguous or nothing else shows it."""
        least = _CLEAR_A if self.running else 0.0
        if current >= least and self.state != "charge":
            self.charging(self.cycle + 1)
        elif current < -least:
            self.state, self.phase = "discharge", -1.0

    def _mark(self, line: bytes, now: float) -> None:
        if line == BANNER:
            self.restart(None)
            self.waiting = True
            self._arrivals = Arrivals()
        elif opened(line) is not None:
            self.sealed = True
        elif line.startswith(_ITERATION) and line[len(_ITERATION) :].isdigit():
            self.charging(float(line[len(_ITERATION) :]))
        elif line == b"CHARGE END":
            self.state, self.phase = "discharge", -1.0
        elif line == b"TEST END":
            self.over("ended")
        self.heard_s = now


def _is_data(line: bytes) -> bool:
    """Return whether a line is a data line or a remnant of one: no mark begins like that."""
    return bool(line) and line[0] not in _CAPITAL
