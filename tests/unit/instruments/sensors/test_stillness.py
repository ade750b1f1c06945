"""A sensor that gives the same numbers again and again does not measure."""

from __future__ import annotations

import numpy as np
import pytest

from hil.instruments.sensors.scale import Scale
from hil.instruments.sensors.stillness import Stillness
from hil.model.errors import NoReply

SCALE = Scale(per_unit=1.0, rails=(-32767, 32767))


def still(noise=3.0):
    """Return a watch over a sensor whose numbers end at +/-32767."""
    return Stillness("gyro", SCALE, noise)


def test_equal_samples_are_counted_over_blocks():
    """Ten and six equal samples are sixteen; one other in between starts the count again."""
    same = np.full((10, 3), 7, np.int16)
    watch = still()
    watch.judge_many(same)
    watch.judge_many(np.array([[8, 7, 7]], np.int16))
    watch.judge_many(same)
    watch.judge_many(same[:5])
    with pytest.raises(NoReply, match="16 consecutive samples"):
        watch.judge_many(same[:1])


def test_single_samples_and_blocks_are_one_row():
    """Whoever read them."""
    watch = still()
    watch.judge_many(np.array([[1, 2, 4], *[[1, 2, 3]] * 5], np.int16))
    for _ in range(10):
        watch.judge((1, 2, 3))
    with pytest.raises(NoReply, match="16 consecutive samples are equal, the sensor is stuck"):
        watch.judge((1, 2, 3))


def test_equal_samples_mean_nothing_without_noise_or_numbers():
    """In a range wider than the noise, and while every axis is without a number, equal samples are usual."""
    still(0.9).judge_many(np.full((100, 3), 7, np.int16))
    Stillness("gyro", SCALE, 0.3, patience=1.0).judge_many(np.full((2000, 3), 7, np.int16))
    for number in (-32768, -32767, 32767):
        still().judge_many(np.full((100, 3), number, np.int16))


@pytest.mark.parametrize(("noise", "longest"), [(0.9, 21), (0.65, 63), (0.5, 278)])
def test_a_quiet_sensor_is_stuck_after_more_equal_samples(noise, longest):
    """With 0.4 of a typical article's noise, in the middle of a count, an article is never called stuck."""
    quiet = np.rint(np.random.default_rng(7).normal(0.0, 0.4 * noise, (200_000, 3))).astype(np.int16)
    watch = Stillness("gyro", SCALE, noise, patience=1.0)
    for at in range(0, len(quiet), 500):
        watch.judge_many(quiet[at : at + 500])
    watch.judge_many(np.array([[9, 9, 9]], np.int16))
    watch.judge_many(np.full((longest - 1, 3), 7, np.int16))
    with pytest.raises(NoReply, match=f"{longest} consecutive samples are equal"):
        watch.judge((7, 7, 7))
    slower = Stillness("gyro", SCALE, noise, patience=2.0)
    slower.judge_many(np.full((longest + 1, 3), 7, np.int16))


def test_one_axis_with_a_number_is_enough():
    """Two at their rails and one that stands still are no measurement."""
    with pytest.raises(NoReply):
        still().judge_many(np.full((16, 3), (7, 32767, 32767), np.int16))
