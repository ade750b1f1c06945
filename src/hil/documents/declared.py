"""Declared models from strict documents: the only place that knows both the YAML tree and the validation library.

A document is validated as the JSON that means the same, in strict mode and without unknown keys, so that nothing is
converted on the way. What the library finds at a path of keys is reported in our sentences, at its line and column.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path as File
from typing import Any, Generic, TypeVar

from pydantic import TypeAdapter, ValidationError

from hil.documents.declaration import Declaration
from hil.documents.findings import Findings
from hil.documents.node import Mapping as MappingNode
from hil.documents.node import Node, Place, Scalar, ScalarKind, Sequence, node_at, place_at
from hil.documents.strict_yaml import parse_yaml
from hil.documents.suggest import did_you_mean, nearest
from hil.documents.text import read_bytes
from hil.model.errors import HilError
from hil.model.notation import Complaint, Path

__all__ = ["Document", "Invalid", "Problem", "parse_document", "read_document", "read_json", "validated"]

_MOST_KEYS = 100
_MOST_DIGITS = 19
_WHOLE = re.compile(r"[-+]?[0-9]+|0x[0-9a-fA-F]+")
_MOST_REPAIRS = 25  # a document has 20 levels at most
_REQUIRED = frozenset({"missing", "missing_argument", "missing_keyword_only_argument"})
_UNKNOWN = frozenset({"extra_forbidden", "unexpected_keyword_argument"})
_WORDS: dict[str, Callable[[dict[str, Any]], Complaint]] = {
    "string_type": lambda _: Complaint("must be text", quote=True),
    "bool_type": lambda _: Complaint("must be true or false without quotes"),
    "int_type": lambda _: Complaint("must be a whole number without quotes"),
    "float_type": lambda _: Complaint("must be a number"),
    **dict.fromkeys(("dict_type", "dataclass_type", "model_type"), lambda _: Complaint("must be a mapping")),
    **dict.fromkeys(("list_type", "tuple_type", "set_type"), lambda _: Complaint("must be a list")),
    "greater_than": lambda context: Complaint(f"must be above {context['gt']:g}"),
    "greater_than_equal": lambda context: Complaint(f"must be at least {context['ge']:g}"),
    "less_than": lambda context: Complaint(f"must be below {context['lt']:g}"),
    "less_than_equal": lambda context: Complaint(f"must be at most {context['le']:g}"),
    "string_pattern_mismatch": lambda context: Complaint(f"must match {context['pattern']}"),
    "too_short": lambda context: Complaint(f"needs at least {context['min_length']} entries", found=False),
    "too_long": lambda context: Complaint(f"may have {context['max_length']} entries at most", found=False),
}

_Model = TypeVar("_Model")


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """One error: the path of the value, or of its key, and a sentence."""

    path: Path
    message: str
    of_key: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Document(Generic[_Model]):
    """A document that was read: its model, where in the file each part of it stands, and at which paths it is wrong.

    A misspelt key counts as the key that was meant, where there is one like it.
    """

    model: _Model
    root: Node
    wrong: tuple[Path, ...] = ()

    def has(self, path: Path) -> bool:
        """Return whether the file gives the value at a path; where it does not, the model has a default."""
        return node_at(self.root, path) is not None

    def is_sound(self, path: Path) -> bool:
        """Return whether everything at and below a path matches its declaration."""
        return not self.wrong or all(wrong[: len(path)] != path for wrong in self.wrong)

    def follows(self, path: Path) -> bool:
        """Return whether an error at a path may be a consequence of something unreadable at, above or below it."""
        return any(path[: len(wrong)] == wrong[: len(path)] for wrong in self.wrong)

    def place(self, path: Path) -> Place:
        """Return the place of the value at a path, of the name of an entry, or of the nearest parent that is there."""
        node = node_at(self.root, path)
        if isinstance(node, Scalar):
            return node
        _, declaration = _declared(type(self.model))  # type: ignore[arg-type]  # a class is hashable
        named = isinstance(node, MappingNode) and declaration.is_named(path)
        return place_at(self.root, path, of_key=named)


class Invalid(HilError, ValueError):
    """Values that are not what their model declares.

    Attributes:
        problems: all errors, each with its path in the document.
        repaired: the model with blank values in the places of the wrong ones, or None if there is none.
    """

    def __init__(self, problems: tuple[Problem, ...], repaired: object = None) -> None:
        self.problems = problems
        self.repaired = repaired
        super().__init__("\n".join(problem.message for problem in problems))


def read_document(
    file: File, shown: str, findings: Findings, model: type[_Model], *, schema: str
) -> Document[_Model] | None:
    """Read a file into a model; its `schema` key must say what is expected.

    All errors are noted. A model is returned also where values are missing or wrong, with blank ones in
    their places, so that what must hold between the others can be checked, too.

    Args:
        file: where the document is.
        shown: its path as shown to a person, relative to the workspace.
        findings: where all errors are noted.
        model: a dataclass or pydantic model, its fields declared with the types of `hil.model.notation`.
        schema: name and version, such as `hil/bench/1`.

    Returns:
        None if nothing can be read under that schema; the findings say why.
    """
    data = read_bytes(file, shown, findings)
    return None if data is None else parse_document(data, shown, findings, model, schema=schema)


def parse_document(
    data: bytes, shown: str, findings: Findings, model: type[_Model], *, schema: str
) -> Document[_Model] | None:
    """Read the content of a file into a model, as `read_document` does."""
    root = parse_yaml(data, shown, findings)
    if root is None:
        return None
    what = schema.split("/")[-2]
    if not isinstance(root, MappingNode):
        findings.add(root, f"{what} must be a mapping, found {root.described}")
        return None
    head = next((value for key, value in root.entries if key.text == "schema"), None)
    if not _is_of(schema, head, root, findings):
        return None
    entries = tuple(entry for entry in root.entries if entry[1] is not head)
    body = MappingNode(path=root.path, line=root.line, column=root.column, entries=entries)
    reading = _Reading(model, body, what, besides=() if head else ("schema",))
    wrong = tuple(reading.wrong())
    for problem in tuple(reading.problems()):
        place = place_at(body, problem.path, of_key=problem.of_key)
        if problem.of_key or not isinstance(place, Scalar) or not findings.has(place):
            findings.add(place, problem.message)  # else YAML readers disagree on it, which was reported
    found = reading.repaired()
    return None if found is None else Document(model=found, root=root, wrong=wrong)


def validated(model: type[_Model], values: Mapping[str, object], what: str, path: Path = ()) -> _Model:
    """Return the model of a part of a document that was read as `Plain`.

    Args:
        model: a dataclass or pydantic model, its fields declared with the types of `hil.model.notation`.
        values: texts, flags, lists and mappings.
        what: what the part is, for messages: `plant cell`.
        path: where it stands in its document.

    Raises:
        Invalid: with all errors, at paths of the document.
    """
    reading = _Reading(model, _node_of(values), what)
    found = reading.problems()
    problems = tuple(Problem(path=path + each.path, message=each.message, of_key=each.of_key) for each in found)
    if problems or reading.model is None:
        raise Invalid(problems, reading.repaired())
    return reading.model


def read_json(data: bytes, model: type[_Model]) -> _Model:
    """Return the model of a JSON file that the product itself has written.

    Raises:
        Invalid: with all errors, at paths of the file, in the words of the library.
    """
    adapter, _ = _declared(model)  # type: ignore[arg-type]  # a class is hashable
    try:
        found: _Model = adapter.validate_json(data, strict=True, extra="forbid")
    except ValidationError as error:
        problems = (Problem(path=each["loc"], message=each["msg"]) for each in error.errors(include_url=False))
        raise Invalid(tuple(problems)) from error
    return found


class _Reading(Generic[_Model]):
    """One tree, validated against one model, and what is wrong with it.

    Args:
        model: what is declared.
        root: the tree, a mapping.
        what: what the tree is, for messages.
        besides: further keys that it may have, beyond those of the model.
    """

    def __init__(self, model: type[_Model], root: Node, what: str, besides: tuple[str, ...] = ()) -> None:
        self._adapter, self._declaration = _declared(model)  # type: ignore[arg-type]  # a class is hashable
        self._root = root
        self._what = what
        self._besides = besides
        self._bare: dict[Path, str] = {}
        self._data: Any = self._plain(root, ())
        self.model: _Model | None = None
        self._errors = self._validate()

    def problems(self) -> Iterator[Problem]:
        """Yield all errors."""
        unknown: dict[Path, int] = {}
        for error in self._errors:
            inside = error["loc"][:-1]
            if error["type"] in _UNKNOWN:
                unknown[inside] = unknown.get(inside, 0) + 1
            if unknown.get(inside, 0) <= _MOST_KEYS or error["type"] not in _UNKNOWN:
                yield from self._told(error)
        for inside, count in unknown.items():
            if count > _MOST_KEYS:
                yield Problem(path=inside, message=f"{self._named(inside)}: {count - _MOST_KEYS} more unknown keys")
        told = {error["loc"] for error in self._errors}
        for path, words in self._bare.items():
            if not any(path[:length] in told for length in range(len(path) + 1)):
                yield self._problem(path, words)

    def wrong(self) -> Iterator[Path]:
        """Yield the paths of all errors, including missing keys and those that misspelt ones stand for."""
        for error in self._errors:
            path, kind = error["loc"], error["type"]
            if kind in _REQUIRED:
                yield path
            elif kind in _UNKNOWN:
                yield (*path[:-1], nearest(str(path[-1]), self._wanted(path[:-1])) or path[-1])
            else:
                yield from (problem.path for problem in self._told(error))
        yield from self._bare

    def repaired(self) -> _Model | None:
        """Return the model, with blank values in the places of those that are missing or cannot be read."""
        for _ in range(_MOST_REPAIRS):
            if self.model is not None:
                break
            for error in self._errors:
                self._repair(error["loc"], unknown=error["type"] in _UNKNOWN)
            self._errors = self._validate()
        return self.model

    def _validate(self) -> list[Any]:
        try:
            self.model = self._adapter.validate_json(
                json.dumps(self._data), strict=True, extra="forbid", by_alias=True, by_name=False
            )
        except ValidationError as error:
            return list(error.errors(include_url=False))
        return []

    def _told(self, error: dict[str, Any]) -> Iterator[Problem]:
        path, kind = error["loc"], error["type"]
        if kind in _REQUIRED:
            part = f"entry {path[-1] + 1}" if isinstance(path[-1], int) else f"key '{path[-1]}'"
            yield Problem(path=path[:-1], message=f"{self._named(path[:-1])}: {part} is missing")
        elif kind in _UNKNOWN:
            hint = did_you_mean(path[-1], self._wanted(path[:-1]))
            yield Problem(path=path, message=f"unknown key '{path[-1]}'{hint}", of_key=True)
        elif path in self._bare:
            yield self._problem(path, self._bare[path])
        else:
            yield from self._complained(path, self._complaint(path, error))

    def _complaint(self, path: Path, error: dict[str, Any]) -> Complaint:
        context = error.get("ctx", {})
        if isinstance(context.get("error"), Complaint):
            complaint: Complaint = context["error"]
            return complaint
        if error["type"] in {"enum", "literal_error"}:
            choices = self._declaration.choices(path)
            return Complaint(f"must be one of {', '.join(choices)}", known=choices)
        if error["type"] in _WORDS:
            return _WORDS[error["type"]](context)
        return Complaint(str(context.get("error") or error["msg"].replace("Input should", "must")))

    def _complained(self, path: Path, complaint: Complaint) -> Iterator[Problem]:
        for inner, one in complaint.inner.items():
            yield from self._complained(path + inner, one)
        if complaint.expected:
            yield self._problem(path, complaint.expected + self._found(path, complaint))

    def _found(self, path: Path, complaint: Complaint) -> str:
        node = node_at(self._root, path)
        if not complaint.found or node is None:
            return ""
        words = f", found {node.described}"
        if isinstance(node, Scalar):
            if complaint.quote and node.kind in {ScalarKind.INTEGER, ScalarKind.FLAG}:
                words += f', write it in quotes: "{node.text[:60]}"'
            words += did_you_mean(node.text, complaint.known)
        return words

    def _problem(self, path: Path, words: str) -> Problem:
        if not path:
            return Problem(path=path, message=f"{self._what} {words}")
        last = f"entry {path[-1] + 1}" if isinstance(path[-1], int) else f"'{path[-1]}'"
        return Problem(path=path, message=f"{self._named(path[:-1])}: {last} {words}")

    def _named(self, path: Path) -> str:
        """Return the name of the part at a path: its key, preceded by the section's name for a named entry."""
        names = [part for part in path if isinstance(part, str)]
        if not names:
            return self._what
        return " ".join(names[-2:]) if self._declaration.is_named(path) else names[-1]

    def _wanted(self, path: Path) -> list[str]:
        """Return the keys that a section lacks, all that it may have where it lacks none."""
        keys = [*self._declaration.keys(path), *(() if path else self._besides)]
        node = node_at(self._root, path)
        there = {key.text for key, _ in node.entries} if isinstance(node, MappingNode) else set()
        return [key for key in keys if key not in there] or keys

    def _repair(self, path: Path, *, unknown: bool) -> None:
        holder = self._data
        for part in path[:-1]:
            holder = holder[part]
        if unknown:
            del holder[path[-1]]
        elif isinstance(holder, list) and path[-1] == len(holder):
            holder.append(self._declaration.blank(path))
        elif path:
            holder[path[-1]] = self._declaration.blank(path)

    def _plain(self, node: Node, path: Path) -> object:
        if isinstance(node, MappingNode):
            return {
                key.text: value.text
                if isinstance(value, Scalar) and value.kind is ScalarKind.TEXT
                else self._plain(value, (*path, key.text))
                for key, value in node.entries
            }
        if isinstance(node, Sequence):
            return [self._plain(item, (*path, index)) for index, item in enumerate(node.items)]
        if not isinstance(node, Scalar) or node.kind is ScalarKind.NOTHING:
            self._bare[path] = "has no value: give it one, or leave the key out"
            return None
        if node.kind is ScalarKind.INTEGER and len(node.text) > _MOST_DIGITS:
            self._bare[path] = f"must be a whole number with fewer digits, found {node.described}"
            return 0
        if node.kind is ScalarKind.INTEGER:
            # A number of a TOML file that is not whole, or a date, is nothing that a model takes.
            return int(node.text, 16 if node.text.startswith("0x") else 10) if _WHOLE.fullmatch(node.text) else []
        return node.text == "true" if node.kind is ScalarKind.FLAG else node.text


