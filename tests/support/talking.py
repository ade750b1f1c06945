"""A dialogue with one peer in bytes: no driver, no port, only a clock and a line."""

from __future__ import annotations

from hil.clock.virtual import VirtualClock
from hil.model.bench import InstrumentSpec
from hil.simulation.faults import read_faults
from hil.simulation.peers.faulty import FaultySerialPeer
from hil.simulation.peers.model import Connections, PeerSetup
from hil.simulation.registry import fault_kinds
from hil.simulation.seeds import Seeds
from hil.simulation.truth import Truth
from hil.wire.simulated_line import SimulatedLine

__all__ = ["Talk"]


class Talk:
    """One peer on its line.

    Args:
        model: the `PeerModel`.
        truth: the peer's truth section.
        faults: rows of the peer's faults.
        baud: speed of the line; 0 is a network.
    """

    def __init__(self, model, *, truth=None, faults=(), baud=0):
        self.clock = VirtualClock()
        wrong = read_faults(faults, ("faults",), fault_kinds(model))
        seeds = Seeds(1)
        self.peer = model.build(
            PeerSetup(
                instrument=InstrumentSpec(name="device", driver="any"),
                truth=Truth(truth or {}, ("truth",)),
                connections=Connections({}, {}, set(), ("connects",)),
                faults=wrong,
                seeds=seeds,
            )
        )
        faulty = FaultySerialPeer(self.peer, wrong, seeds.stream("device", "faults"))
        self._line = SimulatedLine("device", faulty, self.clock, baud=baud)
        faulty.attach(self._line, self.clock)
        self._line.opened()

    def bytes(self, data: bytes, seconds: float = 0.1) -> bytes:
        """Write bytes, let time pass, and return what came."""
        if data:
            self._line.write(data)
        return self._line.read(4096, seconds)

    def line(self, text: str) -> str:
        """Send one line and return the answer without its end."""
        return self.bytes(text.encode() + b"\n").decode().removesuffix("\n")
