"""Sources of a sensor's FIFO blocks: an OBC triggered by the sensor's interrupt, or the host by polling."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from hil.clock.port import Clock
from hil.instruments.sampled import StreamReport
from hil.instruments.sensors.registers import Registers
from hil.model.errors import DeviceFault, Garbled, NoReply
from hil.wire.port import I2cBus
from hil.wire.streaming import BusStream, FifoRead, RegisterRead, StreamFrame, StreamingBus

__all__ = ["Block", "BlockSource", "Fifo", "Packets", "source_of"]

_HOST_BUFFER_BYTES = 4096
_LONGEST_PAUSE_S = 1.0
_MARGIN = 0.5
_FULL, _LEFT_S = 0.7, 0.1  # fill level at which the host reads the FIFO, and the time then left until it overflows
_LARGEST_COUNT = 1.25  # largest plausible count, relative to the FIFO's capacity
# A frame of the OBC link holds 2048 bytes; its header and the other transfers take less than 48.
_MOST_BYTES = 2000
_FRAME_OVERHEAD_BYTES = 64
_STUFFING = 1.02
_FRAME_S = 1.0


@dataclass(frozen=True, slots=True)
class Packets:
    """The packets of one read.

    Attributes:
        counts: counts of the axes, shape (n, axes), invalid packets included.
        usable: which packets are valid, shape (n,).
    """

    counts: NDArray[np.int16]
    usable: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fifo:
    """A chip's FIFO, as in its data sheet.

    Attributes:
        size: capacity in bytes.
        packet: size of one packet in bytes.
        count: register with the fill level, high byte first.
        count_bytes, count_mask: size and mask of that register. An OBC's streams take two whole bytes; the host polls
            any other FIFO itself, even over an OBC.
        unit: bytes per count: 1, or the packet size where packets are counted.
        data: register from which packets are read.
        lost: register of the number of packets lost since the last flush, two bytes; or one byte with a flag.
        lost_order: byte order of that number.
        lost_flag: mask of the flag of packets lost since the last read, 0 where the register is a counter. The number
            lost then follows from time; the host polls such a FIFO itself, even over an OBC.
        lost_flag_stays: whether that flag stays until the FIFO is emptied, so that a stream ends at the first loss.
        temperature: register of the temperature, two bytes, read once per block.
        temperature_on_other: whether that register is on the chip's other die.
        prepare: settings for a watermark in packets, with the FIFO still off.
        flush: register and value that empty it.
        fill: settings that start it in stream mode, dropping the oldest packets when full; with and without the
            watermark interrupt.
        off: settings that switch interrupt and FIFO off.
        decode: decodes the bytes of whole packets.
    """

    size: int
    packet: int
    count: int
    count_bytes: int = 2
    count_mask: int = 0xFFFF
    unit: int = 1
    data: int
    lost: int
    lost_order: Literal["big", "little"] = "little"
    lost_flag: int = 0
    lost_flag_stays: bool = False
    temperature: int
    temperature_on_other: bool = False
    prepare: Callable[[int], Mapping[int, int]]
    flush: tuple[int, int]
    fill: Callable[[bool], Mapping[int, int]]
    off: Mapping[int, int]
    decode: Callable[[bytes], Packets]

    @property
    def capacity(self) -> int:
        """Capacity in packets."""
        return self.size // self.packet

    def watermark(self, rate: float) -> int:
        """Return the number of packets per block at a rate [Hz]: one second's, or half of the FIFO.

        The other half is headroom for a busy bus.
        """
        return max(1, min(self.capacity // 2, round(rate * _FRAME_S)))

    def at_hand(self, registers: Registers) -> int:
        """Return the number of packets in the FIFO."""
        count = int.from_bytes(registers.block(self.count, self.count_bytes), "big") & self.count_mask
        return count * self.unit // self.packet

    def heat(self, registers: Registers) -> bytes:
        """Return the two bytes of the temperature."""
        return ((registers.other if self.temperature_on_other else None) or registers).block(self.temperature, 2)

    def lost_by(self, registers: Registers) -> int:
        """Return the number of packets lost; with only a flag, 1 if any were lost since the last read.

        Raises:
            Garbled: packets were lost, and the flag stays set.
        """
        if self.lost_flag:
            lost = bool(registers.read(self.lost) & self.lost_flag)
            if lost and self.lost_flag_stays:
                raise Garbled(
                    registers.device,
                    "its FIFO has overflowed, and does not say how many samples it lost",
                    "record at a lower rate, and see what keeps the host from reading it",
                )
            return int(lost)
        return int.from_bytes(registers.block(self.lost, 2), self.lost_order)

    def begin(self, registers: Registers, *, interrupt: bool) -> None:
        """Start filling; the interrupt is enabled before the first packet."""
        registers.put(self.fill(interrupt))


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """One read of the FIFO.

    Attributes:
        number: counted from 0; a missing number is a lost block.
        at_s: device time in s at which the FIFO reached its watermark.
        watermark: number of packets that had entered the FIFO since the previous block, at that time.
        temperature: the two bytes of the temperature.
        packets: whole packets.
        lost_counter: the sensor's counter of lost packets after this block.
    """

    number: int
    at_s: float
    watermark: int
    temperature: bytes
    packets: bytes
    lost_counter: int


class BlockSource(Protocol):
    """Source of FIFO blocks in order of arrival."""

    begun_s: float | None
    longest_pause: float

    def begin(self) -> None:
        """Start filling the FIFO."""
        ...

    def blocks(self) -> Iterator[Block]:
        """Yield the blocks received; one with a fault raises when its turn comes."""
        ...

    def silent(self, what: str) -> DeviceFault:
        """Return the fault of sensor or board when an awake sensor sends no blocks; `what` describes the silence."""
        ...

    def end(self) -> StreamReport:
        """Stop taking blocks, and return the statistics, without the samples that the sensor lost."""
        ...


def source_of(registers: Registers, fifo: Fifo, clock: Clock, *, rate: float, line: int) -> BlockSource:
    """Return the block source for a rate [Hz]; `line` is the OBC's interrupt line, where there is an OBC."""
    streaming = _streaming(registers.bus)
    if streaming is None or fifo.lost_flag or fifo.count_bytes != 2:
        return _PolledSource(registers, fifo, clock, rate)
    return _BoardSource(streaming, registers, fifo, rate, line)


