"""Where blocks of the FIFO come from: an OBC that is triggered by the sensor, or polls over the host's own bus."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

from hil.clock.port import Clock
from hil.instruments.iim42652.mode import Mode
from hil.instruments.iim42652.packets import PACKET_BYTES
from hil.instruments.iim42652.registers import Register, Registers
from hil.instruments.sampled import StreamReport
from hil.model.errors import DeviceFault, NoReply
from hil.wire.streaming import BusStream, FifoRead, RegisterRead, StreamFrame, StreamingBus

__all__ = ["Block", "BlockSource", "BoardSource", "PolledSource"]

_FIFO_PACKETS = 2048 // PACKET_BYTES
_HOST_BUFFER_BYTES = 4096
_LONGEST_PAUSE_S = 1.0
_MARGIN = 0.5
# A frame of the OBC link holds 2048 bytes; its head and the other transfers take less than 48.
_MOST_BYTES = 2000
_FRAME_OVERHEAD_BYTES = 64
_STUFFING = 1.02
_WATERMARK_ON_INT1 = 1 << 2
_STREAM_TO_FIFO = 0b01 << 6


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """One read of the FIFO.

    Attributes:
        number: counted from 0; a number that is left out is a block that was lost.
        at_s: device time in s at which the FIFO reached its watermark.
        watermark: packets that had come into the FIFO since the block before, at that time.
        temperature: two bytes of TEMP_DATA.
        packets: whole packets.
        lost_counter: the sensor's counter of lost packets behind them.
    """

    number: int
    at_s: float
    watermark: int
    temperature: bytes
    packets: bytes
    lost_counter: int


class BlockSource(Protocol):
    """Blocks of the FIFO as they come."""

    begun_s: float | None
    longest_pause: float

    def begin(self) -> None:
        """Let the FIFO fill."""
        ...

    def blocks(self) -> Iterator[Block]:
        """Yield the blocks that have come; one that brings a fault raises when its turn comes."""
        ...

    def silent(self, what: str) -> DeviceFault:
        """Return whose fault it is that a sensor, which is awake, gives no blocks; `what` says since when."""
        ...

    def end(self) -> StreamReport:
        """Take no more blocks, and return how it went; samples that the sensor lost are not in it."""
        ...


class BoardSource:
    """Blocks that an OBC reads at every watermark interrupt of the sensor.

    Args:
        bus: the OBC's bus.
        registers: the sensor.
        mode: rate and interrupt line.
        watermark: packets.
    """

    begun_s: float | None = None

    def __init__(self, bus: StreamingBus, registers: Registers, mode: Mode, watermark: int) -> None:
        self._bus = bus
        self._registers = registers
        self._mode = mode
        self._watermark = watermark
        self._stream: BusStream | None = None
        frame = _STUFFING * (watermark * PACKET_BYTES + _FRAME_OVERHEAD_BYTES)
        self.longest_pause = min(_LONGEST_PAUSE_S, _MARGIN * _HOST_BUFFER_BYTES / frame * watermark / mode.rate)

    def begin(self) -> None:
        """Start the board's stream, then the FIFO and the interrupt: a line that is high already gives no trigger."""
        address = self._registers.address
        self._stream = self._bus.start_stream(
            (
                RegisterRead(address=address, register=Register.TEMP_DATA, length=2),
                FifoRead(
                    address=address,
                    count_register=Register.FIFO_COUNT,
                    unit=1,
                    record=PACKET_BYTES,
                    data_register=Register.FIFO_DATA,
                    most=_MOST_BYTES,
                ),
                # Behind the FIFO, which is empty then: what it counts was lost before these packets.
                RegisterRead(address=address, register=Register.FIFO_LOST_PKT, length=2),
            ),
            line=self._mode.line,
        )
        _fill(self._registers, interrupt=True)

    def blocks(self) -> Iterator[Block]:
        """Yield the frames that have come.

        Raises:
            NoReply: of the sensor, where a transfer had no acknowledge.
            DeviceFault: of the OBC.
        """
        for frame in self._stream.frames() if self._stream else ():
            yield self._block(frame)

    def silent(self, what: str) -> DeviceFault:
        """Return the sensor's fault where its FIFO fills, for no interrupt comes; the board's where it is emptied."""
        if _packets_at_hand(self._registers) >= self._watermark:
            return NoReply(
                self._registers.device,
                f"{what}: its FIFO fills, and nobody reads it",
                "look at the wire of its INT1, and at `line` in the wiring",
            )
        return NoReply(
            self._bus.device,
            f"{what} of {self._registers.device}, though it answers and reads that sensor's FIFO",
            "look at its firmware",
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
                "look at the sensor's power and its wires",
            )
        return Block(
            number=frame.number,
            at_s=frame.device_s,
            watermark=self._watermark,
            temperature=temperature,
            packets=packets,
            lost_counter=int.from_bytes(lost, "little"),
        )


