"""The way every schema is read: key by key, with all errors at once."""

from __future__ import annotations

from collections.abc import Callable, Collection
from enum import Enum
from functools import partial
from pathlib import Path
from typing import TypeVar

from hil.documents.findings import Findings
from hil.documents.node import Mapping, Node, Place, Scalar, ScalarKind, Sequence
from hil.documents.scalars import (
    Complaint,
    decimal_of,
    duration_of,
    flag_of,
    frequency_of,
    integer_of,
    number_of,
    text_of,
)
from hil.documents.strict_yaml import read_yaml
from hil.documents.suggest import did_you_mean

__all__ = ["MappingReader", "Required", "read_document"]

_MOST_KEYS = 100

_Value = TypeVar("_Value")
_Default = TypeVar("_Default")


class Required(Enum):
    """The default of a key that must be there."""

    REQUIRED = "required"


class MappingReader:
    """Reads one mapping of a document.

    Every method takes a key and returns its value; a key without a default must be there. What is
    wrong becomes a finding, and the method returns a placeholder of the right type, so that reading
    goes on and a person sees all errors at once. Call `done` when every key was read.

    Args:
        node: the mapping; anything else is a finding, and reads as empty.
        findings: where everything that is wrong is noted.
        what: what the mapping is, for messages: `requirement`, `clamp`.
    """

    def __init__(self, node: Node, findings: Findings, what: str) -> None:
        self.node = node
        self.findings = findings
        self.what = what
        self._readable = isinstance(node, Mapping)
        self._entries = {key.text: (key, value) for key, value in node.entries} if isinstance(node, Mapping) else {}
        self._asked: dict[str, None] = {}
        if not self._readable:
            findings.add(node, f"{what} must be a mapping, found {node.described}")

    def text(
        self,
        key: str,
        default: _Default | Required = Required.REQUIRED,
        *,
        pattern: str = "",
        choices: Collection[str] = (),
    ) -> str | _Default:
        """Return a text; `pattern` must match the whole of it, `choices` are the only ones allowed."""
        convert = _filled_text if default is Required.REQUIRED and not (pattern or choices) else text_of
        return self._read(key, default, partial(convert, pattern=pattern, choices=choices), "")

    def number(self, key: str, default: _Default | Required = Required.REQUIRED) -> float | _Default:
        """Return the value of a decimal number in quotes."""
        return self._read(key, default, number_of, 0.0)

    def decimal(self, key: str, default: _Default | Required = Required.REQUIRED) -> str | _Default:
        """Return a decimal number in quotes as it is written."""
        return self._read(key, default, decimal_of, "0")

    def integer(
        self, key: str, default: _Default | Required = Required.REQUIRED, *, minimum: int | None = None
    ) -> int | _Default:
        """Return a whole number, decimal or with 0x."""
        return self._read(key, default, partial(integer_of, minimum=minimum), minimum or 0)

    def flag(self, key: str, default: _Default | Required = Required.REQUIRED) -> bool | _Default:
        """Return an unquoted true or false."""
        return self._read(key, default, flag_of, False)

    def duration(self, key: str, default: _Default | Required = Required.REQUIRED) -> float | _Default:
        """Return seconds, written as `10 ms`, `4 h`, `90 d`."""
        return self._read(key, default, duration_of, 0.0)

    def frequency(self, key: str, default: _Default | Required = Required.REQUIRED) -> float | _Default:
        """Return hertz, written as `100 Hz`, `400 kHz`."""
        return self._read(key, default, frequency_of, 1.0)

    def texts(self, key: str, default: _Default | Required = Required.REQUIRED) -> tuple[str, ...] | _Default:
        """Return a list of texts."""
        nothing: tuple[str, ...] = ()
        return self._read(key, default, self._texts_of, nothing)

    def plain(self, key: str, default: _Default | Required = Required.REQUIRED) -> object | _Default:
        """Return what is there as dictionaries, lists, texts and flags; numbers stay texts, in quotes."""
        nothing: object = {}
        return self._read(key, default, self._plain_of, nothing)

    def child(self, key: str, *, required: bool = False) -> MappingReader | None:
        """Return a reader of the mapping at `key`, None where there is none."""
        node = self._find(key, required=required)
        return None if node is None else MappingReader(node, self.findings, key)

    def children(self, key: str, *, required: bool = False) -> list[MappingReader]:
        """Return a reader per mapping of the list at `key`."""
        node = self._find(key, required=required)
        if node is None:
            return []
        if not isinstance(node, Sequence):
            self.findings.add(node, f"{self.what}: '{key}' must be a list of mappings, found {node.described}")
            return []
        return [MappingReader(item, self.findings, key) for item in node.items]

    def entries(self, key: str, *, required: bool = False) -> list[tuple[Scalar, MappingReader]]:
        """Return name and reader per mapping of the mapping at `key`."""
        inner = self.child(key, required=required)
        if inner is None or not isinstance(inner.node, Mapping):
            return []
        return [(name, MappingReader(value, self.findings, f"{key} {name.text}")) for name, value in inner.node.entries]

    def keys(self) -> tuple[str, ...]:
        """Return the keys that are there, in the order of the file."""
        return tuple(self._entries)

    def has(self, key: str) -> bool:
        """Return whether the key is there; it still has to be read."""
        self._asked[key] = None
        return key in self._entries

    def place(self, key: str = "") -> Place:
        """Return where the value of `key` is; without key, or where it is missing, the mapping itself."""
        return self._entries[key][1] if key in self._entries else self.node

    def done(self) -> None:
        """Note every key that nobody read, up to a hundred of them."""
        unread = [(text, key) for text, (key, _) in self._entries.items() if text not in self._asked]
        for text, key in unread[:_MOST_KEYS]:
            known = [asked for asked in self._asked if asked not in self._entries] or list(self._asked)
            self.findings.add(key, f"unknown key '{text}'{did_you_mean(text, known)}")
        if len(unread) > _MOST_KEYS:
            self.findings.add(self.node, f"{self.what}: {len(unread) - _MOST_KEYS} more unknown keys")

    def _find(self, key: str, *, required: bool) -> Node | None:
        self._asked[key] = None
        if key in self._entries:
            return self._entries[key][1]
        if required and self._readable:
            self.findings.add(self.node, f"{self.what}: key '{key}' is missing")
        return None

    def _read(
        self, key: str, default: _Default | Required, convert: Callable[[Node], _Value], placeholder: _Value
    ) -> _Value | _Default:
        node = self._find(key, required=isinstance(default, Required))
        if node is None:
            return placeholder if isinstance(default, Required) else default
        try:
            return convert(node)
        except Complaint as complaint:
            self.findings.add(node, f"{self.what}: '{key}' {complaint}")
            return placeholder

    def _texts_of(self, node: Node) -> tuple[str, ...]:
        if not isinstance(node, Sequence):
            raise Complaint(f"must be a list of texts, found {node.described}")
        texts: list[str] = []
        for item in node.items:
            try:
                texts.append(_filled_text(item))
            except Complaint as complaint:
                self.findings.add(item, f"{self.what}: {complaint}")
        return tuple(texts)

    def _plain_of(self, node: Node) -> object:
        # Documents are at most 20 levels deep, so this may recurse.
        if isinstance(node, Mapping):
            return {key.text: self._plain_of(value) for key, value in node.entries}
        if isinstance(node, Sequence):
            return [self._plain_of(item) for item in node.items]
        if isinstance(node, Scalar) and node.kind is ScalarKind.FLAG:
            return node.text == "true"
        try:
            return text_of(node)
        except Complaint as complaint:
            self.findings.add(node, f"{self.what}: {complaint}")
            return ""


