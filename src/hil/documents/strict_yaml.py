"""YAML without its surprises: a tree of nodes, or findings that say what is refused and where."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import yaml

from hil.documents.findings import Findings
from hil.documents.node import Mapping, Node, Place, Scalar, ScalarKind, Sequence
from hil.documents.text import decoded, hidden_character, read_bytes

__all__ = ["parse_yaml", "read_yaml"]

_DEEPEST = 20
_MOST_FINDINGS = 100
_MOST_NODES = 500_000
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_TEXT_TAG = "tag:yaml.org,2002:str"

_NOTHING = frozenset({"", "~", "null", "Null", "NULL"})
_FLAGS = frozenset({"true", "false"})
_INTEGER = re.compile(r"[-+]?(0|[1-9][0-9]*)|0x[0-9a-fA-F]+")
_QUOTE = 'write it in quotes: "{}"'
# What YAML 1.1, YAML 1.2 and people read differently, why it is refused, and what to write.
_SURPRISES = (
    (
        re.compile(r"(yes|no|on|off)", re.IGNORECASE),
        "is a boolean to some YAML readers and text to others",
        f"write true or false, or {_QUOTE}",
    ),
    (re.compile(r"(true|false)", re.IGNORECASE), "is a boolean to some YAML readers only", "write true or false"),
    (re.compile(r"[-+]?0[0-9_]+|[-+]?0o[0-7_]+|[-+]?0b[01_]+"), "is octal or binary to some readers", _QUOTE),
    (re.compile(r"[-+]?[0-9]+(:[0-5]?[0-9])+(\.[0-9_]*)?"), "is a number to base 60 to some readers", _QUOTE),
    (re.compile(r"[-+]?[0-9]+_[0-9_]*"), "is a number to some readers only", _QUOTE),
    (
        re.compile(r"[-+]?(\.[0-9]+|[0-9][0-9_]*(\.[0-9_]*)?)([eE][-+]?[0-9]+)?"),
        "would lose its digits as a number",
        _QUOTE,
    ),
    (re.compile(r"[-+]?\.(inf|nan)", re.IGNORECASE), "is not a finite number", "give a value, or leave the key out"),
    (re.compile(r"="), "has a meaning of its own in YAML", _QUOTE),
)


_PLAIN = re.compile(r"(?!(?:yes|no|on|off|true|false|null)\Z)[A-Za-z/_(]", re.IGNORECASE)
"""The first characters of text that is read as nothing else."""


def read_yaml(file: Path, shown: str, findings: Findings) -> Node | None:
    """Return the document in `file`; None if there is none, with the reason among the findings.

    Args:
        file: where the document is.
        shown: its path as shown to a person, relative to the workspace.
        findings: where everything refused is noted.
    """
    data = read_bytes(file, shown, findings)
    return None if data is None else parse_yaml(data, shown, findings)


def parse_yaml(data: bytes, shown: str, findings: Findings) -> Node | None:
    """Return the document in `data`; None if there is none, with the reason among the findings."""
    text = decoded(data, shown, findings)
    return None if text is None else _Composer(text, shown, findings).document()


class _Stop(Exception):
    """Stop reading; the reason is among the findings."""


class _Composer:
    """Composes nodes from parser events.

    Aliases are never followed, so a document takes no more than its bytes.
    """

    def __init__(self, text: str, shown: str, findings: Findings) -> None:
        self._text = text
        self._events: Iterator[yaml.Event] = iter(())
        self._shown = shown
        self._findings = findings
        self._before = len(findings)
        self._nodes = 0

    def document(self) -> Node | None:
        """Return the root node."""
        root: Node | None = None
        try:
            root = self._document()
        except _Stop:
            pass
        except yaml.YAMLError as error:
            self._unreadable(error)
        return root

    def _document(self) -> Node | None:
        root: Node | None = None
        self._events = iter(_LOADER(self._text).get_event, None)
        for event in self._events:
            if isinstance(event, yaml.DocumentStartEvent):
                if root is not None:
                    self._refuse(event, "a second document begins, one file holds one document")
                    raise _Stop
                root = self._node(next(self._events), 0)
        if root is None:
            self._findings.add(Place(path=self._shown), "the file is empty")
        return root

    def _node(self, event: yaml.Event, depth: int) -> Node:
        self._nodes += 1
        if depth > _DEEPEST or self._nodes > _MOST_NODES:
            deep, many = f"nested deeper than {_DEEPEST} levels", f"more than {_MOST_NODES} keys and values"
            self._refuse(event, deep if depth > _DEEPEST else f"{many}, the rest was not read")
            raise _Stop
        if type(event) is yaml.ScalarEvent and not event.anchor:  # as most are
            return self._scalar(event)
        if isinstance(event, yaml.AliasEvent):
            self._refuse(event, f"the alias *{str(event.anchor)[:60]} is not allowed, write the value out")
            return self._nothing(event)
        if isinstance(event, yaml.NodeEvent) and event.anchor:
            self._refuse(event, f"the anchor &{str(event.anchor)[:60]} is not allowed, write values out")
        if isinstance(event, yaml.ScalarEvent):
            return self._scalar(event)
        if isinstance(event, yaml.SequenceStartEvent):
            return self._sequence(event, depth)
        if isinstance(event, yaml.MappingStartEvent):
            return self._mapping(event, depth)
        raise _Stop

    def _scalar(self, event: yaml.ScalarEvent) -> Scalar:
        if event.tag:
            self._check_tag(event, _TEXT_TAG)
        quoted = bool(event.style) or event.tag == _TEXT_TAG
        text = event.value
        # Everything hidden that the file holds as such was refused before; in double quotes it may hide in an escape.
        if event.style == '"' and (hidden := hidden_character(text)):
            self._refuse(event, f"the text holds character U+{ord(hidden[0]):04X}, which is not allowed")
        kind = ScalarKind.TEXT if quoted or _PLAIN.match(text) else self._kind(event, text)
        mark = event.start_mark
        return Scalar(
            path=self._shown,
            line=mark.line + 1 if mark else 0,
            column=mark.column + 1 if mark else 0,
            text=text,
            quoted=quoted,
            kind=kind,
        )

    def _kind(self, event: yaml.ScalarEvent, text: str) -> ScalarKind:
        if text in _NOTHING:
            return ScalarKind.NOTHING
        if text in _FLAGS:
            return ScalarKind.FLAG
        if _INTEGER.fullmatch(text):
            return ScalarKind.INTEGER
        for pattern, why, advice in _SURPRISES:
            if pattern.fullmatch(text):
                self._refuse(event, f"`{text[:60]}` {why}, {advice.format(text[:60])}")
                break
        return ScalarKind.TEXT

    def _sequence(self, event: yaml.SequenceStartEvent, depth: int) -> Sequence:
        self._check_tag(event, "tag:yaml.org,2002:seq")
        items: list[Node] = []
        for inner in self._events:
            if isinstance(inner, yaml.SequenceEndEvent):
                break
            items.append(self._node(inner, depth + 1))
        at = self._place(event)
        return Sequence(path=at.path, line=at.line, column=at.column, items=tuple(items))

    def _mapping(self, event: yaml.MappingStartEvent, depth: int) -> Mapping:
        self._check_tag(event, "tag:yaml.org,2002:map")
        entries: dict[str, tuple[Scalar, Node]] = {}
        for inner in self._events:
            if isinstance(inner, yaml.MappingEndEvent):
                break
            key = self._node(inner, depth + 1)
            value = self._node(next(self._events), depth + 1)
            if self._is_key(key, entries) and isinstance(key, Scalar):
                entries[key.text] = (key, value)
        at = self._place(event)
        return Mapping(path=at.path, line=at.line, column=at.column, entries=tuple(entries.values()))

    def _is_key(self, key: Node, entries: dict[str, tuple[Scalar, Node]]) -> bool:
        if not isinstance(key, Scalar):
            self._refuse_at(key, f"{key.described} cannot be a key")
        elif key.kind is ScalarKind.TEXT and key.text not in entries and (key.quoted or key.text != "<<"):
            return True  # as most are
        elif key.text == "<<" and not key.quoted:
            self._refuse_at(key, "the merge key << is not allowed, write the entries out")
        elif not key.text and not key.quoted:
            self._refuse_at(key, "a key is missing before the colon")
        elif key.kind in {ScalarKind.NOTHING, ScalarKind.FLAG}:
            self._refuse_at(key, f"`{key.text}` cannot be a key, write it in quotes")
        elif key.text in entries:
            self._refuse_at(key, f"duplicate key '{key.text}', first on line {entries[key.text][0].line}")
        else:
            return True
        return False

    def _check_tag(self, event: yaml.ScalarEvent | yaml.CollectionStartEvent, core: str) -> None:
        if event.tag and event.tag != core:
            self._refuse(event, f"the tag {str(event.tag)[:60]} is not allowed, remove it")

    def _nothing(self, event: yaml.Event) -> Scalar:
        at = self._place(event)
        return Scalar(path=at.path, line=at.line, column=at.column, text="", quoted=False, kind=ScalarKind.NOTHING)

    def _place(self, event: yaml.Event) -> Place:
        mark = event.start_mark
        if mark is None:
            return Place(path=self._shown)
        return Place(path=self._shown, line=mark.line + 1, column=mark.column + 1)

    def _refuse(self, event: yaml.Event, message: str) -> None:
        self._refuse_at(self._place(event), message)

    def _refuse_at(self, place: Place, message: str) -> None:
        self._findings.add(place, message)
        if len(self._findings) - self._before >= _MOST_FINDINGS:
            self._findings.add(Place(path=self._shown), f"more than {_MOST_FINDINGS} findings, the rest was not read")
            raise _Stop

    def _unreadable(self, error: yaml.YAMLError) -> None:
        mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
        problem = getattr(error, "problem", None) or getattr(error, "reason", None) or "no YAML"
        if "cannot start any token" in problem:
            problem = "a character that is not allowed here, such as a tab; indent with spaces"
        line, column = (mark.line + 1, mark.column + 1) if mark else (0, 0)
        self._findings.add(Place(path=self._shown, line=line, column=column), f"not readable as YAML: {problem}")
