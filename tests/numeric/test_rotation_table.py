"""The simulated rotation table against numerical integration, and against what is known of the Earth."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from rotation import plant

SECOND = 1_000_000_000
COMMANDS = (
    (0, {"rate_command": 40.0, "acceleration": 15.0}),
    (SECOND, {"rate_command": -25.0}),
    (2_345_678_901, {"acceleration": 60.0}),
    (4_000_000_000, {"rate_command": 33.0, "grip": 0.8}),
    (5_500_000_000, {"grip": 1.0, "rate_command": 0.0}),
)
TRUTH = {"ripple": "0.02", "tilt": ["0.01", "-0.02"], "earth_rate": "15.041", "latitude": "41.4", "angle": "12"}
SIGNALS = ("angle", "table_rate", "rate.x", "rate.y", "rate.z", "turns")


def follow(table, commands=COMMANDS, looks=(), end_ns=8 * SECOND, seen=None):
    """Let a table follow commands while somebody looks; `seen` takes what was seen at the looks."""
    events = sorted([(at, 1, values) for at, values in commands] + [(at, 0, None) for at in looks], key=lambda e: e[:2])
    for at_ns, _, values in events:
        table.advance(at_ns)
        if values is not None:
            table.command(**values)
        elif seen is not None:
            seen.append([table.observe(signal) for signal in SIGNALS])
    table.advance(end_ns)
    return table


def test_closed_form_agrees_with_numerical_integration():
    """Motor and ripple integrated in steps of 50 us give the same angle and rate, commands in the middle included."""
    step_ns = 50_000
    motor, rate, angle = 12.0, 0.0, 12.0
    inputs = {"rate_command": 0.0, "acceleration": 10.0, "grip": 1.0}
    looks = tuple(range(SECOND // 2, 8 * SECOND, SECOND // 2))
    seen: list[list[float]] = []
    follow(plant(**TRUTH), looks=looks, seen=seen)
    due = dict(zip(looks, seen, strict=True))
    commands = list(COMMANDS)
    for now_ns in range(0, 8 * SECOND, step_ns):
        if now_ns in due:
            assert due[now_ns][0] == pytest.approx(angle, abs=2e-3)
            rippled = inputs["grip"] * rate * (1 + 0.02 * math.cos(math.radians(motor)))
            assert due[now_ns][1] == pytest.approx(rippled, abs=5e-3)
        while commands and commands[0][0] <= now_ns:
            inputs |= commands.pop(0)[1]
        dt = step_ns / SECOND
        gap = inputs["rate_command"] - rate
        before = rate
        rate += max(-inputs["acceleration"] * dt, min(inputs["acceleration"] * dt, gap))
        mean = (before + rate) / 2
        angle += inputs["grip"] * mean * (1 + 0.02 * math.cos(math.radians(motor + mean * dt / 2))) * dt
        motor += mean * dt


@pytest.mark.parametrize("grid_s", [0.001, 0.013, 1.0])
def test_the_grid_changes_nothing(grid_s):
    """A coarse grid gives the values of a fine one, between grid points too."""
    looks = tuple(range(123_456_789, 8 * SECOND, 377_777_777))
    fine: list[list[float]] = []
    other: list[list[float]] = []
    follow(plant(0.01, **TRUTH), looks=looks, seen=fine)
    follow(plant(grid_s, **TRUTH), looks=looks, seen=other)
    np.testing.assert_allclose(other, fine, rtol=1e-9, atol=1e-9)


def test_looking_changes_nothing():
    """Any observation leaves the state bit-identical."""
    watched = follow(plant(**TRUTH), looks=range(0, 8 * SECOND, 7_654_321), seen=[])
    assert json.dumps(watched.state()) == json.dumps(follow(plant(**TRUTH)).state())


def test_restored_in_the_middle_of_a_ramp_it_goes_on():
    """Saved through JSON and restored, it ends in the same bits."""
    first = follow(plant(**TRUTH), COMMANDS[:2], end_ns=2 * SECOND)
    second = plant(**TRUTH)
    second.restore(json.loads(json.dumps(first.state())))
    for table in (first, second):
        follow(table, COMMANDS[2:])
    assert [first.observe(name) for name in SIGNALS] == [second.observe(name) for name in SIGNALS]


@pytest.mark.parametrize("signal", SIGNALS)
@pytest.mark.parametrize("grid_s", [0.01, 1.0])
def test_many_instants_at_once_are_the_single_ones(signal, grid_s):
    """Across commands and grid points, an instant's value is the one before its command, for one as for many."""
    table = plant(grid_s, **TRUTH)
    follow(table, COMMANDS[:4], end_ns=5_400_000_000)
    times = np.unique(np.array([3_400_000_001, *range(3_450_000_000, 5_400_000_001, 12_500_000)], dtype=np.int64))
    many = table.observe_many(signal, times)
    single = [table.observe_at(signal, int(at)) for at in times]
    np.testing.assert_allclose(many, single, rtol=1e-10, atol=1e-10)
    assert table.observe_many(signal, times[:0]).size == 0
    with pytest.raises(ValueError, match="cannot be observed"):
        table.observe_many(signal, np.array([5_400_000_001]))


