"""Gates on a sensor that turns slowly through few counts: it repeats often where it turns back, and is not stuck."""

from __future__ import annotations

import numpy as np
import pytest

from hil.analysis.gates import repeated, stuck

SAMPLES, DEGREES = 130, 3.0  # of a recording on a table, and how far it turns from one to the next
NOISE = 0.86  # counts rms


def turning(seed, recordings, sizes=(0.0, 15.0)):
    """Return counts (recordings, 3, 130) of axes that turn through few counts; through none points along the axis."""
    generator = np.random.default_rng(seed)
    shape = (recordings, 3, 1)
    size, start = generator.uniform(*sizes, shape), generator.uniform(0.0, 360.0, (recordings, 1, 1))
    phase = np.radians(start + [[0.0], [90.0], [180.0]] + DEGREES * np.arange(SAMPLES))
    signal = size * np.sin(phase) + generator.uniform(-50.0, 50.0, shape)
    return np.rint(signal + NOISE * generator.standard_normal((recordings, 3, SAMPLES)))


def test_what_turns_slowly_is_not_stuck():
    """In 2000 recordings of three axes: runs of a dozen equal samples are chance where an axis turns back."""
    gates = [stuck("any", axis) for axes in turning(1, 2000) for axis in axes]
    assert [gate.reason for gate in gates if gate.ok is False] == []


def test_rows_of_what_turns_slowly_may_repeat():
    """Fewer than a dozen of 129 rows do by chance."""
    gates = [repeated(dict(zip("xyz", axes, strict=True))) for axes in turning(2, 2000)]
    assert [gate.reason for gate in gates if gate.ok is False] == []


@pytest.mark.parametrize("lasts", [45, 60, 90])
def test_an_axis_that_stops_is_stuck(lasts):
    """For a third of the recording, a half, or most of it, whatever the axis would have done."""
    for axes in turning(3, 300):
        axes[1, 15 : 15 + lasts] = axes[1, 15]
        gate = stuck("y", axes[1])
        assert gate.ok is False
        first, last = gate.samples
        assert first <= 16
        assert last >= 15 + lasts


def test_a_sensor_that_is_read_twice_repeats():
    """Every other row is the one before, in a recording as short as these."""
    for axes in turning(4, 300, sizes=(100.0, 200.0)):
        twice = np.repeat(axes[:, ::2], 2, axis=1)
        assert repeated(dict(zip("xyz", twice, strict=True))).ok is False
