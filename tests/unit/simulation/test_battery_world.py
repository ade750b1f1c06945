"""The battery plant in a built world: a controller on the plates of its assembly."""

from __future__ import annotations

import pytest
from chamber_bench import CLAMPS, THERMAL, LinePort

from hil.clock.virtual import VirtualClock
from hil.instruments.driver import Clamps, Connection
from hil.instruments.eurotherm_3216 import Eurotherm3216
from hil.model.bench import InstrumentSpec, PeerSpec, PlantSpec, SimulatedBench
from hil.simulation.world import build_world
from hil.wire.simulated_line import SimulatedLine

CONNECTS = {"sensor": "cell.plate", "drive": "cell.tec", "ambient": "cell.ambient"}
# A turn a minute, with a band as wide: weeks of cycles need no faster loop.
TUNING = {"period": "60 s", "proportional_band": "60"}


@pytest.fixture
def world():
    """Return a world with a cell in the assembly, and the role of the controller on its plates."""
    clock = VirtualClock()
    spec = SimulatedBench(
        epoch="2026-01-01T00:00:00Z",
        seed=7,
        plants=(PlantSpec(name="cell", model="battery", grid_s=5.0, truth={"place": "assembly", "charge": "0.5"}),),
        peers=(PeerSpec(device="tec", model="", truth=TUNING, connects=CONNECTS, faults=()),),
    )
    built = build_world(spec, (InstrumentSpec(name="tec", driver="eurotherm-3216", baud=9600, address=1),), clock)
    peer = built.serial_peers["tec"]
    line = SimulatedLine("tec", peer, clock, number=built.devices["tec"], baud=9600)
    peer.attach(line, built.clock_of("tec"))
    connection = Connection(device="tec", clock=clock, clamps=Clamps(CLAMPS), port=LinePort(line), address=1)
    return built, Eurotherm3216(connection).role(THERMAL)


@pytest.mark.parametrize("target", [40.0, 10.0])
def test_a_controller_holds_the_temperature_of_the_modules(world, target):
    """While the cell is discharged, plates and cell come to the setpoint, and stay there."""
    built, thermal = world
    plant = built.plants["cell"]
    thermal.hold(target)
    built.clock.sleep(1800)
    plant.command(discharge_contact=True)
    for _ in range(20):
        built.clock.sleep(60)
        assert plant.observe("plate") == pytest.approx(target, abs=1.0)
        assert plant.observe("temperature") == pytest.approx(target, abs=1.5)
