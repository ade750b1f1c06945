"""The battery plant against what was published, against its equations, and against an independent solver."""

from __future__ import annotations

import json
from itertools import pairwise

import numpy as np
import pytest
from battery_cycles import GRID_S, SECOND_NS, Cycles, battery
from scipy.integrate import solve_ivp

from hil.simulation.plants.battery.cell import CellTruth
from hil.simulation.plants.battery.housing import HousingTruth
from hil.simulation.plants.battery.plant import WiringTruth

KELVIN = 273.15
CELL, WIRING, HOUSING = CellTruth(), WiringTruth(), HousingTruth()
OUTSIDE = WIRING.leads + WIRING.fuse
PATH = WIRING.contact + WIRING.supply_leads
THROUGH = HOUSING.conductance * HOUSING.sink_ambient / (HOUSING.conductance + HOUSING.sink_ambient)
NO_AGE = {"fade": "0", "growth": "0"}
DISCHARGE = {"charge_contact": False, "discharge_contact": True}
CHARGE = {"charge_contact": True, "discharge_contact": False, "supply_voltage": 4.2, "supply_current": 0.7}
REST = {"charge_contact": False, "discharge_contact": False}


def rows_of(plant, seconds, *signals, start=0):
    """Return signals at every grid point, shape (points, signals), the beginning included."""
    rows = [[plant.observe(name) for name in signals]]
    for now in range(start + GRID_S, start + seconds + 1, GRID_S):
        plant.advance(now * SECOND_NS)
        rows.append([plant.observe(name) for name in signals])
    return np.array(rows)


def test_the_published_cycle_comes_out():
    """Times, energies and rises of temperature are those of the first cycle in Table 1: 4:18:30 and 2:47:58."""
    cycles = Cycles(battery(charge="1"))
    cycles.discharge()
    cycles.rest()
    charged = cycles.charge()
    cycles.rest()
    discharged = cycles.discharge()
    assert charged.seconds == pytest.approx(4 * 3600 + 18 * 60 + 30, rel=0.03)
    assert discharged.seconds == pytest.approx(2 * 3600 + 47 * 60 + 58, rel=0.03)
    assert charged.energy == pytest.approx(7.98, rel=0.01)
    assert discharged.energy == pytest.approx(7.07, rel=0.01)
    assert charged.rise == pytest.approx(28.6 - 24.9, abs=1.5)
    assert discharged.rise == pytest.approx(32.9 - 24.1, abs=1.5)


@pytest.mark.system
def test_the_published_loss_comes_out():
    """In 844 hours, charged at 40 and discharged at 10 degC, a discharge loses what 70 to 65 is: 7.1 %."""
    plant = battery(20)
    cycles = Cycles(plant, 20)
    energies, seconds = [], 0.0
    while seconds < 844 * 3600:
        plant.command(ambient=40.0)
        charged = cycles.charge()
        plant.command(ambient=10.0)
        discharged = cycles.discharge()
        energies.append(discharged.energy)
        seconds += charged.seconds + discharged.seconds
    assert energies[-1] / energies[1] == pytest.approx(65 / 70, abs=0.005)
    assert plant.observe("capacity") < CELL.capacity
    assert plant.observe("cycles") == pytest.approx(len(energies), rel=0.1)


@pytest.mark.parametrize(("command", "start"), [(CHARGE, "0.1"), (DISCHARGE, "0.9")])
def test_energy_is_kept(command, start):
    """What entered at the tabs is in the chemistry, in the nodes, or went to the room."""
    plant = battery(charge=start, **NO_AGE)
    plant.command(**command)
    names = ("cell_voltage", "current", "box", "plate", "charge", "temperature")
    room = plant.observe("ambient")
    busy = rows_of(plant, 7200, *names)
    plant.command(**REST)
    still = rows_of(plant, 36000, *names, start=7200)
    # The current of a step is the one at its end.
    work = sum(after[1] * (before[0] + after[0]) / 2 for before, after in pairwise(busy)) * GRID_S
    _, _, box, plate, charge, cell = np.vstack((busy, still[1:])).T
    lost = np.trapezoid(HOUSING.box_ambient * (box - room) + THROUGH * (plate - room)) * GRID_S
    stored = (
        HOUSING.cell_capacity * (cell[-1] - room)
        + HOUSING.box_capacity * (box[-1] - room)
        + HOUSING.plate_capacity * (plate[-1] - room)
    )
    grid = np.linspace(charge[0], charge[-1], 20_001)
    volts = np.trapezoid(np.interp(grid, CELL.charge, CELL.open_circuit), grid)
    chemistry = CELL.capacity * 3600 * (volts - (25 + KELVIN) * CELL.entropic * (charge[-1] - charge[0]))
    assert abs(lost + stored) > 300
    assert work == pytest.approx(chemistry + lost + stored, abs=5)


