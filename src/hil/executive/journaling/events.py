"""Event dispatch: events are written to the journal first, then shown to all listeners."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

import msgspec

from hil.clock.port import Clock
from hil.evidence.events import NOTHING, Anomaly, Effect, Entry, Event
from hil.evidence.journal.writer import UNRECORDED, Journal
from hil.executive.ending.stop import StopFlags, leave_unsealed
from hil.model.errors import Diverged, EvidenceError

__all__ = ["DISK_FULL", "Caller", "Eventful", "Events", "Listener", "Retraced", "Unheard"]

DISK_FULL = "disk full"
"""The reason of a stop caused by a full disk."""

Listener = Callable[[Event], None]
"""Takes one event, with its bench time; what it raises would stop a run, so it must not raise."""


class Retraced(Protocol):
    """The events of an interrupted run, which a resumed one retraces before it writes anything new."""

    @property
    def over(self) -> bool:
        """Whether every event that recurs has been retraced."""
        ...

    @property
    def course(self) -> int:
        """How many events of the run's own course are before them, in the head of the journal."""
        ...

    def take(self, event: Event, t: float) -> bool:
        """Return whether this event is the next one in the journal; see `Past.take`."""
        ...

    def skip(self, last: int) -> None:
        """Skip the events up to sequence number `last`, which are void."""
        ...

    def resume(self, t: float, entry: Entry | None) -> None:
        """Record at bench time `t` that the run was resumed, with its point of entry unless it simply continues."""
        ...


class Eventful(Protocol):
    """The run that the events belong to."""

    def before_event(self) -> None:
        """Called before the event is stamped: catch up with where the run is."""
        ...

    def before_line(self) -> None:
        """Called before a line of the journal is written: hand what the event is based on to the operating system."""
        ...

    def after_event(self, course: int) -> None:
        """Called after an event of the run's own course, with their number so far."""
        ...


class Caller(Protocol):
    """The caller of a run, notified of what the run cannot recover from."""

    def diverged(self, error: Diverged) -> None:
        """Report why a resumed run does not retrace its past; nothing more may be written."""
        ...

    def stopped_early(self) -> None:
        """Report that a resumed run is to stop before it has retraced its past, which it cannot do."""
        ...

    def expect(self, seconds: float | None) -> None:
        """Start a timeout: without another call within this many seconds the process is ended; None cancels it."""
        ...

    def given_up(self) -> None:
        """Seal and end the process, for a case that never ends."""
        ...


class Unheard:
    """No caller: what the run cannot recover from is raised, or ends the process."""

    def diverged(self, error: Diverged) -> None:
        """Do nothing: the error is raised."""

    def stopped_early(self) -> None:
        """Do nothing: the stop is raised at the next scheduling point."""

    def expect(self, seconds: float | None) -> None:
        """Start no timeout: a person waits for the run."""

    def given_up(self) -> None:
        """End the process without a seal."""
        leave_unsealed()


