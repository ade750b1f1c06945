"""A sensor that was warmed twice: what is alike in both runs is no reason for doubt, and what changed is found."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sweeps

from hil.analysis.comparison import normalised_error
from hil.analysis.drift import drift_of
from hil.analysis.repeated import drift_change
from hil.model.errors import Refused
from hil.model.figure import FigureStatus

TIME = np.arange(0.0, 600.0, 0.5)
_TOP = 35 * (1 - math.exp(-300 / 86))
HEATED = 25 + np.where(TIME < 300, 35 * (1 - np.exp(-TIME / 86)), _TOP * np.exp(-(TIME - 300) / 86))
LOOP = np.where(TIME < 300, 1.0, -1.0) * np.sin((HEATED - 25) / _TOP * np.pi)


def run(drift, seed, warmer=1.0, begun=0.0):
    """Return a run with a loop of 0.1 deg/s, and as much white noise."""
    degrees = 25 + warmer * (HEATED - 25)
    noise = np.random.default_rng(seed).normal(0.0, 0.01, TIME.size)
    return TIME + begun, degrees, drift * (degrees - 25) + 0.1 * LOOP + noise


def test_a_loop_of_hysteresis_does_not_hide_a_change():
    """Each run's own slope is uncertain by its loop; the change between them only by their noise."""
    first, again = run(0.02, 1), run(0.021, 2, begun=1234.5)
    own, change = drift_of(*first, "deg/s").slope, drift_change(first, again, "deg/s").slope
    assert abs(change.value - 0.001) < 3 * change.uncertainty
    assert (change.unit, change.status) == ("deg/s/K", FigureStatus.MEASURED)
    assert change.uncertainty < 1e-4
    assert own.uncertainty > 5e-4


def test_a_warmer_run_is_no_change():
    """A lamp that hangs a little lower heats more, and the drift per kelvin is the same."""
    change = drift_change(run(0.5, 1), run(0.5, 2, warmer=1.04), "deg/s").slope
    assert abs(change.value) < 3 * change.uncertainty
    assert change.uncertainty < 1e-3


def test_intervals_of_no_change_hold_zero():
    """Of equal runs about one in twenty is beyond 95 %."""
    trials = sweeps.chosen(40, 400)
    beyond = sum(
        drift_change(run(0.02, seed), run(0.02, seed + 1000), "deg/s").probability("slope") < 0.05
        for seed in range(trials)
    )
    assert beyond <= 0.05 * trials + 3 * math.sqrt(0.0475 * trials)


@pytest.mark.system
@pytest.mark.timeout(600)
def test_slow_noise_that_hardly_shows_is_no_change():
    """A walk of a third of the power of the averages is often taken for white; three uncertainties are enough."""
    trials, beyond = sweeps.chosen(40, 1000), 0
    for seed in range(trials):
        random = np.random.default_rng(seed)
        walks = np.cumsum(random.normal(0.0, 0.01 / math.sqrt(20.0 * 660.0), (2, TIME.size)), axis=1)
        first, again = (
            (time, degrees, values + walk)
            for (time, degrees, values), walk in zip((run(0.02, 2 * seed), run(0.02, 2 * seed + 1)), walks, strict=True)
        )
        error = normalised_error(drift_change(first, again, "deg/s").slope)
        beyond += error.value > 3.0
    assert beyond <= 0.002 * trials


def test_what_cannot_be_compared_says_so():
    """A gap in the numbers leaves the change unknown; shapes that do not fit are refused; a shorter run is enough."""
    first, again = run(0.02, 1), run(0.02, 2)
    again[2][7] = math.nan
    found = drift_change(first, again, "deg/s")
    assert found.slope.status is FigureStatus.NOT_OBSERVABLE
    assert "no numbers" in found.why("slope")[0] or "finite" in found.why("slope")[0]
    with pytest.raises(Refused, match="different shapes"):
        drift_change(first, (TIME, HEATED, TIME[1:]), "deg/s")
    with pytest.raises(Refused, match="different shapes"):
        drift_change(first, (TIME[:0], HEATED[:0], TIME[:0]), "deg/s")
    shorter = tuple(each[:1000] for each in run(0.02, 3))
    assert drift_change(first, shorter, "deg/s").time[-1] < 500.0
