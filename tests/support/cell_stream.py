"""A streamed role in memory: a device that sends one row every period by itself, until it falls silent."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from case_parts import Case
from numpy.typing import NDArray

from hil.clock.virtual import VirtualClock
from hil.executive.cases.facade import Facade
from hil.executive.watching.scheduler import Scheduler
from hil.instruments.sampled import Channel, StreamReport
from hil.model.bench import InstrumentSpec, Wire
from hil.model.errors import NoReply

__all__ = ["Stream", "adopt", "beside", "facade_of"]


class Stream:
    """Row k comes k periods after the beginning, with the next of `values`; the last of them stays.

    Args:
        clock: the bench's clock.
        period: between two rows, by the bench's clock.
        stamp: the same by the device's own clock.
        dead_after: from when on it is silent.
    """

    longest_pause = 5.0

    def __init__(
        self, clock: VirtualClock, period: float = 5.0, stamp: float | None = None, dead_after: float = np.inf
    ) -> None:
        self.values = [3.0]
        self.over_at = np.inf
        self.mute_from = self.mute_until = np.inf
        self.calls: list[tuple[object, ...]] = []
        self.drained_at: list[int] = []
        self._clock = clock
        self._period = period
        self._stamp = stamp or period
        self._dead_after = dead_after
        self._given = 0
        self._start = 0.0

    @property
    def over(self) -> bool:
        """Whether its test has ended."""
        return self._clock.now() >= self.over_at

    def channels(self) -> tuple[Channel, ...]:
        """Return one channel."""
        return (Channel("voltage", "V"),)

    def sample(self) -> tuple[float, ...]:
        """Not asked of a streamed role."""
        raise AssertionError

    def begin(self, rate: float) -> None:
        """Start to count."""
        self.calls.append(("begin", rate))
        self._start = self._clock.now()

    def drain(self) -> NDArray[np.float64]:
        """Return what has come since the last call; rows of the time in which it is mute never come."""
        now = self._clock.now()
        self.drained_at.append(self._clock.now_ns())
        if now > self._dead_after:
            raise NoReply("cyc1", "no line for 7 s", "look at its cable")
        count = int((now - self._start) / self._period + 1e-9)
        rows = [
            (number * self._stamp, self.values[min(number, len(self.values)) - 1])
            for number in range(self._given + 1, count + 1)
            if not self.mute_from <= number * self._period < self.mute_until
        ]
        self._given = count
        return np.array(rows).reshape(-1, 2)

    def end(self) -> StreamReport:
        """Stop."""
        self.calls.append(("end",))
        return StreamReport(frames=self._given, lost=0, drift=None, drift_uncertainty=None)


def facade_of(case: Case, role: object, instrument: str = "cyc1", instance: str = "", kind: str = "cycler") -> Facade:
    """Return a role as a case of its bench holds it."""
    spec = InstrumentSpec(name=instrument, driver="none")
    wire = Wire(role=kind, instance=instance, instrument=instrument)
    return Facade(wire, spec, role, case.run.effects, case.run, {instrument: spec})


def adopt(case: Case, made: Scheduler) -> None:
    """Let a case run on another scheduler."""
    case.scheduler = case.run.scheduler = case.run.record._scheduler = made


def beside(folder: Path, **options: float) -> tuple[Case, Stream, Facade]:
    """Return a case with a cycler in memory, and its façade."""
    case = Case(folder)
    role = Stream(case.clock, **options)
    return case, role, facade_of(case, role)
