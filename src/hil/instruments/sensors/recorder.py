"""Streaming sensors: FIFO blocks become rows with device time."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from hil.clock.port import Clock
from hil.instruments.marks import drives
from hil.instruments.sampled import StreamReport
from hil.instruments.sensors.axes import Axes, Sampling
from hil.instruments.sensors.fifo import Block, Fifo, Packets, source_of
from hil.instruments.sensors.registers import Registers
from hil.instruments.sensors.stillness import Stillness
from hil.instruments.sensors.timeline import Span, Timeline
from hil.model.errors import DeviceFault, Garbled, NoReply, Refused

__all__ = ["FifoSensor", "Recorder", "Stream", "StreamingSensor"]

_SILENT_FRAMES = 3
_MARGIN_S = 0.1
_FASTER = 1.5  # relative to the nominal rate; no oscillator is this fast


@dataclass(frozen=True, slots=True)
class _Readings:
    """The samples of one block whose times are not known yet."""

    packets: Packets
    temperature: float


class Recorder:
    """One stream of a started sensor.

    Args:
        registers: the sensor's registers.
        fifo: the chip's FIFO.
        sampling: the sampling configuration.
        clock: the bench's clock.
        named: raises if the sensor's ID reads wrong; called where the host polls the FIFO.
    """

    def __init__(
        self, registers: Registers, fifo: Fifo, sampling: Sampling, clock: Clock, named: Callable[[], None]
    ) -> None:
        self._registers = registers
        self._fifo = fifo
        self._sampling = sampling
        self._clock = clock
        self._named = named
        self._watermark = fifo.watermark(sampling.rate)
        self._source = source_of(registers, fifo, clock, rate=sampling.rate, line=sampling.line)
        self.longest_pause = self._source.longest_pause
        self._timeline = Timeline(sampling.period, self._source.begun_s)
        self._stillness = Stillness(registers.device, sampling.axes, sampling.noise)
        self._waiting: deque[_Readings] = deque()
        self._fault: DeviceFault | None = None
        self._heard = 0.0
        self._lost_counter = 0
        self._at = -math.inf if self._source.begun_s is None else self._source.begun_s  # of the last block
        self._lost_samples = 0

    def begin(self) -> None:
        """Empty the FIFO and start filling it.

        Raises:
            Rejected: a setting reads back differently, or the OBC cannot run the stream.
            DeviceFault: fault of the sensor or the OBC.
        """
        self._prepare()
        try:
            self._source.begin()
        except DeviceFault:
            with suppress(DeviceFault):
                self._source.end()
            raise
        self._heard = self._clock.now()

    def drain(self) -> NDArray[np.float64]:
        """Return the rows received since the last call, shape (n, 2 + axes): time in s, axes, temperature in degC.

        Raises:
            DeviceFault: the stream is over; earlier rows have been returned.
        """
        if self._fault:
            raise self._fault
        rows: list[NDArray[np.float64]] = []
        try:
            for block in self._source.blocks():
                rows.extend(self._rows(block))
            self._must_not_be_silent()
            if (
                self._source.begun_s is not None
            ):  # a board's frames have checksums, and packets that it reads have headers
                self._named()
        except DeviceFault as fault:
            if not rows:
                raise
            self._fault = fault
        return np.concatenate(rows) if rows else self._table(np.empty(0), _Readings(self._fifo.decode(b""), 0.0))

    def end(self) -> StreamReport:
        """Stop the stream, switch the FIFO off, and return the statistics."""
        report = self._source.end()
        self._registers.set(self._fifo.off)
        return replace(report, lost_samples=self._lost_samples)

    def _prepare(self) -> None:
        registers, fifo = self._registers, self._fifo
        registers.set(fifo.off)
        registers.put(fifo.prepare(self._watermark))
        registers.write(*fifo.flush)
        fifo.at_hand(registers)  # the first count after a flush can be wrong (Linux inv_icm42600)
        self._lost_counter = fifo.lost_by(registers)

    def _rows(self, block: Block) -> Iterator[NDArray[np.float64]]:
        packets = self._fifo.decode(block.packets)
        count = len(packets.usable)
        lost = self._count_lost(block)
        self._require_usable(packets, block.number)
        self._stillness.judge_many(packets.counts)
        if count:
            self._heard = self._clock.now()
        self._waiting.append(_Readings(packets, self._sampling.celsius(block.temperature)))
        span = Span(number=block.number, at_s=block.at_s, watermark=block.watermark, count=count, lost=lost)
        for times in self._timeline.place(span):
            yield self._table(times, self._waiting.popleft())

    def _table(self, times: NDArray[np.float64], readings: _Readings) -> NDArray[np.float64]:
        axes = self._sampling.axes.numbers(readings.packets.counts)
        temperature = np.full(len(times), readings.temperature)
        return np.column_stack((times, axes, temperature))[readings.packets.usable]

    def _count_lost(self, block: Block) -> int:
        """Return the number of packets lost since the last block; a counter that went back was restarted.

        Raises:
            Garbled: more than can have come in that time, so the counter cannot be the sensor's.
        """
        before, counter = self._lost_counter, block.lost_counter
        lost = counter - before if counter >= before else counter
        possible = self._fifo.capacity + _FASTER * (block.at_s - self._at) / self._sampling.period
        if lost > possible:
            raise Garbled(
                self._registers.device,
                f"it says in block {block.number} that it lost {lost} samples, and {possible:.0f} can have come",
                "check the sensor's wires and its power",
            )
        self._lost_counter, self._at = counter, block.at_s
        self._lost_samples += lost
        return lost

    def _require_usable(self, packets: Packets, number: int) -> None:
        wrong = len(packets.usable) - int(np.count_nonzero(packets.usable))
        self._lost_samples += wrong
        if 2 * wrong > len(packets.usable):
            raise Garbled(
                self._registers.device,
                f"{wrong} of {len(packets.usable)} packets in block {number} are not what the sensor was set to give",
                "check the sensor's wires and what else reads its FIFO",
            )

    def _must_not_be_silent(self) -> None:
        """Raise the cause of silence once no samples came for the duration of three blocks."""
        quiet = self._clock.now() - self._heard
        if quiet <= _SILENT_FRAMES * self._watermark * self._sampling.period + _MARGIN_S:
            return
        what = f"no samples for {quiet:.2f} s"
        # A silent link fails here, as the fault of its own device.
        if any(self._registers.read(register) != value for register, value in self._sampling.awake.items()):
            raise NoReply(
                self._registers.device, f"{what}: it has lost its settings", "check its power, and start it again"
            )
        raise self._source.silent(what)


class Stream(Protocol):
    """Interface of a running stream of samples."""

    longest_pause: float

    def begin(self) -> None:
        """Start the stream."""
        ...

    def drain(self) -> NDArray[np.float64]:
        """Return the rows received since the last call, shape (n, 2 + axes): time in s, axes, temperature in degC."""
        ...

    def end(self) -> StreamReport:
        """Stop the stream, and return the statistics."""
        ...


class StreamingSensor(Axes):
    """A sensor that can also stream its samples, see `hil.instruments.sampled.Streamed`."""

    _stream: Stream | None = None

    @drives
    def start(self) -> None:
        """End any running stream, and start; see `Sensor.start`."""
        self._abandon()
        super().start()

    @drives
    def stop(self) -> None:
        """End any running stream, put the sensor to sleep, and read that back."""
        self._abandon()
        super().stop()

    def begin(self, rate: float) -> None:
        """Start to stream at a rate [Hz]; device time counts from the first sample.

        Over an OBC this is up to one sampling period later than the call. See `hil.instruments.sampled.Streamed`.

        Raises:
            Refused: not started, already streaming, or the rate is not available.
            Rejected: a setting reads back differently, or the OBC cannot run the stream.
        """
        self._require_running()
        if self._stream:
            raise Refused(f"{self._device} is already streaming", "end the stream first")
        stream = self._stream_at(rate)
        stream.begin()
        self._stream, self._named = stream, self._clock.now()

    def drain(self) -> NDArray[np.float64]:
        """Return the samples since the last call, shape (n, 2 + axes): device time in s, axes, temperature in degC.

        A lost sample leaves a gap in time.

        Raises:
            NoReply: fault of the sensor: no acknowledge, no samples for the duration of three blocks, or frozen values.
            Garbled: most packets of a block are invalid.
            DeviceFault: fault of the OBC: the link failed.
        """
        return self._streaming().drain()

    def end(self) -> StreamReport:
        """Stop the stream, and return its statistics."""
        stream = self._streaming()
        self._stream = None
        return stream.end()

    @property
    def longest_pause(self) -> float:
        """Seconds until a buffer in the path overflows, with a margin; 0 while nothing is streaming."""
        return self._stream.longest_pause if self._stream else 0.0

    @abstractmethod
    def _stream_at(self, rate: float) -> Stream:
        """Return a stream at a rate [Hz], not yet started; Refused for an unavailable rate."""

    def _abandon(self) -> None:
        """End any running stream, ignoring its faults."""
        self._running = False
        stream, self._stream = self._stream, None
        if stream:
            with suppress(DeviceFault):
                stream.end()

    def _streaming(self) -> Stream:
        if self._stream is None:
            raise Refused(f"{self._device} does not stream", "call begin() first")
        return self._stream


class FifoSensor(StreamingSensor):
    """A sensor that streams through its FIFO; the temperature is read once per block.

    The chip's class defines `fifo` in addition to what `Axes` requires.
    """

    fifo: ClassVar[Fifo]

    def _stream_at(self, rate: float) -> Stream:
        if rate != self._sampling.rate:
            raise Refused(
                f"{self._device} runs at {self._sampling.rate:g} Hz, not at {rate:g} Hz",
                "record at that rate, or set `rate` in the wiring",
            )
        return Recorder(self._registers, self.fifo, self._sampling, self._clock, self._recheck_id)
