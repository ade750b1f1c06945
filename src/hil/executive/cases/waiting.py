"""`clock`: bench time as a case may see it, and measured durations until a condition is met."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

from hil.clock.port import NANOSECONDS
from hil.executive.cases.effects import Effects
from hil.executive.cases.escapes import OfThisProcess
from hil.executive.watching.scheduler import Scheduler
from hil.model.errors import HilError, Misused, NotMet
from hil.model.figure import Figure
from hil.model.provenance import Provenance, merged

__all__ = ["CaseClock", "WaitingCase", "span"]

_CLOCK_ERROR = 1e-4
"""Relative error: a computer's quartz is within 100 ppm, whether or not it is disciplined."""


class WaitingCase(Protocol):
    """The case whose clock it is."""

    @property
    def effects(self) -> Effects:
        """Where waits are recorded."""
        ...

    @property
    def scheduler(self) -> Scheduler:
        """Lets bench time pass."""
        ...

    def refused(self, error: HilError) -> None:
        """Note a refused request, before the case learns of it."""
        ...


class CaseClock(OfThisProcess):
    """The `clock` fixture: bench time as a case may see it."""

    said = "`clock`"

    def __init__(self, case: WaitingCase) -> None:
        self._case = case
        self._effects, self._scheduler = case.effects, case.scheduler

    def now(self) -> float:
        """Return the bench time of the last operation or wait in s; only differences are meaningful."""
        self._scheduler.point()
        return self._effects.perform("clock.now", "reads", {}, lambda: self._scheduler.now_ns() / NANOSECONDS)

    def sleep(self, seconds: float) -> None:
        """Let `seconds` of bench time pass; monitors continue."""
        self._effects.perform("clock.sleep", "waits", {"seconds": seconds}, lambda: self._scheduler.sleep(seconds))

    def until(
        self, condition: Callable[[], object], *, within: float, since: float | None = None, every: float = 0.01
    ) -> Figure:
        """Wait until a condition is met, and return how long that took in s.

        The condition is polled; the figure comes from the instruments that it reads. The awaited change happened
        between the beginning of the last poll that did not show it and the end of the first one that did; the time
        began between `since` and this call. The midpoints of both spans are taken, and the spans are the uncertainty
        (rectangular, GUM 4.3.7), together with 100 ppm of the clock.

        Args:
            condition: called without arguments; met if the result is true.
            within: timeout, from this call on [s].
            since: bench time from `now` at which the time begins; by default this call.
            every: polling period [s]; a poll that takes longer delays the next one.

        Raises:
            NotMet: the condition was not met in time; if a case suppresses that, what it did not check is INCONCLUSIVE.
            Misused: for times that are not numbers above zero, or a beginning in the future.
        """
        self._scheduler.point()
        called_ns = self._scheduler.now_ns()
        since_ns = called_ns if since is None else self._beginning(since, called_ns)
        if not (0 < within < math.inf and 0 < every < math.inf):
            raise self._misused(f"clock.until cannot wait for {within} s, every {every} s", "give seconds above zero")
        with self._effects.learning() as learnt:
            seen = self._poll(condition, learnt, called_ns, within, every)
        origin = merged(*learnt) or Provenance()

        def tell() -> Figure:
            if seen is None:
                raise NotMet(
                    ", ".join(origin.instruments) or "clock",
                    f"clock.until: the condition was not met within {within:g} s; it read "
                    f"{', '.join(origin.sources) or 'nothing'}",
                    "check what should have happened, how it is measured, and how long it may take",
                )
            return span((since_ns, called_ns), (since_ns if seen[0] < 0 else seen[0], seen[1]))

        arguments = {"within": within, "every": every, "since": since}
        took = self._effects.perform("clock.until", "waits", arguments, tell)
        return took.with_provenance(origin.through("clock.until"))

    def _poll(
        self, condition: Callable[[], object], learnt: list[Provenance], start_ns: int, within: float, every: float
    ) -> tuple[int, int] | None:
        """Return when the last unmet poll began, -1 if there was none, and when the met one ended; None on timeout."""
        vain_ns, turn = -1, 0
        while True:
            learnt.clear()  # the figure comes from what the last poll reads
            began_ns = self._scheduler.now_ns()
            met = bool(condition())
            now_ns = self._scheduler.now_ns()
            if met:
                return vain_ns, now_ns
            if now_ns >= start_ns + round(within * NANOSECONDS):
                return None
            vain_ns = began_ns
            turn = max(turn + 1, math.ceil((now_ns - start_ns) / NANOSECONDS / every))
            with self._effects.undisturbed():  # a turn beside the case may be in the middle of a transaction
                self._scheduler.wait_until(start_ns + round(turn * every * NANOSECONDS))

    def _beginning(self, since: object, now_ns: int) -> int:
        if isinstance(since, bool) or not isinstance(since, int | float) or not 0 <= since <= now_ns / NANOSECONDS:
            problem = f"clock.until: since is a bench time up to {now_ns / NANOSECONDS:g} s, found {since!r}"
            raise self._misused(problem, "take it from clock.now() before what begins the time")
        return round(since * NANOSECONDS)

    def _misused(self, what: str, hint: str) -> Misused:
        error = Misused(what, hint)
        self._case.refused(error)
        return error


def span(began_ns: tuple[int, int], ended_ns: tuple[int, int]) -> Figure:
    """Return the time between two instants, each known to lie between two others.

    Args:
        began_ns: first and last instant at which it may have begun.
        ended_ns: the same for its end.
    """
    middle = (sum(ended_ns) - sum(began_ns)) / 2 / NANOSECONDS
    halves = [(last - first) / 2 / NANOSECONDS for first, last in (began_ns, ended_ns)]
    uncertainty = math.hypot(*halves, _CLOCK_ERROR * middle) / math.sqrt(3.0)
    return Figure(value=middle, unit="s", uncertainty=uncertainty)
