"""Roles that `record` can sample: polled, streamed by the device, or captured around a trigger."""

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
    """One channel of a sampled role: name and unit."""

    name: str
    unit: str


class Sampled(Protocol):
    """Anything that `record` can sample."""

    def channels(self) -> tuple[Channel, ...]:
        """Return the channels, in the order of a sample's values."""
        ...

    def sample(self) -> tuple[float, ...]:
        """Return the newest value of every channel; NaN where the device marks it invalid."""
        ...


class ReadBacks:
    """Sampling for a role without samples of its own: `record` reads each of its quantities.

    They are read one after the other; the time of a sample is that of its last reading.

    Args:
        role: the role that the driver's object fills.
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
    """Statistics of a streamed recording.

    Attributes:
        frames: frames received.
        lost: frames that never came.
        drift: rate of the device's clock relative to the bench's, minus 1; None if unknown.
        drift_uncertainty: standard uncertainty of `drift`.
        lost_samples: samples dropped by the device, or damaged, within frames that arrived.
        losses_known: whether every loss is detected; False where frames are not numbered.
        time_uncertainty: standard uncertainty in s of the row times against bench time, as at the start of the
            stream; None if unknown.
    """

    frames: int
    lost: int
    drift: float | None
    drift_uncertainty: float | None
    lost_samples: int = 0
    losses_known: bool = True
    time_uncertainty: float | None = None


class Streamed(Sampled, Protocol):
    """A sampled role that can also sample autonomously and be read in blocks."""

    def begin(self, rate: float) -> None:
        """Start sampling autonomously at `rate` [Hz]; device time starts at 0."""
        ...

    def drain(self) -> NDArray[np.float64]:
        """Return the samples since the last call, shape (n, 1 + channels): device time in s since `begin`, channels.

        A lost sample leaves a gap in time. Call this at least every `longest_pause` seconds.
        """
        ...

    def end(self) -> StreamReport:
        """Stop sampling, and return the stream's statistics."""
        ...

    @property
    def longest_pause(self) -> float:
        """Seconds until a buffer in the path overflows at the present rate, with a margin."""
        ...


class Choosing(Protocol):
    """Extension of `Streamed`: whether the role can stream as wired, or be polled instead.

    Attributes:
        streams: whether it can stream as it is wired.
        can_be_asked: whether it can be polled for samples alongside other roles instead.
    """

    streams: bool
    can_be_asked: bool


class Patient(Protocol):
    """Extension of `Streamed`: how long, beyond `longest_pause`, rows can wait without loss."""

    @property
    def patience(self) -> float:
        """Seconds until a buffer in the path overflows, or the device's host watchdog expires, with a margin."""
        ...


class Ending(Protocol):
    """Extension of `Streamed`: whether the test that the device runs autonomously has ended."""

    @property
    def over(self) -> bool:
        """Whether the device has reported the end of its test so far; it is not queried."""
        ...


@dataclass(frozen=True, slots=True)
class Screen:
    """Range and resolution of one channel of a capture, in the channel's unit.

    Attributes:
        probe: probe factor: channel value over input voltage.
        resolution: converter step.
        low: lowest value; a sample there may be clipped.
        high: highest value; likewise.
    """

    probe: float
    resolution: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Frame:
    """Description of a completed capture.

    Attributes:
        interval: time between two rows in s.
        first: time of the first row in s relative to the trigger, negative before it.
        rows: number of rows.
        channel: the channel that triggered.
        level: trigger level, in the unit of its channel.
        slope: trigger slope.
        screens: range and resolution of each channel, in channel order.
    """

    interval: float
    first: float
    rows: int
    channel: str
    level: float
    slope: Literal["rising", "falling"]
    screens: tuple[Screen, ...]


class Captured(Protocol):
    """A role that captures samples around a trigger, and is read afterwards."""

    def channels(self) -> tuple[Channel, ...]:
        """Return the channels, in the order of a row's values."""
        ...

    def complete(self) -> bool:
        """Return whether the capture is complete: triggered, with all samples after the trigger taken."""
        ...

    def frame(self) -> Frame:
        """Return the description of the capture."""
        ...

    def blocks(self, frame: Frame) -> Iterator[NDArray[np.float64]]:
        """Yield the rows in blocks, shape (n, 1 + channels): s after the trigger, channels; each read is short."""
        ...
