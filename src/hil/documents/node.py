"""A document as a tree of frozen nodes with their places; a large one has a hundred thousand of them."""

from __future__ import annotations

from enum import StrEnum

import msgspec

from hil.model.notation import Path

__all__ = ["Mapping", "Node", "Place", "Scalar", "ScalarKind", "Sequence", "node_at", "place_at"]


class Place(msgspec.Struct, frozen=True, kw_only=True):
    """A place in a file, as shown to a person; line and column count from 1, 0 is the file as a whole."""

    path: str
    line: int = 0
    column: int = 0

    @classmethod
    def __get_pydantic_core_schema__(cls, source: object, handler: object) -> dict[str, object]:
        # Declared models have places in fields that no file gives, so that there is nothing to read.
        return {"type": "is-instance", "cls": cls}


class Node(Place, frozen=True, kw_only=True):
    """Anything in a document."""

    @property
    def described(self) -> str:
        """What this is, for the sentence `... expected, found <this>`."""
        return "nothing"


class ScalarKind(StrEnum):
    """What a scalar is; anything that YAML versions disagree on was refused before."""

    TEXT = "text"
    FLAG = "flag"
    INTEGER = "integer"
    NOTHING = "nothing"


class Scalar(Node, frozen=True, kw_only=True):
    """A scalar: its text as written, and what that is. Quoted scalars are always text."""

    text: str
    quoted: bool
    kind: ScalarKind

    @property
    def described(self) -> str:
        """The scalar itself, in backquotes, shortened."""
        if self.kind is ScalarKind.NOTHING:
            return "nothing"
        shown = self.text if len(self.text) <= 60 else f"{self.text[:57]}..."
        return f"`{shown}`" if not self.quoted else f'"{shown}"'


class Sequence(Node, frozen=True, kw_only=True):
    """A sequence of nodes."""

    items: tuple[Node, ...]

    @property
    def described(self) -> str:
        """A list, in words."""
        return "a list"


class Mapping(Node, frozen=True, kw_only=True):
    """Keys, unique by their text, and values, in the order of the file."""

    entries: tuple[tuple[Scalar, Node], ...]

    @property
    def described(self) -> str:
        """A mapping, in words."""
        return "a mapping"


def node_at(root: Node, path: Path) -> Node | None:
    """Return the value at a path of keys and list positions, None if there is none."""
    node: Node | None = root
    for part in path:
        entry = _entry(node, part)
        node = entry and entry[1]
    return node


def place_at(root: Place, path: Path, *, of_key: bool = False) -> Place:
    """Return the place of the value at a path, or of its nearest parent that is there.

    Args:
        root: the document, or a part of it.
        path: keys and list positions.
        of_key: whether the key is meant, not its value.
    """
    node: Place = root
    for index, part in enumerate(path, 1):
        entry = _entry(node, part)
        if entry is None:
            break
        node = entry[0] if of_key and index == len(path) else entry[1]
    return node


def _entry(node: Place | None, part: str | int) -> tuple[Node, Node] | None:
    """Return key and value below a node; an item of a list has no key but itself."""
    if isinstance(node, Mapping):
        for entry in node.entries:
            if entry[0].text == part:
                return entry
    if isinstance(node, Sequence) and isinstance(part, int) and 0 <= part < len(node.items):
        return node.items[part], node.items[part]
    return None
