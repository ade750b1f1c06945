"""Events: written to the journal first, then shown to whoever listens."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Protocol

import msgspec

from hil.clock.port import Clock
from hil.evidence.events import NOTHING, Event
from hil.evidence.journal.past import Entry
from hil.evidence.journal.writer import Journal
from hil.executive.ending.stop import StopFlags
from hil.model.errors import Diverged, EvidenceError

__all__ = ["DISK_FULL", "Events", "Listener", "Retraced"]

DISK_FULL = "disk full"
"""The reason of a stop that the disk asked for."""

Listener = Callable[[Event], None]
"""Takes one event, with its bench time; what it raises would stop a run, so it must not raise."""


class Retraced(Protocol):
    """The events of an interrupted run, which a resumed one comes to again before it writes anything new."""

    @property
    def over(self) -> bool:
        """Whether every event that comes again has come."""
        ...

    @property
    def course(self) -> int:
        """How many events of the run's own course stand before them, in the head of the journal."""
        ...

    def take(self, event: Event, t: float) -> bool:
        """Return whether the journal holds this event next; see `Past.take`."""
        ...

    def skip(self, last: int) -> None:
        """Pass over the events up to sequence number `last`, which are void."""
        ...

    def resume(self, t: float, entry: Entry | None) -> None:
        """Write down at bench time `t` that the run was resumed, and where it was entered, if not where it was."""
        ...


class Events:
    """The one vocabulary between the run and everything downstream.

    Args:
        journal: where every event is written before anybody sees it.
        flags: asked to end the run once the disk is full; later events go in as far as space allows.
        past: the events of a resumed run so far, which come again first and are not written a second time.

    Attributes:
        ahead: is called before an event is written: what the event stands on goes to the operating system first.
        catch_up: is called before every event, see `Scheduler.catch_up`.
        behind: is called with the number of events of the run's own course, after each of them.
        at_divergence: hears why a resumed run does not come to its past again; nothing is to be written any more.
        at_stop: is called before every event of a run that was asked to stop.
    """

    def __init__(self, journal: Journal, flags: StopFlags, past: Retraced | None = None) -> None:
        self._journal = journal
        self._flags = flags
        self._past = past
        self._count = past.course if past else 0
        self.ahead: Callable[[], None] = lambda: None
        self.catch_up: Callable[[], None] = lambda: None
        self.behind: Callable[[int], None] = lambda _: None
        self.at_divergence: Callable[[Diverged], object] = lambda _: None
        self.at_stop: Callable[[], None] = lambda: None
        self._clock: Clock | None = None
        self._listeners: list[Listener] = []

    @property
    def course(self) -> int:
        """How many events of the run's own course there are."""
        return self._count

    def follow(self, clock: Clock) -> None:
        """Stamp events with this clock from now on; before that they are at zero."""
        self._clock = clock

    def tick(self) -> None:
        """Bring events to the disk that wait for long, see `Journal.tick`."""
        self._journal.tick()

    def listen(self, listener: Listener) -> None:
        """Show every further event to `listener`."""
        self._listeners.append(listener)

    def write(self, event: Event, *, beside: Mapping[str, object] = NOTHING) -> None:
        """Write an event down, then show it; a line of the journal is never cut in two by a request to stop.

        Args:
            event: the event, not stamped yet.
            beside: see `Journal.write`.
        """
        if self._flags.reason:
            self.at_stop()
        with self._flags.undisturbed():  # where bench time came to the present is told by the number of events
            self.catch_up()
            t = self._now()
            if not self._comes_again(event, t):
                self._append(event, t, beside)
            if self._listeners:
                self.show(msgspec.structs.replace(event, t=t))
            self._count += event.recurs
        if event.recurs:
            self.behind(self._count)

    def show(self, event: Event) -> None:
        """Show an event to whoever listens."""
        for listener in tuple(self._listeners):
            try:
                listener(event)
            except (OSError, ValueError):  # a display that is gone: what it is given would wait in its buffer for ever
                self._listeners.remove(listener)
            except (Exception, SystemExit):  # noqa: BLE001, S112 - the bench must not hear of it
                continue

    def skip(self, last: int) -> None:
        """Let the events of the past up to sequence number `last` not come again: they are void."""
        if self._past is not None:
            self._past.skip(last)

    @property
    def comes_again(self) -> bool:
        """Whether the journal holds events that have not come again yet."""
        return self._past is not None and not self._past.over

    def end_of_past(self, entry: Entry | None = None) -> None:
        """Note that everything has come again, if it has, and where the run was entered, if not where it was."""
        if self._past is not None and self._past.over:
            past, self._past = self._past, None
            past.resume(self._now(), entry)

    def _now(self) -> float:
        return self._clock.now() if self._clock else 0.0

    def _append(self, event: Event, t: float, beside: Mapping[str, object]) -> None:
        with suppress(OSError):  # a full disk is told by who looks after it
            self.ahead()
        try:
            self._journal.write(event, t, beside=beside)
        except EvidenceError:
            self._flags.leave_off(DISK_FULL)  # told once, see Journal.write

    def _comes_again(self, event: Event, t: float) -> bool:
        if self._past is None:
            return False
        try:
            again = self._past.take(event, t)
        except Diverged as error:
            self.at_divergence(error)
            raise
        if not again:
            self.end_of_past()
        return again