@pytest.mark.parametrize(("start", "seconds", "tolerance"), [(0.2, 3000, 1e-12), (0.5, 9000, 2e-5)])
def test_charge_is_kept(start, seconds, tolerance):
    """State of charge is current times time over capacity, exactly under a limit; both directions make up cycles."""
    plant = battery(charge=str(start), **NO_AGE)
    plant.command(**CHARGE)
    first = rows_of(plant, seconds, "current")
    plant.command(**DISCHARGE)
    second = rows_of(plant, seconds, "current", start=seconds)
    moved = [float(rows[1:].sum()) * GRID_S for rows in (first, second)]
    capacity = CELL.capacity * 3600
    assert plant.observe("charge") == pytest.approx(start + sum(moved) / capacity, abs=tolerance)
    assert plant.observe("cycles") == pytest.approx((moved[0] - moved[1]) / (2 * capacity), abs=tolerance)


def slopes(_, state, supply, load, room):
    """Return the derivatives of charge, links, cell, box and plates, written out without any step in mind."""
    charge, fast, slow, cell, box, plate = state
    factor = np.exp(CELL.activation * (1 / (cell + KELVIN) - 1 / (25 + KELVIN)))
    inner = np.interp(charge, CELL.charge, CELL.open_circuit) + CELL.entropic * (cell - 25) + fast + slow
    ohms = factor * CELL.resistance
    current = -load if load else min(supply[1], (supply[0] - inner) / (ohms + OUTSIDE + PATH))
    heat = current**2 * ohms + fast**2 / (factor * CELL.fast_resistance) + slow**2 / (factor * CELL.slow_resistance)
    heat += current * (cell + KELVIN) * CELL.entropic
    into_box = HOUSING.cell_box * (cell - box) + HOUSING.plate_box * (plate - box) + HOUSING.box_ambient * (room - box)
    return (
        current / (CELL.capacity * 3600),
        (factor * CELL.fast_resistance * current - fast) / CELL.fast_time,
        (factor * CELL.slow_resistance * current - slow) / CELL.slow_time,
        (heat + HOUSING.cell_box * (box - cell)) / HOUSING.cell_capacity,
        into_box / HOUSING.box_capacity,
        (HOUSING.plate_box * (box - plate) + THROUGH * (room - plate)) / HOUSING.plate_capacity,
    )


@pytest.mark.parametrize(
    ("command", "start", "supply", "load", "seconds"),
    [(CHARGE, 0.1, (4.2, 0.7), 0.0, 14_000), (DISCHARGE, 0.97, (0.0, 0.0), 0.7, 9_500)],
)
def test_an_independent_solver_agrees(command, start, supply, load, seconds):
    """Constant current, the change to constant voltage, and the tail are those of an adaptive solver."""
    plant = battery(charge=str(start), **NO_AGE)
    room = plant.observe("ambient")
    plant.command(**command)
    seen = rows_of(plant, seconds, "charge", "temperature", "box")
    solved = solve_ivp(
        slopes,
        (0, seconds),
        (start, 0, 0, room, room, room),
        method="LSODA",
        t_eval=np.arange(0, seconds + 1, GRID_S),
        rtol=1e-8,
        atol=1e-9,
        max_step=20,
        args=(supply, load, room),
    )
    assert seen[:, 0] == pytest.approx(solved.y[0], abs=2e-4)
    assert seen[:, 1] == pytest.approx(solved.y[3], abs=0.02)
    assert seen[:, 2] == pytest.approx(solved.y[4], abs=0.02)


