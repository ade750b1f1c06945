"""What a wire says of its cycler."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

from hil.instruments import settings
from hil.model.bench import Wire
from hil.model.errors import Refused

__all__ = ["Wiring"]

_SHORTEST_BEAT_S, _LONGEST_BEAT_S = 15, 600
_MOST_CYCLES = 9999


@dataclass(frozen=True, slots=True, kw_only=True)
class Wiring:
    """The settings of a wire.

    Attributes:
        level: of the protocol that the device must speak: `1` or `2.0`.
        beat_s: the device's longest time between heartbeats; the driver sends one three times as often.
        cycles: how many a device of level 1 runs, for it cannot be told.
    """

    level: str
    beat_s: float
    cycles: int

    @classmethod
    def read(cls, wire: Wire) -> Self:
        """Read the settings `level`, `beat` and `cycles`; Refused where one cannot be."""
        settings.only(wire, "level", "beat", "cycles")
        level = "1" if settings.choice(wire, "level", "", (1.0, 2.0), 2.0) == 1 else "2.0"
        beat = settings.quantity(wire, "beat", "s")
        cycles = settings.quantity(wire, "cycles", "")
        for key, of_level in (("beat", "2.0"), ("cycles", "1")):
            if key in wire.settings and level != of_level:
                raise Refused(f"wiring {wire.name}: a device of level {level} has no {key} here", f"leave {key} out")
        return cls(
            level=level,
            beat_s=60.0 if beat is None else float(_within(wire, "beat", beat, _SHORTEST_BEAT_S, _LONGEST_BEAT_S)),
            cycles=10 if cycles is None else _within(wire, "cycles", cycles, 1, _MOST_CYCLES),
        )


def _within(wire: Wire, key: str, value: float, lowest: int, highest: int) -> int:
    if value not in range(lowest, highest + 1):
        raise Refused(
            f"wiring {wire.name}: {key} cannot be {value:g}", f"write a whole number from {lowest} to {highest}"
        )
    return int(value)
