"""How much of a sweep is run: a sample of it, or with `--soak` (as `make soak` does) all of it.

A sweep is what proves one rule many times over: every byte, every moment, hundreds of seeds or generated examples. The
sample proves the rule; the whole looks for the one place where it does not hold.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

__all__ = ["begin", "chosen", "examples", "sample"]

_Item = TypeVar("_Item")
_state = {"whole": False}


def begin(*, whole: bool) -> None:
    """Say how much is run; `tests/conftest.py` does, before any test module is imported."""
    _state["whole"] = whole


def sample(items: Iterable[_Item], most: int) -> list[_Item]:
    """Return all items in a soak, else at most so many: spread evenly, the first and the last among them."""
    every = list(items)
    if _state["whole"] or len(every) <= most:
        return every
    if most == 1:
        return every[:1]
    return [every[place * (len(every) - 1) // (most - 1)] for place in range(most)]


def chosen(few: _Item, whole: _Item) -> _Item:
    """Return the second in a soak, else the first: for what is no list, such as a length of time."""
    return whole if _state["whole"] else few


def examples(whole: int) -> int:
    """Return how many generated examples a property is tried with: these in a soak, else a tenth."""
    return chosen(max(10, whole // 10), whole)