def test_the_supply_holds_its_current_then_its_voltage():
    """At grid points the supply gives its limit, or has its voltage; never more of either."""
    plant = battery(charge="0.3")
    plant.command(**CHARGE)
    volts, amperes, tester = rows_of(plant, 14_000, "supply.voltage", "supply.current", "voltage").T
    limited = np.isclose(amperes, 0.7, rtol=0, atol=1e-12)
    assert limited[1:].any()
    assert not limited.all()
    assert volts.max() <= 4.2 + 1e-9
    assert volts[~limited] == pytest.approx(4.2, abs=1e-3)
    assert volts - tester == pytest.approx(amperes * PATH, abs=1e-9)


@pytest.mark.parametrize("grid_s", [1, 20])
def test_the_grid_changes_little(grid_s):
    """A cycle on a finer and on a coarser grid takes as long, holds as much energy, and warms as much."""

    def lived(grid):
        cycles = Cycles(battery(grid, charge="0.05"), grid)
        return cycles.charge(), cycles.discharge()

    for one, other in zip(lived(grid_s), lived(GRID_S), strict=True):
        assert one.seconds == pytest.approx(other.seconds, abs=2 * max(grid_s, GRID_S))
        assert one.energy == pytest.approx(other.energy, rel=2e-3)
        assert one.rise == pytest.approx(other.rise, abs=0.05)


def test_looking_changes_nothing_and_a_restored_cell_goes_on():
    """The state after polling, and after saving through JSON, is bit-identical."""

    def lived(*, looks, pause=False):
        plant = battery(charge="0.4", place="assembly")
        plant.command(**CHARGE, tec=0.3)
        plant.advance(503 * SECOND_NS)
        for number in range(looks):
            plant.advance(503 * SECOND_NS + number * 123_456_789)
            for name in plant.signals:
                plant.observe(name)
        if pause:
            state = json.loads(json.dumps(plant.state()))
            plant = battery(charge="0.4", place="assembly")
            plant.restore(state)
        plant.advance(600 * SECOND_NS)
        plant.command(**DISCHARGE, tec=-0.5)
        plant.advance(900 * SECOND_NS)
        return json.dumps(plant.state())

    assert lived(looks=300) == lived(looks=0) == lived(looks=30, pause=True)


def test_a_cell_left_alone_comes_to_rest():
    """With open contacts links and temperatures settle, and nothing is stepped any more."""
    plant = battery(charge="0.8")
    plant.command(**DISCHARGE)
    plant.advance(1800 * SECOND_NS)
    plant.command(**REST)
    plant.advance(24 * 3600 * SECOND_NS)
    before = plant.state()["moments"][-1]
    plant.advance(35 * 24 * 3600 * SECOND_NS)
    assert plant.state()["moments"][-1] == before
    assert plant.observe("cell_voltage") == pytest.approx(plant.observe("open_circuit"), abs=1e-3)
    assert plant.observe("temperature") == plant.observe("ambient")


@pytest.mark.parametrize("share", [-0.6, 0.0, 0.4])
def test_the_assembly_settles_where_its_heats_balance(share):
    """Plates, sinks and box end where what is pumped, conducted and lost adds up to nothing."""
    plant = battery(place="assembly", charge="0.5")
    plant.command(tec=share)
    plant.advance(24 * 3600 * SECOND_NS)
    room, current = plant.observe("ambient"), share * HOUSING.current
    cell, plate, box = (plant.observe(name) for name in ("temperature", "plate", "box"))
    joule, peltier = current**2 * HOUSING.resistance / 2, HOUSING.seebeck * current
    sink = (HOUSING.sink_ambient * room + joule - peltier * KELVIN + HOUSING.conductance * plate) / (
        HOUSING.sink_ambient + HOUSING.conductance + peltier
    )
    pumped = peltier * (plate + KELVIN) + joule + HOUSING.conductance * (sink - plate)
    assert HOUSING.cell_box * (box - cell) + HOUSING.cell_plate * (plate - cell) == pytest.approx(0, abs=1e-9)
    into_plate = HOUSING.cell_plate * (cell - plate) + HOUSING.plate_box * (box - plate)
    assert pumped + into_plate == pytest.approx(0, abs=1e-6)
    assert (plate - room) * share >= 0


def test_the_assembly_reaches_both_temperatures():
    """From 24.5 degC the cell between the plates gets beyond 40 and below 10 degC within twenty minutes."""
    for share, target in ((1.0, 40.0), (-1.0, 10.0)):
        plant = battery(place="assembly", charge="0.5")
        plant.command(tec=share)
        plant.advance(1200 * SECOND_NS)
        assert (plant.observe("temperature") - target) * share > 0
