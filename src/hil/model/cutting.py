"""What keeps a bench safe where its safe-off cannot be taken, or says more than is so: data of the bench file."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["CutPath", "WatchAfter"]


@dataclass(frozen=True, slots=True, kw_only=True)
class CutPath:
    """What takes an output's energy away when its own port is gone.

    Either `by` and `state` (another output, whose safe state cuts it off) or `hardware` (in words: what no software of
    the host is part of) is set.

    Attributes:
        output: the output that is cut off.
        by: the output whose safe state does it.
        state: that state.
        hardware: a dead-man or an interlock.
        within_s: how long it takes at most.
    """

    output: str
    by: str = ""
    state: str = ""
    hardware: str = ""
    within_s: float

    @property
    def means(self) -> str:
        """What does it, in words."""
        return f"{self.by} {self.state}" if self.by else self.hardware


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchAfter:
    """What must be seen behind the last safe-off, whatever its lines have proven.

    Either the reading stays between two bounds all the time, or it goes `toward` a value: it comes closer by the
    tolerance, or is within the tolerance of it in the end.

    Attributes:
        output: the role instance that is read; it is the one that is not safe where this does not hold.
        quantity: which of its reads.
        unit: unit of the numbers.
        minimum: lowest safe value; None with `toward`.
        maximum: highest safe value; None with `toward`.
        toward: where it goes by itself, such as the temperature of the room; None with bounds.
        tolerance: how far from there is as good as there, and how much closer is closer.
        seconds: how long it is watched at most.
    """

    output: str
    quantity: str
    unit: str
    minimum: float | None = None
    maximum: float | None = None
    toward: float | None = None
    tolerance: float = 0.0
    seconds: float
