"""Looking after bench and case while a case's own code runs, which nobody but the case can foresee."""

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
    """Looks after a bench outside this process while a case's own code runs, unless a record stands in for it.

    Args:
        bench: the bench.
        machine: lets the guardian hear of the run.
        clock: the bench's clock.
        scheduler: gives monitors and turns their time.
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
        """Let the guardian hear of the run."""
        self._machine.between()

    def attend(self, alone_s: float, silent_s: float) -> None:
        """Look after the bench where the case's own code may be disturbed.

        Args:
            alone_s: for how long that ran since the last look; one that came in time was `LOOK_S` after it.
            silent_s: for how long it came to no scheduling point.
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
    """Looks after a case on a bench of this process, whose time stands still while the case's own code runs.

    Args:
        bench: the bench, or the record of one outside the process.
        scheduler: ends the case in time.
        holding: knows what the case has driven.
        expect: is told within how many seconds this is called again, if anything but a call into C runs; None where
            no case does.
    """

    def __init__(
        self, bench: BoundBench, scheduler: Scheduler, holding: Holding, expect: Callable[[float | None], None]
    ) -> None:
        self._longest_s = bench.spec.head.longest_computation_s if bench.outside else math.inf
        self._scheduler = scheduler
        self._holding = holding
        self._expect = expect
        self._expected = -math.inf
        self._signs = scheduler.now_ns(), scheduler.stood_since

    def between(self) -> None:
        """Say that the case can still be ended from here, if it let bench time pass or a person wait meanwhile."""
        signs = self._scheduler.now_ns(), self._scheduler.stood_since
        if signs != self._signs:
            self._signs = signs
            self._go_on()

    def attend(self, _alone_s: float, silent_s: float) -> None:
        """Look after the case, whose own code came to no scheduling point for so many seconds."""
        self._go_on()
        if silent_s > self._longest_s and self._holding.drives():
            self._scheduler.overrun(_silent(silent_s, self._longest_s))
        self._scheduler.look()

    def _go_on(self) -> None:
        now = wall.monotonic()
        if now - self._expected >= _EXPECT_S:
            self._expected = now
            self._expect(self._scheduler.patience_s)


def _silent(seconds: float, allowed_s: float) -> str:
    return (
        f"the case's own code came to no scheduling point for {seconds:.1f} s with outputs on;"
        f" this bench allows {allowed_s:g} s"
    )
