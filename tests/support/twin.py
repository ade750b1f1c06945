"""A small simulated bench for tests of the simulation: supply, relays, coil, magnetometer."""

from __future__ import annotations

from hil.clock.virtual import VirtualClock
from hil.model.bench import InstrumentSpec, PeerSpec, PlantSpec, SimulatedBench
from hil.simulation.plants.plant import Plant
from hil.simulation.world import build_world
from hil.wire.simulated_bus import SimulatedBus
from hil.wire.simulated_line import SimulatedLine

__all__ = ["COIL", "INSTRUMENTS", "MAGNETOMETER", "Charging", "Twin", "plant", "twin_spec"]

MAGNETOMETER = 0x1C

COIL = {
    "turns": "60",
    "sides": ["0.08", "0.08"],
    "distance": "0.01",
    "resistance": "40",
    "earth_field": ["22", "5", "-38"],
    "boards": {"x_plus": {"winding": "left"}, "y_plus": {}},
}

INSTRUMENTS = (
    InstrumentSpec(name="psu", driver="keysight-e36300"),
    InstrumentSpec(name="relays", driver="waveshare-relay", baud=9600, address=1),
    InstrumentSpec(name="mag", driver="lis3mdl", bus="i2c", address=MAGNETOMETER),
)

_CONNECTS = {
    "psu": {"1": "coil.sensor_power", "2": "coil.supply"},
    "relays": {"1": "coil.contact_a", "2": "coil.contact_b"},
    "mag": {"field": "coil.field", "power": "coil.sensor_power.voltage", "temperature": "coil.ambient"},
}


def plant(truth=None, *, grid_s=0.01):
    """Return the coil's plant; `truth` says what differs from `COIL`."""
    return PlantSpec(name="coil", model="coil-and-earth-field", grid_s=grid_s, truth={**COIL, **(truth or {})})


def twin_spec(*, coil=None, truths=None, faults=None, connects=None, person=None, seed=7, grid_s=0.01):
    """Return the twin's description; `truths`, `faults` and `connects` are by device."""
    peers = tuple(
        PeerSpec(
            device=name,
            model="",
            truth=(truths or {}).get(name, {}),
            connects=(connects or {}).get(name, _CONNECTS[name]),
            faults=tuple((faults or {}).get(name, ())),
        )
        for name in _CONNECTS
    )
    return SimulatedBench(
        epoch="2026-01-01T00:00:00Z",
        seed=seed,
        plants=(plant(coil, grid_s=grid_s),),
        peers=peers,
        person=person or {"outer_board": "coil.board", "compass": "coil.outward", "coil_current": "coil.current"},
    )


class Twin:
    """A built world with its lines, and short ways to talk to it."""

    def __init__(self, **choices) -> None:
        self.clock = VirtualClock()
        self.world = build_world(twin_spec(**choices), INSTRUMENTS, self.clock)
        self.lines = {
            name: SimulatedLine(name, peer, self.clock, number=self.world.devices[name])
            for name, peer in self.world.serial_peers.items()
        }
        for name, line in self.lines.items():
            self.world.serial_peers[name].attach(line, self.world.clock_of(name))
            line.opened()
        self.bus = SimulatedBus(self.clock, 400_000, self.world.bus_peers["i2c"])
        self.coil = self.world.plants["coil"]

    def exchange(self, device: str, data: bytes, seconds: float = 0.1) -> bytes:
        """Write bytes, let time pass, and return everything that came."""
        line = self.lines[device]
        line.write(data)
        self.clock.sleep(seconds)
        return line.read(line.waiting(), 0)

    def scpi(self, text: str) -> str:
        """Send one line to the supply and return its answer."""
        return self.exchange("psu", f"{text}\n".encode("latin-1")).decode("ascii").rstrip("\n")

    def modbus(self, frame: str) -> str:
        """Send one frame, in hexadecimal, to the relay board and return its answer, in hexadecimal."""
        return self.exchange("relays", bytes.fromhex(frame)).hex(" ").upper()

    def power_sensor(self) -> None:
        """Give the magnetometer 3.3 V and let it boot."""
        self.scpi("VOLT 3.3,(@1);CURR 0.1,(@1);:OUTP ON,(@1)")

    def wake_sensor(self, ctrl1=0xFC, ctrl2=0x00, ctrl4=0x0C, ctrl5=0x00) -> None:
        """Power the magnetometer and start continuous conversions; 80 Hz, best performance, 4 gauss."""
        self.power_sensor()
        for register, value in ((0x20, ctrl1), (0x21, ctrl2), (0x23, ctrl4), (0x24, ctrl5), (0x22, 0x00)):
            self.write(register, value)

    def write(self, register: int, value: int) -> None:
        """Write one register of the magnetometer."""
        self.bus.write_byte_data(MAGNETOMETER, register, value)

    def register(self, register: int) -> int:
        """Read one register of the magnetometer."""
        return self.bus.read_byte_data(MAGNETOMETER, register)

    def burst(self, register: int, count: int) -> bytes:
        """Read registers in one go; bit 7 of the address is the caller's choice."""
        return bytes(self.bus.read_i2c_block_data(MAGNETOMETER, register, count))

    def field(self) -> tuple[int, ...]:
        """Return the three axes in LSB."""
        data = self.burst(0xA8, 6)
        return tuple(int.from_bytes(data[place : place + 2], "little", signed=True) for place in (0, 2, 4))


class Charging(Plant):
    """A capacitor behind a resistor, with 1 s: the simplest plant there is. Signal `level`, input `drive`."""

    def __init__(self, grid_ns: int = 100_000_000) -> None:
        super().__init__("charging", grid_ns, (0.0,), {"drive": 0.0}, frozenset({"level"}))

    def step(self, state, inputs, dt):
        """Step by one Heun step, so that the way the steps are cut can be seen in the result."""
        slope = inputs["drive"] - state[0]
        ahead = inputs["drive"] - (state[0] + dt * slope)
        return (state[0] + dt * (slope + ahead) / 2,)

    def signal(self, name, state, inputs, at):
        """Return the level."""
        del name, inputs, at
        return state[0]