def read_document(file: Path, shown: str, findings: Findings, *, schema: str) -> MappingReader | None:
    """Return a reader of the document in `file`, whose `schema` key must say what is expected.

    Args:
        file: where the document is.
        shown: its path as shown to a person, relative to the workspace.
        findings: where everything that is wrong is noted.
        schema: name and version, such as `hil/bench/1`.

    Returns:
        None where nothing can be read under that schema; the findings say why.
    """
    node = read_yaml(file, shown, findings)
    if node is None:
        return None
    reader = MappingReader(node, findings, schema.split("/")[-2])
    if not isinstance(node, Mapping):
        return None
    before = len(findings)
    found = reader.text("schema")
    if len(findings) == before and found != schema:
        findings.add(reader.place("schema"), _other_schema(found, schema))
        return None
    return reader


def _other_schema(found: str, expected: str) -> str:
    if found.rpartition("/")[0] == expected.rpartition("/")[0]:
        return f"this version of hil reads schema '{expected}', not '{found}', convert the file or use the matching hil"
    return f"schema must be '{expected}' here, found '{found}'{did_you_mean(found, [expected])}"


def _filled_text(node: Node, pattern: str = "", choices: Collection[str] = ()) -> str:
    text = text_of(node, pattern, choices)
    if not text.strip():
        raise Complaint("must not be empty")
    return text
