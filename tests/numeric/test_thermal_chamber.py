"""The thermal chamber against its equations: energy, steady states, an independent solver, any grid, any polling."""

from __future__ import annotations

import json

import numpy as np
import pytest
from chamber_bench import SECOND_NS, ChamberBench, chamber
from scipy.integrate import solve_ivp

from hil.simulation.plants.thermal_chamber import ChamberTruth, build
from hil.simulation.truth import Truth, TruthError

NODES = ("plate", "board", "die", "box", "sink")
KELVIN = 273.15


def seen(plant, *signals):
    """Return signals at the present instant."""
    return np.array([plant.observe(name) for name in signals or NODES])


def heat_flows(truth, temperatures, share, lamp):
    """Return what flows into every node in W, written out node by node, and the cooler's electrical power."""
    plate, board, die, box, sink = temperatures
    amperes = share * truth.current
    joule = amperes**2 * truth.resistance / 2
    through = truth.conductance * (sink - plate)
    into_plate = truth.seebeck * amperes * (plate + KELVIN) + joule + through
    into_sink = -truth.seebeck * amperes * (sink + KELVIN) + joule - through
    flows = (
        into_plate + truth.plate_board * (board - plate) + truth.plate_box * (box - plate),
        truth.plate_board * (plate - board)
        + truth.board_die * (die - board)
        + truth.board_box * (box - board)
        + lamp * truth.lamp_board,
        truth.board_die * (board - die),
        truth.plate_box * (plate - box)
        + truth.board_box * (board - box)
        + truth.box_ambient * (truth.ambient - box)
        + lamp * truth.lamp_box,
        into_sink + truth.sink_ambient * (truth.ambient - sink),
    )
    return flows, into_plate + into_sink


def capacities(truth):
    """Return the heat capacities in the order of the nodes."""
    return np.array([getattr(truth, f"{name}_capacity") for name in NODES])


@pytest.mark.parametrize(("share", "lamp"), [(-1.0, False), (-0.62, True), (0.35, False), (1.0, True), (0.0, True)])
def test_an_independent_solver_agrees(share, lamp):
    """Twenty minutes under constant inputs end where an adaptive solver of the written-out equations ends."""
    truth, plant = ChamberTruth(), chamber()
    plant.command(tec=share, lamp=lamp)
    plant.advance(1200 * SECOND_NS)

    def slopes(_, state):
        return np.array(heat_flows(truth, state, share, lamp)[0]) / capacities(truth)

    solved = solve_ivp(slopes, (0, 1200), [truth.ambient] * 5, method="DOP853", rtol=1e-10, atol=1e-10)
    assert seen(plant) == pytest.approx(solved.y[:, -1], abs=1e-6)


def test_energy_is_kept():
    """What the nodes have gained is electrical power and lamp, less what went into the room."""
    truth, plant = ChamberTruth(), chamber()
    plant.command(tec=-0.8, lamp=True)
    rows = [[*seen(plant), plant.observe("tec_power")]]
    for second in range(1, 601):
        plant.advance(second * SECOND_NS)
        rows.append([*seen(plant), plant.observe("tec_power")])
    *_, box, sink, power = np.array(rows).T
    lost = truth.box_ambient * (box - truth.ambient) + truth.sink_ambient * (sink - truth.ambient)
    came = np.trapezoid(power - lost + truth.lamp_board + truth.lamp_box)
    gained = capacities(truth) @ (np.array(rows[-1][:5]) - truth.ambient)
    assert power.sum() > 10_000
    assert gained == pytest.approx(came, abs=0.5)


def test_the_cooler_draws_what_it_gives_to_both_sides():
    """The signal is the sum of the heats of both sides, whichever way the current flows."""
    for share in (-0.9, 0.4):
        plant = chamber()
        plant.command(tec=share)
        plant.advance(100 * SECOND_NS)
        _, power = heat_flows(ChamberTruth(), seen(plant), share, lamp=False)
        assert plant.observe("tec_power") == pytest.approx(power, rel=1e-12)


