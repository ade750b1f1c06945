"""One condition of readiness."""

from __future__ import annotations

from dataclasses import dataclass

from hil.model.identity import Source

__all__ = ["Gate"]


@dataclass(frozen=True, slots=True)
class Gate:
    """One condition of readiness, whether it holds, and what was seen.

    Attributes:
        name: its name.
        ok: whether it holds.
        detail: what was seen.
        instrument: the instrument whose identity or port it is about, empty for any other gate.
        unproven: what it leaves open although it holds, empty if nothing.
        source: what the instrument counts as from now on, None if this gate does not say.
        exception: why its port counts as hardware although it is on this computer, as the bench file says; else empty.
    """

    name: str
    ok: bool
    detail: str
    instrument: str = ""
    unproven: str = ""
    source: Source | None = None
    exception: str = ""
