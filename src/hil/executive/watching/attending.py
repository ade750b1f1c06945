"""Attending to bench and case while a case's own code runs, whose duration is unpredictable."""

from __future__ import annotations

import math
from collections.abc import Callable

from hil.bench.bound import BoundBench
from hil.clock import wall
from hil.clock.live import LiveClock
from hil.executive.ending.signals import LOOK_S
from hil.executive.watching.holding import Holding
from hil.executive.watching.machine import LiveMachine
from hil.executive.watching.scheduler import Scheduler

__all__ = ["Attendant", "Lookout"]

_EXPECT_S = 1.0


class Attendant:
    """Attends to a bench outside this process while a case's own code runs, unless a record stands in for it.

    Args:
        bench: the bench.
        machine: sends the guardian its heartbeat.
        clock: the bench's clock.
        scheduler: runs monitors and turns.
        holding: knows what the case has driven.
    """

    def __init__(
        self, bench: BoundBench, machine: LiveMachine, clock: LiveClock, scheduler: Scheduler, holding: Holding
    ) -> None:
        self._machine = machine
        self._clock = clock
        self._scheduler = scheduler
        self._holding = holding
        self._longest_s = bench.spec.head.longest_computation_s

    def between(self) -> None:
        """Send the guardian a heartbeat."""
        self._machine.between()

    def attend(self, alone_s: float, silent_s: float) -> None:
        """Attend to the bench where the case's own code may be interrupted.

        Args:
            alone_s: how long the code ran since it was last attended to; `LOOK_S` if this one is on time.
            silent_s: how long it has passed no scheduling point.
        """
        if not self._clock.began:
            return
        self._clock.pulse()
        if self._scheduler.watching:
            if self._holding.drives():
                self._scheduler.busy(alone_s - LOOK_S)
                if silent_s > self._longest_s:
                    self._scheduler.overrun(_silent(silent_s, self._longest_s))
            self._scheduler.idle()


class Lookout:
    """Watches a case on a bench in this process, whose time stands still while the case's own code runs.

    Args:
        bench: the bench, or the record of one outside the process.
        scheduler: ends the case in time.
        holding: knows what the case has driven.
        expect: starts a timeout within which the next call must come, unless a call into C blocks; None if no case
            runs.
    """

    def __init__(
        self, bench: BoundBench, scheduler: Scheduler, holding: Holding, expect: Callable[[float | None], None]
    ) -> None:
        self._longest_s = bench.spec.head.longest_computation_s if bench.outside else math.inf
        self._scheduler = scheduler
        self._holding = holding
        self._expect = expect
        self._expected = -math.inf
        self._signs = scheduler.now_ns(), scheduler.standstill.since

    def between(self) -> None:
        """Restart the timeout, if the case has let bench time pass or waited for a person meanwhile."""
        signs = self._scheduler.now_ns(), self._scheduler.standstill.since
        if signs != self._signs:
            self._signs = signs
            self._restart_timeout()

    def attend(self, _alone_s: float, silent_s: float) -> None:
        """Check on the case, whose own code has passed no scheduling point for this many seconds."""
        self._restart_timeout()
        if silent_s > self._longest_s and self._holding.drives():
            self._scheduler.overrun(_silent(silent_s, self._longest_s))
        self._scheduler.look()

    def _restart_timeout(self) -> None:
        now = wall.monotonic()
        if now - self._expected >= _EXPECT_S:
            self._expected = now
            self._expect(self._scheduler.patience_s)


def _silent(seconds: float, allowed_s: float) -> str:
    return (
        f"the case's own code came to no scheduling point for {seconds:.1f} s with outputs on;"
        f" this bench allows {allowed_s:g} s"
    )
