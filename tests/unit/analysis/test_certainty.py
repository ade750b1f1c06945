"""Uncertainties of a battery tester's numbers, from first principles."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hil.analysis.battery.certainty import Certainty
from hil.analysis.battery.cycles import cycles
from hil.analysis.battery.series import series

KNOWN = Certainty(interval=5.0, voltage=0.01, current=0.002, temperature=0.5, drift=3e-4, drift_uncertainty=4e-4)
NOTHING = Certainty(interval=5.0)
HALF = SimpleNamespace(duration=7200.0, mean_voltage=3.7, charge=1.4, last_change=0.03)


def test_a_time_has_a_line_at_each_end_and_the_clock():
    """Two rectangular intervals of one line make a triangle of variance interval^2 / 6; the clock adds its share."""
    rng = np.random.default_rng(1)
    ends = rng.uniform(0, 5, (2, 200_000))
    assert KNOWN.clock == pytest.approx(5e-4)
    assert NOTHING.time(100.0) is None
    assert Certainty(interval=5.0, drift=0.0, drift_uncertainty=0.0).time(1e4) == pytest.approx(
        (ends[1] - ends[0]).std(), rel=0.01
    )
    assert KNOWN.time(1e4) == pytest.approx(math.hypot(5.0 / math.sqrt(6.0), 5.0))


def test_a_time_to_a_level_moves_with_the_meter():
    """An offset of the meter shifts the crossing by its sensitivity."""
    assert KNOWN.time_to(0.0, 0.01, 300.0) == pytest.approx(math.hypot(5.0 / math.sqrt(6.0), 3.0))
    assert KNOWN.time_to(0.0, None, 300.0) is None
    assert KNOWN.time_to(0.0, 0.01, math.nan) is None
    assert NOTHING.time_to(0.0, 0.01, 300.0) is None


def test_charge_and_energy_have_the_offset_all_the_time():
    """2 mA for two hours are 4 mAh; the energy has that at the mean voltage, and the voltage's at the charge."""
    assert KNOWN.charge(HALF) == pytest.approx(0.004)
    assert KNOWN.energy(HALF) == pytest.approx(math.hypot(0.004 * 3.7, 0.01 * 1.4))
    assert (NOTHING.charge(HALF), NOTHING.energy(HALF)) == (None, None)


def test_an_offset_counts_in_both_half_cycles():
    """What it adds to the charge it takes from the discharge: the ratio has both, in full."""
    made = SimpleNamespace(charge=HALF, discharge=HALF)
    offset = 0.002 * 2
    ratio = (1.4 - offset) / (1.4 + offset)
    assert KNOWN.ratio(made, 1.0) == pytest.approx(1.0 - ratio, rel=0.01)
    assert NOTHING.ratio(made, 1.0) is None


def test_ends_and_resistances():
    """The end came between two lines; a resistance is the difference of two voltages."""
    assert KNOWN.end_of(HALF) > 0.01
    assert KNOWN.end_of(SimpleNamespace(last_change=math.nan)) is None
    assert NOTHING.end_of(HALF) is None
    assert KNOWN.resistance(-0.7) == pytest.approx(0.01 * math.sqrt(2) / 0.7)
    assert NOTHING.resistance(0.7) is None


def test_a_gain_is_in_all_of_a_charge_and_in_no_efficiency():
    """0.1 % of 1.4 Ah, beside the offset; energy has the gain of the voltage, too."""
    known = Certainty(interval=5.0, voltage=0.01, current=0.002, current_gain=0.001, voltage_gain=0.002)
    assert known.charge(HALF) == pytest.approx(math.hypot(0.004, 0.0014))
    assert known.energy(HALF) == pytest.approx(math.hypot(0.004 * 3.7, 0.0014 * 3.7, 0.01 * 1.4, 0.002 * 1.4 * 3.7))
    made = SimpleNamespace(charge=HALF, discharge=HALF)
    assert known.ratio(made, 1.0) == KNOWN.ratio(made, 1.0)


def test_moments_of_switching_are_as_uncertain_as_stated():
    """A discharge of 1 A that begins and ends at any moment between samples: the pull has a deviation of one."""
    rng = np.random.default_rng(1)
    time = np.arange(0.0, 3000.0, 60.0)
    pulls = []
    for begin, lasts in zip(rng.uniform(300.0, 360.0, 200), rng.uniform(1800.0, 1860.0, 200), strict=True):
        current = np.where((time >= begin) & (time < begin + lasts), -1.0, 0.0)
        (made,) = cycles(series(time, 4.0 - time / 6000.0, current))
        charge, energy = Certainty(interval=60.0).flowed(made.discharge)
        pulls.append((made.discharge.charge - lasts / 3600.0) / charge)
        assert energy == pytest.approx(charge * made.discharge.mean_voltage, rel=0.02)
    assert 0.85 < np.std(pulls) < 1.15
    assert abs(np.mean(pulls)) < 0.25
