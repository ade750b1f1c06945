"""The commands of the simulated board, one by one, and what its analogue inputs see."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Protocol

import numpy as np
from numpy.typing import NDArray

from hil.analysis.noise.numbers import RandomStream
from hil.model.notation import NotNegative, matching, number, whole
from hil.simulation.peers.obc_link.bus import BoardBus
from hil.simulation.peers.obc_link.fields import (
    BUSES,
    LINES,
    MESSAGES,
    STREAMS,
    TRANSFERS,
    Code,
    Message,
    Reader,
    Refusal,
    messages_of,
    program_of,
)
from hil.simulation.peers.obc_link.stream import Stream
from hil.simulation.peers.obc_link.uart import LARGEST, VERSION, Frame, Uart
from hil.simulation.peers.timing import Alarm, BoardClock
from hil.simulation.plants.terminal import SignalPoint
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import PeerClock

__all__ = ["CHANNELS", "FULL_SCALE", "MINOR", "READING", "REQUEST_USER", "BoardTruth", "Commands", "Tally", "Watch"]

CHANNELS = 6
FULL_SCALE = 4095

_LARGEST_DRIFT = 0.01
_SIMULATED = b"SIMULATE"
"""Stands where a board has eight bytes of its firmware's commit."""
_BYTE = r"(\d{1,2}|1\d\d|2[0-4]\d|25[0-5])"


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardTruth:
    """One board.

    Attributes:
        clock_drift: of its crystal, relative.
        clock_offset: what its clock shows at the bench's epoch [s].
        firmware: version.
        unique_id: the twelve bytes of the chip's, in hexadecimal.
        ring: bytes for stream frames.
        reference: VDDA [V].
        analog_noise: of one conversion [counts rms].
        boots: its boot counter at the epoch.
        command_time, boot_time: from a request to its execution, and from a reset to the boot notice [s].
    """

    clock_drift: Annotated[float, number(-_LARGEST_DRIFT, _LARGEST_DRIFT)] = 0.0
    clock_offset: NotNegative = 0.0
    firmware: Annotated[str, matching(rf"{_BYTE}(\.{_BYTE}){{2}}", "a version such as '1.0.0'")] = "1.0.0"
    unique_id: Annotated[str, matching("[0-9A-Fa-f]{24}", "24 hexadecimal digits")] = "20373257533055100041002b"
    ring: Annotated[int, whole(4096, 16_384)] = 16_384
    reference: Annotated[float, number(1, 4)] = 3.3
    analog_noise: NotNegative = 0.5
    boots: Annotated[int, whole(0, 2**31)] = 41
    command_time: Annotated[float, number(0, 0.01)] = 20e-6
    boot_time: Annotated[float, number(0, 0.1)] = 0.05

    @property
    def version(self) -> bytes:
        """The three numbers of the firmware's version."""
        return bytes(map(int, self.firmware.split(".")))


MINOR = 0
READING = frozenset({0x01, 0x02, 0x09})
"""IDENTIFY, TIME and STATUS: executed at every arrival."""

REQUEST_USER = "request"
"""The request's name in the line-up for the bus."""

_NAME = b"hil-obc"
_MOST_CONVERSIONS = 1024
_CONVERSION_NS = 20_000
_FILLER = 17
_WATCH_MS = (100, 600_000)
_SPEEDS = (100_000, 400_000, 1_000_000)
_NOT_RUN = 5


@dataclass(slots=True, kw_only=True)
class Tally:
    """What the board counts from reset to reset; the boots from power to power."""

    boots: int
    reason: int
    usable: int = 0
    unusable: int = 0
    overruns: int = 0
    events: int = 0


class Watch(Protocol):
    """What commands need of the board as a whole."""

    tally: Tally
    watchdog_ms: int

    def watch(self, watchdog_ms: int) -> None:
        """Set the watchdog's time and start it; 0 is off."""
        ...

    def safe(self) -> int:
        """Go into the safe state; return how many streams were stopped."""
        ...

    def answer(self, payload: bytes) -> None:
        """Take the reply of a request that took its time."""
        ...