@pytest.mark.parametrize("share", [-1.0, -0.5, 0.2])
def test_steady_state_is_the_one_solved_by_hand(share):
    """Resistors in series and parallel leave two equations, for plate and sink (Cramer's rule)."""
    truth, plant = ChamberTruth(), chamber()
    plant.command(tec=share)
    plant.advance(6 * 3600 * SECOND_NS)
    to_box = truth.plate_box + truth.plate_board * truth.board_box / (truth.plate_board + truth.board_box)
    to_room = to_box * truth.box_ambient / (to_box + truth.box_ambient)
    peltier, joule = truth.seebeck * share * truth.current, (share * truth.current) ** 2 * truth.resistance / 2
    a, b = truth.conductance + to_room - peltier, truth.conductance + truth.sink_ambient + peltier
    c = truth.conductance
    p = joule + peltier * KELVIN + to_room * truth.ambient
    q = joule - peltier * KELVIN + truth.sink_ambient * truth.ambient
    plate, sink = (p * b + q * c) / (a * b - c * c), (a * q + c * p) / (a * b - c * c)
    assert seen(plant, "plate", "sink") == pytest.approx([plate, sink], abs=1e-6)
    box = truth.ambient + to_room * (plate - truth.ambient) / truth.box_ambient
    assert seen(plant, "box", "die") == pytest.approx(
        [box, (truth.plate_board * plate + truth.board_box * box) / (truth.plate_board + truth.board_box)], abs=1e-6
    )


def test_nothing_happens_without_a_cause():
    """Without current and lamp every node stays at the temperature of the room."""
    plant = chamber(ambient=18.5)
    plant.advance(3600 * SECOND_NS)
    assert seen(plant) == pytest.approx([18.5] * 5, abs=1e-9)


@pytest.mark.parametrize("grid_ns", [SECOND_NS // 10, 7 * SECOND_NS, 60 * SECOND_NS])
def test_the_grid_changes_nothing(grid_ns):
    """Steps are exact: a command between grid points, and any grid, give the same temperatures."""

    def lived(grid):
        plant = chamber(grid)
        for at_s, inputs in ((0, {"tec": -1.0}), (100.3, {"tec": 0.4, "lamp": True}), (333.3, {"lamp": False})):
            plant.advance(round(at_s * SECOND_NS))
            plant.command(**inputs)
        plant.advance(840 * SECOND_NS)
        return seen(plant)

    assert lived(grid_ns) == pytest.approx(lived(SECOND_NS), abs=1e-9)


def test_looking_changes_nothing_and_a_restored_chamber_goes_on():
    """The state after polling, and after saving through JSON, is bit-identical."""

    def lived(*, looks, pause=False):
        plant = chamber()
        plant.command(tec=-0.7)
        plant.advance(50 * SECOND_NS)
        for number in range(looks):
            plant.advance(50 * SECOND_NS + number * 12_345_678)
            seen(plant, "plate", "tec_power", "ambient")
        if pause:
            state = json.loads(json.dumps(plant.state()))
            plant = chamber()
            plant.restore(state)
        plant.advance(60 * SECOND_NS)
        plant.command(lamp=True)
        plant.advance(90 * SECOND_NS)
        return json.dumps(plant.state())

    assert lived(looks=300) == lived(looks=0) == lived(looks=30, pause=True)


@pytest.mark.parametrize("target", [-16.0, 40.0])
def test_the_plate_gets_there_within_ten_minutes(target):
    """From 22 degC both ends of the range are reached, and the die follows minutes later."""
    bench = ChamberBench()
    bench.thermal.hold(target)
    reached = {}
    while len(reached) < 2 and bench.clock.now() < 3600:
        bench.clock.sleep(10)
        for node in ("plate", "die"):
            if node not in reached and abs(bench.plant.observe(node) - target) < 1.0:
                reached[node] = bench.clock.now()
    assert reached["plate"] < 600
    assert 120 < reached["die"] - reached["plate"] < 900


def test_the_loop_converges_with_its_period():
    """A loop of one second regulates as one of a tenth does: what is simulated is the chamber, not the period."""

    def lived(period):
        bench = ChamberBench(truths={"tec": {"period": period, "sensor_noise": "0"}}, grid_s=0.1)
        bench.thermal.hold(10.0)
        rows = []
        for _ in range(20):
            bench.clock.sleep(30)
            rows.append(seen(bench.plant))
        return np.array(rows)

    coarse, middle, fine = lived("1 s"), lived("500 ms"), lived("100 ms")
    assert np.abs(coarse - fine).max() < 0.5
    assert np.abs(middle - fine).max() < 0.6 * np.abs(coarse - fine).max()


def test_wrong_truths_are_told():
    """A capacity of zero would let the temperature jump; an unknown key is named."""
    with pytest.raises(TruthError, match="must be above 0"):
        build("chamber", SECOND_NS, Truth({"die_capacity": "0"}, ("truth",)))
    with pytest.raises(TruthError, match="unknown key 'lamp_bord', did you mean 'lamp_board'"):
        build("chamber", SECOND_NS, Truth({"lamp_bord": "3"}, ("truth",)))
