"""Ends of ports and buses that a record answers first, and the bench itself from the handover on."""

from __future__ import annotations

from typing import Any, Generic, TypeVar

__all__ = ["Handed"]

_End = TypeVar("_End")


class Handed(Generic[_End]):
    """The far end of a byte stream or a bus, whichever end answers behind it; it has the interface of both.

    Args:
        end: what answers until `hand_to`.
    """

    def __init__(self, end: _End) -> None:
        self._end = end

    def hand_to(self, end: _End) -> None:
        """Let `end` answer from now on; the host does not notice."""
        self._end = end

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever the ends have
        return getattr(self._end, name)
