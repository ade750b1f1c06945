"""Roles that `record` can sample: number by number, streamed by the device itself, or captured around a trigger."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol

from hil.instruments.role import Role

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = [
    "Captured",
    "Channel",
    "Choosing",
    "Ending",
    "Frame",
    "Patient",
    "ReadBacks",
    "Sampled",
    "Screen",
    "StreamReport",
    "Streamed",
]


@dataclass(frozen=True, slots=True)
class Channel:
    """One channel of a sampled role: its name, and the unit of its numbers."""

    name: str
    unit: str


class Sampled(Protocol):
    """Anything that `record` can sample."""

    def channels(self) -> tuple[Channel, ...]:
        """Return the channels, in the order of a sample's numbers."""
        ...

    def sample(self) -> tuple[float, ...]:
        """Return the newest number of every channel; NaN where the device marks it invalid."""
        ...


class ReadBacks:
    """What `record` samples of a role that has no samples of its own: every quantity that it reads.

    They are asked for one after the other; the time of a sample is when the last one came.

    Args:
        role: what the driver's object fills.
        filled: the driver's object.
    """

    def __init__(self, role: Role, filled: object) -> None:
        self._channels = tuple(Channel(name, unit) for name, unit in role.quantities.items())
        self._reads = [getattr(filled, channel.name) for channel in self._channels]

    def channels(self) -> tuple[Channel, ...]:
        """Return a channel for every quantity."""
        return self._channels

    def sample(self) -> tuple[float, ...]:
        """Read every quantity."""
        return tuple([read().value for read in self._reads])


@dataclass(frozen=True, slots=True)
class StreamReport:
    """How a streamed recording went.

    Attributes:
        frames: frames received.
        lost: frames that never came.
        drift: rate of the device's clock against the bench's minus 1, None if unknown.
        drift_uncertainty: standard uncertainty of `drift`.
        lost_samples: samples that the device dropped, or sent damaged, inside of frames that came.
        losses_known: whether every loss shows; False where frames have no numbers.
        time_uncertainty: standard uncertainty in s of the rows' times against the bench's clock at their beginning,
            None if it is not told.
    """

    frames: int
    lost: int
    drift: float | None
    drift_uncertainty: float | None
    lost_samples: int = 0
    losses_known: bool = True
    time_uncertainty: float | None = None


class Streamed(Sampled, Protocol):
    """A sampled role that can also run by itself and be emptied block by block."""

    def begin(self, rate: float) -> None:
        """Let the device sample at `rate` [Hz] by itself; device time starts to count."""
        ...

    def drain(self) -> NDArray[np.float64]:
        """Return the samples since the last call, shape (n, 1 + channels): device time in s since `begin`, channels.

        A sample that was lost leaves its place in time empty. Call it at least every `longest_pause` seconds.
        """
        ...

    def end(self) -> StreamReport:
        """Stop sampling and return how it went."""
        ...

    @property
    def longest_pause(self) -> float:
        """Seconds after which a buffer on the way overflows at the present rate, with a margin."""
        ...


class Choosing(Protocol):
    """What a role with the operations of `Streamed` can say beside: whether it can run by itself, or be asked.

    Attributes:
        streams: whether it can run by itself as it is wired.
        can_be_asked: whether it can be asked for samples beside other roles instead.
    """

    streams: bool
    can_be_asked: bool


class Patient(Protocol):
    """What a streamed role can say beside: how much longer than `longest_pause` its rows can wait, and none is lost."""

    @property
    def patience(self) -> float:
        """Seconds after which a buffer on the way overflows, or the device misses its host, with a margin."""
        ...


class Ending(Protocol):
    """What a streamed role can do beside: say that the test that its device runs by itself has ended."""

    @property
    def over(self) -> bool:
        """Whether the device reported the end of its test, as far as is known; it is not asked."""
        ...


@dataclass(frozen=True, slots=True)
class Screen:
    """What one channel of a capture can show, in the channel's unit.

    Attributes:
        probe: the factor between what the instrument sees and the channel's values.
        resolution: the step of the converter.
        low: the least value that it has; a sample there may be less.
        high: the largest one.
    """

    probe: float
    resolution: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Frame:
    """A capture that an instrument has finished.

    Attributes:
        interval: the time between two rows in s.
        first: the time of the first row in s after the trigger, negative before it.
        rows: how many there are.
        channel: the channel that triggered.
        level: the level of the trigger, in the unit of its channel.
        slope: of the trigger.
        screens: of every channel, in their order.
    """

    interval: float
    first: float
    rows: int
    channel: str
    level: float
    slope: Literal["rising", "falling"]
    screens: tuple[Screen, ...]


class Captured(Protocol):
    """A role that takes samples by itself around its trigger, and is read afterwards."""

    def channels(self) -> tuple[Channel, ...]:
        """Return the channels, in the order of a row's numbers."""
        ...

    def complete(self) -> bool:
        """Return whether the trigger has come, and the samples after it too."""
        ...

    def frame(self) -> Frame:
        """Return what was captured."""
        ...

    def blocks(self, frame: Frame) -> Iterator[NDArray[np.float64]]:
        """Give the rows in blocks, shape (n, 1 + channels): s after the trigger, channels; reading one is quick."""
        ...
