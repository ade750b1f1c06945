"""The page about the OBC link as data, and the simulated board to try it on."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hil.clock.virtual import VirtualClock
from hil.model.bench import InstrumentSpec
from hil.simulation.faults import read_faults
from hil.simulation.peers.faulty import FaultySerialPeer
from hil.simulation.peers.model import Connections, PeerSetup
from hil.simulation.peers.obc_link.board import MODEL
from hil.simulation.peers.obc_link.uart import FrameReader, seal
from hil.simulation.registry import fault_kinds
from hil.simulation.seeds import Seeds
from hil.simulation.truth import Truth
from hil.wire.peer import Nack

__all__ = ["GOLDEN", "BoardUnderTest", "Sensor", "golden"]

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "obc-link.md"
_ROW = re.compile(r"^\| (\d+) \| (host|device) \| ([^|]+) \| `([0-9A-F ]+)` \|", re.MULTILINE)

GOLDEN = {
    int(number): (sender, title.strip(), bytes.fromhex(data))
    for number, sender, title, data in _ROW.findall(PAGE.read_text(encoding="utf-8"))
}
"""Every golden frame of the page by its number: who sends it, what it is, its bytes."""


def golden(number: int) -> bytes:
    """Return the bytes of one golden frame."""
    return GOLDEN[number][2]


@dataclass
class Sensor:
    """A device with registers, a FIFO at 2E and 30, and an interrupt pin that tests pull."""

    address: int = 0x68
    registers: dict[int, bytes] = field(default_factory=lambda: {0x75: b"\x6f"})
    fifo: bytes = b""
    refused: set[int] = field(default_factory=set)
    written: list[bytes] = field(default_factory=list)
    reads: list[tuple[int, int]] = field(default_factory=list)
    pointer: int = 0

    @property
    def addresses(self):
        """The one address."""
        return (self.address,)

    def attach(self, clock):
        """Take the clock."""
        self.clock = clock

    def on_interrupt(self, callback):
        """Let `pull` be the callback."""
        self.pull = callback

    def write(self, address, data):
        """Point at a register, unless it is refused."""
        if data and data[0] in self.refused:
            raise Nack
        self.written.append(data)
        self.pointer = data[0] if data else self.pointer

    def read(self, address, count):
        """Give a register, or the FIFO's counter or data."""
        self.reads.append((self.clock.now_ns(), self.pointer))
        if self.pointer == 0x2E:
            return len(self.fifo).to_bytes(2, "big")
        if self.pointer == 0x30:
            taken, self.fifo = self.fifo[:count], self.fifo[count:]
            return taken
        return self.registers.get(self.pointer, b"").ljust(count, b"\0")[:count]


class Even:
    """Noise of chosen numbers."""

    def __init__(self, numbers):
        self.numbers = numbers

    def normal_block(self, number, size):
        """Return the numbers over and over."""
        return np.array((self.numbers * size)[:size], dtype=float)


class BoardUnderTest:
    """A board with a sensor, on a line without a speed unless `baud` says one."""

    def __init__(self, truth=None, faults=(), sensors=None, baud=0):
        self.clock = VirtualClock()
        self.sensor = Sensor()
        self.sensors = [self.sensor] if sensors is None else sensors
        wrong = read_faults(faults, ("faults",), fault_kinds(MODEL))
        setup = PeerSetup(
            instrument=InstrumentSpec(name="obc", driver="obc-link", baud=baud),
            truth=Truth(truth or {}, ("truth",)),
            connections=Connections({}, {}, set(), ("connects",)),
            faults=wrong,
            seeds=Seeds(1),
        )
        self.board = MODEL.build(setup)
        self.peer = FaultySerialPeer(self.board, wrong, Seeds(1).stream("obc", "faults"))
        for sensor in self.sensors:
            sensor.attach(self.clock)
        self.peer.serve(self.sensors)
        if not baud:
            self.board._uart.ns_per_byte = 0
        self.sent: list[tuple[int, bytes]] = []
        self.peer.attach(self, self.clock)

    def send(self, data, after_ns=0):
        """Take what the board sends, as its line."""
        self.sent.append((self.clock.now_ns() + after_ns, data))

    def fetch(self) -> bytes:
        """Return what was sent since the last time."""
        data = b"".join(data for _, data in self.sent)
        self.sent.clear()
        return data

    def until_us(self, shown_us: int) -> None:
        """Let time pass until the board's clock shows this."""
        self.clock.wait_until(self.board._board_clock.instant(shown_us))

    def raw(self, data: bytes, seconds: float = 0.5) -> bytes:
        """Give bytes, let time pass, and return what came."""
        self.peer.receive(data)
        self.clock.sleep(seconds)
        return self.fetch()

    def ask(self, kind: int, sequence: int, payload: bytes = b"", seconds: float = 0.5) -> bytes:
        """Give a request, and return the payload of its reply; nothing else may have come."""
        frames = self.frames(self.raw(seal(kind, sequence, payload), seconds))
        (frame,) = frames
        assert (frame.kind, frame.sequence) == (kind | 0x80, sequence)
        return frame.payload

    @staticmethod
    def frames(data: bytes):
        """Return the frames in bytes, all of which must be usable."""
        found = [frame for _, frame in FrameReader().take(data)]
        assert None not in found
        return found
