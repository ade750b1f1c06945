"""A document as a tree of frozen nodes that know where they stand."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

__all__ = ["Mapping", "Node", "Place", "Scalar", "ScalarKind", "Sequence"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """A place in a file, as shown to a person; line and column count from 1, 0 is the file as a whole."""

    path: str
    line: int = 0
    column: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Node(Place):
    """Anything in a document."""

    @property
    def described(self) -> str:
        """What this is, for the sentence `... expected, found <this>`."""
        return "nothing"


class ScalarKind(StrEnum):
    """What a scalar is; whatever YAML versions disagree on was refused before."""

    TEXT = "text"
    FLAG = "flag"
    INTEGER = "integer"
    NOTHING = "nothing"


@dataclass(frozen=True, slots=True, kw_only=True)
class Scalar(Node):
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Sequence(Node):
    """A sequence of nodes."""

    items: tuple[Node, ...]

    @property
    def described(self) -> str:
        """A list, in words."""
        return "a list"


@dataclass(frozen=True, slots=True, kw_only=True)
class Mapping(Node):
    """Keys, unique by their text, and values, in the order of the file."""

    entries: tuple[tuple[Scalar, Node], ...]

    @property
    def described(self) -> str:
        """A mapping, in words."""
        return "a mapping"