class Events:
    """The one channel between the run and everything downstream.

    Args:
        journal: where every event is written before any listener sees it.
        flags: requested to end the run once the disk is full; later events are written as far as space allows.
        past: the events of a resumed run so far, which are retraced first and not written a second time.
        caller: is notified why a resumed run does not retrace its past.
    """

    def __init__(
        self, journal: Journal, flags: StopFlags, past: Retraced | None = None, caller: Caller | None = None
    ) -> None:
        self._journal = journal
        self._flags = flags
        self._past = past
        self._caller = caller or Unheard()
        self._count = past.course if past else 0
        self._unrecorded = False
        self._clock: Clock | None = None
        self._run: Eventful | None = None
        self._listeners: dict[Listener, tuple[type[Event], ...]] = {}
        self._hearing: dict[tuple[type[Event], str], tuple[Listener, ...]] = {}

    @property
    def course(self) -> int:
        """How many events of the run's own course there are."""
        return self._count

    @property
    def lost(self) -> int:
        """How many events found no space, and are not accounted for yet; see `Journal.lost`."""
        return self._journal.lost

    def follow(self, clock: Clock) -> None:
        """Stamp events with this clock from now on; before, they are stamped zero."""
        self._clock = clock

    def serve(self, run: Eventful) -> None:
        """Notify this run of every further event, before and after it is written."""
        self._run = run

    def tick(self) -> None:
        """Sync events that have waited long enough, see `Journal.tick`."""
        self._journal.tick()

    def listen(self, listener: Listener, *kinds: type[Event]) -> None:
        """Show every further event of these kinds to `listener`.

        By default they are the ones it `hears`, and of effects those whose kind is among its `effects`; a listener
        without these attributes is shown all. A case has thousands of readings that are for the journal only.
        """
        self._listeners[listener] = kinds or getattr(listener, "hears", (Event,))
        self._hearing.clear()

    def write(self, event: Event, *, beside: Mapping[str, object] = NOTHING) -> None:
        """Write an event, then show it; a line of the journal is never cut in two by a request to stop.

        Args:
            event: the event, not stamped yet.
            beside: see `Journal.write`.
        """
        run = self._run
        with self._flags.undisturbed():  # the number of events marks where bench time caught up with the present
            if run is not None:
                run.before_event()
            t = self._now()
            if not self._comes_again(event, t):
                self._append(event, t, beside)
            if self._listeners:
                self.show(msgspec.structs.replace(event, t=t))
            self._count += event.recurs
        if event.recurs and run is not None:
            run.after_event(self._count)

    def show(self, event: Event) -> None:
        """Show an event to all listeners."""
        kind = type(event)
        key = kind, event.effect if isinstance(event, Effect) else ""
        listeners = self._hearing.get(key)
        if listeners is None:
            listeners = self._hearing[key] = tuple(each for each in self._listeners if self._is_for(each, *key))
        for listener in listeners:
            try:
                listener(event)
            except (OSError, ValueError):  # a display that is gone: its buffer would keep everything for ever
                self._listeners.pop(listener, None)
                self._hearing.clear()
            except (Exception, SystemExit):  # noqa: BLE001, S112 - a listener's failure must not affect the bench
                continue

    def _is_for(self, listener: Listener, kind: type[Event], effect: str) -> bool:
        """Return whether a listener wants events of a kind, and for effects, of this kind of effect."""
        effects = getattr(listener, "effects", None)
        return issubclass(kind, self._listeners[listener]) and (not effect or effects is None or effect in effects)

    def skip(self, last: int) -> None:
        """Skip the events of the past up to sequence number `last`: they are void."""
        if self._past is not None:
            self._past.skip(last)

    @property
    def comes_again(self) -> bool:
        """Whether the journal holds events that have not been retraced yet."""
        return self._past is not None and not self._past.over

    def end_of_past(self, entry: Entry | None = None) -> None:
        """Note it if everything has been retraced, with the point of entry unless the run simply continues."""
        if self._past is not None and self._past.over:
            past, self._past = self._past, None
            past.resume(self._now(), entry)

    def _now(self) -> float:
        return self._clock.now() if self._clock else 0.0

    def _append(self, event: Event, t: float, beside: Mapping[str, object]) -> None:
        if self._run is not None:
            try:
                self._run.before_line()
                self._unrecorded = False
            except OSError:
                self._note_unrecorded(t)
        self._put(event, t, beside)

    def _note_unrecorded(self, t: float) -> None:
        """Note, once, that the transcript no longer holds what the events from here on stand on."""
        self._flags.leave_off(DISK_FULL)
        if not self._unrecorded:
            self._unrecorded = True
            self._put(Anomaly(text=UNRECORDED), t, NOTHING)

    def _put(self, event: Event, t: float, beside: Mapping[str, object]) -> None:
        try:
            self._journal.write(event, t, beside=beside)
        except EvidenceError:
            self._flags.leave_off(DISK_FULL)  # reported once, see Journal.write

    def _comes_again(self, event: Event, t: float) -> bool:
        if self._past is None:
            return False
        try:
            again = self._past.take(event, t)
        except Diverged as error:
            self._caller.diverged(error)
            raise
        if not again:
            self.end_of_past()
        return again
