"""A Nucleo-64 with the firmware `hil-obc`, as its serial line shows it.

Everything is from the page about the OBC link (docs/reference/obc-link.md), protocol 1.0. Also assumed: transfers
of one turn, or one request, happen at the instant at which the bus is theirs, and take the time of their bits; a
request takes `command_ns` before anything of it happens. Not modelled: bus errors and timeouts (status 3 and 4,
events 2 and 3, code HARDWARE), and a frame that a reset cuts short.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from hil.analysis.noise.numbers import RandomStream
from hil.clock.port import NANOSECONDS
from hil.simulation.faults import Fault, Faults
from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.peers.obc_link.bus import BoardBus, NoAcknowledge
from hil.simulation.peers.obc_link.commands import CHANNELS, MINOR, READING, REQUEST_USER, BoardTruth, Commands, Tally
from hil.simulation.peers.obc_link.fields import Code, Refusal
from hil.simulation.peers.obc_link.stream import STREAM_USER, Stream
from hil.simulation.peers.obc_link.uart import VERSION, Frame, FrameReader, LoseFrames, Stall, Uart, seal
from hil.simulation.peers.timing import Alarm, Alarms, BoardClock
from hil.simulation.plants.terminal import SignalPoint
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import BusPeer, Line, PeerClock

__all__ = ["MODEL", "ObcBoard", "Reset", "build"]

_REPLY, _BOOT, _EVENT = 0x80, 0x41, 0x42
_REQUESTS = range(0x01, 0x40)
_HELD = 3
_EXPIRED, _OVERRUN = 1, 4
_POWER_ON, _WATCHDOG_RESET = 1, 4
_NS_PER_MS = 1_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Reset(Fault):
    """The board's watchdog resets it."""

    name = "reset"


