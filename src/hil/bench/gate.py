"""One condition of readiness."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Gate"]


@dataclass(frozen=True, slots=True)
class Gate:
    """One condition of readiness, whether it holds, and what was seen."""

    name: str
    ok: bool
    detail: str
