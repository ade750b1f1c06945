"""Counts as quantities: one by one and many at once, and the counts that are no number."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hil.instruments.sensors.scale import Scale


def test_counts_at_a_rail_are_nan():
    """One count inside is a number."""
    counts = np.array([-32768, -32767, -32766, 0, 32766, 32767], np.int16)
    scale = Scale(per_unit=2.0, rails=(-32767, 32767))
    numbers = scale.numbers(counts)
    assert np.isnan(numbers).tolist() == [True, True, False, False, False, True]
    assert numbers[2:5].tolist() == [-16383.0, 0.0, 16383.0]


def test_beyond_full_scale_is_nan():
    """Full scale itself is a number, in the unit of the quantity."""
    scale = Scale(per_unit=10.0, factor=100.0, full_scale=4.0)
    assert scale.number(40) == 400.0
    assert scale.number(-40) == -400.0
    assert math.isnan(scale.number(41))
    assert np.isnan(scale.numbers(np.array([40, 41, -41], np.int16))).tolist() == [False, True, True]


@pytest.mark.parametrize(
    "scale",
    [
        Scale(per_unit=132.48, zero=25.0, rails=(-32768, 32768)),
        Scale(per_unit=6842.0, factor=100.0, full_scale=4.0, rails=(-32768, 32767)),
    ],
)
def test_one_by_one_and_many_at_once_are_the_same_bits(scale):
    """A stream and a single sample give one number for one reading."""
    counts = np.arange(-32768, 32768, 7).astype(np.int16)
    single = np.array([scale.number(int(number)) for number in counts])
    assert np.array_equal(single, scale.numbers(counts), equal_nan=True)


def test_resolution_is_one_count():
    """In the unit of the quantity."""
    assert Scale(per_unit=6842.0, factor=100.0).resolution == 100.0 / 6842.0