class ObcBoard(Stateful):
    """The board: takes one request at a time, remembers the last, and streams by itself.

    It has had power since before the epoch. The fault `reset` resets it, as its independent watchdog would.

    Args:
        truth: what it is.
        inputs: signals [V] by channel of its analogue inputs.
        noise: of those.
        faults: what goes wrong.
        baud: of its line, 0 for one without a speed.
    """

    _board_clock: Kept[BoardClock]
    _reader: Kept[FrameReader]
    _bus: Kept[BoardBus]
    _uart: Kept[Uart]
    _stream: Kept[Stream]
    _commands: Kept[Commands]
    tally: Kept[Tally]
    watchdog_ms: Kept[int]
    _requests: Kept[list[tuple[Frame, int]]]
    _last: Kept[tuple[Frame, bytes] | None]
    _work: Kept[Alarm]
    _dog: Kept[Alarm]
    _booting: Kept[Alarm]
    _resets: Kept[Alarms]

    def __init__(
        self,
        truth: BoardTruth,
        inputs: Mapping[int, SignalPoint],
        noise: RandomStream,
        faults: Faults,
        *,
        baud: int,
    ) -> None:
        self._truth = truth
        clock = BoardClock(truth.clock_drift, round(truth.clock_offset * _MICROSECONDS))
        self._board_clock = clock
        self._faults = faults
        self._command_ns, self._boot_ns = (round(s * NANOSECONDS) for s in (truth.command_time, truth.boot_time))
        self._reader = FrameReader()
        self._bus = BoardBus(faults)
        self._uart = Uart(round(10e9 / baud) if baud else 0, truth.ring, faults, self._settle)
        self._stream = Stream(self._bus, self._uart, clock, self._settle)
        self._commands = Commands(truth, inputs, noise, (clock, self._bus, self._stream, self._uart), self)
        self.tally = Tally(boots=truth.boots, reason=_POWER_ON)
        self.watchdog_ms = 0
        self._requests = []
        self._last = None
        self._clock: PeerClock

    def serve(self, peers: Sequence[BusPeer]) -> None:
        """Put devices on the board's bus."""
        self._bus.serve(peers)
        self._stream.serve(tuple(peers))

    def attach(self, line: Line, clock: PeerClock) -> None:
        """Connect the line."""
        self._clock = clock
        self._work, self._dog = Alarm(clock, self._execute), Alarm(clock, self._expire)
        self._booting = Alarm(clock, self._boot)
        self._uart.attach(line, clock)
        self._bus.attach(clock, {REQUEST_USER: self._commands, STREAM_USER: self._stream})
        self._stream.attach(clock)
        self._commands.attach(clock)
        self._resets = Alarms(clock, [(fault.start_ns, self._reset) for fault in self._faults.of(Reset)])

    def receive(self, data: bytes) -> None:
        """Take bytes of the line; while it boots the board hears nothing."""
        if self._booting.due_ns is not None:
            return
        for later, frame in self._reader.take(data):
            if frame is None or frame.kind not in _REQUESTS or not frame.sequence:
                self.tally.unusable += 1
            else:
                self._take(frame, self._clock.now_ns() - later * self._uart.ns_per_byte)

    def watch(self, watchdog_ms: int) -> None:
        """Set the watchdog's time and start it; 0 is off."""
        self.watchdog_ms = watchdog_ms
        if watchdog_ms:
            self._dog.set(self._clock.now_ns() + watchdog_ms * _NS_PER_MS)
        else:
            self._dog.clear()

    def safe(self) -> int:
        """Go into the safe state; return how many streams were stopped."""
        self.watch(0)
        stopped = self._stream.halt()
        self._uart.discard()
        return int(stopped)

    def answer(self, payload: bytes) -> None:
        """Remember the reply of the request that is being executed, and send it."""
        self._last = (self._requests[0][0], payload)
        self._send(payload)

    def _take(self, frame: Frame, received_ns: int) -> None:
        self.tally.usable += 1
        self.watch(self.watchdog_ms)
        if len(self._requests) == _HELD:
            self.tally.overruns += 1
            self._tell(_OVERRUN, self.tally.overruns)
            return
        self._requests.append((frame, self._board_clock.at(received_ns)))
        if len(self._requests) == 1:
            self._begin()

    def _begin(self) -> None:
        self._work.set(self._clock.now_ns() + self._command_ns)

    def _execute(self) -> None:
        frame, received_us = self._requests[0]
        last = self._last[0] if self._last else None
        repeated = last is not None and last.sequence == frame.sequence
        if frame == last:
            # The host may not have seen the end of the reply before, or of noise.
            self._uart.send(b"\0")
        if frame.version != VERSION:
            self._send(Refusal(Code.VERSION, VERSION).payload)
        elif not self._commands.knows(frame.kind):
            self._refuse(Refusal(Code.UNKNOWN_TYPE, frame.kind), remembered=not repeated)
        elif not repeated or frame.kind in READING:
            self._run(frame, received_us)
        elif self._last is not None and frame == last:
            self._send(self._last[1])
        else:
            self._refuse(Refusal(Code.SEQUENCE, frame.sequence), remembered=False)

    def _run(self, frame: Frame, received_us: int) -> None:
        try:
            payload = self._commands.execute(frame, received_us)
        except Refusal as refusal:
            self._refuse(refusal, remembered=True)
        else:
            if payload is not None:
                self.answer(payload)

    def _refuse(self, refusal: Refusal, *, remembered: bool) -> None:
        if remembered:
            self.answer(refusal.payload)
        else:
            self._send(refusal.payload)

    def _send(self, payload: bytes) -> None:
        frame, _ = self._requests.pop(0)
        self._uart.send(seal(frame.kind | _REPLY, frame.sequence, payload))
        if self._requests:
            self._begin()

    def _settle(self) -> None:
        self._commands.settle()

    def _tell(self, event: int, detail: int) -> None:
        self.tally.events += 1
        now_us = self._board_clock.at(self._clock.now_ns())
        payload = bytes([event]) + self.tally.events.to_bytes(4, "little") + now_us.to_bytes(8, "little")
        self._uart.send(seal(_EVENT, 0, payload + detail.to_bytes(4, "little")))

    def _expire(self) -> None:
        after_ms = self.watchdog_ms
        self.safe()
        self._tell(_EXPIRED, after_ms)
        self._commands.settle()

    def _reset(self) -> None:
        now_ns = self._clock.now_ns()
        self.watch(0)
        self._work.clear()
        self._requests.clear()
        self._last = None
        for part in (self._commands, self._stream, self._bus, self._uart):
            part.reset()
        self._reader.clear()
        self._board_clock.reset(now_ns)
        self.tally = Tally(boots=self.tally.boots + 1, reason=_WATCHDOG_RESET)
        self._booting.set(now_ns + self._boot_ns)

    def _boot(self) -> None:
        head = bytes([VERSION, MINOR]) + self.tally.boots.to_bytes(4, "little")
        payload = head + bytes([self.tally.reason, *self._truth.version])
        self._uart.send(b"\0" + seal(_BOOT, 0, payload))


_USUAL_BAUD = 921_600
_MICROSECONDS = 1_000_000


def build(setup: PeerSetup) -> ObcBoard:
    """Build the board; terminals `A0` to `A5` go to signals in V.

    Raises:
        TruthError: with everything that is wrong in its truth or terminals.
    """
    board = setup.truth.part(BoardTruth)
    points = {channel: setup.connections.signal(f"A{channel}") for channel in range(CHANNELS)}
    setup.finish()
    inputs = {channel: point for channel, point in points.items() if point is not None}
    baud = setup.instrument.baud or _USUAL_BAUD
    return ObcBoard(board, inputs, setup.stream("analog"), setup.faults, baud=baud)


MODEL = PeerModel(link="serial", fault_kinds=(LoseFrames, NoAcknowledge, Reset, Stall), build=build, serves_bus=True)
"""The model for the driver `obc-link`."""
