"""Plants step on their grid, split at commands, and can be observed without being disturbed."""

from __future__ import annotations

import json
from itertools import pairwise

import numpy as np
import pytest
from twin import Charging

GRID = 100_000_000


def test_observation_lies_on_the_line_to_the_next_grid_point():
    """Half-way between grid points is the mean of both."""
    plant = Charging()
    plant.command(drive=1.0)
    plant.advance(GRID // 2)
    half = plant.observe("level")
    plant.advance(GRID)
    assert half == pytest.approx(plant.observe("level") / 2, rel=1e-15)


def test_command_splits_the_step():
    """A command between grid points steps to its instant, then on to the grid."""
    plant = Charging()
    plant.advance(GRID // 4)
    plant.command(drive=2.0)
    plant.advance(GRID)
    rest = 0.075
    assert plant.observe("level") == pytest.approx(2 * (rest - rest * rest / 2), rel=1e-12)


def test_command_that_changes_nothing_is_no_break_point():
    """The same value again leaves the trajectory bit-identical, and nobody is called back."""
    one, two = Charging(), Charging()
    calls = []
    two.listen(lambda: calls.append(1))
    for plant in (one, two):
        plant.command(drive=1.0)
        plant.advance(GRID // 3)
    two.command(drive=1.0)
    for plant in (one, two):
        plant.advance(10 * GRID)
    assert one.observe("level") == two.observe("level")
    assert calls == [1]


def test_unknown_input_is_refused():
    """A wrong input's name is an error that names it."""
    with pytest.raises(ValueError, match="no input push"):
        Charging().command(push=1.0)


def test_past_observation_does_not_see_later_commands():
    """An instant of the past looks the same before and after a command that came later, or just then."""
    plant = Charging()
    plant.command(drive=1.0)
    plant.advance(GRID // 4)
    before = plant.observe_at("level", GRID // 4)
    plant.command(drive=-5.0)
    assert plant.observe_at("level", GRID // 4) == before
    plant.advance(GRID // 2)
    assert plant.observe_at("level", GRID // 4) == before


def test_past_is_kept_for_two_seconds_only():
    """Older instants, and the future, are refused."""
    plant = Charging()
    plant.command(drive=1.0)
    plant.advance(50 * GRID)
    assert plant.observe_at("level", 31 * GRID) < plant.observe("level")
    for at_ns in (20 * GRID, 51 * GRID):
        with pytest.raises(ValueError, match="cannot be observed"):
            plant.observe_at("level", at_ns)


def test_state_survives_json():
    """A plant restored from JSON goes on bit by bit, its past included."""
    plant = Charging()
    plant.command(drive=1.0)
    plant.advance(7 * GRID + 12345)
    plant.command(drive=0.3)
    other = Charging()
    other.restore(json.loads(json.dumps(plant.state())))
    for item in (plant, other):
        item.advance(9 * GRID + 1)
    assert other.observe("level") == plant.observe("level")
    assert other.observe_at("level", 8 * GRID) == plant.observe_at("level", 8 * GRID)
    assert other.state() == plant.state()


def test_grid_counts_from_the_epoch():
    """Grid points are multiples of the grid, whatever commands came between."""
    plant = Charging()
    for at_ns in (GRID // 3, GRID * 2 + 7):
        plant.advance(at_ns)
        plant.command(drive=float(at_ns))
    plant.advance(4 * GRID)
    instants = [moment[0] for moment in plant.state()["moments"]]
    assert instants == [0, GRID // 3, GRID, 2 * GRID, 2 * GRID + 7, 3 * GRID, 4 * GRID]
    assert all(a < b for a, b in pairwise(instants))


def test_many_observations_are_what_single_ones_see():
    """At grid points, commands and between, an array of instants sees what `observe_at` sees of each."""
    plant = Charging()
    plant.command(drive=1.0)
    plant.advance(GRID // 4)
    plant.command(drive=2.0)
    plant.advance(3 * GRID)
    plant.command(drive=-1.0)
    plant.advance(3 * GRID + GRID // 3)
    plant.restore(json.loads(json.dumps(plant.state())))
    times = np.arange(0, 3 * GRID + GRID // 3 + 1, GRID // 12)
    many = plant.observe_many("level", times)
    assert many == pytest.approx([plant.observe_at("level", int(at)) for at in times], rel=1e-14, abs=1e-15)
    plant.advance(4 * GRID)
    assert plant.observe_many("level", times).tolist() == many.tolist()
    assert plant.observe_many("level", times[5:7]).tolist() == many[5:7].tolist()
    assert plant.observe_many("level", times[:0]).size == 0


def test_physics_at_rest_costs_no_steps():
    """A plant that does not change is not stepped from grid point to grid point, and goes on from the right one."""
    plant, stepped = Charging(), Charging()
    steps = []
    plant.step = lambda state, inputs, dt: steps.append(dt) or Charging.step(plant, state, inputs, dt)
    plant.advance(1000 * GRID + GRID // 2)
    assert len(steps) <= 3
    for number in range(1, 1001):
        stepped.advance(number * GRID)
    for each in (plant, stepped):
        each.advance(1000 * GRID + GRID // 2)
        each.command(drive=1.0)
        each.advance(1003 * GRID)
    assert plant.observe("level") == stepped.observe("level")
    assert plant.observe_at("level", 1001 * GRID) == stepped.observe_at("level", 1001 * GRID)


def test_many_observations_stay_within_two_seconds():
    """Neither the future nor what was forgotten can be observed."""
    plant = Charging()
    plant.command(drive=1.0)
    plant.advance(40 * GRID)
    with pytest.raises(ValueError, match="cannot be observed"):
        plant.observe_many("level", np.array([10 * GRID, 40 * GRID]))
    with pytest.raises(ValueError, match="cannot be observed"):
        plant.observe_many("level", np.array([40 * GRID, 40 * GRID + 1]))
