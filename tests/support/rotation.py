"""A rotation table for tests: plant, controller, driver and wire, and a peer's line without a driver."""

from __future__ import annotations

from contextlib import contextmanager

from facing import facing

from hil.clock.virtual import VirtualClock
from hil.instruments.newport_esp301 import NewportEsp301
from hil.model.bench import Clamp, InstrumentSpec, Wire
from hil.simulation.faults import read_faults
from hil.simulation.peers.esp301.controller import MODEL
from hil.simulation.peers.faulty import FaultySerialPeer
from hil.simulation.peers.model import Connections, PeerSetup
from hil.simulation.plants.rotation_table import build
from hil.simulation.registry import fault_kinds
from hil.simulation.seeds import Seeds
from hil.simulation.truth import Truth
from hil.wire.simulated_line import SimulatedLine

__all__ = ["CONNECTS", "WIRE", "Controller", "plant", "table"]

CONNECTS = {
    "rate": "table.rate_command",
    "acceleration": "table.acceleration",
    "grip": "table.grip",
    "angle": "table.angle",
}
WIRE = Wire(
    role="rotation_table",
    instance="",
    instrument="device",
    channel=1,
    settings={"acceleration": "20 deg/s2", "tolerance": "0.1 deg/s"},
)
CLAMPS = (
    Clamp(output="rotation_table", quantity="rate", unit="deg/s", minimum=-60, maximum=60),
    Clamp(output="rotation_table", quantity="turns", unit="turn", minimum=-5, maximum=5),
)
BAUD = 921_600


def plant(grid_s=0.1, **truth):
    """Return the plant `table`."""
    return build("table", round(grid_s * 1e9), Truth(truth, ("truth",)))


@contextmanager
def table(*, faults=(), truth=None, clamps=CLAMPS, wire=WIRE, **plant_truth):
    """Yield the role, the plant, the clock and the driver of a table on the simulated bench."""
    physics = plant(**plant_truth)
    with facing(
        MODEL,
        driver=NewportEsp301,
        truth=truth,
        faults=faults,
        clamps={1: clamps},
        connects=CONNECTS,
        plants={"table": physics},
        baud=BAUD,
    ) as (driver, clock):
        yield driver.role(wire), physics, clock, driver


class Controller:
    """The simulated controller on its line, for bytes of one's own."""

    def __init__(self, *, faults=(), truth=None, connects=CONNECTS, **plant_truth) -> None:
        self.clock = VirtualClock()
        self.table = plant(**plant_truth)
        self.table.follow(self.clock.now_ns)
        wrong = read_faults(faults, ("faults",), fault_kinds(MODEL))
        setup = PeerSetup(
            instrument=InstrumentSpec(name="device", driver="newport-esp301"),
            truth=Truth(truth or {}, ("truth",)),
            connections=Connections(connects, {"table": self.table}, set(), ("connects",)),
            faults=wrong,
        )
        self.peer = FaultySerialPeer(MODEL.build(setup), wrong, Seeds(1).stream("device", "faults"))
        self.line = SimulatedLine("device", self.peer, self.clock, baud=BAUD)
        self.peer.attach(self.line, self.clock)
        self.line.opened()

    def exchange(self, data: bytes, seconds: float = 0.1) -> bytes:
        """Write bytes, let time pass, and return everything that came."""
        self.line.write(data)
        self.clock.sleep(seconds)
        return self.line.read(self.line.waiting(), 0)

    def ask(self, text: str) -> list[str]:
        """Send one line and return the lines that came."""
        return self.exchange(f"{text}\r".encode("latin-1")).decode("ascii").splitlines()
