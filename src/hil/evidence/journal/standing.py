"""The events that stand: a run that was entered again left some behind that are void."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from hil.evidence.events import Event, Origin, Resumed, Voided
from hil.evidence.events.codec import KINDS
from hil.evidence.journal.reader import Body

__all__ = ["Entry", "entries", "standing", "standing_bodies"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """Where a run was entered again after it had been stopped.

    Attributes:
        place: how many events of the run's own course stand up to the one that it was entered behind.
        boundary: the sequence number of that event.
        void_to: the sequence number of the last event that is void; the first is the one behind the boundary.
        operations: how many operations the transcript held then; those since the boundary are void, too.
        at: the bench time in s at which it was entered.
        number: the number that the next recording got.
        rows: the void rows of every recording that went on.
        kept: the recording at whose beginning it was entered, whose rows are not void; empty where there was none.
        over: whether every case had ended, so that nothing was driven any more but the way to the safe state.
    """

    place: int
    boundary: int
    void_to: int
    operations: int
    at: float
    number: int
    rows: tuple[Voided, ...]
    kept: str = ""
    over: bool = False


def entries(events: Iterable[Event]) -> tuple[Entry, ...]:
    """Return where a run was entered again, in order."""
    return tuple(
        Entry(
            place=event.entry.place,
            boundary=event.entry.boundary,
            void_to=event.entry.void_to,
            operations=event.entry.operations,
            at=event.t,
            number=event.entry.number,
            rows=event.entry.rows,
            kept=event.entry.kept,
            over=bool(event.entry.over),
        )
        for event in events
        if isinstance(event, Resumed) and event.entry
    )


def standing(events: Sequence[Event]) -> tuple[Event, ...]:
    """Return the events that stand; what came from outside of the run's own course is never void."""
    void = [(entry.boundary, entry.void_to) for entry in entries(events)]
    return tuple(
        event
        for event in events
        if event.origin is Origin.OUTSIDE or not any(after < event.seq <= last for after, last in void)
    )


def standing_bodies(events: Sequence[Body]) -> tuple[Body, ...]:
    """Return the bodies of the events that stand."""
    told = [event["entry"] for event in events if event["kind"] == "resumed" and event.get("entry")]
    void = [(entry["boundary"], entry["void_to"]) for entry in told]
    return tuple(
        event
        for event in events
        if KINDS[event["kind"]].origin is Origin.OUTSIDE
        or not any(after < event["seq"] <= last for after, last in void)
    )
