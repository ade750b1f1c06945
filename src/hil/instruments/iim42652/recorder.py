"""A gyroscope that runs by itself: blocks of the FIFO become rows with device time."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from hil.clock.port import Clock
from hil.instruments.iim42652.mode import GYRO_ON, Mode, celsius
from hil.instruments.iim42652.packets import PACKET_BYTES, Packets, rates
from hil.instruments.iim42652.registers import Register, Registers
from hil.instruments.iim42652.source import Block, BlockSource, BoardSource, PolledSource
from hil.instruments.iim42652.stillness import Stillness
from hil.instruments.iim42652.timeline import Span, Timeline
from hil.instruments.sampled import StreamReport
from hil.model.errors import DeviceFault, Garbled, NoReply
from hil.wire.port import I2cBus
from hil.wire.streaming import StreamingBus

__all__ = ["Recorder", "watermark"]

_COLUMNS = 5
_FRAME_S = 1.0
_MOST_PACKETS = 128  # half of the FIFO: the other half is time for a bus that is busy
_SILENT_FRAMES = 3
_MARGIN_S = 0.1
_GYRO_AND_TEMPERATURE = 1 << 1 | 1 << 2
_FLUSH = 1 << 1
_PULSES_UP_PUSH_PULL = 0b011


@dataclass(frozen=True, slots=True)
class _Readings:
    """The samples of one block, until their times are known."""

    packets: Packets
    temperature: float


def watermark(rate: float) -> int:
    """Return the packets of one block at a rate [Hz]: one second, or half of the FIFO."""
    return max(1, min(_MOST_PACKETS, round(rate * _FRAME_S)))


class Recorder:
    """One stream of a gyroscope that has been started.

    Args:
        registers: the sensor.
        mode: its mode.
        clock: the bench's clock.
    """

    def __init__(self, registers: Registers, mode: Mode, clock: Clock) -> None:
        self._registers = registers
        self._mode = mode
        self._clock = clock
        self._watermark = watermark(mode.rate)
        self._source = _source(registers, mode, clock, self._watermark)
        self._timeline = Timeline(mode.period, self._source.begun_s)
        self._stillness = Stillness(registers.device, mode.noise_counts)
        self._waiting: deque[_Readings] = deque()
        self._fault: DeviceFault | None = None
        self._heard = 0.0
        self._lost_counter = 0
        self._lost_samples = 0

    @property
    def longest_pause(self) -> float:
        """Seconds after which a buffer on the way overflows, with a margin."""
        return self._source.longest_pause

    def begin(self) -> None:
        """Empty the FIFO and let it fill.

        Raises:
            Rejected: a setting reads back otherwise, or the OBC cannot run the stream.
            DeviceFault: of the sensor or the OBC.
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
        """Return what has come, shape (n, 5): time in s, x, y, z in deg/s, temperature in degC.

        Raises:
            DeviceFault: no more will come; what came before it has been returned.
        """
        if self._fault:
            raise self._fault
        rows: list[NDArray[np.float64]] = []
        try:
            for block in self._source.blocks():
                rows.extend(self._rows(block))
            self._must_go_on()
        except DeviceFault as fault:
            if not rows:
                raise
            self._fault = fault
        return np.concatenate(rows) if rows else np.empty((0, _COLUMNS))

    def end(self) -> StreamReport:
        """Stop the stream, switch the FIFO off, and return how it went."""
        report = self._source.end()
        self._registers.set({Register.INT_SOURCE0: 0, Register.FIFO_CONFIG: 0})
        return replace(report, lost_samples=self._lost_samples)

    def _prepare(self) -> None:
        level = self._watermark * PACKET_BYTES
        self._registers.set({Register.INT_SOURCE0: 0, Register.FIFO_CONFIG: 0})
        values = {
            Register.FIFO_CONFIG1: _GYRO_AND_TEMPERATURE,
            Register.FIFO_CONFIG2: level & 0xFF,
            Register.FIFO_CONFIG3: level >> 8,
            Register.INT_CONFIG: _PULSES_UP_PUSH_PULL,
        }
        self._registers.set(values)
        self._registers.expect(values)
        self._registers.write(Register.SIGNAL_PATH_RESET, _FLUSH)
        self._registers.block(Register.FIFO_COUNT, 2)  # the first count after a flush is wrong (Linux inv_icm42600)
        self._lost_counter = int.from_bytes(self._registers.block(Register.FIFO_LOST_PKT, 2), "little")

    def _rows(self, block: Block) -> Iterator[NDArray[np.float64]]:
        packets = Packets.read(block.packets)
        count = len(packets.usable)
        lost = self._count_lost(block.lost_counter)
        self._require_usable(packets, block.number)
        self._stillness.judge(packets.counts)
        if count:
            self._heard = self._clock.now()
        self._waiting.append(_Readings(packets, celsius(block.temperature)))
        span = Span(number=block.number, at_s=block.at_s, watermark=block.watermark, count=count, lost=lost)
        for times in self._timeline.place(span):
            yield self._table(times, self._waiting.popleft())

    def _table(self, times: NDArray[np.float64], readings: _Readings) -> NDArray[np.float64]:
        table = np.empty((len(times), _COLUMNS))
        table[:, 0] = times
        table[:, 1:4] = rates(readings.packets.counts, self._mode.sensitivity)
        table[:, 4] = readings.temperature
        return table[readings.packets.usable]

    def _count_lost(self, counter: int) -> int:
        """Return how many packets were lost since the last block; a counter that went back began anew."""
        lost = counter - self._lost_counter if counter >= self._lost_counter else counter
        self._lost_counter = counter
        self._lost_samples += lost
        return lost

    def _require_usable(self, packets: Packets, number: int) -> None:
        wrong = len(packets.usable) - int(np.count_nonzero(packets.usable))
        self._lost_samples += wrong
        if 2 * wrong > len(packets.usable):
            raise Garbled(
                self._registers.device,
                f"{wrong} of {len(packets.usable)} packets in block {number} are none of the gyroscope's",
                "look at the sensor's wires and at who else reads its FIFO",
            )

    def _must_go_on(self) -> None:
        """Find out why no samples come, where none did for three blocks' time."""
        quiet = self._clock.now() - self._heard
        if quiet <= _SILENT_FRAMES * self._watermark * self._mode.period + _MARGIN_S:
            return
        what = f"no samples for {quiet:.2f} s"
        # A link that is silent fails here, and is the fault of its own device.
        if self._registers.read(Register.PWR_MGMT0) != GYRO_ON:
            raise NoReply(
                self._registers.device, f"{what}: it has lost its settings", "look at its power, and start it again"
            )
        raise self._source.silent(what)


def _source(registers: Registers, mode: Mode, clock: Clock, level: int) -> BlockSource:
    streaming = _streaming(registers.bus)
    if streaming is None:
        return PolledSource(registers, mode, clock)
    return BoardSource(streaming, registers, mode, level)


def _streaming(bus: I2cBus) -> StreamingBus | None:
    """Return the bus as one that runs transfers by itself, if it is one."""
    return cast("StreamingBus", bus) if hasattr(bus, "start_stream") else None
