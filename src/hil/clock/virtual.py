"""Virtual next-event clock: time jumps from event to event without waiting."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from datetime import timedelta
from heapq import heappop, heappush

from hil.clock import wall
from hil.clock.port import NANOSECONDS, ClockError

__all__ = ["Event", "VirtualClock"]

_MOST_EVENTS_AT_ONE_INSTANT = 100_000


class Event:
    """A scheduled event that can be cancelled.

    Attributes:
        number: its order among the events of one device at one instant.
        action: called when it is due.
        cancelled: whether it was cancelled.
    """

    __slots__ = ("action", "cancelled", "number")

    def __init__(self, number: int, action: Callable[[], None]) -> None:
        self.number = number
        self.action = action
        self.cancelled = False

    def cancel(self) -> None:
        """Cancel the event; it may already have happened."""
        self.cancelled = True

    def __lt__(self, other: Event) -> bool:
        """Order events in the heap; of events with the same number all but one are cancelled."""
        return other.cancelled and not self.cancelled


class VirtualClock:
    """A next-event clock.

    Time is an integer number of nanoseconds, so that sums of steps are exact and two runs agree.
    Simultaneous events happen in the order of their device, then in the order in which they were
    scheduled. Plants follow the clock: every observer sees a plant as it is at that instant.

    Args:
        epoch: the bench's epoch in UTC, ISO 8601; simulated UTC is this plus the virtual time.

    Attributes:
        asked: number of events scheduled, which is the number of the next one. A restore sets it.
    """

    def __init__(self, epoch: str = "2026-01-01T00:00:00Z") -> None:
        self._epoch = wall.moment_of(epoch)
        self._now_ns = 0
        self._events: list[tuple[int, int, int, Event]] = []
        self.asked = 0
        self._at_this_instant = 0
        self._waiting = "nobody"
        self._awaited_ns = 0  # end of an unconditional wait

    def now_ns(self) -> int:
        """Return the nanoseconds since the bench's epoch."""
        return self._now_ns

    look = now_ns

    def now(self) -> float:
        """Return the seconds since the bench's epoch."""
        return self._now_ns / NANOSECONDS

    def utc(self) -> str:
        """Return the simulated UTC: epoch plus virtual time."""
        moment = self._epoch + timedelta(microseconds=self._now_ns // 1000)
        return moment.isoformat(timespec="microseconds").replace("+00:00", "Z")

    def state(self) -> Mapping[str, int]:
        """Return the time, and the number of events scheduled."""
        return {"now_ns": self._now_ns, "asked": self.asked}

    def restore(self, state: Mapping[str, int]) -> None:
        """Continue from what `state` returned; events must have been rescheduled beforehand.

        Raises:
            ValueError: if the clock stands at another instant.
        """
        if state["now_ns"] != self._now_ns:
            raise ValueError(f"the state is of {state['now_ns']} ns, the clock is at {self._now_ns} ns")
        self.asked = state["asked"]

    def at(self, when_ns: int, action: Callable[[], None], number: int | None = None, *, device: int = 0) -> Event:
        """Schedule `action` at `when_ns`, or at once if that has passed; `device` orders simultaneous events.

        A `number` is that of an event scheduled before its peer was restored: it keeps its order, and new events come
        after it.
        """
        if number is None:
            number = self.asked
            self.asked = number + 1
        else:
            self.asked = max(self.asked, number + 1)
        event = Event(number, action)
        heappush(self._events, (max(when_ns, self._now_ns), device, number, event))
        return event

    def next_ns(self) -> int | None:
        """Return when the next event is due, None while there is none."""
        events = self._events
        while events and events[0][3].cancelled:
            heappop(events)
        return events[0][0] if events else None

    def calm_until_ns(self) -> int:
        """Return the last instant before any other event or the end of an unconditional wait; it may be past.

        Called during an event. A device that sends every few seconds for weeks can send everything up to then at once:
        each part has its own instant, and nothing can observe the device in between.
        """
        events = self._events
        return min(self._awaited_ns, events[0][0] - 1) if events else self._awaited_ns

    def sleep(self, seconds: float) -> None:
        """Let `seconds` pass, executing all events due meanwhile."""
        if not seconds >= 0:
            raise ClockError(f"cannot sleep for {seconds} s")
        self.wait_until(self._now_ns + round(seconds * NANOSECONDS))

    def wait_until(self, when_ns: int) -> None:
        """Let time pass until `when_ns`, executing all events due meanwhile."""
        events, self._waiting = self._events, "nobody"
        while events and events[0][0] <= when_ns:
            due_ns, _, _, event = heappop(events)
            if event.cancelled:
                continue
            self._awaited_ns = when_ns
            if due_ns > self._now_ns:
                self._now_ns, self._at_this_instant = due_ns, 0
            self._at_this_instant += 1
            if self._at_this_instant > _MOST_EVENTS_AT_ONE_INSTANT:
                raise self._crowded()
            event.action()
        if when_ns > self._now_ns:
            self._now_ns, self._at_this_instant = when_ns, 0

    def run(self, deadline_ns: int, done: Callable[[], bool], who: str = "nobody") -> bool:
        """Let time pass until `done()` or the deadline; return whether it is done.

        This is how a read waits: time stops at the event that brought the last byte, and moves on to
        the deadline only if none did. If time is stuck, the error names the waiting `who`.
        """
        events, self._waiting = self._events, who
        while not done():
            while events and events[0][3].cancelled:
                heappop(events)
            if not events or events[0][0] > deadline_ns:
                if deadline_ns > self._now_ns:
                    self._now_ns, self._at_this_instant = deadline_ns, 0
                return done()
            due_ns, _, _, event = heappop(events)
            self._awaited_ns = 0  # any event may be what is waited for
            if due_ns > self._now_ns:
                self._now_ns, self._at_this_instant = due_ns, 0
            self._at_this_instant += 1
            if self._at_this_instant > _MOST_EVENTS_AT_ONE_INSTANT:
                raise self._crowded()
            event.action()
        return True

    def _crowded(self) -> ClockError:
        return ClockError(
            f"more than {_MOST_EVENTS_AT_ONE_INSTANT} events at {self.now():.9f} s while {self._waiting} waits"
        )
