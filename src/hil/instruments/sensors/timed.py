"""Streaming of a sensor without a FIFO: an OBC's timer polls it, and the frames become rows."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from hil.clock.port import Clock
from hil.instruments.sampled import StreamReport
from hil.instruments.sensors.axes import Sampling
from hil.instruments.sensors.recorder import Stream, StreamingSensor
from hil.instruments.sensors.registers import Registers
from hil.instruments.sensors.stillness import Stillness
from hil.model.errors import DeviceFault, Garbled, NoReply, Refused
from hil.wire.streaming import BusStream, RegisterRead, StreamFrame, StreamingBus

__all__ = ["Outputs", "TimedSensor"]

_HOST_BUFFER_BYTES = 4096
_LONGEST_PAUSE_S, _LONGEST_PAUSE_BEFORE_S = 4.0, 1.0
_MARGIN = 0.5
_FRAME_OVERHEAD_BYTES = 32
_SILENT_FRAMES = 3
_SILENT_S = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Outputs:
    """Consecutive registers read in one transfer.

    Attributes:
        first: the first register.
        length: number of bytes.
        axes: offset of three 16-bit numbers, low byte first.
        temperature: offset of the one-byte temperature.
        steady: offsets of the bytes that are constant while the sensor measures: status, mode.
        judge: raises the fault that such bytes show.
    """

    first: int
    length: int
    axes: int
    temperature: int
    steady: slice
    judge: Callable[[bytes], object]


class _TimedStream:
    """Stream of samples polled by a board's timer. See `hil.instruments.sensors.recorder.Stream`.

    Args:
        registers: the sensor's registers.
        outputs: the registers read at every tick.
        sampling: the sampling configuration.
        clock: the bench's clock.
        rate: timer ticks per second.
        patience: correlation length of the noise in samples, see `Stillness`.
    """

    def __init__(
        self, registers: Registers, outputs: Outputs, sampling: Sampling, clock: Clock, rate: float, patience: float
    ) -> None:
        self._registers, self._outputs, self._sampling, self._clock = registers, outputs, sampling, clock
        self._bus = cast("StreamingBus", registers.bus)
        self._period = 1.0 / rate
        self._every = max(1, round(sampling.period * rate + 0.49))  # ticks from one sample to the next
        self._stillness = Stillness(registers.device, sampling.axes, sampling.noise, patience)
        self._stream: BusStream | None = None
        self._origin: float | None = None
        self._steady: NDArray[np.uint8] | None = None
        self._fault: DeviceFault | None = None
        self._heard = 0.0
        buffered = _HOST_BUFFER_BYTES / (outputs.length + _FRAME_OVERHEAD_BYTES)
        longest = _LONGEST_PAUSE_S if registers.sparing else _LONGEST_PAUSE_BEFORE_S
        self.longest_pause = min(longest, _MARGIN * buffered * self._period)

    def begin(self) -> None:
        """Start the board's timer, which reads the sensor at every tick; the first comes one period later."""
        outputs = self._outputs
        outputs.judge(self._registers.long(outputs.first, outputs.length))  # which also selects its page
        read = RegisterRead(address=self._registers.address, register=outputs.first, length=outputs.length)
        self._stream = self._bus.start_stream((read,), period_s=self._period)
        self._heard = self._clock.now()

    def drain(self) -> NDArray[np.float64]:
        """Return the rows received since the last call, shape (n, 5): time in s, axes, temperature in degC."""
        if self._fault:
            raise self._fault
        frames = list(self._stream.frames()) if self._stream else []
        if not frames:
            self._must_not_be_silent()
            return np.empty((0, 5))
        self._heard = self._clock.now()
        try:
            return self._rows(frames)
        except DeviceFault as fault:
            good = next((place for place, frame in enumerate(frames) if not self._is_good(frame)), 0)
            if not good:
                raise
            self._fault = fault
            return self._rows(frames[:good])

    def end(self) -> StreamReport:
        """Stop the board's stream, and return the statistics."""
        stream, self._stream = self._stream, None
        if stream is None:
            return StreamReport(frames=0, lost=0, drift=None, drift_uncertainty=None)
        told = stream.stop()
        return StreamReport(
            frames=told.frames, lost=told.lost, drift=told.drift, drift_uncertainty=told.drift_uncertainty
        )

    def _rows(self, frames: list[StreamFrame]) -> NDArray[np.float64]:
        outputs = self._outputs
        data = np.frombuffer(b"".join(map(self._bytes, frames)), dtype=np.uint8).reshape(-1, outputs.length)
        steady = data[:, outputs.steady]
        if self._steady is None or (steady != self._steady).any():
            for row in data:
                outputs.judge(row.tobytes())
            self._steady = steady[-1]
        counts = np.ascontiguousarray(data[:, outputs.axes : outputs.axes + 6]).view("<i2")
        self._stillness.judge_many(counts[:: self._every])
        times = np.array([frame.device_s for frame in frames])
        if self._origin is None:
            self._origin = frames[0].device_s - (frames[0].number + 1) * self._period
        celsius = self._sampling.temperature.numbers(data[:, outputs.temperature].view(np.int8).astype(np.int16))
        return np.column_stack((times - self._origin, self._sampling.axes.numbers(counts), celsius))

    def _bytes(self, frame: StreamFrame) -> bytes:
        (reply,) = frame.replies
        if reply is None:
            raise NoReply(
                self._registers.device,
                f"no acknowledge at address {self._registers.address:#04x} in frame {frame.number}",
                "check the sensor's power and its wires",
            )
        if len(reply) != self._outputs.length:
            raise Garbled(
                self._bus.device,
                f"{self._outputs.length} bytes were asked for and {len(reply)} came in frame {frame.number}",
                "check its firmware",
            )
        return reply

    def _is_good(self, frame: StreamFrame) -> bool:
        try:
            self._outputs.judge(self._bytes(frame))
        except DeviceFault:
            return False
        return True

    def _must_not_be_silent(self) -> None:
        """Raise if no frame has come for long although the link answers."""
        longest = max(_SILENT_S, _SILENT_FRAMES * self._period + self.longest_pause)
        if (silent := self._clock.now() - self._heard) > longest:
            raise NoReply(
                self._bus.device,
                f"no reading of {self._registers.device} for {silent:.2g} s, though its link answers",
                "check its firmware",
            )


class TimedSensor(StreamingSensor):
    """A sensor that streams on an OBC's bus; on any bus it can also be polled sample by sample.

    The chip's class defines `_outputs` in addition to what `Axes` requires.
    """

    can_be_asked: ClassVar[bool] = True

    @property
    def streams(self) -> bool:
        """Whether the bus belongs to a board that can poll it."""
        return hasattr(self._registers.bus, "start_stream")

    @abstractmethod
    def _outputs(self) -> Outputs:
        """Return the registers read at every tick."""

    def _stream_at(self, rate: float) -> Stream:
        if not self.streams:
            raise Refused(f"{self._device} has no FIFO, and its bus no timer", "record it beside another role")
        return _TimedStream(self._registers, self._outputs(), self._sampling, self._clock, rate, self._patience)