def _streaming(bus: I2cBus) -> StreamingBus | None:
    """Return the bus as a streaming one, if it is one."""
    return cast("StreamingBus", bus) if hasattr(bus, "start_stream") else None


class _BoardSource:
    """Blocks read by an OBC at every watermark interrupt of the sensor."""

    begun_s: float | None = None

    def __init__(self, bus: StreamingBus, registers: Registers, fifo: Fifo, rate: float, line: int) -> None:
        self._bus = bus
        self._registers = registers
        self._fifo = fifo
        self._line = line
        self._watermark = fifo.watermark(rate)
        self._stream: BusStream | None = None
        frame = _STUFFING * (self._watermark * fifo.packet + _FRAME_OVERHEAD_BYTES)
        self.longest_pause = min(_LONGEST_PAUSE_S, _MARGIN * _HOST_BUFFER_BYTES / frame * self._watermark / rate)

    def begin(self) -> None:
        """Start the board's stream, then FIFO and interrupt: a line that is already high would give no edge."""
        address, fifo = self._registers.address, self._fifo
        self._stream = self._bus.start_stream(
            (
                RegisterRead(address=address, register=fifo.temperature, length=2),
                FifoRead(
                    address=address,
                    count_register=fifo.count,
                    unit=fifo.unit,
                    record=fifo.packet,
                    data_register=fifo.data,
                    most=_MOST_BYTES,
                ),
                # Read after the FIFO, which is then empty: the packets counted were lost before these.
                RegisterRead(address=address, register=fifo.lost, length=2),
            ),
            line=self._line,
        )
        fifo.begin(self._registers, interrupt=True)

    def blocks(self) -> Iterator[Block]:
        """Yield the blocks of the frames received.

        Raises:
            NoReply: fault of the sensor: a transfer was not acknowledged.
            DeviceFault: fault of the OBC.
        """
        for frame in self._stream.frames() if self._stream else ():
            yield self._block(frame)

    def silent(self, what: str) -> DeviceFault:
        """Return the sensor's fault if its FIFO is filling without an interrupt; the board's if it is being emptied."""
        if self._fifo.at_hand(self._registers) >= self._watermark:
            return NoReply(
                self._registers.device,
                f"{what}: its FIFO fills, and nothing reads it",
                "check the wire of its INT1, and `line` in the wiring",
            )
        return NoReply(
            self._bus.device,
            f"{what} of {self._registers.device}, though it answers and reads that sensor's FIFO",
            "check its firmware",
        )

    def end(self) -> StreamReport:
        """Stop the board's stream."""
        stream, self._stream = self._stream, None
        if stream is None:
            return StreamReport(frames=0, lost=0, drift=None, drift_uncertainty=None)
        summary = stream.stop()
        return StreamReport(
            frames=summary.frames,
            lost=summary.lost,
            drift=summary.drift,
            drift_uncertainty=summary.drift_uncertainty,
        )

    def _block(self, frame: StreamFrame) -> Block:
        temperature, packets, lost = frame.replies
        if temperature is None or packets is None or lost is None:
            raise NoReply(
                self._registers.device,
                f"no acknowledge at address {self._registers.address:#04x} in frame {frame.number}",
                "check the sensor's power and its wires",
            )
        return Block(
            number=frame.number,
            at_s=frame.device_s,
            watermark=self._watermark,
            temperature=temperature,
            packets=packets,
            lost_counter=int.from_bytes(lost, self._fifo.lost_order),
        )


