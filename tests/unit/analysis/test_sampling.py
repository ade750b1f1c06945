"""How timestamps are judged."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hil.analysis.sampling import assess, placed, with_holes
from hil.model.errors import Refused


def test_even_timestamps_have_a_rate_and_no_jitter():
    """A thousand samples at 100 Hz."""
    report = assess(np.arange(1000) / 100.0)
    assert report.rate == pytest.approx(100.0)
    assert report.duration == pytest.approx(9.99)
    assert report.jitter_max < 1e-12
    assert report.even


def test_jitter_is_told_as_rms_and_maximum():
    """Intervals of 9 and 11 ms in turn: 100 Hz with 1 ms of jitter."""
    report = assess(np.concatenate([[0.0], np.cumsum(np.tile([0.009, 0.011], 50))]))
    assert report.rate == pytest.approx(100.0)
    assert report.jitter_rms == pytest.approx(0.001)
    assert report.jitter_max == pytest.approx(0.001)
    assert report.even


def test_a_gap_is_counted_and_does_not_lower_the_rate():
    """Ten samples missing out of a hundred at 10 Hz."""
    times = np.delete(np.arange(100) / 10.0, np.s_[40:50])
    report = assess(times)
    assert (report.gaps, report.missing) == (1, 10)
    assert report.longest_gap == pytest.approx(1.1)
    assert report.rate == pytest.approx(10.0)
    assert not report.even


def test_repeated_and_reversed_timestamps_are_counted():
    """One repetition and one step backwards."""
    report = assess([0.0, 1.0, 1.0, 2.0, 1.5, 2.5, 3.5])
    assert (report.duplicates, report.reversals) == (1, 1)
    assert not report.even


@pytest.mark.parametrize(
    ("times", "why"),
    [
        ([0.0, 1.0], "2 timestamps do not tell"),
        ([0.0, math.nan, 2.0], "timestamp 2 is not a finite number"),
        ([5.0, 5.0, 5.0], "no timestamp is later"),
    ],
)
def test_timestamps_that_tell_no_rate_are_refused(times, why):
    """Too few, not finite, or standing still."""
    with pytest.raises(Refused, match=why):
        assess(times)


@pytest.mark.parametrize("size", [1e150, 1e-150])
def test_times_that_cannot_be_are_refused(size):
    """Squares of their rates would be no numbers."""
    with pytest.raises(Refused, match="apart, which cannot be"):
        assess(size * np.arange(100.0))


def test_missing_samples_become_holes():
    """A gap of ten samples becomes ten NaN, also where the rate is a little off."""
    times = np.delete(np.arange(1000) / 10.0, np.s_[400:410])
    grid = with_holes(placed(times * 1.001)[1], np.arange(990.0))
    assert grid.size == 1000
    assert np.flatnonzero(np.isnan(grid)).tolist() == list(range(400, 410))
    assert grid[410] == 400.0


def test_a_record_that_is_nearly_all_hole_is_refused():
    """Ten times more samples missing than there are."""
    with pytest.raises(Refused, match="497 samples are missing"):
        with_holes(np.array([0, 1, 2, 500]), [1.0, 2.0, 3.0, 4.0])


@pytest.mark.parametrize("rate", [952.0, 1030.0, 1500.0])
def test_rounded_timestamps_lose_nothing(rate):
    """Whole milliseconds of rates that are none: no sample is missing, none repeats, and the rate is right."""
    report = assess(np.floor(np.arange(10_000) / rate * 1e3) / 1e3)
    assert report.rounded
    assert report.even
    assert abs(report.rate - rate) < 3.0 * report.rate_uncertainty
    assert report.jitter < 0.05


def test_a_real_gap_between_rounded_timestamps_is_counted():
    """952 Hz in whole milliseconds without 500 samples."""
    report, places = placed(np.delete(np.floor(np.arange(10_000) / 952.0 * 1e3) / 1e3, np.s_[4000:4500]))
    assert (report.gaps, abs(report.missing - 500) <= 1) == (1, True)
    assert abs(int(places[-1]) - 9999) <= 1


def test_samples_lost_on_a_coarse_grid_are_missing():
    """100 Hz written in hundredths: rounding explains no interval of two."""
    kept = np.random.default_rng(1).random(10_000) > 0.05
    report = assess(np.arange(10_000)[kept] / 100.0)
    assert not report.rounded
    assert report.missing == 10_000 - kept.sum() - np.argmax(kept) - np.argmax(kept[::-1])


@pytest.mark.parametrize("spread", [0.0, 1e-4])
def test_bursts_are_even_samples(spread):
    """Ten samples at once, each 0.1 s: 100 Hz, nothing repeats and nothing is missing."""
    report = assess(np.repeat(np.arange(200) / 10.0, 10) + np.tile(np.arange(10) * spread, 200))
    assert report.even
    assert report.burst == pytest.approx(10.0)
    assert report.rate == pytest.approx(100.0, rel=1e-9)


def test_jitter_of_a_third_loses_nothing_and_widens_the_rate():
    """Intervals that scatter by a third: no gaps; the rate is known by what adds up."""
    for seed in range(20):
        walk = np.cumsum(np.abs(1.0 + np.random.default_rng(seed).standard_normal(5000) / 3.0)) / 100.0
        report = assess(walk)
        assert report.gaps <= 1
        assert abs(report.rate - 100.0) < 4.0 * report.rate_uncertainty
    host = assess(np.arange(5000) / 100.0 + np.random.default_rng(0).uniform(-1.0, 1.0, 5000) / 300.0)
    assert abs(host.rate - 100.0) < 4.0 * host.rate_uncertainty < 0.1
