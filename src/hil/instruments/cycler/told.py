"""What the lines of a cycler have told so far, in either level."""

from __future__ import annotations

from hil.instruments.cycler.lines import Banner

__all__ = ["RUNNING", "Reading", "Told"]

RUNNING = frozenset({"charge", "rest", "discharge"})
"""States in which a test runs."""

Reading = tuple[float, float, float, float]
"""Voltage in V, current in A, energy in W.h, temperature in degC."""


class Told:
    """The present state, the newest reading, and the rows that nobody has taken yet.

    Attributes:
        state: as the role tells it.
        phase: 1 in a charge, -1 in a discharge, 0 in neither.
        cycle: counted from 1, 0 before the first.
        reading: the newest numbers, None where they say nothing of now any more.
        read_s: bench time at which they were read.
        heard_s: bench time of the newest line that was whole.
        recording: whether rows are kept.
        rows: numbers of the rows one after the other: time, reading, phase, cycle.
        frames: lines that came while rows are kept.
        lost: lines that did not come, or came damaged, while rows are kept.
        damaged: lines that were damaged, ever.
        started: the banners that came and were not looked at; None is that of level 1.
    """

    def __init__(self, now: float) -> None:
        self.state = "idle"
        self.phase = 0.0
        self.cycle = 0.0
        self.reading: Reading | None = None
        self.read_s = now
        self.heard_s = now
        self.recording = False
        self.rows: list[float] = []
        self.frames = 0
        self.lost = 0
        self.damaged = 0
        self.started: list[Banner | None] = []

    @property
    def running(self) -> bool:
        """Whether a test runs."""
        return self.state in RUNNING

    def charging(self, cycle: float) -> None:
        """Note that a cycle began."""
        self.state, self.phase, self.cycle = "charge", 1.0, cycle

    def over(self, state: str) -> None:
        """Note that no test runs: what was measured in it says nothing of now."""
        self.state, self.phase, self.reading = state, 0.0, None

    def begin_anew(self, banner: Banner | None) -> None:
        """Note that the device has started: no test runs."""
        self.over("idle")
        self.cycle = 0.0
        self.started.append(banner)

    def take_rows(self) -> list[float]:
        """Return the rows that have come, once."""
        rows, self.rows = self.rows, []
        return rows

    def record(self) -> None:
        """Keep rows from now on, and count anew."""
        self.rows = []
        self.frames = self.lost = 0
        self.recording = True
