"""YAML without its surprises: a tree of nodes, or findings that say what is refused and where."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import yaml

from hil.documents.findings import Findings
from hil.documents.node import Mapping, Node, Place, Scalar, ScalarKind, Sequence

__all__ = ["MOST_BYTES", "parse_yaml", "read_yaml"]

MOST_BYTES = 5_000_000
_BYTE_ORDER_MARK = "\ufeff"
_FORBIDDEN = re.compile(
    "[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f"  # controls; NEL is a line end to some readers and none to others
    "\u061c\u200b-\u200f\u2028-\u202e\u2060-\u2069\ufeff"  # marks that reorder or hide text, line separators
    "\ud800-\udfff]"
)


def _forbidden_character(text: str) -> re.Match[str] | None:
    """Return the first control, bidirectional or invisible character of `text`, or None."""
    return _FORBIDDEN.search(text)


def _decode(data: bytes, shown: str, findings: Findings) -> str | None:
    """Return the text of `data` without byte order mark and with plain line ends.

    Anything that cannot be read safely becomes a finding, and the text is None.
    """
    if len(data) > MOST_BYTES:
        findings.add(Place(path=shown), f"the file is larger than {MOST_BYTES} bytes")
        return None
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        findings.add(
            _place_of_byte(data, error.start, shown), f"not UTF-8 at byte {error.start}, save the file as UTF-8"
        )
        return None
    text = text.removeprefix(_BYTE_ORDER_MARK).replace("\r\n", "\n").replace("\r", "\n")
    before = len(findings)
    for number, line in enumerate(text.split("\n"), 1):
        match = _forbidden_character(line)
        if match:
            place = Place(path=shown, line=number, column=match.start() + 1)
            findings.add(place, f"character U+{ord(match[0]):04X} is not allowed, remove it")
    return text if len(findings) == before else None


def _place_of_byte(data: bytes, offset: int, shown: str) -> Place:
    line_start = data.rfind(b"\n", 0, offset) + 1
    column = len(data[line_start:offset].decode("utf-8", errors="replace")) + 1
    return Place(path=shown, line=data.count(b"\n", 0, offset) + 1, column=column)


_DEEPEST = 20
_MOST_FINDINGS = 100
_MOST_NODES = 500_000
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_TEXT_TAG = "tag:yaml.org,2002:str"

_NOTHING = frozenset({"", "~", "null", "Null", "NULL"})
_FLAGS = frozenset({"true", "false"})
_INTEGER = re.compile(r"[-+]?(0|[1-9][0-9]*)|0x[0-9a-fA-F]+")
# What YAML 1.1, YAML 1.2 and a person read differently, and why it is refused.
_SURPRISES = (
    (re.compile(r"(yes|no|on|off)", re.IGNORECASE), "is a flag to some readers and text to others"),
    (re.compile(r"(true|false)", re.IGNORECASE), "is a flag to some readers only, write true or false"),
    (re.compile(r"[-+]?0[0-9_]+|[-+]?0o[0-7_]+|[-+]?0b[01_]+"), "is octal or binary to some readers"),
    (re.compile(r"[-+]?[0-9]+(:[0-5]?[0-9])+(\.[0-9_]*)?"), "is a number to base 60 to some readers"),
    (re.compile(r"[-+]?[0-9]+_[0-9_]*"), "is a number to some readers only"),
    (re.compile(r"[-+]?(\.[0-9]+|[0-9][0-9_]*(\.[0-9_]*)?)([eE][-+]?[0-9]+)?"), "would lose its digits as a number"),
    (re.compile(r"[-+]?\.(inf|nan)", re.IGNORECASE), "is not a number that means something here"),
    (re.compile(r"="), "means something of its own in YAML"),
)


def read_yaml(file: Path, shown: str, findings: Findings) -> Node | None:
    """Return the document in `file`; None if there is none, with the reason among the findings.

    Args:
        file: where the document is.
        shown: its path as shown to a person, relative to the workspace.
        findings: where everything that is refused is noted.
    """
    try:
        if not file.is_file():
            findings.add(Place(path=shown), "the file is missing" if not file.exists() else "this is not a file")
            return None
        with file.open("rb") as stream:
            data = stream.read(MOST_BYTES + 1)
    except OSError as error:
        findings.add(Place(path=shown), f"cannot be read: {error.strerror}")
        return None
    return parse_yaml(data, shown, findings)


def parse_yaml(data: bytes, shown: str, findings: Findings) -> Node | None:
    """Return the document in `data`; None if there is none, with the reason among the findings."""
    text = _decode(data, shown, findings)
    return None if text is None else _Composer(text, shown, findings).document()


class _Stop(Exception):
    """Reading on makes no sense; the reason is among the findings."""


class _Composer:
    """Composes nodes from parser events.

    Aliases are never followed, so a document takes no more than its bytes.
    """

    def __init__(self, text: str, shown: str, findings: Findings) -> None:
        self._events: Iterator[yaml.Event] = yaml.parse(text, Loader=_LOADER)
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
        if depth > _DEEPEST:
            self._refuse(event, f"nested deeper than {_DEEPEST} levels")
            raise _Stop
        self._nodes += 1
        if self._nodes > _MOST_NODES:
            self._refuse(event, f"more than {_MOST_NODES} keys and values, the rest was not read")
            raise _Stop
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
        self._check_tag(event, _TEXT_TAG)
        quoted = bool(event.style) or event.tag == _TEXT_TAG
        text = str(event.value)
        hidden = _forbidden_character(text)
        if hidden:
            self._refuse(event, f"the text holds character U+{ord(hidden[0]):04X}, which is not allowed")
        kind = ScalarKind.TEXT if quoted else self._kind(event, text)
        at = self._place(event)
        return Scalar(path=at.path, line=at.line, column=at.column, text=text, quoted=quoted, kind=kind)

    def _kind(self, event: yaml.ScalarEvent, text: str) -> ScalarKind:
        if text in _NOTHING:
            return ScalarKind.NOTHING
        if text in _FLAGS:
            return ScalarKind.FLAG
        if _INTEGER.fullmatch(text):
            return ScalarKind.INTEGER
        for pattern, why in _SURPRISES:
            if pattern.fullmatch(text):
                self._refuse(event, f'`{text[:60]}` {why}, write it in quotes: "{text[:60]}"')
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
        elif key.text == "<<" and not key.quoted:
            self._refuse_at(key, "the merge key << is not allowed, write the entries out")
        elif key.kind in {ScalarKind.NOTHING, ScalarKind.FLAG}:
            self._refuse_at(key, f"{key.described} cannot be a key, write it in quotes")
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
        line, column = (mark.line + 1, mark.column + 1) if mark else (0, 0)
        self._findings.add(Place(path=self._shown, line=line, column=column), f"not readable as YAML: {problem}")