class PolledSource:
    """Blocks that the host reads itself; device time is the bench's clock.

    When the newest sample came is known within one period only. Its time goes on at the nominal rate, and is moved as
    little as that takes where the sensor's own oscillator is faster or slower.

    Args:
        registers: the sensor.
        mode: its rate.
        clock: the bench's clock.
    """

    begun_s: float | None = 0.0

    def __init__(self, registers: Registers, mode: Mode, clock: Clock) -> None:
        self._registers = registers
        self._period = mode.period
        self._clock = clock
        self._began = 0.0
        self._newest = 0.0
        self._behind = 0  # packets of the last block that came after its instant
        self._lost_counter = 0
        self._number = 0
        self.longest_pause = min(_LONGEST_PAUSE_S, _MARGIN * _FIFO_PACKETS * mode.period)

    def begin(self) -> None:
        """Let the FIFO fill; device time is zero now."""
        self._lost_counter = self._lost()
        _fill(self._registers, interrupt=False)
        self._began = self._clock.now()

    def blocks(self) -> Iterator[Block]:
        """Yield what is in the FIFO, if anything is.

        Raises:
            NoReply: of the sensor, where it does not acknowledge.
        """
        count = _packets_at_hand(self._registers)
        counted = self._clock.now() - self._began
        if not count:
            return
        # What a full FIFO drops while it is read came before these packets, and as many newer ones take its place.
        lost = self._lost() if count >= _FIFO_PACKETS - 1 else self._lost_counter
        came = count + max(0, lost - self._lost_counter)
        packets = self._registers.long(Register.FIFO_DATA, count * PACKET_BYTES)
        self._lost_counter = self._lost()
        expected = self._newest + (self._behind + came) * self._period
        self._newest = min(max(expected, counted - self._period), counted)
        self._behind = self._lost_counter - lost
        yield Block(
            number=self._number,
            at_s=self._newest,
            watermark=came,
            temperature=self._registers.block(Register.TEMP_DATA, 2),
            packets=packets,
            lost_counter=self._lost_counter,
        )
        self._number += 1

    def silent(self, what: str) -> DeviceFault:
        """Return the sensor's fault."""
        return NoReply(
            self._registers.device, f"{what}: its FIFO stays empty", "switch it off and on, and start it again"
        )

    def end(self) -> StreamReport:
        """Count blocks; between them nothing can be lost."""
        return StreamReport(frames=self._number, lost=0, drift=None, drift_uncertainty=None)

    def _lost(self) -> int:
        return int.from_bytes(self._registers.block(Register.FIFO_LOST_PKT, 2), "little")


def _packets_at_hand(registers: Registers) -> int:
    return int.from_bytes(registers.block(Register.FIFO_COUNT, 2), "big") // PACKET_BYTES


def _fill(registers: Registers, *, interrupt: bool) -> None:
    """Let the FIFO fill, the oldest packets going where it is full; the interrupt is on before the first packet."""
    values = {
        Register.INT_SOURCE0: _WATERMARK_ON_INT1 if interrupt else 0,
        Register.FIFO_CONFIG: _STREAM_TO_FIFO,
    }
    registers.set(values)
    registers.expect(values)
