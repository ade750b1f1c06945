"""Abandoned attempts of a case: what they had read when their run was interrupted, which is void now."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from hil.evidence.events import (
    Check,
    Effect,
    Entry,
    Event,
    Fault,
    Origin,
    Recording,
    Resumed,
    Stop,
)

__all__ = ["Abandoned", "abandoned"]

_LEARNS = frozenset({"asks", "reads", "records"})
_MOST_LISTED = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Abandoned:
    """An attempt of a case that ended without a verdict, after its first reading.

    Attributes:
        case: the case.
        void_to: the sequence number of its last event, which identifies the resumption at which it was given up.
        t: bench time of that event in s.
        count: how many readings, answers, recordings and checks it had.
        read: the newest of them, in words.
        how: what ended it.
    """

    case: str
    void_to: int
    t: float
    count: int
    read: tuple[str, ...]
    how: str

    @property
    def text(self) -> str:
        """Description of the attempt, as a sentence without a full stop."""
        more = self.count - len(self.read)
        readings = f"{'; '.join(self.read)}{f' ({more} more before)' if more else ''}"
        return f"{self.how} at {self.t:g} s without a verdict, after it had read {readings}"

    @property
    def counts(self) -> str:
        """Why its case is ABORTED, if its plan does not declare it repeatable."""
        return f"an earlier attempt counts: {self.text}; the plan does not declare the case repeatable"


def abandoned(happened: Iterable[Event], entry: Entry | None = None) -> tuple[Abandoned, ...]:
    """Return the attempts that were given up at each resumption of a run, in order.

    Only void events are examined: up to a checkpoint (a turn of a loop, a recording that continues, the end of a
    case) everything stands. A killed run whose simulated bench continues where it was leaves nothing void.

    Args:
        happened: the events of the run.
        entry: its current point of entry, if it is being resumed and its journal does not record that yet.
    """
    happened = tuple(happened)
    entries = [each.entry for each in happened if isinstance(each, Resumed) and each.entry]
    found: list[Abandoned] = []
    covered: list[tuple[int, int]] = []
    for each in (*entries, *([entry] if entry else [])):
        void = [
            event
            for event in happened
            if event.origin is not Origin.OUTSIDE
            and each.boundary < event.seq <= each.void_to
            and not any(first < event.seq <= last for first, last in covered)
        ]
        covered.append((each.boundary, each.void_to))
        found += _given_up(void, happened, each)
    return tuple(found)


def _given_up(void: Sequence[Event], happened: Sequence[Event], entry: Entry) -> list[Abandoned]:
    """Return the attempts in a void part of a run."""
    learnt: dict[str, list[str]] = {}
    for event in void:
        if text := _learnt(event):
            learnt.setdefault(str(getattr(event, "case", "")), []).append(text)
    for case, text in _rows(happened, void, entry):
        learnt.setdefault(case, []).append(text)
    stop = next((event for event in reversed(void) if isinstance(event, Stop)), None)
    return [
        Abandoned(
            case=case,
            void_to=entry.void_to,
            t=max((event.t for event in void), default=0.0),
            count=len(texts),
            read=tuple(texts[-_MOST_LISTED:]),
            how=f"stopped by {stop.reason}" if stop else "interrupted",
        )
        for case, texts in learnt.items()
    ]


def _rows(happened: Sequence[Event], void: Sequence[Event], entry: Entry) -> Iterable[tuple[str, str]]:
    """Yield the recordings of cases that lost rows, whether begun before or after the point of entry."""
    begun = {event.recording: event for event in happened if isinstance(event, Recording) and event.case is not None}
    retaken = {event.recording for event in void if isinstance(event, Recording)}
    parts: Mapping[str, int] = {part.recording: part.end - part.first for part in entry.rows}
    for name in dict.fromkeys((*parts, *retaken)):
        recording = begun.get(name)
        if recording is not None and recording.case is not None and (name in retaken or parts[name] > 0):
            rows = parts.get(name)
            yield recording.case, f"recording {recording.name}{f', {rows} rows' if rows else ''}"


def _learnt(event: Event) -> str:
    """Return what a case learns from an event, in words; empty if nothing."""
    match event:
        case Effect(effect=kind, raised="") if kind in _LEARNS:
            return f"{event.name} {_value(event.result)}".strip()
        case Fault(dut=True):
            return f"{event.device}: {event.message}"
        case Check():
            return f"{event.requirement} {event.parameter} {event.verdict}"
    return ""


def _value(result: object) -> str:
    """Return the result of an effect, if it fits into a sentence."""
    if isinstance(result, Mapping) and "value" in result and "unit" in result:
        return f"{_number(result['value'])} {result['unit']}"
    return _number(result) if isinstance(result, str | int | float) else ""


def _number(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
