"""A gyroscope behind its driver: on the host's own bus, or on one that streams."""

from __future__ import annotations

import numpy as np
from board_bus import BoardBus

from hil.clock.virtual import VirtualClock
from hil.instruments.driver import Clamps, Connection
from hil.instruments.iim42652 import Iim42652
from hil.model.bench import InstrumentSpec, Wire
from hil.simulation.faults import BUS_FAULTS, SERIAL_FAULTS, read_faults
from hil.simulation.peers.faulty import FaultyBusPeer, FaultySerialPeer
from hil.simulation.peers.iim42652 import MODEL
from hil.simulation.peers.model import Connections, PeerSetup
from hil.simulation.plants.plant import Plant
from hil.simulation.seeds import Seeds
from hil.simulation.truth import Truth
from hil.wire.simulated_bus import SimulatedBus

__all__ = ["Bench"]

_SECOND = 1_000_000_000


class Table(Plant):
    """A supply that can be cut."""

    def __init__(self) -> None:
        super().__init__("table", _SECOND // 10, (0.0,), {"volts": 3.3}, frozenset({"supply"}))

    def step(self, state, inputs, dt):
        """Do nothing."""
        return state

    def signal(self, name, state, inputs, at):
        """Return the supply voltage."""
        return inputs["volts"]


class Bench:
    """A gyroscope, its bus, clock and supply."""

    def __init__(self, *, board=False, truth=None, faults=(), settings=None) -> None:
        self.clock = VirtualClock()
        self.supply = Table()
        self.clock.advance_first(self.supply.advance)
        self.seeds = Seeds(5)
        self.peer = self.build("gyro", MODEL, truth, faults)
        self.peer.attach(self.clock)
        self.bus = self.make_bus(board)
        self.driver = Iim42652(Connection(device="gyro", clock=self.clock, clamps=Clamps(), bus=self.bus, address=0x68))
        self.gyro = self.driver.role(Wire(role="gyroscope", instance="", instrument="gyro", settings=settings or {}))
        self.clock.sleep(0.01)

    def build(self, name, model, truth, faults):
        """Return a peer, with its faults around it."""
        bus = model.link == "bus"
        wrong = read_faults(faults, ("faults",), (*(BUS_FAULTS if bus else SERIAL_FAULTS), *model.fault_kinds))
        plugs = {"power": "table.supply"} if bus else {}
        setup = PeerSetup(
            instrument=InstrumentSpec(name=name, driver="any", address=0x68 if bus else 0),
            truth=Truth(truth or {}, ("truth",)),
            connections=Connections(plugs, {"table": self.supply}, set(), ("connects",)),
            faults=wrong,
            seeds=self.seeds,
        )
        faulty = FaultyBusPeer if bus else FaultySerialPeer
        return faulty(model.build(setup), wrong, self.seeds.stream(name, "faults"))

    def make_bus(self, board):
        """Return the bus of the sensor."""
        return BoardBus(self.clock, self.peer) if board else SimulatedBus(self.clock, 400_000, [self.peer])

    def streaming(self, rate=100.0):
        """Return the bench with its gyroscope streaming."""
        self.gyro.start()
        self.gyro.begin(rate)
        return self

    def rows(self, seconds, pause=1.0):
        """Drain for some time."""
        blocks = []
        for _ in range(round(seconds / pause)):
            self.clock.sleep(pause)
            blocks.append(self.gyro.drain())
        return np.concatenate(blocks)
