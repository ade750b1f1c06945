"""Where in a document something is that only its content is known of."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from hil.documents.findings import Findings
from hil.documents.node import Mapping, Node, Place, Sequence
from hil.documents.strict_yaml import read_yaml

__all__ = ["place_of"]


def place_of(file: Path, shown: str, keys: Iterable[str]) -> Place:
    """Return the place of the value at a path of keys, or of its nearest parent that exists."""
    node = read_yaml(file, shown, Findings())
    for key in keys:
        inner = _inner(node, key)
        if inner is None:
            break
        node = inner
    return node if node is not None else Place(path=shown)


def _inner(node: Node | None, key: str) -> Node | None:
    if isinstance(node, Mapping):
        return next((value for name, value in node.entries if name.text == key), None)
    if isinstance(node, Sequence) and key.isdigit() and int(key) < len(node.items):
        return node.items[int(key)]
    return None
