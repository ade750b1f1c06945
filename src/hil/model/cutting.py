"""What keeps a bench safe where its safe-off cannot be taken, or says more than is so: data of the bench file."""

from dataclasses import dataclass, field
from typing import Annotated

from hil.model.notation import AnyText, Number, Text, number, seconds

__all__ = ["CutPath", "WatchAfter"]

_LONG = seconds(above=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class CutPath:
    """What takes an output's energy away when its own port is gone.

    One of three is set: `by` and `state` (another output, whose safe state cuts it off), `watchdog` (an output whose
    instrument opens by itself once its heartbeat is missing), or `hardware` (in words: what needs no heartbeat).

    Attributes:
        output: the output that is cut off.
        by: the output whose safe state does it.
        state: that state.
        watchdog: an output whose instrument keeps the heartbeat; it may be the same output.
        hardware: an interlock or a cut-out.
        within_s: how long it takes at most.
    """

    output: Text
    by: AnyText = ""
    state: AnyText = ""
    watchdog: AnyText = ""
    hardware: AnyText = ""
    within_s: Annotated[float, _LONG] = field(metadata={"alias": "within"})

    @property
    def means(self) -> str:
        """What does it, in words."""
        if self.watchdog:
            return f"watchdog of {self.watchdog}"
        return f"{self.by} {self.state}" if self.by else self.hardware

    @property
    def needs_host(self) -> bool:
        """Whether run or guardian have to live for it."""
        return bool(self.by)


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchAfter:
    """What must be seen after the last safe-off, whatever its lines have proven.

    Either the reading stays between two bounds all the time, or it goes `toward` a value: it comes closer by the
    tolerance, or is within the tolerance of it in the end.

    Attributes:
        output: the role instance that is read; it is the one that is not safe where this does not hold.
        quantity: which of its reads.
        unit: unit of the numbers.
        minimum: lowest safe value; None with `toward`.
        maximum: highest safe value; None with `toward`.
        toward: where it goes by itself, such as the temperature of the room; None with bounds.
        tolerance: how far from there is as good as there, and how much closer is closer; None with bounds.
        for_s: how long it stays between the bounds; None with `toward`.
        within_s: how long it may take to come closer; None with bounds.
    """

    output: Text
    quantity: Text
    unit: Text
    minimum: Number | None = field(default=None, metadata={"alias": "min"})
    maximum: Number | None = field(default=None, metadata={"alias": "max"})
    toward: Number | None = None
    tolerance: Annotated[float, number(above=0.0)] | None = None
    for_s: Annotated[float, _LONG] | None = field(default=None, metadata={"alias": "for"})
    within_s: Annotated[float, _LONG] | None = field(default=None, metadata={"alias": "within"})

    @property
    def seconds(self) -> float:
        """How long it is watched at most."""
        return (self.for_s if self.toward is None else self.within_s) or 0.0