@pytest.mark.parametrize("mounting", ["x", "y", "z"])
def test_the_board_sees_the_rate_along_its_mounted_axis(mounting):
    """Without tilt and Earth the other two axes see nothing, whichever way the person mounts the board."""
    table = plant()
    assert table.choices("mounting") == ("x", "y", "z")
    table.command(mounting=mounting, rate_command=30.0, acceleration=100.0)
    table.advance(SECOND)
    for axis in "xyz":
        assert table.observe(f"rate.{axis}") == (30.0 if axis == mounting else 0.0)


def test_a_tilted_axis_shows_on_the_others():
    """The rate's length stays; the first angle is towards the next axis, the second towards the one after."""
    table = plant(tilt=["0.03", "-0.02"], mounting="y")
    table.command(rate_command=50.0, acceleration=100.0)
    table.advance(SECOND)
    x, y, z = (table.observe(f"rate.{axis}") for axis in "xyz")
    assert math.hypot(x, y, z) == pytest.approx(50.0)
    assert (z / y, x / y) == pytest.approx((0.03, -0.02))


def test_the_earth_turns_under_a_table_at_rest():
    """Vertical part along the axis, horizontal part across it and turning with the table; together 15.041 deg/h."""
    table = plant(earth_rate="15.041", latitude="41.4", tilt=["0.01", "0"])
    rates = []
    for angle in (0.0, 90.0):
        turned = plant(earth_rate="15.041", latitude="41.4", angle=str(angle))
        rates.append([turned.observe(f"rate.{axis}") * 3600 for axis in "xyz"])
    north, up = 15.041 * math.cos(math.radians(41.4)), 15.041 * math.sin(math.radians(41.4))
    assert rates[0] == pytest.approx([north, 0.0, up], abs=1e-9)
    assert rates[1] == pytest.approx([0.0, -north, up], abs=1e-9)
    assert math.hypot(*(table.observe(f"rate.{axis}") for axis in "xyz")) * 3600 == pytest.approx(15.041)


def test_the_ripple_comes_once_per_turn_and_leaves_the_mean():
    """Over whole turns the rate is the commanded one; its extremes are one ripple away."""
    table = plant(ripple="0.01")
    table.command(rate_command=36.0, acceleration=1e9)
    table.advance(SECOND)
    begin = table.observe("angle")
    rates = []
    for step in range(1, 1001):
        table.advance(SECOND + step * 10_000_000)
        rates.append(table.observe("table_rate"))
    assert table.observe("angle") - begin == pytest.approx(360.0, abs=1e-6)
    assert (max(rates), min(rates)) == pytest.approx((36.36, 35.64), abs=1e-3)
