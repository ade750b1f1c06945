"""The plants' physics against closed forms and an independent integrator."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.constants import mu_0
from scipy.integrate import solve_ivp

from hil.simulation.plants.coil import CoilAndEarthField, CoilTruth, EarthTruth, drive
from hil.simulation.plants.magnetics import field_per_ampere, rotation


@pytest.mark.parametrize("z", [0.0, 0.002, 0.01, 0.05, 0.3, 2.0])
def test_square_loop_on_its_axis(z):
    """B = mu0 N I a^2 / (2 pi (z^2 + a^2/4) sqrt(z^2 + a^2/2)) along the axis of a square loop of side a."""
    side, turns = 0.08, 60
    expected = mu_0 * turns * side**2 / (2 * np.pi * (z**2 + side**2 / 4) * np.sqrt(z**2 + side**2 / 2)) * 1e6
    found = field_per_ampere(turns, (side, side), (0, 0, z))
    assert found == pytest.approx([0, 0, expected], rel=1e-9, abs=1e-9)


def test_far_field_is_a_dipole():
    """Far away, off the axis, a rectangle of area A looks like the dipole N I A."""
    place = np.array([1.2, -0.7, 1.5])
    moment = np.array([0, 0, 10 * 0.06 * 0.1])
    distance = np.linalg.norm(place)
    dipole = mu_0 / (4 * np.pi) * (3 * place * (moment @ place) / distance**5 - moment / distance**3) * 1e6
    assert field_per_ampere(10, (0.06, 0.1), tuple(place)) == pytest.approx(dipole, rel=2e-3)


def test_field_has_no_divergence():
    """The central differences of the field around a place off the axis sum to nothing."""
    step, place = 1e-4, np.array([0.013, -0.021, 0.03])

    def component(axis, sign):
        shifted = place.copy()
        shifted[axis] += sign * step
        return field_per_ampere(1, (0.08, 0.05), tuple(shifted))[axis]

    slopes = [(component(axis, 1) - component(axis, -1)) / (2 * step) for axis in range(3)]
    assert abs(sum(slopes)) < 1e-4 * max(abs(slope) for slope in slopes)


def test_rotation_keeps_lengths():
    """The matrix of three small angles is orthogonal with determinant 1."""
    matrix = rotation((0.1, -0.2, 0.3))
    assert matrix @ matrix.T == pytest.approx(np.eye(3), abs=1e-15)
    assert np.linalg.det(matrix) == pytest.approx(1)


@pytest.mark.parametrize(
    ("start", "volts", "limit"),
    [(0.0, 5.0, 1.0), (0.0, 5.0, 0.05), (-0.1, 5.0, 0.05), (0.2, 5.0, 0.05), (0.1, 0.0, 0.05), (0.04, 5.0, 0.0)],
)
@pytest.mark.parametrize("seconds", [1e-5, 1e-3, 2e-2])
def test_limited_coil_against_an_integrator(start, volts, limit, seconds):
    """Current and its mean square agree with a stiff solver that clamps at the limit by an event."""
    ohms, henries = 40.0, 0.02

    def slope(_, state):
        current = state[0]
        applied = volts
        if volts / ohms > limit:
            applied = 0.0 if current > limit else volts
        return [(applied - ohms * current) / henries, current**2]

    def reached(_, state):
        return state[0] - limit

    reached.terminal = True
    limited = volts / ohms > limit
    events = [reached] if limited and start != limit else None
    solved = solve_ivp(slope, (0, seconds), [start, 0.0], rtol=1e-10, atol=1e-14, events=events)
    current, square = solved.y[0][-1], solved.y[1][-1]
    if solved.status == 1:
        square += limit**2 * (seconds - solved.t[-1])
        current = limit
    after, mean_square = drive(start, volts, limit, ohms=ohms, henries=henries, seconds=seconds)
    assert after == pytest.approx(current, rel=1e-6, abs=1e-10)
    assert mean_square == pytest.approx(square / seconds, rel=1e-5, abs=1e-12)


def test_coil_and_copper_against_an_integrator():
    """Ten seconds of a warming coil, voltage held, agree with an integrator of both equations together."""
    truth = CoilTruth(
        turns=60, sides=(0.08, 0.08), distance=0.01, resistance=4.0, inductance=0.02, heat_capacity=0.5,
        thermal_resistance=20.0,
    )  # fmt: skip
    plant = CoilAndEarthField("coil", 1_000_000, coil=truth, boards={}, earth=EarthTruth(earth_field=(0, 0, 0)))
    plant.command(board="any", supply_voltage=3.0, supply_current=5.0)
    plant.advance(10_000_000_000)

    def slope(_, state):
        current, temperature = state
        ohms = 4.0 * (1 + 0.00393 * (temperature - 20))
        return [(3.0 - ohms * current) / 0.02, (ohms * current**2 - (temperature - 20) / 20.0) / 0.5]

    solved = solve_ivp(slope, (0, 10), [0.0, 20.0], method="LSODA", rtol=1e-9, atol=1e-12)
    assert plant.observe("winding_current") == pytest.approx(solved.y[0][-1], rel=1e-4)
    assert plant.observe("temperature") - 20 == pytest.approx(solved.y[1][-1] - 20, rel=1e-3)
