"""Marks on a role's operations: whether they drive the bench or read it.

The executive journals both, and reissues only the last driving call when a case is re-executed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

__all__ = ["begins", "drives", "reads"]

_Operation = TypeVar("_Operation", bound=Callable[..., object])


def drives(operation: _Operation) -> _Operation:
    """Mark an operation that changes the bench."""
    operation.effect = "drives"  # type: ignore[attr-defined]  # a mark on a function, read by the façade
    return operation


def begins(operation: _Operation) -> _Operation:
    """Mark an operation that drives the bench and starts something: it is never reissued outside its case."""
    operation.effect = "drives"  # type: ignore[attr-defined]  # a mark on a function, read by the façade
    operation.begins = True  # type: ignore[attr-defined]  # the same
    return operation


def reads(operation: _Operation) -> _Operation:
    """Mark an operation that only reads."""
    operation.effect = "reads"  # type: ignore[attr-defined]  # a mark on a function, read by the façade
    return operation
