"""Cut paths and post-safe watches: safety measures beyond the safe-off, as data of the bench file."""

from dataclasses import dataclass, field
from typing import Annotated

from hil.model.notation import AnyText, Number, Text, number, seconds

__all__ = ["CutPath", "WatchAfter"]

_LONG = seconds(above=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class CutPath:
    """Means of removing an output's energy when its own port is gone.

    One of three is set: `by` and `state` (another output, whose safe state cuts it off), `watchdog` (an output whose
    instrument opens by itself when its heartbeat stops), or `hardware` (a description of one without a heartbeat).

    Attributes:
        output: the output to cut off.
        by: the output whose safe state cuts it off.
        state: that state.
        watchdog: an output whose instrument has the watchdog; may be the same output.
        hardware: an interlock or a cut-out.
        within_s: time limit [s].
    """

    output: Text
    by: AnyText = ""
    state: AnyText = ""
    watchdog: AnyText = ""
    hardware: AnyText = ""
    within_s: Annotated[float, _LONG] = field(metadata={"alias": "within"})

    @property
    def means(self) -> str:
        """Description of the means."""
        if self.watchdog:
            return f"watchdog of {self.watchdog}"
        return f"{self.by} {self.state}" if self.by else self.hardware

    @property
    def needs_host(self) -> bool:
        """Whether it depends on run or guardian being alive."""
        return bool(self.by)


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchAfter:
    """Condition that must be observed after the safe-off, whatever its lines have proven.

    Either the reading stays between two bounds throughout, or it goes `toward` a value: it approaches by the tolerance,
    or ends within the tolerance of it.

    Attributes:
        output: the role instance that is read, which is unsafe if the condition fails.
        quantity: the quantity read.
        unit: unit of the numbers.
        minimum: lowest safe value; None with `toward`.
        maximum: highest safe value; None with `toward`.
        toward: its equilibrium, such as room temperature; None with bounds.
        tolerance: distance that counts as there, and least approach that counts as closer; None with bounds.
        for_s: time to stay between the bounds [s]; None with `toward`.
        within_s: time limit for the approach [s]; None with bounds.
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
        """Longest duration of the watch in s."""
        return (self.for_s if self.toward is None else self.within_s) or 0.0