class Commands(Stateful):
    """Executes one request after the other.

    Args:
        truth: what the board is.
        inputs: signals [V] by channel; the others are 0 V.
        noise: of the conversions.
        parts: its clock, bus, stream and UART.
        board: the board as a whole.
    """

    _messages: Kept[tuple[Message, ...]]
    _later: Kept[bytes]
    _stopping: Kept[bool]
    _converted: Kept[Alarm]

    def __init__(
        self,
        truth: BoardTruth,
        inputs: Mapping[int, SignalPoint],
        noise: RandomStream,
        parts: tuple[BoardClock, BoardBus, Stream, Uart],
        board: Watch,
    ) -> None:
        self._truth = truth
        self._inputs = inputs
        self._noise = noise
        self._board_clock, self._bus, self._stream, self._uart = parts
        self._board = board
        self._messages = ()
        self._later = b""
        self._stopping = False
        self._received_us = 0
        self._clock: PeerClock
        self._known: Mapping[int, Callable[[bytes], bytes | None]] = {
            0x01: self._identify,
            0x02: self._time,
            0x03: self._transfer,
            0x04: self._convert,
            0x05: self._start,
            0x06: self._stop,
            0x07: self._watchdog,
            0x08: self._halt,
            0x09: self._status,
            0x0A: self._speed,
        }

    def attach(self, clock: PeerClock) -> None:
        """Connect the bench's clock."""
        self._clock = clock
        self._converted = Alarm(clock, self._give)

    def knows(self, kind: int) -> bool:
        """Return whether there is a command of that type."""
        return kind in self._known

    def execute(self, frame: Frame, received_us: int) -> bytes | None:
        """Execute a request; return its reply, or None if `answer` will bring it.

        Raises:
            Refusal: if the request is not allowed.
        """
        self._received_us = received_us
        return self._known[frame.kind](frame.payload)

    def on_bus(self) -> None:
        """Run the messages of the request up to the first that fails."""
        reply, status = bytes([Code.OK, len(self._messages)]), 0
        for message in self._messages:
            data = b""
            if status:
                status = _NOT_RUN
            elif message.length:
                status, data = self._bus.read(message.address, message.length)
            else:
                status = self._bus.write(message.address, message.written)
            reply += bytes([status]) + len(data).to_bytes(2, "little") + data
        self._later = reply

    def off_bus(self) -> None:
        """Answer when the messages are through."""
        self._give()

    def settle(self) -> None:
        """Answer STREAM_STOP once its turns have ended and the ring is empty."""
        if self._stopping and not self._stream.busy and not self._uart.holds_stream:
            self._stopping = False
            self._board.answer(self._stopped())

    def reset(self) -> None:
        """Forget the request that is being executed."""
        self._converted.clear()
        self._stopping = False

    def _give(self) -> None:
        self._board.answer(self._later)

    def _identify(self, payload: bytes) -> bytes:
        Reader(payload).end()
        truth, tally = self._truth, self._board.tally
        counts = (tally.reason, BUSES, LINES, CHANNELS, STREAMS, TRANSFERS, MESSAGES)
        return b"".join(
            (
                bytes([Code.OK, VERSION, MINOR, *truth.version]),
                _SIMULATED,
                bytes.fromhex(truth.unique_id),
                _u32(tally.boots),
                bytes(counts),
                LARGEST.to_bytes(2, "little"),
                _u32(truth.ring),
                bytes([len(_NAME)]),
                _NAME,
            )
        )

    def _time(self, payload: bytes) -> bytes:
        reader = Reader(payload)
        host = reader.taken(8)
        reader.taken(_FILLER)
        reader.end()
        sent_us = self._board_clock.at(self._uart.free_ns())
        return bytes([Code.OK]) + host + self._received_us.to_bytes(8, "little") + sent_us.to_bytes(8, "little")

    def _transfer(self, payload: bytes) -> None:
        self._messages = messages_of(payload, self._bus.frequency_hz)
        self._bus.ask(REQUEST_USER)

    def _convert(self, payload: bytes) -> None:
        reader = Reader(payload)
        channel, count = reader.number(1, 0, CHANNELS - 1), reader.number(2, 1, _MOST_CONVERSIONS)
        reader.end()
        noise = self._noise.normal_block(self._received_us * CHANNELS + channel, count)
        counts = self._conversions(channel, noise)
        self._later = b"".join(
            (
                bytes([Code.OK, channel]),
                count.to_bytes(2, "little"),
                _u32(int(counts.sum())),
                int((counts**2).sum()).to_bytes(8, "little"),
                FULL_SCALE.to_bytes(2, "little"),
                round(1000 * self._truth.reference).to_bytes(2, "little"),
            )
        )
        self._converted.set(self._clock.now_ns() + count * _CONVERSION_NS)

    def _conversions(self, channel: int, noise: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return raw conversions of a channel now, shape as `noise`, which is in units of its standard deviation."""
        volts = self._inputs[channel].observe() if channel in self._inputs else 0.0
        counts = np.rint(volts / self._truth.reference * FULL_SCALE + self._truth.analog_noise * noise)
        return np.clip(counts, 0, FULL_SCALE).astype(np.int64)

    def _start(self, payload: bytes) -> bytes:
        program = program_of(payload, self._bus.frequency_hz, self._not_busy)
        start_us = self._stream.start(program, payload)
        return bytes([Code.OK, program.number]) + start_us.to_bytes(8, "little") + _u32(program.period_us)

    def _stop(self, payload: bytes) -> bytes | None:
        reader = Reader(payload)
        number = reader.number(1, 0, STREAMS - 1)
        reader.end()
        if not self._stream.running:
            raise Refusal(Code.NOT_RUNNING, number)
        self._stream.stop()
        self._stopping = self._stream.busy or self._uart.holds_stream
        return None if self._stopping else self._stopped()

    def _stopped(self) -> bytes:
        return bytes([Code.OK, 0]) + _u32(self._stream.numbers) + _u32(self._stream.lost)

    def _watchdog(self, payload: bytes) -> bytes:
        reader = Reader(payload)
        watchdog_ms = reader.number(4, 0, _WATCH_MS[1])
        if 0 < watchdog_ms < _WATCH_MS[0]:
            reader.refuse(0)
        reader.end()
        before = self._board.watchdog_ms
        self._board.watch(watchdog_ms)
        return bytes([Code.OK]) + _u32(before)

    def _halt(self, payload: bytes) -> bytes:
        Reader(payload).end()
        return bytes([Code.OK, self._board.safe()])

    def _status(self, payload: bytes) -> bytes:
        Reader(payload).end()
        tally = self._board.tally
        lost = self._stream.lost_since_reset
        counters = (self._board.watchdog_ms, tally.usable, tally.unusable, tally.overruns, lost, tally.events)
        return bytes([Code.OK, int(self._stream.running)]) + b"".join(map(_u32, counters))

    def _speed(self, payload: bytes) -> bytes:
        reader = Reader(payload)
        bus = reader.number(1, 0, BUSES - 1)
        frequency_hz = reader.number(4)
        if frequency_hz not in _SPEEDS:
            reader.refuse(1)
        reader.end()
        self._not_busy()
        self._bus.frequency_hz = frequency_hz
        return bytes([Code.OK, bus]) + _u32(frequency_hz)

    def _not_busy(self) -> None:
        if self._stream.running:
            raise Refusal(Code.BUSY, 0)


def _u32(number: int) -> bytes:
    return number.to_bytes(4, "little")
