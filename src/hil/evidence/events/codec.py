"""Codec of events: between typed events and the canonical bytes in a line of the journal."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache
from json.encoder import encode_basestring
from typing import Any, TypeVar

import msgspec

from hil.documents.canonical import JsonError, Unusual, canonical, library_text, quick_text
from hil.documents.suggest import did_you_mean
from hil.evidence.events import bench, cases, code, people, recordings, run
from hil.evidence.events.event import Event

__all__ = ["KINDS", "convert", "decode", "encode", "is_text_of", "plain", "quick_canonical", "stamped", "told"]


def quick_canonical(value: object) -> bytes:
    """Return the canonical JSON of `value`, the same bytes as `canonical`.

    The journal writes a line per effect, and encoding it must not dominate the time of a simulated run.

    Raises:
        JsonError: for what has no canonical JSON.
    """
    try:
        return quick_text(value, _struct).encode()
    except (Unusual, RecursionError, TypeError, UnicodeEncodeError):
        return canonical(plain(value))


def is_text_of(text: bytes, value: object, *, plain_numbers: bool = False) -> bool:
    """Return whether this text is what `quick_canonical` returns, for values read from JSON or derived from it.

    Args:
        text: the text.
        value: the value.
        plain_numbers: whether all numbers are known to be integers of less than 16 digits, and all keys ASCII.
    """
    if plain_numbers:
        return _ENCODE(value) == text
    quick, is_canonical = library_text(value)
    return (quick == text and is_canonical) or quick_canonical(value) == text


_ENCODE = msgspec.json.Encoder(order="sorted").encode


def told(value: msgspec.Struct) -> dict[str, object]:
    """Return the fields of a struct that are written, unconverted."""
    fields = [(name, getattr(value, name), default) for name, _, default in _members(type(value)) if name]
    return {name: item for name, item, default in fields if item is not default}


def plain(value: object) -> Any:  # noqa: ANN401 - JSON holds what it holds
    """Return a value in which structs are plain objects, and defaults are left out as in the journal."""
    if isinstance(value, msgspec.Struct):
        tag = value.__struct_config__.tag
        return {name: plain(item) for name, item in told(value).items()} | ({"kind": tag} if tag else {})
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value


def _struct(value: object) -> str:
    if not isinstance(value, msgspec.Struct):
        raise Unusual
    members = []
    for name, written, default in _members(type(value)):
        item = getattr(value, name) if name else None
        if not name:
            members.append(written)
        elif item is not default:
            members.append(written + quick_text(item, _struct))
    return "{" + ",".join(members) + "}"


@cache
def _members(kind: type[msgspec.Struct]) -> tuple[tuple[str, str, object], ...]:
    """Return, for every field, name, beginning of its text, and the default that is not written; and the whole tag."""
    found = [(each.name, f"{encode_basestring(each.name)}:", _left_out(each)) for each in msgspec.structs.fields(kind)]
    if (tag := kind.__struct_config__.tag) is not None:
        found.append(("", f'"{kind.__struct_config__.tag_field}":{encode_basestring(str(tag))}', None))
    return tuple(sorted(found, key=lambda member: member[1]))


def _left_out(field: msgspec.structs.FieldInfo) -> object:
    """Return the value at which a field is omitted; the stamp of an event has none."""
    return field.default if field.default in (None, "", (), False) else msgspec.NODEFAULT


_Event = TypeVar("_Event", bound=Event)

KINDS: Mapping[str, type[Event]] = {
    each.kind(): each
    for module in (run, cases, code, recordings, bench, people)
    for each in (getattr(module, name) for name in module.__all__)
    if issubclass(each, Event)
}
"""The type of every kind of event, by its name in the journal."""


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
    """Return the event in a line's body.

    Raises:
        JsonError: for an unknown kind, and with every field that is missing, unknown or mistyped.
    """
    kind = body.get("kind")
    found = KINDS.get(kind) if isinstance(kind, str) else None
    if found is None:
        raise JsonError(f"field 'kind': there are no events of kind {kind!r}{did_you_mean(str(kind), KINDS)}")
    return convert(body, found, str(kind))


_Struct = TypeVar("_Struct", bound=msgspec.Struct)


def convert(value: Mapping[str, Any], kind: type[_Struct], what: str) -> _Struct:
    """Return an object as its type declares it.

    Args:
        value: the object.
        kind: its type.
        what: what it is, for messages.

    Raises:
        JsonError: with every field that is missing, unknown or mistyped.
    """
    try:
        return msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        wrong = list(_wrong_fields(value, kind)) or [str(error)]
        raise JsonError(f"{what}: {'; '.join(wrong)}") from None


def _wrong_fields(value: Mapping[str, Any], kind: type[msgspec.Struct]) -> Iterator[str]:
    """Yield a sentence for every field that is not as declared; of nested ones, only the first."""
    declared = {each.encode_name: each for each in msgspec.structs.fields(kind)}
    config = kind.__struct_config__
    for name in sorted(value.keys() - declared.keys() - {config.tag_field}):
        if config.forbid_unknown_fields:
            yield f"unknown field '{name}'{did_you_mean(name, declared)}"
    for name, each in declared.items():
        if name not in value:
            if each.required:
                yield f"field '{name}' is missing"
            continue
        try:
            msgspec.convert(value[name], each.type)
        except msgspec.ValidationError as error:
            yield _reworded(name, str(error))


_JSON_WORDS = {
    "str": "text", "int": "a whole number", "float": "a number", "bool": "true or false", "null": "null",
    "array": "a list", "object": "an object",
}  # fmt: skip
_INSIDE = re.compile(r"Object (missing required|contains unknown) field `([^`]*)`")
_EXPECTED = re.compile(r"Expected `([^`]*)`, got `([^`]*)`")
_ENUM = re.compile(r"Invalid enum value (.*)", re.DOTALL)


def _reworded(field: str, said: str) -> str:
    """Return the library's message about a value in our words; the place that it names is within the field."""
    message, _, place = said.partition(" - at `$")
    where = f"{field}{place.removesuffix('`')}"
    if found := _INSIDE.fullmatch(message):
        return f"field '{where}.{found[2]}' is {'missing' if found[1].startswith('missing') else 'unknown'}"
    if found := _EXPECTED.fullmatch(message):
        due, there = (
            " or ".join(_JSON_WORDS.get(part, part) for part in words.split(" | ")) for words in found.groups()
        )
        return f"field '{where}' must be {due}, found {there}"
    if found := _ENUM.fullmatch(message):
        return f"field '{where}' has the unknown value {found[1]}"
    return f"field '{where}': {message}"
