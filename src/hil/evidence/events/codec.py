"""The codec of events: canonical bytes in a journal's line, and the typed event that they tell."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

import msgspec

from hil.documents.canonical import JsonError
from hil.documents.suggest import did_you_mean
from hil.evidence.events import bench, cases, people, run
from hil.evidence.events.event import Event
from hil.evidence.events.quick_json import quick_canonical

__all__ = ["KINDS", "decode", "encode", "stamped"]

_Event = TypeVar("_Event", bound=Event)

KINDS: Mapping[str, type[Event]] = {
    each.kind(): each
    for module in (run, cases, bench, people)
    for each in (getattr(module, name) for name in module.__all__)
    if issubclass(each, Event)
}
"""The type of every kind of event, by what the journal calls it."""


def stamped(event: _Event, seq: int, t: float) -> _Event:
    """Return an event with its sequence number and its bench time, to the nanosecond."""
    return msgspec.structs.replace(event, seq=seq, t=round(t, 9))


def encode(event: Event) -> bytes:
    """Return the body of an event's line as canonical JSON.

    Raises:
        JsonError: for values that have no canonical JSON.
    """
    return quick_canonical(event)


def decode(body: Mapping[str, Any]) -> Event:
    """Return the event that a line's body tells.

    Raises:
        JsonError: for an unknown kind, and for a missing, unknown or mistyped field, which it names.
    """
    kind = body.get("kind")
    found = KINDS.get(kind) if isinstance(kind, str) else None
    if found is None:
        raise JsonError(f"there are no events of kind {kind!r}{did_you_mean(str(kind), KINDS)}")
    try:
        return msgspec.convert(body, found)
    except msgspec.ValidationError as error:
        raise JsonError(f"{kind}: {str(error).replace('$.', '')}") from None