@cache
def _declared(model: type[Any]) -> tuple[TypeAdapter[Any], Declaration]:
    adapter: TypeAdapter[Any] = TypeAdapter(model)
    return adapter, Declaration(adapter.core_schema)


def _is_of(schema: str, head: Node | None, root: Node, findings: Findings) -> bool:
    """Return whether a document has this schema; a missing schema is a finding, and counts as this one."""
    if head is None:
        findings.add(root, f"{schema.split('/')[-2]}: key 'schema' is missing")
    elif not isinstance(head, Scalar) or head.kind is not ScalarKind.TEXT:
        findings.add(head, f"{schema.split('/')[-2]}: 'schema' must be text, found {head.described}")
    elif head.text != schema:
        findings.add(head, _other_schema(head.text, schema))
        return False
    return True


def _other_schema(found: str, expected: str) -> str:
    if found.rpartition("/")[0] == expected.rpartition("/")[0]:
        return f"this version of hil reads schema '{expected}', not '{found}', convert the file or use the matching hil"
    return f"schema must be '{expected}' here, found '{found}'{did_you_mean(found, [expected])}"


def _node_of(value: object) -> Node:
    """Return the tree of values that were read as `Plain`, which has no places any more."""
    if isinstance(value, Mapping):
        entries = ((_text(str(key)), _node_of(item)) for key, item in value.items())
        return MappingNode(path="", entries=tuple(entries))
    if isinstance(value, list | tuple):
        return Sequence(path="", items=tuple(_node_of(item) for item in value))
    if isinstance(value, str):
        return _text(value)
    kind = ScalarKind.FLAG if isinstance(value, bool) else ScalarKind.INTEGER
    return Scalar(path="", text=str(value).lower(), quoted=False, kind=kind)


def _text(text: str) -> Scalar:
    return Scalar(path="", text=text, quoted=True, kind=ScalarKind.TEXT)
