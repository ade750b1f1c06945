"""The stream of the simulated board: a program of transfers at every trigger, each trigger with its number."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import cast

from hil.clock.port import NANOSECONDS
from hil.simulation.peers.obc_link.bus import OK, BoardBus
from hil.simulation.peers.obc_link.fields import FifoTransfer, Program, RegisterTransfer, program_of
from hil.simulation.peers.obc_link.uart import Uart, seal
from hil.simulation.peers.timing import Alarm, BoardClock
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import BusPeer, PeerClock

__all__ = ["STREAM_DATA", "STREAM_USER", "Stream"]

STREAM_DATA = 0x40
STREAM_USER = "stream"
"""The stream's name in the line-up for the bus."""

_LATENCY_NS = 2000
_LONGEST_NS = NANOSECONDS
_HEAD, _ITEM = 32, 3
"""Bytes of a frame beside its items, at the most, and of an item beside its data."""


@dataclass(frozen=True, slots=True)
class _Trigger:
    """One trigger: when it was by the board's clock, and its number unless the turn has to earn one."""

    at_us: int
    number: int | None


class Stream(Stateful):
    """Stream 0 of bus 0. The interrupt pins of all devices on the bus are joined at line 0; nothing is at line 1.

    Args:
        bus: where the transfers run.
        uart: with the ring that takes the frames.
        clock: the board's.
        ended: called when a stream that was stopped has finished its turns.
    """

    lost_since_reset: Kept[int]
    _request: Kept[bytes]
    _counting: Kept[bool]
    _start_us: Kept[int]
    _ticks: Kept[int]
    numbers: Kept[int]
    lost: Kept[int]
    _turn: Kept[_Trigger | None]
    _next: Kept[_Trigger | None]
    _result: Kept[bytes | None]
    _timer: Kept[Alarm]
    _gathering: Kept[Alarm]
    _turning: Kept[Alarm]

    def __init__(self, bus: BoardBus, uart: Uart, clock: BoardClock, ended: Callable[[], None]) -> None:
        self._bus = bus
        self._uart = uart
        self._board = clock
        self._ended = ended
        self.lost_since_reset = 0
        self._request = b""
        self._program: Program | None = None
        self._counting = False
        self._start_us = 0
        self._ticks = 0
        self.numbers = 0
        self.lost = 0
        self._turn = None
        self._next = None
        self._result = None
        self._clock: PeerClock

    def serve(self, peers: tuple[BusPeer, ...]) -> None:
        """Listen to the interrupt pins of the devices that have one."""
        for peer in peers:
            listen = getattr(peer, "on_interrupt", None)
            if listen is not None:
                listen(partial(self.edge, 0))

    def attach(self, clock: PeerClock) -> None:
        """Connect the bench's clock."""
        self._clock = clock
        self._timer = Alarm(clock, self._tick)
        self._gathering = Alarm(clock, self._gather)
        self._turning = Alarm(clock, partial(self._bus.ask, STREAM_USER))

    @property
    def running(self) -> bool:
        """Whether triggers count."""
        return self._counting

    @property
    def busy(self) -> bool:
        """Whether a turn runs or a trigger waits."""
        return self._turn is not None

    def start(self, program: Program, request: bytes) -> int:
        """Let triggers count from now on; return the board's time."""
        self._program, self._request = program, request
        self._start_us = self._board.at(self._clock.now_ns())
        self._ticks, self.numbers, self.lost = 0, 0, 0
        self._counting = True
        self._arm_timer()
        return self._start_us

    def stop(self) -> None:
        """Let no further trigger count; the pending turns are finished."""
        self._counting = False
        self._timer.clear()
        self._gathering.clear()

    def halt(self) -> bool:
        """Stop, give up the turn that runs and the trigger that waits; return whether triggers counted."""
        was = self._counting
        self.stop()
        self._turning.clear()
        self._bus.withdraw(STREAM_USER)
        self._turn = self._next = self._result = None
        return was

    def reset(self) -> None:
        """Be as after a reset."""
        self.halt()
        self.lost_since_reset = 0

    def edge(self, line: int) -> None:
        """Take a rising edge of an interrupt line; it comes in the middle of what the device does."""
        if self._counting and self._program is not None and self._program.line == line:
            self._trigger(self._board.at(self._clock.now_ns()))

    def on_bus(self) -> None:
        """Run the program once."""
        self._result = self._run()

    def off_bus(self) -> None:
        """Put the turn's frame into the ring, and begin the turn of a trigger that waits."""
        turn, result = self._turn, self._result
        self._turn, self._next, self._result = self._next, None, None
        if turn is not None and result is not None:
            self._emit(turn, result)
        if self._turn is not None:
            self._turning.set(self._clock.now_ns())
        else:
            self._ended()

    def restored(self) -> None:
        """Read the program again."""
        # It was allowed when it came, at a speed of the bus that may have changed since.
        self._program = program_of(self._request, float("inf"), lambda: None) if self._request else None

    def _arm_timer(self) -> None:
        if self._program is not None and self._program.period_us:
            self._timer.set(self._board.instant(self._start_us + (self._ticks + 1) * self._program.period_us))

    def _tick(self) -> None:
        through_ns = self._unseen_ns()
        if through_ns is not None:
            self._gathering.set(through_ns)
            return
        self._ticks += 1
        self._arm_timer()
        self._trigger(self._board.at(self._clock.now_ns()))

    def _unseen_ns(self) -> int | None:
        """Return when the last turn is through of those that nobody sees begin or end, None where there is none.

        They are made together then, each for its instant.
        """
        program = cast("Program", self._program)
        if self._turn is not None or not self._uart.idle:
            return None
        if not all(
            isinstance(each, RegisterTransfer) and self._bus.remembers(each.address, each.register, each.length)
            for each in program.transfers
        ):
            return None
        turn_ns = self._turn_ns(program)
        sent_ns = turn_ns + (_HEAD + sum(_ITEM + each.length for each in program.transfers)) * self._uart.ns_per_byte
        if 2 * sent_ns > program.period_us * 1000:
            return None
        now_ns = self._clock.now_ns()
        ends_ns = self._instants(program, min(self._clock.calm_until_ns(), now_ns + _LONGEST_NS) - turn_ns)
        return ends_ns[-1] + turn_ns if ends_ns else None

    def _gather(self) -> None:
        """Make the turns that nobody saw; the last frame of them leaves now."""
        program = cast("Program", self._program)
        now_ns, turn_ns = self._clock.now_ns(), self._turn_ns(program)
        at_ns = self._instants(program, now_ns - turn_ns)
        read_ns = [each + _LATENCY_NS for each in at_ns]
        transfers = cast("tuple[RegisterTransfer, ...]", program.transfers)
        replies = [self._bus.remembered(each.address, each.register, each.length, read_ns) for each in transfers]
        for tick_ns, parts in zip(at_ns, zip(*replies, strict=True), strict=True):
            self._ticks += 1
            items = b"".join([bytes([OK]) + len(data).to_bytes(2, "little") + data for data in parts])
            frame = self._frame(self._board.at(tick_ns), self._number(), bytes([len(parts)]) + items)
            if tick_ns == at_ns[-1]:
                self._uart.stream(frame)
            else:
                self._uart.streamed(frame, tick_ns + turn_ns)
        self._arm_timer()

    def _turn_ns(self, program: Program) -> int:
        """Return what a turn takes whose transfers are all acknowledged."""
        bits = 9 * sum(each.size for each in program.transfers)
        return _LATENCY_NS + bits * NANOSECONDS // self._bus.frequency_hz

    def _instants(self, program: Program, until_ns: int) -> list[int]:
        """Return when the timer's next ticks are."""
        shown_us = self._start_us + self._ticks * program.period_us
        return self._board.instants(shown_us, program.period_us, until_ns, _LONGEST_NS // (program.period_us * 1000))

    def _trigger(self, at_us: int) -> None:
        program = self._program
        polled = program is not None and program.watermark > 0
        if self._turn is not None and self._next is not None:
            if not polled:
                self._number()
                self._lose()
            return
        trigger = _Trigger(at_us, None if polled else self._number())
        if self._turn is not None:
            self._next = trigger
        else:
            self._turn = trigger
            self._turning.set(self._clock.now_ns() + _LATENCY_NS)

    def _number(self) -> int:
        self.numbers += 1
        return self.numbers - 1

    def _lose(self) -> None:
        self.lost += 1
        self.lost_since_reset += 1

    def _run(self) -> bytes | None:
        """Return the transfers of a frame, or None if the watermark is not reached."""
        program = cast("Program", self._program)
        first, parts = program.watermark > 0, [bytes([len(program.transfers)])]
        for transfer in program.transfers:
            if isinstance(transfer, RegisterTransfer):
                status, data = self._bus.registers(transfer.address, transfer.register, transfer.length)
            else:
                status, data = self._bus.registers(transfer.address, transfer.counter, 2)
                at_hand = int.from_bytes(data, "big") * transfer.unit
                if first and status == OK and at_hand < program.watermark:
                    return None
                first = False
                status, data = self._records(transfer, at_hand) if status == OK else (status, b"")
            parts.append(bytes([status]) + len(data).to_bytes(2, "little") + data)
        return b"".join(parts)

    def _records(self, transfer: FifoTransfer, at_hand: int) -> tuple[int, bytes]:
        length = min(at_hand, transfer.length) // transfer.record * transfer.record
        return self._bus.registers(transfer.address, transfer.register, length) if length else (OK, b"")

    def _emit(self, turn: _Trigger, result: bytes) -> None:
        number = self._number() if turn.number is None else turn.number
        if not self._uart.stream(self._frame(turn.at_us, number, result)):
            self._lose()

    def _frame(self, at_us: int, number: int, result: bytes) -> bytes:
        program = cast("Program", self._program)
        head = bytes([program.number, 0]) + number.to_bytes(4, "little") + self.lost.to_bytes(4, "little")
        return seal(STREAM_DATA, 0, head + at_us.to_bytes(8, "little") + result)
