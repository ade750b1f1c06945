"""A simulated temperature controller with its line in the test's own hands."""

from __future__ import annotations

from types import SimpleNamespace

from chamber_bench import SECOND_NS, chamber

from hil.clock.virtual import VirtualClock
from hil.model.bench import InstrumentSpec
from hil.simulation.faults import read_faults
from hil.simulation.peers.eurotherm.controller import MODEL
from hil.simulation.peers.modbus_rtu import seal
from hil.simulation.peers.model import Connections, PeerSetup
from hil.simulation.registry import fault_kinds
from hil.simulation.seeds import Seeds
from hil.simulation.truth import Truth

__all__ = ["ControllerLine"]

_CONNECTS = {"sensor": "chamber.plate", "drive": "chamber.tec", "ambient": "chamber.ambient"}


class ControllerLine:
    """The controller on a chamber; keywords are its truth.

    Args:
        faults: rows of its faults.
        connects: its terminals.
    """

    def __init__(self, *, faults=(), connects=None, **truth) -> None:
        self.clock = VirtualClock()
        self.chamber = chamber()
        self.chamber.follow(self.clock.now_ns)
        connects = _CONNECTS if connects is None else connects
        self.peer = MODEL.build(
            PeerSetup(
                instrument=InstrumentSpec(name="tec", driver="eurotherm-3216", address=1),
                truth=Truth(truth, ("truth",)),
                connections=Connections(connects, {"chamber": self.chamber}, set(), ("connects",)),
                faults=read_faults(faults, ("faults",), fault_kinds(MODEL)),
                seeds=Seeds(1),
            )
        )
        self._answers = b""
        self.peer.attach(SimpleNamespace(send=self._take), self.clock)
        self.clock.sleep(0)

    def _take(self, data: bytes, after_ns: int = 0) -> None:
        del after_ns
        self._answers += data

    def frame(self, text: str) -> str:
        """Send a whole frame in hexadecimal, and return the answer, in hexadecimal."""
        self._answers = b""
        self.peer.receive(bytes.fromhex(text))
        self.clock.sleep(0.02)
        return self._answers.hex(" ").upper()

    def body(self, text: str) -> str:
        """Send a body with its checksum, and return the answer's body."""
        answer = bytes.fromhex(self.frame(seal(bytes.fromhex(text)).hex()))
        assert not answer or seal(answer[:-2]) == answer
        return answer[:-2].hex(" ").upper()

    def read(self, address: int) -> int:
        """Return one register as a signed number."""
        answer = bytes.fromhex(self.body(f"01 03 {address:04X} 0001"))
        assert answer[:3] == b"\x01\x03\x02", answer.hex(" ")
        return int.from_bytes(answer[3:], "big", signed=True)

    def write(self, address: int, value: int) -> str:
        """Write one register, and return the answer's body."""
        return self.body(f"01 06 {address:04X} {value & 0xFFFF:04X}")

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        self.clock.wait_until(self.clock.now_ns() + round(seconds * SECOND_NS))
