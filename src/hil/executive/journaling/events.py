"""Events: written to the journal first, then shown to all listeners."""

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
"""The reason of a stop that the disk asked for."""

Listener = Callable[[Event], None]
"""Takes one event, with its bench time; what it raises would stop a run, so it must not raise."""


class Retraced(Protocol):
    """The events of an interrupted run, which a resumed one reproduces before it writes anything new."""

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


class Eventful(Protocol):
    """The run whose events they are."""

    def before_event(self) -> None:
        """Come to where the run is, before the event is stamped."""
        ...

    def before_line(self) -> None:
        """Hand what the event stands on to the operating system, before a line of the journal is written."""
        ...

    def after_event(self, course: int) -> None:
        """Come after an event of the run's own course, of which there are so many now."""
        ...


class Caller(Protocol):
    """Anyone who called for the run, and hears of what it cannot come back from."""

    def diverged(self, error: Diverged) -> None:
        """Hear why a resumed run does not come to its past again; nothing is to be written any more."""
        ...

    def stopped_early(self) -> None:
        """Hear that a resumed run is to stop before it has replayed its past: it cannot."""
        ...

    def expect(self, seconds: float | None) -> None:
        """Expect to be called again within so many seconds, and end the process if not; None ends that."""
        ...

    def given_up(self) -> None:
        """Seal and end the process, for a case that never ends; nothing of the run is left then."""
        ...


class Unheard:
    """Nobody called for the run: what it cannot come back from is raised, or ends the process."""

    def diverged(self, error: Diverged) -> None:
        """Do nothing: it is raised."""

    def stopped_early(self) -> None:
        """Do nothing: the stop is raised at the next scheduling point."""

    def expect(self, seconds: float | None) -> None:
        """Expect nothing: a person waits for it."""

    def given_up(self) -> None:
        """End the process without a seal."""
        leave_unsealed()


class Events:
    """The one vocabulary between the run and everything downstream.

    Args:
        journal: where every event is written before anybody sees it.
        flags: asked to end the run once the disk is full; later events go in as far as space allows.
        past: the events of a resumed run so far, which come again first and are not written a second time.
        caller: hears why a resumed run does not come to its past again.
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
        """Stamp events with this clock from now on; before that they are at zero."""
        self._clock = clock

    def serve(self, run: Eventful) -> None:
        """Tell this run of every further event before it is written, and after that."""
        self._run = run

    def tick(self) -> None:
        """Bring events to the disk that wait for long, see `Journal.tick`."""
        self._journal.tick()

    def listen(self, listener: Listener, *kinds: type[Event]) -> None:
        """Show every further event of these kinds to `listener`.

        Where none is named, they are those that it `hears`, and of effects those whose kind is among its `effects`;
        one without such attributes is shown all. A case has thousands of readings that are for nobody but the journal.
        """
        self._listeners[listener] = kinds or getattr(listener, "hears", (Event,))
        self._hearing.clear()

    def write(self, event: Event, *, beside: Mapping[str, object] = NOTHING) -> None:
        """Write an event down, then show it; a line of the journal is never cut in two by a request to stop.

        Args:
            event: the event, not stamped yet.
            beside: see `Journal.write`.
        """
        run = self._run
        with self._flags.undisturbed():  # the number of events says where bench time caught up with the present
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
            except (OSError, ValueError):  # a display that is gone: what it is given would wait in its buffer for ever
                self._listeners.pop(listener, None)
                self._hearing.clear()
            except (Exception, SystemExit):  # noqa: BLE001, S112 - the bench must not hear of it
                continue

    def _is_for(self, listener: Listener, kind: type[Event], effect: str) -> bool:
        """Return whether events of a kind, of effects those of this kind of theirs, are for a listener."""
        effects = getattr(listener, "effects", None)
        return issubclass(kind, self._listeners[listener]) and (not effect or effects is None or effect in effects)

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
