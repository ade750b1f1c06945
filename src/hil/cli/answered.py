"""Waiting a moment for what a run answers to something that was asked of it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hil.report.live.following import Follower

__all__ = ["answer_of"]

_PATIENCE_S = 10.0
_LOOK_S = 0.1


def answer_of(follower: Follower, awaited: Collection[str]) -> Mapping[str, Any] | None:
    """Return the next event of one of these kinds, None where none comes in time or the run ends."""
    from hil.clock import wall  # noqa: PLC0415 - only when it is used

    end = wall.monotonic() + _PATIENCE_S
    while wall.monotonic() < end and follower.goes_on():
        for line in follower.read():
            if line.body["kind"] in awaited:
                return line.body
        wall.pause(_LOOK_S)
    return None
