"""What drivers see of a bus that can run their transfers by itself: streams with device time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from hil.wire.port import I2cBus

__all__ = ["BusStream", "FifoRead", "RegisterRead", "StreamFrame", "StreamSummary", "StreamTransfer", "StreamingBus"]


@dataclass(frozen=True, slots=True, kw_only=True)
class RegisterRead:
    """A transfer of a stream: write the register's number, read `length` bytes."""

    address: int
    register: int
    length: int


@dataclass(frozen=True, slots=True, kw_only=True)
class FifoRead:
    """A transfer of a stream whose length the device reports: read a counter, then that much of a data register.

    Attributes:
        address: 7-bit address.
        count_register: register of the counter, two bytes, high byte first.
        unit: bytes per count: 1 where the counter counts bytes, the record's size where it counts records.
        record: bytes of one record; only whole records are read.
        data_register: register from which the data are read.
        most: largest number of bytes of one read; what is left comes with the next frame.
    """

    address: int
    count_register: int
    unit: int
    record: int
    data_register: int
    most: int


StreamTransfer = RegisterRead | FifoRead


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamFrame:
    """Result of one trigger of a stream.

    Attributes:
        number: counted by the device from 0; a lost frame leaves a gap.
        lost: number of frames dropped by the device itself since the stream began.
        device_s: device time of the trigger in s, unwrapped, from the device's start.
        replies: the raw bytes of every transfer, in the order of the program; None if the device did not
            acknowledge.
    """

    number: int
    lost: int
    device_s: float
    replies: tuple[bytes | None, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamSummary:
    """Statistics of a stream.

    Attributes:
        frames: frames received.
        lost: frames that never came, dropped by the device or lost on the way.
        drift: rate of the device's clock relative to the host's, minus 1 (1e-6 is 1 ppm); None if unknown.
        drift_uncertainty: standard uncertainty of `drift`.
        offset_s: host time minus device time at the end, in s.
    """

    frames: int
    lost: int
    drift: float | None
    drift_uncertainty: float | None
    offset_s: float | None


class BusStream(Protocol):
    """A running stream."""

    def frames(self) -> Sequence[StreamFrame]:
        """Return the frames received since the last call, in order; waits at most for the duration of one frame.

        Raises:
            DeviceFault: if the link is silent or answers nonsense, or its device restarted.
        """
        ...

    def stop(self) -> StreamSummary:
        """End the stream and return its statistics."""
        ...


class StreamingBus(I2cBus, Protocol):
    """An I2C bus of a device that runs transfers autonomously, by timer or interrupt line."""

    @property
    def device(self) -> str:
        """Name of the device that serves the bus, which faults of the link are attributed to."""
        ...

    def start_stream(
        self, transfers: Sequence[StreamTransfer], *, period_s: float | None = None, line: int | None = None
    ) -> BusStream:
        """Have the device run `transfers` every `period_s`, or at every rising edge of interrupt line `line`.

        Raises:
            Rejected: if the device cannot run this program.
        """
        ...
