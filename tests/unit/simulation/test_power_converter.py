"""A converter behind its input capacitor, against what is known in closed form."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest

from hil.simulation.plants.power_converter import build
from hil.simulation.truth import Truth, TruthError

MS = 1_000_000
EXACT = {
    "leads": "0.05", "contact": "0.02", "esr": "0.03", "limiter": "2.9", "capacitance": "0.0002", "bleeder": "1e12",
    "quiescent": "0", "output_resistance": "0.02", "voltage": "5", "delay": "0.02", "rise": "0.025",
}  # fmt: skip


def board(grid_ns=MS, **truth):
    """Return a board with an open contact, on a supply of 8 V and 3 A."""
    plant = build("board", grid_ns, Truth({**EXACT, **truth}, ("truth",)))
    plant.command(contact=False, given=8.0, limit=3.0)
    return plant


def close(plant, at_ns=10 * MS, **inputs):
    """Close the contact at an instant, and return it."""
    plant.advance(at_ns)
    plant.command(contact=True, **inputs)
    return at_ns


def test_the_inrush_is_that_of_a_series_circuit():
    """8 V over 3 ohm, and 0.6 ms; charge and heat as in the book, whatever lies between the grid points."""
    plant = board()
    since_ns = close(plant)
    plant.advance(since_ns + 12 * MS)
    times = since_ns + np.arange(1, 8 * MS, 1000)
    seconds = (times - since_ns) / 1e9
    current = plant.waveform("current", times)
    assert current == pytest.approx(8 / 3 * np.exp(-seconds / 6e-4), abs=1e-6)
    assert plant.waveform("input.voltage", times) == pytest.approx(8 - 3 * current, abs=1e-5)
    assert np.trapezoid(current, seconds) == pytest.approx(8 * 2e-4, rel=1e-3)
    assert np.trapezoid(current**2, seconds) == pytest.approx((8 / 3) ** 2 * 3e-4, rel=2e-3)


def test_the_rail_comes_after_its_delay():
    """The input reaches 6 V at R C ln 4; the ramp begins 20 ms later, and has its time constant."""
    plant = board()
    since_ns = close(plant)
    starts = 6e-4 * math.log(4) + 0.02
    plant.advance(since_ns + 400 * MS)
    times = since_ns + np.array([15, 20, 21, 40, 100, 399]) * MS
    expected = [5 * (1 - math.exp(-max(0.0, (at - since_ns) / 1e9 - starts) / 0.025)) for at in times]
    assert plant.waveform("load.voltage", times) == pytest.approx(expected, abs=1e-9)


def test_power_is_conserved():
    """At rest the supply gives what load, losses and leads take."""
    plant = board(proportional_loss="0.06", loss_resistance="0.08", quiescent="0.006")
    since_ns = close(plant, mode="CC", level=2.0)
    plant.advance(since_ns + 1000 * MS)
    volts, amperes, given = (plant.observe(each) for each in ("load.voltage", "load.current", "current"))
    entry = plant.observe("input.voltage")
    assert (volts, amperes) == (pytest.approx(4.96), 2.0)
    assert entry == pytest.approx(8.0 - 0.07 * given)
    taken = volts * amperes * 1.06 + 0.08 * amperes**2 + 0.006 * entry
    assert entry * given == pytest.approx(taken, rel=1e-6)


def test_overload_folds_back_and_a_weak_battery_starves_it():
    """Beyond its limit the rail gives a share of it; a supply that limits lets the input come down, time and again."""
    plant = board(foldback="0.3")
    since_ns = close(plant, mode="CC", level=3.5)
    plant.advance(since_ns + 500 * MS)
    assert plant.observe("load.current") == pytest.approx(0.9)
    assert plant.observe("load.voltage") < 0.1
    plant.command(level=2.0, limit=0.5)
    plant.advance(since_ns + 1500 * MS)
    entry = plant.waveform("input.voltage", since_ns + 500 * MS + np.arange(1, 900 * MS, MS // 2))
    assert entry.min() < 6.0
    assert entry.max() > 7.9
    assert plant.waveform("current", since_ns + 500 * MS + np.arange(1, 900 * MS, 20 * MS)).max() < 8 / 3


def test_off_it_discharges_over_its_bleeder():
    """Nothing flows back into a supply that is off, and its terminals show what the capacitor holds."""
    plant = board(bleeder="1000")
    since_ns = close(plant)
    plant.advance(since_ns + 200 * MS)
    plant.command(given=0.0)
    held = plant.observe("input.voltage")
    plant.advance(since_ns + 400 * MS)
    assert plant.observe("current") == 0.0
    assert plant.observe("voltage") == plant.observe("input.voltage") == pytest.approx(held * math.exp(-1), rel=1e-3)
    plant.command(contact=False)
    assert plant.observe("voltage") == 0.0


def test_looking_changes_nothing_and_a_restored_board_goes_on_alike():
    """Two boards under the same commands, one of them looked at all the time and restored in between."""
    quiet, watched = board(bleeder="2200"), board(bleeder="2200")
    rng, at_ns = random.Random(4), 0
    for _ in range(60):
        at_ns += rng.randrange(1, 30 * MS)
        command = {
            "contact": rng.random() < 0.8, "given": rng.choice([0.0, 6.5, 8.4]), "limit": rng.choice([0.2, 3.0]),
            "mode": rng.choice(["", "CC", "CP"]), "level": rng.choice([0.1, 1.0, 4.0]),
        }  # fmt: skip
        watched.advance(max(0, at_ns - 100))
        watched.waveform("current", np.arange(max(1, at_ns - 5000), at_ns - 100, 1000))
        for plant in (quiet, watched):
            plant.advance(at_ns)
            plant.command(**command)
        other = board(bleeder="2200")
        other.restore(watched.state())
        watched = other
        assert watched.observe("input.voltage") == quiet.observe("input.voltage")
        assert 0.0 <= quiet.observe("input.voltage") <= 8.4 + 1e-9
    assert watched.state() == quiet.state()


@pytest.mark.parametrize("inputs", [{"mode": "CC", "level": 2.0}, {"given": 0.0}, {"contact": False}])
def test_at_rest_it_moves_no_more(inputs):
    """Under load, off or separated: nothing is left to compute, however long it lasts."""
    plant = board(bleeder="2200")
    since_ns = close(plant)
    plant.advance(since_ns + 500 * MS)
    plant.command(**inputs)
    plant.advance(since_ns + 20_000 * MS)
    rest = plant.state()["moments"]
    plant.advance(since_ns + 60_000 * MS)
    assert plant.state()["moments"] == rest


def test_a_truth_that_cannot_be_is_refused():
    """A converter that stops above the voltage at which it starts."""
    with pytest.raises(TruthError, match="has to be below `starts`"):
        board(starts="5", stops="5.5")
