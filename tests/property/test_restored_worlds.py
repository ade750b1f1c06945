"""A world restored at any instant goes on byte for byte, whether it was built then or has lived until then."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import sweeps
from adcs_bench import adcs
from cycler_page import sealed
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.bench.file.reading import load_bench
from hil.clock.virtual import VirtualClock
from hil.model.bench import InstrumentSpec, PeerSpec, PlantSpec, SimulatedBench
from hil.simulation.peers.modbus_rtu import seal
from hil.simulation.world import build_world
from hil.wire.peer import Nack

MS = 1_000_000
ROOT = Path(__file__).parents[2]

BATTERY = (
    SimulatedBench(
        epoch="2026-01-01T00:00:00Z",
        seed=11,
        plants=(
            PlantSpec(name="cell", model="battery", grid_s=5.0, truth={"charge": "0.9995", "place": "assembly"}),
            PlantSpec(name="chamber", model="thermal-chamber", grid_s=1.0, truth={}),
        ),
        peers=tuple(
            PeerSpec(device=device, model=model, truth=truth, connects=connects, faults=tuple(faults))
            for device, model, truth, connects, faults in (
                (
                    "cycler",
                    "",
                    {"voltage_noise": "0.002", "clock_drift": "0.0003", "reset_on_open": False},
                    {
                        **{name: f"cell.{name}" for name in ("voltage", "current", "temperature")},
                        **{name: f"cell.{name}_contact" for name in ("charge", "discharge")},
                    },
                    (
                        {"kind": "reset", "from": "300 s", "until": "301 s"},
                        {"kind": "stuck-relay", "relay": "charge", "from": "20 s", "until": "40 s"},
                        {"kind": "torn-lines", "share": "0.2"},
                    ),
                ),
                ("psu", "", {}, {"1": "cell.supply"}, ()),
                ("korad", "", {}, {}, ({"kind": "chatty", "every": "1700 ms", "from": "3 s"},)),
                ("tec", "", {}, {"sensor": "cell.plate", "drive": "cell.tec", "ambient": "cell.ambient"}, ()),
                ("air", "eurotherm-3216", {}, {"sensor": "chamber.plate", "drive": "chamber.tec"}, ()),
            )
        ),
        person={},
    ),
    (
        InstrumentSpec(name="cycler", driver="cycler", baud=9600),
        InstrumentSpec(name="psu", driver="rigol-dp832"),
        InstrumentSpec(name="korad", driver="korad-ka3005p", baud=9600),
        InstrumentSpec(name="tec", driver="eurotherm-3216", baud=19_200, address=1),
        InstrumentSpec(name="air", driver="eurotherm-3216", baud=9600, address=2),
    ),
    (),
)


def modbus(text):
    """Return a frame with its checksum."""
    return seal(bytes.fromhex(text))


def write(address, register, value):
    """Return a frame that writes a register."""
    return seal(bytes((address, 6)) + register.to_bytes(2, "big") + value.to_bytes(2, "big"))


WORDS = {
    "cycler": (
        *(sealed(f":{n} {text}") for n, text in enumerate(("STATE", "SET rest=5", "SET beat=10", "STOP", "CLEAR"), 1)),
        sealed(":6 START run=0007A3F2 settings=432A"),
        sealed(":7 BEAT run=0007A3F2"),
        b":8 STA",
        b"\n",
    ),
    "psu": (b":MEAS:VOLT? CH1\n", b":OUTP:OCP CH1,ON\n", b":OUTP CH1,OFF\n", b":SOUR1:CURR 0.4\n", b":ME"),
    "psu1": (b"MEAS:CURR? (@2)\n", b"CURR:PROT:STAT ON,(@2)\n", b"VOLT 3,(@2)\nOUTP ON,(@2)\n", b"SYST:ERR?\n", b"VO"),
    "korad": (b"VSET1:04.20", b"OUT1", b"OCP1", b"VOUT1?", b"STAT"),
    "tec": (modbus("01 03 00 01 00 02"), write(1, 199, 1), write(1, 24, 300), b"\x01\x03"),
    "air": (modbus("02 03 00 01 00 02"), write(2, 24, 100), b"\x02"),
    "relay1": (modbus("01 05 00 00 FF 00"), modbus("01 05 00 00 00 00"), modbus("01 0F 00 00 00 08 01 02"), b"\x01"),
    "tec1": (modbus("01 03 00 01 00 02"), write(1, 24, 300), b"\x01"),
    "table1": (b"1MO;1VA10;1MV+\r", b"1ST;1TP?\r", b"1TV?\r", b"1T"),
    "obc1": (b"\0", b"\x03\x01"),
}


class Living:
    """A world with somebody who writes down what its peers send, and when."""

    def __init__(self, bench, at_ns=0):
        spec, instruments, buses = bench
        self.clock = VirtualClock(spec.epoch)
        self.clock.wait_until(at_ns)
        self.sent: list[tuple[int, str, bytes, int]] = []
        self.world = build_world(spec, instruments, self.clock, buses)
        for name, peer in self.world.serial_peers.items():
            peer.attach(Ear(self, name), self.world.clock_of(name))

    def do(self, deed):
        """Let time pass, and give a device its bytes; look at everything that hangs on a bus."""
        pause_ns, device, place = deed
        self.clock.wait_until(self.clock.now_ns() + pause_ns)
        words = WORDS[device]
        self.world.serial_peers[device].receive(words[place % len(words)])
        for bus, peers in self.world.bus_peers.items():
            for peer in peers:
                self.look(bus, peer)

    def look(self, bus, peer):
        """Configure a device on a bus, and read its registers."""
        address = peer.addresses[0]
        try:
            peer.write(address, b"\x22\x01")
            peer.write(address, bytes([0xA0]))
            self.sent.append((self.clock.now_ns(), bus, peer.read(address, 16), address))
        except Nack:
            self.sent.append((self.clock.now_ns(), bus, b"", address))

    def told(self):
        """Return everything that was sent, and everything that can be seen."""
        seen = {
            f"{name}.{signal}": plant.observe(signal)
            for name, plant in self.world.plants.items()
            for signal in sorted(plant.signals)
        }
        return self.sent, seen, json.dumps(self.world.state())


class Ear:
    """The line of one device."""

    def __init__(self, living, name):
        self._living = living
        self._name = name

    def send(self, data, after_ns=0):
        """Note what leaves."""
        self._living.sent.append((self._living.clock.now_ns(), self._name, data, after_ns))


def bench_of(spec):
    """Return what a world is built from."""
    return spec.simulated, spec.instruments, spec.buses


def deeds(bench, pauses):
    """Return a strategy of what is done to a bench."""
    names = [name for name in (instrument.name for instrument in bench[1]) if name in WORDS]
    return st.tuples(pauses, st.sampled_from(names), st.integers(0, 8))


PAUSES = st.one_of(st.integers(0, 20_000 * MS), st.integers(0, 40).map(lambda n: n * 250 * MS), st.just(0))


def restored_goes_on(bench, before, pause_ns, after, *, at_once, opening=()):
    """Return what the world that went on and the restored one tell."""
    first = Living(bench)
    for deed in (*opening, *before):
        first.do(deed)
    first.clock.wait_until(first.clock.now_ns() + pause_ns)
    now_ns = first.clock.now_ns()
    second = Living(bench, now_ns if at_once else 0)
    second.clock.wait_until(now_ns)
    state = json.dumps(first.world.state())
    second.world.restore(json.loads(state))
    assert json.dumps(second.world.state()) == state
    for living in (first, second):
        living.sent.clear()
        for deed in after:
            living.do(deed)
        living.clock.sleep(75)
    return first.told(), second.told()


STARTED = (
    *((100 * MS, "psu", 0), (100 * MS, "tec", 1), (100 * MS, "tec", 2)),
    (100 * MS, "cycler", 5),
)


@pytest.mark.system
@settings(max_examples=sweeps.examples(60), derandomize=True)
@given(
    before=st.lists(deeds(BATTERY, PAUSES), max_size=6),
    pause_ns=PAUSES,
    after=st.lists(deeds(BATTERY, PAUSES), max_size=6),
    at_once=st.booleans(),
)
def test_a_battery_in_a_test(before, pause_ns, after, at_once):
    """A cycler in a test with a supply that is on and coolers that regulate."""
    first, second = restored_goes_on(BATTERY, before, pause_ns, after, at_once=at_once, opening=STARTED)
    assert second == first


@pytest.mark.system
@pytest.mark.parametrize("which", sweeps.chosen(["whole"], ["small", "whole"]))
@settings(max_examples=sweeps.examples(30), derandomize=True)
@given(data=st.data())
def test_an_attitude_bench(which, data):
    """Supply, relays and magnetometer; and all of the committed bench."""
    spec = adcs() if which == "small" else load_bench(ROOT / "fixtures" / "benches", "adcs", ROOT)
    bench = bench_of(spec)
    before, after = (data.draw(st.lists(deeds(bench, PAUSES), max_size=5)) for _ in range(2))
    pause_ns, at_once = data.draw(PAUSES), data.draw(st.booleans())
    first, second = restored_goes_on(bench, before, pause_ns, after, at_once=at_once)
    assert second == first
