"""A sensor behind its driver on the bus of an on-board computer: sensor, board and line are simulated."""

from __future__ import annotations

from sensor_bench import IIM42652, Bench

from hil.instruments.driver import Clamps, Connection
from hil.instruments.obc_link.driver import ObcLink
from hil.simulation.peers.obc_link.board import MODEL
from hil.wire.exchange import publish_stream, withdraw
from hil.wire.opening import open_port
from hil.wire.simulated_line import SimulatedLine
from hil.wire.transcript import Transcript

__all__ = ["BehindObc"]

BAUD = 921_600
WORLD = "sim://behind-obc/"


class BehindObc(Bench):
    """A sensor on the bus of an OBC."""

    def __init__(self, chip=IIM42652, *, obc=None, obc_faults=(), **sensor) -> None:
        self.obc, self.obc_faults = obc, obc_faults
        super().__init__(chip, **sensor)

    def make_bus(self, board):
        """Put the sensor behind a board."""
        model = self.build("obc", MODEL, self.obc, self.obc_faults)
        model.serve([self.peer])
        withdraw(WORLD)
        line = SimulatedLine("obc", model, self.clock, baud=BAUD)
        model.attach(line, self.clock)
        publish_stream(f"{WORLD}obc", line)
        port = open_port("obc", f"{WORLD}obc", self.clock, Transcript(None), baud=BAUD)
        self.clock.sleep(0.1)
        return ObcLink(Connection(device="obc", clock=self.clock, clamps=Clamps(), port=port)).bus(400_000)