class _PolledSource:
    """Blocks polled by the host; device time is bench time.

    The arrival of the newest sample is known only to within one sampling period. Sample times advance at the nominal
    rate, and are shifted just enough to follow the sensor's oscillator.
    """

    begun_s: float | None = 0.0

    def __init__(self, registers: Registers, fifo: Fifo, clock: Clock, rate: float) -> None:
        self._registers = registers
        self._fifo = fifo
        self._period = 1.0 / rate
        self._clock = clock
        self._began = 0.0
        self._newest = 0.0
        self._behind = 0  # packets of the last block that came after its nominal instant
        self._lost_counter = 0
        self._number = 0
        self._was_full = False
        self.longest_pause = min(_LONGEST_PAUSE_S, _filling(registers, fifo.capacity * self._period))

    def begin(self) -> None:
        """Start filling the FIFO; device time starts at 0."""
        lost = self._fifo.lost_by(self._registers)
        self._lost_counter = 0 if self._fifo.lost_flag else lost
        self._fifo.begin(self._registers, interrupt=False)
        self._began = self._clock.now()

    def blocks(self) -> Iterator[Block]:
        """Yield one block of the FIFO's content, if there is any.

        Raises:
            NoReply: the sensor does not acknowledge.
            Garbled: the fill level exceeds the FIFO's capacity.
        """
        registers, fifo = self._registers, self._fifo
        count = fifo.at_hand(registers)
        counted = self._clock.now() - self._began
        if not count:
            return
        if count > _LARGEST_COUNT * fifo.capacity:
            raise Garbled(
                registers.device,
                f"its FIFO of {fifo.capacity} packets tells of {count}",
                "check its power and its wires, and what else is at its address",
            )
        # Packets that a full FIFO drops while being read precede these, and as many newer ones take their place.
        full, self._was_full = self._was_full or count >= fifo.capacity - 1, count >= fifo.capacity - 1
        lost = self._lost(count, counted) if full else self._lost_counter
        came = count + max(0, lost - self._lost_counter)
        packets = registers.long(fifo.data, count * fifo.packet)
        self._lost_counter = lost if fifo.lost_flag else fifo.lost_by(registers)
        expected = self._newest + (self._behind + came) * self._period
        self._newest = min(max(expected, counted - self._period), counted)
        self._behind = self._lost_counter - lost
        yield Block(
            number=self._number,
            at_s=self._newest,
            watermark=came,
            temperature=fifo.heat(registers),
            packets=packets,
            lost_counter=self._lost_counter,
        )
        self._number += 1

    def _lost(self, count: int, counted: float) -> int:
        """Return the number of packets lost since the start; `count` are in the FIFO at the time `counted`."""
        lost = self._fifo.lost_by(self._registers)
        if not self._fifo.lost_flag:
            return lost
        came = int((counted - self._newest) / self._period)
        return self._lost_counter + (max(1, came - count) if lost else 0)

    def silent(self, what: str) -> DeviceFault:
        """Return the sensor's fault."""
        return NoReply(
            self._registers.device, f"{what}: its FIFO stays empty", "switch it off and on, and start it again"
        )

    def end(self) -> StreamReport:
        """Return the statistics; no block can be lost between sensor and host."""
        return StreamReport(frames=self._number, lost=0, drift=None, drift_uncertainty=None)


def _filling(registers: Registers, whole_s: float) -> float:
    """Return how long the host may let a FIFO fill that is full after `whole_s` [s]."""
    wanted = min(_FULL * whole_s, whole_s - _LEFT_S) if registers.sparing else 0.0
    return max(_MARGIN * whole_s, wanted)
