"""Noise of a sensor at its levels: against its own expectation and allantools, in one piece and in many."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import allantools
import numpy as np
import pytest

from hil.analysis import NoiseLevels, SensorModel, SimulatedSensor, simulate
from hil.analysis.noise.series import expected, noise

RATE, COUNT, RECORDS = 10.0, 2**13, 24
M = 2 ** np.arange(11)
FLOOR = 2 * np.log(2) / np.pi
KINDS = {
    "white": NoiseLevels(white=3.4e-3),
    "flicker": NoiseLevels(flicker=4.5e-4),
    "random_walk": NoiseLevels(random_walk=1e-4),
    "quantisation": NoiseLevels(quantisation=2e-2),
    "all": NoiseLevels(white=1.0, flicker=0.5, random_walk=0.1, quantisation=0.1, ramp=1e-3),
}
SENSOR = SensorModel(levels=NoiseLevels(white=1e-2, flicker=1e-3, random_walk=1e-4), rate=RATE)


def variances(values):
    """Return the overlapping Allan variance of a record, as allantools has it."""
    found, deviation, _, _ = allantools.oadev(values, rate=RATE, data_type="freq", taus=M / RATE)
    assert found == pytest.approx(M / RATE)
    return deviation**2


@pytest.mark.parametrize("kind", KINDS)
def test_a_record_has_its_levels_at_every_averaging_time(kind):
    """The mean over many records is the expectation, within 4.5 standard errors; at the shortest times within 1 %."""
    rows = [variances(noise(KINDS[kind], COUNT, RATE, np.random.default_rng(seed))) for seed in range(RECORDS)]
    ratios = np.array(rows) / expected(KINDS[kind], COUNT, RATE, M)
    away = ratios.mean(axis=0) - 1.0
    assert (np.abs(away) < 4.5 * ratios.std(axis=0, ddof=1) / np.sqrt(RECORDS)).all()
    assert np.abs(away[:2]).max() < 0.01


def test_a_ramp_is_exact():
    """R tau/sqrt(2)."""
    values = noise(NoiseLevels(ramp=0.02), COUNT, RATE, np.random.default_rng(1))
    assert variances(values) == pytest.approx((0.02 * M / RATE) ** 2 / 2, rel=1e-6)


def test_flicker_is_at_its_floor():
    """2 ln 2/pi B^2 within a few per cent from four samples to a sixteenth of the record; 9 % above at one sample."""
    ratio = np.sqrt(expected(NoiseLevels(flicker=3.0), COUNT, RATE, M) / (FLOOR * 9.0))
    assert ratio[2:-1] == pytest.approx(1.0, abs=0.02)
    assert ratio[0] == pytest.approx(1.09, abs=0.01)


@pytest.mark.parametrize("kind", KINDS)
def test_a_sensor_that_streams_has_the_same_levels(kind):
    """Flicker in octaves is 22 % above its floor at one sample, and within 5 % of it from there on."""
    model = SensorModel(levels=KINDS[kind], rate=RATE)
    rows = [variances(simulate(model, COUNT, seed=seed).values) for seed in range(RECORDS)]
    ratios = np.array(rows) / expected(KINDS[kind], COUNT, RATE, M)
    allowed = {"flicker": 0.1, "all": 0.03}.get(kind, 0.0)
    away = np.abs(ratios.mean(axis=0) - 1.0)[1:]
    assert (away < allowed + 4.5 * ratios.std(axis=0, ddof=1)[1:] / np.sqrt(RECORDS)).all()


@pytest.mark.parametrize("lost_run", [1, 7])
def test_pieces_are_the_whole(lost_run):
    """Read in pieces or at once, with temperature, jitter and losses: the same samples."""
    model = replace(SENSOR, bias=(0.1, 0.01), scale=(0.0, 1e-3), lsb=1e-3, jitter=1e-3, lost=0.1, lost_run=lost_run)
    count = 40_000
    truth, warmth = np.sin(np.arange(count)), np.linspace(20.0, 40.0, count)
    whole = simulate(model, count, seed=3, truth=truth, temperature=warmth)
    sensor, cuts = SimulatedSensor(model, seed=3), [0, 5, 6, 20_000, 20_003, count]
    pieces = [
        sensor.read(end - begin, truth=truth[begin:end], temperature=warmth[begin:end]) for begin, end in pairwise(cuts)
    ]
    assert np.array_equal(np.concatenate([piece.times for piece in pieces]), whole.times)
    assert np.array_equal(np.concatenate([piece.values for piece in pieces]), whole.values)
    assert len(whole.times) == pytest.approx(0.9 * count, rel=0.02)


def test_seeds_are_independent():
    """And one seed gives one record."""
    rows = np.array([simulate(SENSOR, COUNT, seed=seed).values for seed in (1, 2, 1)])
    assert np.array_equal(rows[0], rows[2])
    white = np.array([simulate(replace(SENSOR, levels=KINDS["white"]), COUNT, seed=seed).values for seed in range(8)])
    assert np.abs(np.corrcoef(white) - np.eye(8)).max() < 4.5 / np.sqrt(COUNT)


@pytest.mark.parametrize("lsb", [0.5, 1.0, 2.0])
def test_counts_add_a_twelfth_of_their_square(lsb):
    """Down to half a count of noise; values are whole counts."""
    model = SensorModel(levels=NoiseLevels(white=1.0 / np.sqrt(RATE)), rate=RATE, lsb=lsb)
    values = simulate(model, 2**16, seed=1).values
    assert values.var() == pytest.approx(1.0 + lsb**2 / 12.0, rel=0.03)
    assert np.array_equal(values, np.rint(values / lsb) * lsb)


def test_readings_stop_at_the_full_scale():
    """At the last whole count below it."""
    model = replace(SENSOR, full_scale=1.0, lsb=0.3)
    values = simulate(model, 1000, seed=1, truth=np.linspace(-3.0, 3.0, 1000)).values
    assert (values.min(), values.max()) == pytest.approx((-0.9, 0.9))


@pytest.mark.parametrize("bandwidth", [1.0, 5.0, 40.0])
def test_a_filter_lets_its_bandwidth_through(bandwidth):
    """2 N^2 BW, whatever the rate is."""
    model = SensorModel(levels=NoiseLevels(white=1e-2), rate=RATE, bandwidth=bandwidth)
    assert simulate(model, 2**16, seed=4).values.var() == pytest.approx(2e-4 * bandwidth, rel=0.05)


def test_bias_and_scale_follow_the_temperature():
    """Polynomials above the reference; a scale that grows with the truth only."""
    model = SensorModel(levels=NoiseLevels(), rate=RATE, bias=(1.0, 0.1, 0.01), scale=(0.0, 0.02), reference=20.0)
    warm = simulate(model, 2, seed=1, truth=[0.0, 10.0], temperature=30.0).values
    assert warm == pytest.approx([3.0, 3.0 + 10.0 * 1.2])
    assert simulate(model, 1, seed=1).values == pytest.approx([1.0])


def test_time_stamps_jitter_and_losses_leave_gaps():
    """About the grid of the samples, with the standard deviation that was asked for; lost ones come in runs."""
    model = replace(SENSOR, jitter=2e-3)
    times = simulate(model, 2**16, seed=5).times
    assert (times - np.arange(1, 2**16 + 1) / RATE).std() == pytest.approx(2e-3, rel=0.02)
    steps = np.rint(np.diff(simulate(replace(SENSOR, lost=0.05, lost_run=20), 2**18, seed=5).times) * RATE)
    gaps = steps[steps > 1] - 1
    assert gaps.min() == 20
    assert gaps.sum() / 2**18 == pytest.approx(0.05, rel=0.1)
