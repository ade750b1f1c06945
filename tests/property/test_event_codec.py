"""The codec of events: every kind is written and read, and what is not as its type says is refused by name."""

from __future__ import annotations

import types
from collections.abc import Mapping
from enum import Enum
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec
import pytest
import sweeps
from evidence_runs import stamps
from hypothesis import given, settings
from hypothesis import strategies as st
from typed_events import event_of

from hil.documents.canonical import JsonError, canonical, parse_strict
from hil.evidence.events import Part
from hil.evidence.events.codec import KINDS, decode, encode
from hil.evidence.journal.reader import read_journal
from hil.evidence.journal.writer import Journal

TEXT = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
JSON = st.recursive(
    st.none() | st.booleans() | NUMBERS | TEXT,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXT, inner, max_size=3),
    max_leaves=4,
)
PLAIN = {str: TEXT, int: st.integers(-(2**53) + 1, 2**53 - 1), float: NUMBERS, bool: st.booleans(), Any: JSON}


def values(hint):  # noqa: PLR0911 - one return per kind of type
    """Return what a field of this type can hold."""
    origin, inner = get_origin(hint), get_args(hint)
    if hint in PLAIN:
        return PLAIN[hint]
    if hint is types.NoneType:
        return st.none()
    if origin in {Union, types.UnionType}:
        return st.one_of([values(each) for each in inner])
    if origin is Literal:
        return st.sampled_from(inner)
    if origin is tuple:
        return st.lists(values(inner[0]), max_size=3).map(tuple)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return st.dictionaries(TEXT, values(inner[1]), max_size=3)
    return st.sampled_from(hint) if issubclass(hint, Enum) else parts(hint)


def parts(kind):
    """Return events of a kind, or parts of them, with whatever their fields can hold."""
    hints = get_type_hints(kind)
    fields = {each.name: values(hints[each.name]) for each in msgspec.structs.fields(kind)}
    return st.builds(kind, **{name: found for name, found in fields.items() if name not in {"seq", "t"}})


@pytest.mark.parametrize("kind", sorted(KINDS))
@given(st.data())
@settings(max_examples=sweeps.chosen(4, 20))
def test_every_kind_is_written_and_read(tmp_path_factory, kind, data):
    """A journal gives back every event as it was, stamped, in canonical JSON, with an unbroken chain."""
    events = data.draw(st.lists(parts(KINDS[kind]), min_size=1, max_size=3))
    path = tmp_path_factory.mktemp("journal") / "journal.jsonl"
    with Journal(path, stamp=stamps()) as journal:
        for number, event in enumerate(events):
            journal.write(event, number + 0.1234567891)
        digest = journal.content_digest if kind != "results" else None
    reading = read_journal(path)
    assert (reading.findings, reading.torn) == ((), b"")
    assert digest is None or reading.content_digest == digest
    for number, (line, event) in enumerate(zip(reading.lines, events, strict=True)):
        assert line.event == msgspec.structs.replace(event, seq=number, t=number + 0.123456789)
        assert line.canonical
        assert canonical(parse_strict(line.raw)) == line.raw


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_what_the_type_does_not_say_is_refused_by_name(kind):
    """A field that is missing, unknown or of another type is never read as empty."""
    body = parse_strict(encode(msgspec.structs.replace(event_of(kind), seq=0, t=0.0)))
    assert decode(body) == msgspec.structs.replace(event_of(kind), seq=0, t=0.0)
    for field in msgspec.structs.fields(KINDS[kind]):
        if field.required:
            with pytest.raises(JsonError, match=f"{kind}: .*{field.name}. is missing"):
                decode({name: value for name, value in body.items() if name != field.name})
        if field.type is not Any:
            with pytest.raises(JsonError, match=f"{kind}: .*field .{field.name}"):
                decode({**body, field.name: [[object]]})
    with pytest.raises(JsonError, match=f"{kind}: .*unknown field .more."):
        decode({**body, "more": 1})


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ({"kind": "chekc"}, "there are no events of kind 'chekc', did you mean 'check'"),
        ({"kind": 7}, "there are no events of kind 7"),
        ({}, "there are no events of kind None"),
    ],
)
def test_a_kind_that_there_is_not_is_refused(body, message):
    """It is told with the nearest one that there is."""
    with pytest.raises(JsonError, match=message):
        decode(body)


def test_damage_is_told_with_line_and_field(tmp_path):
    """The reader keeps the events around a damaged one, and says where it is and what is wrong with it."""
    path = tmp_path / "journal.jsonl"
    with Journal(path, stamp=stamps()) as journal:
        for text in ("before", "damaged", "after"):
            journal.write(event_of("note", text=text, by="Ada"), 0.0)
    path.write_bytes(path.read_bytes().replace(b'"text":"damaged"', b'"test":"damaged"'))
    reading = read_journal(path)
    assert [event.text for event in reading.events] == ["before", "after"]
    assert (reading.findings[0].line, reading.findings[0].message.startswith("note: ")) == (2, True)
    assert "unknown field 'test', did you mean 'text'?; field 'text' is missing" in reading.findings[0].message


def test_a_field_with_its_default_is_not_written():
    """What older packages do not have is left out, as in them; the stamp is always there."""
    assert encode(msgspec.structs.replace(event_of("armed"), seq=0, t=0.0)) == b'{"kind":"armed","seq":0,"t":0}'
    assert b"doubts" not in encode(event_of("check"))
    assert b"doubts" in encode(event_of("check", doubts=["stuck"]))


def test_parts_are_objects_of_their_own():
    """An inner object is as strict as its event."""
    assert issubclass(type(event_of("run").dut), Part)
    with pytest.raises(JsonError, match="field 'dut.colour' is unknown"):
        event_of("run", dut={"colour": "red"})
