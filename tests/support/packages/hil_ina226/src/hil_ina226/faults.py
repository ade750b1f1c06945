"""What can go wrong on a bus besides what `hil` brings along."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from hil.analysis.noise.numbers import RandomStream
from hil.model.notation import whole
from hil.simulation.faults import LinkFault

__all__ = ["SdaLow"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SdaLow(LinkFault):
    """The data line is held low after the first bytes of each reply."""

    name = "sda-low"
    links = frozenset({"bus"})

    after: Annotated[int, whole(0)] = 0

    def spoiled(self, data: bytes, noise: RandomStream, now_ns: int) -> bytes:
        """Return the first bytes, and zeros for the others."""
        del noise, now_ns
        return data[: self.after].ljust(len(data), b"\0")
