"""A battery on its tester with supply and temperature controller, behind tapped ports on one virtual clock."""

from __future__ import annotations

from cycler_page import sealed

from hil.clock.virtual import VirtualClock
from hil.model.bench import InstrumentSpec, PeerSpec, PlantSpec, SimulatedBench
from hil.simulation.world import build_world
from hil.wire.exchange import publish_stream, withdraw
from hil.wire.opening import open_port
from hil.wire.simulated_line import SimulatedLine
from hil.wire.transcript import Transcript

__all__ = ["LINE_S", "BatteryTester"]

LINE_S = 5
_URL = "sim://battery-tester/"
_CELL = {"charge": "0.3", "place": "assembly"}
_SIGNALS = ("voltage", "current", "temperature")
_CYCLER = {name: f"cell.{name}" for name in _SIGNALS} | {
    f"{way}": f"cell.{way}_contact" for way in ("charge", "discharge")
}
_PEERS = (
    ("cycler", "cycler", 9600, 0, {"reset_on_open": False}, _CYCLER),
    ("psu", "rigol-dp832", 0, 0, {}, {"1": "cell.supply"}),
    ("tec", "eurotherm-3216", 19_200, 1, {}, {"sensor": "cell.plate", "drive": "cell.tec", "ambient": "cell.ambient"}),
)


class BatteryTester:
    """The bench; the battery is cycled at 0.7 A from `start` on.

    Args:
        sink: where the transcript goes, None for nowhere.
        regulated: whether there is a controller with its coolers.
    """

    def __init__(self, sink=None, *, regulated=False):
        self.clock = VirtualClock()
        self.transcript = Transcript(sink)
        peers = _PEERS if regulated else _PEERS[:2]
        spec = SimulatedBench(
            epoch="2026-01-01T00:00:00Z",
            seed=11,
            plants=(PlantSpec(name="cell", model="battery", grid_s=5.0, truth=_CELL),),
            peers=tuple(
                PeerSpec(device=name, model="", truth=truth, connects=connects) for name, *_, truth, connects in peers
            ),
            person={},
        )
        instruments = tuple(
            InstrumentSpec(name=name, driver=driver, baud=baud, address=address)
            for name, driver, baud, address, *_ in peers
        )
        self.world = build_world(spec, instruments, self.clock)
        self.ports = {}
        for number, instrument in enumerate(instruments, start=1):
            name = instrument.name
            peer = self.world.serial_peers[name]
            line = SimulatedLine(name, peer, self.clock, number=number, baud=instrument.baud)
            peer.attach(line, self.world.clock_of(name))
            publish_stream(f"{_URL}{name}", line)
            self.ports[name] = open_port(name, f"{_URL}{name}", self.clock, self.transcript, baud=instrument.baud)

    def close(self):
        """Withdraw the bench's ports."""
        for port in self.ports.values():
            port.close()
        withdraw(_URL)

    def start(self, cycles=10):
        """Let the supply hold 4.2 V and 0.7 A, and begin a test."""
        for command in (b":SOUR1:VOLT 4.2\n", b":SOUR1:CURR 0.7\n", b":OUTP CH1,ON\n"):
            self.ports["psu"].write(command)
            self.clock.sleep(0.1)
        cycler = self.ports["cycler"]
        for text in (":1 SET beat=600", f":2 SET cycles={cycles}"):
            cycler.write(sealed(text))
            assert b" OK " in cycler.read_line()
        settings = self.settings(cycles)
        cycler.write(sealed(f":3 START run=0007A3F2 settings={settings}"))
        assert b":3 OK" in cycler.read_line(), settings

    @staticmethod
    def settings(cycles):
        """Return the CRC of the settings of a test of so many cycles."""
        text = (
            f"cycles={cycles};rest=0;beat=600;vfull=4.150;iend=0.050;vend=2.700;vmax=4.250;vmin=2.600;"
            "imax=1.000;tmax=45.0;tmin=0.0;time=28800;charge=3.000"
        )
        return sealed(text).rpartition(b"*")[2].decode("ascii").strip()

    def follow(self, lines):
        """Let time pass for some lines, reading each when it has come, with a heartbeat now and then."""
        cycler, clock, received = self.ports["cycler"], self.clock, 0
        for number in range(lines):
            clock.sleep(LINE_S)
            waiting = cycler.in_waiting
            received += len(cycler.read(waiting))
            if not number % 40:
                cycler.write(sealed(":4 BEAT run=0007A3F2"))
        return received
