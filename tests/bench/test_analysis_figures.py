"""What the analyses of a long record cost."""

from __future__ import annotations

import numpy as np
import pytest

from hil.analysis.allan.deviation import ESTIMATORS, deviation
from hil.analysis.quality import Facts, tripped

SAMPLES = 1_440_000  # four hours at 100 Hz
RECORD = np.random.default_rng(1).standard_normal(SAMPLES)


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_a_deviation_of_four_hours(cost, estimator):
    """Octaves of one axis, with intervals."""
    curve = cost(
        f"{estimator} deviation of 1.44 million samples", lambda: deviation(RECORD, 100.0, estimator=estimator)
    )
    assert curve.m[-1] == 2**18


def test_the_quality_of_four_hours(cost):
    """All gates of three axes and a temperature."""
    time = np.arange(SAMPLES) / 100.0
    channels = {axis: np.rint(4.0 * RECORD) / 131.0 for axis in "xyz"} | {"temperature": np.full(SAMPLES, 25.0)}
    facts = Facts(rate=100.0, lsb=1.0 / 131.0, full_scale=250.0, bandwidth=25.0, temperature="temperature")
    assert not [gate for gate in cost("quality of four hours", lambda: tripped(time, channels, facts)) if gate.channel]
