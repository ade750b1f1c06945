"""A small simulated bench for tests of the thermal side: chamber, temperature controller, relay board with the lamp."""

from __future__ import annotations

from hil.clock.virtual import VirtualClock
from hil.instruments.driver import Clamps, Connection
from hil.instruments.eurotherm_3216 import Eurotherm3216
from hil.instruments.waveshare_relay import WaveshareRelay
from hil.model.bench import Clamp, InstrumentSpec, PeerSpec, PlantSpec, SimulatedBench, Wire
from hil.simulation.plants.thermal_chamber import ChamberTruth, ThermalChamber
from hil.simulation.world import build_world
from hil.wire.simulated_line import SimulatedLine

__all__ = ["CLAMPS", "SECOND_NS", "THERMAL", "ChamberBench", "LinePort", "chamber"]

SECOND_NS = 1_000_000_000
THERMAL = Wire(role="thermal", instance="", instrument="tec")
CLAMPS = {0: (Clamp(output="thermal", quantity="temperature", unit="degC", minimum=-20, maximum=45),)}
_RELAYS = Wire(role="relays", instance="", instrument="relays", contacts={"lamp": 3})
_INSTRUMENTS = (
    InstrumentSpec(name="tec", driver="eurotherm-3216", baud=9600, address=1),
    InstrumentSpec(name="relays", driver="waveshare-relay", baud=9600, address=1),
)
_CONNECTS = {
    "tec": {"sensor": "chamber.plate", "drive": "chamber.tec", "ambient": "chamber.ambient"},
    "relays": {"3": "chamber.lamp"},
}


def chamber(grid_ns=SECOND_NS, **truth):
    """Return a plant with what differs from the usual truth."""
    return ThermalChamber("chamber", grid_ns, ChamberTruth(**truth))


class LinePort:
    """The host's end of a simulated line, as far as a Modbus session uses a port."""

    def __init__(self, line: SimulatedLine) -> None:
        self._line = line
        self.timeout = 0.5
        line.opened()

    @property
    def in_waiting(self) -> int:
        """How much is here."""
        return self._line.waiting()

    def exchange(self, data: bytes) -> bytes:
        """Write bytes, and wait for what comes."""
        return self._line.exchange(data, self.timeout)

    def read(self, size: int = 1) -> bytes:
        """Wait for bytes until the timeout."""
        return self._line.read(size, self.timeout)

    def write(self, data: bytes) -> int:
        """Write bytes."""
        self._line.write(data)
        return len(data)

    def reset_input_buffer(self) -> None:
        """Throw away what is here."""
        self._line.discard()


class ChamberBench:
    """A built world with both drivers on it; `truths` and `faults` are by device."""

    def __init__(self, *, plant=None, truths=None, faults=None, seed=7, grid_s=1.0) -> None:
        self.clock = VirtualClock()
        peers = tuple(
            PeerSpec(
                device=name,
                model="",
                truth=(truths or {}).get(name, {}),
                connects=connects,
                faults=tuple((faults or {}).get(name, ())),
            )
            for name, connects in _CONNECTS.items()
        )
        plants = (PlantSpec(name="chamber", model="thermal-chamber", grid_s=grid_s, truth=plant or {}),)
        spec = SimulatedBench(epoch="2026-01-01T00:00:00Z", seed=seed, plants=plants, peers=peers)
        self.world = build_world(spec, _INSTRUMENTS, self.clock)
        self.plant = self.world.plants["chamber"]
        ports = {name: self._port(name) for name in _CONNECTS}
        self.controller, self.board = (
            driver(Connection(device=name, clock=self.clock, clamps=Clamps(CLAMPS), port=ports[name], address=1))
            for name, driver in (("tec", Eurotherm3216), ("relays", WaveshareRelay))
        )
        self.thermal = self.controller.role(THERMAL)
        self.relays = self.board.role(_RELAYS)

    def _port(self, name):
        peer = self.world.serial_peers[name]
        number = self.world.devices[name]
        line = SimulatedLine(name, peer, self.clock, number=number, baud=9600)
        peer.attach(line, self.world.clock_of(name))
        return LinePort(line)

    def plant_temperatures(self):
        """Return what really is, by node."""
        return {name: self.plant.observe(name) for name in ("plate", "board", "die", "box", "sink")}
