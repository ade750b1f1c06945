"""Checkpoints: where a simulated bench is, so that it can go on from there in another process."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

__all__ = ["Checkpoint"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Checkpoint:
    """A simulated bench at a scheduling point.

    Attributes:
        at_ns: the bench's time.
        operations: how many operations its transcript held.
        state: world and lines, as JSON values.
    """

    at_ns: int
    operations: int
    state: Mapping[str, Any]
