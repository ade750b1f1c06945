"""Events for tests: what a test does not care about is blank."""

from __future__ import annotations

import types
from collections.abc import Iterable, Mapping
from enum import Enum
from functools import cache
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec

from hil.evidence.events import Event, Part
from hil.evidence.events.codec import KINDS, decode
from hil.evidence.results.outcome import Outcome

__all__ = ["body_of", "event_of", "events_of", "outcome_of"]


def event_of(kind: str, **fields: Any) -> Event:
    """Return an event; fields are JSON values, and those that are missing, inner ones too, are blank."""
    return decode({**_filled(KINDS[kind], fields), "kind": kind})


def events_of(bodies: Iterable[Mapping[str, Any]]) -> list[Event]:
    """Return the events that some bodies tell; what is missing is blank."""
    return [event_of(**body) for body in bodies]


def body_of(kind: str, **fields: Any) -> dict[str, Any]:
    """Return the body of an event as JSON; what is missing is blank."""
    return {**msgspec.to_builtins(event_of(kind, **fields)), "kind": kind}


def outcome_of(fields: Mapping[str, Any]) -> Outcome:
    """Return results; fields are JSON values, and those that are missing, inner ones too, are blank."""
    run = fields.get("run")
    outcome = msgspec.convert(_filled(Outcome, {**fields, "run": None}), Outcome)
    return msgspec.structs.replace(outcome, run=event_of("run", **run) if run else None)


def _filled(kind: type[msgspec.Struct], fields: Mapping[str, Any]) -> dict[str, Any]:
    hints, required = _fields(kind)
    known = {name: _fill(hints[name], value) if name in hints else value for name, value in fields.items()}
    return {**{name: _blank(hints[name]) for name in required}, **known}


@cache
def _fields(kind: type[msgspec.Struct]) -> tuple[Mapping[str, Any], tuple[str, ...]]:
    """Return the type of every field, and the names of those that have to be there."""
    return get_type_hints(kind), tuple(each.name for each in msgspec.structs.fields(kind) if each.required)


def _fill(hint: Any, value: Any) -> Any:
    for each in (hint, *get_args(hint)):
        if isinstance(each, type) and issubclass(each, Part):
            if isinstance(value, list | tuple):
                return [_filled(each, item) if isinstance(item, Mapping) else item for item in value]
            return _filled(each, value) if isinstance(value, Mapping) else value
    return value


def _blank(hint: Any) -> Any:  # noqa: PLR0911 - one return per kind of type
    origin = get_origin(hint)
    if origin in {Union, types.UnionType}:
        return None if type(None) in get_args(hint) else _blank(get_args(hint)[0])
    if origin is Literal:
        return get_args(hint)[0]
    if origin is tuple:
        return []
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return {}
    if hint is Any:
        return None
    if issubclass(hint, Part):
        return _filled(hint, {})
    if issubclass(hint, Enum):
        return next(iter(hint)).value
    return hint()
