"""The simulated cycler with the simulated battery behind it: a test as the campaign published it."""

from __future__ import annotations

import pytest

from hil.clock.virtual import VirtualClock
from hil.model.bench import InstrumentSpec
from hil.simulation.peers.cycler.firmware import MODEL
from hil.simulation.peers.model import Connections, PeerSetup
from hil.simulation.plants.battery.plant import build
from hil.simulation.seeds import Seeds
from hil.simulation.truth import Truth

WIRING = {
    "voltage": "battery.voltage",
    "current": "battery.current",
    "temperature": "battery.ntc_temperature",
    "charge": "battery.charge_contact",
    "discharge": "battery.discharge_contact",
}


class Terminal:
    """A line without a speed that keeps what came as text."""

    def __init__(self):
        self.lines = []

    def send(self, data, after_ns=0):
        """Keep a line."""
        self.lines.append(data.decode("ascii").removesuffix("\r\n"))


def test_a_published_cycle():
    """Level 1, C/2 from the supply: energies and times of a whole cycle are near the first of the campaign's table."""
    clock, terminal = VirtualClock(), Terminal()
    battery = build("battery", 5_000_000_000, Truth({}, ("truth",)))
    battery.follow(clock.now_ns)
    cycler = MODEL.build(
        PeerSetup(
            instrument=InstrumentSpec(name="cycler", driver="cycler"),
            truth=Truth({"level": "1", "cycles": "1"}, ("truth",)),
            connections=Connections(WIRING, {"battery": battery}, set(), ("connects",)),
            seeds=Seeds(1),
        )
    )
    cycler.attach(terminal, clock)
    battery.command(supply_voltage=4.2, supply_current=0.7)
    cycler.opened()
    clock.sleep(2)
    cycler.receive(b"\r")
    clock.sleep(9 * 3600)
    marks = [line for line in terminal.lines if not (line[0].isdigit() or line[0] == "-")]
    assert marks == ["START ARDUINO", "TEST ITERATION 1", "CHARGE END", "DISCHARGE END", "TEST END"]
    charge, discharge = (terminal.lines.index(mark) for mark in ("CHARGE END", "DISCHARGE END"))
    assert 5 * (charge - 2) == pytest.approx(4.3 * 3600, rel=0.03)
    assert 5 * (discharge - charge - 1) == pytest.approx(2.8 * 3600, rel=0.03)
    rows = [[float(field) for field in terminal.lines[place - 1].split(";")] for place in (charge, discharge)]
    assert rows[0] == pytest.approx([4.2, 0.05, 7.98, 25.0], rel=0.06)
    assert rows[1] == pytest.approx([2.7, -0.7, 7.07, 32.9], rel=0.06)
