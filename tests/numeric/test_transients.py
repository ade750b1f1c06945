"""Transients against what is known in closed form: exponentials, steps, triangles."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hil.analysis import charge, crossing, joule_integral, peak, rise_time, time_above, time_below
from hil.model.errors import Refused
from hil.model.figure import FigureStatus

TAU = 1e-3
TIME = np.arange(-2000, 10_000) * 1e-6
CHARGED = np.where(TIME < 0, 0.0, 5.0 * (1 - np.exp(-np.maximum(TIME, 0) / TAU)))
INRUSH = np.where(TIME < 0, 0.0, 2.5 * np.exp(-np.maximum(TIME, 0) / TAU))


def test_rise_time_of_an_exponential():
    """From 10 to 90 %: tau ln 9; a fall is treated alike."""
    found = rise_time(TIME, CHARGED, top=5.0)
    assert found.value == pytest.approx(TAU * math.log(9), rel=1e-4)
    assert found.uncertainty == pytest.approx(math.sqrt(2 / 3) * 1e-6, rel=1e-3)
    assert rise_time(TIME, -CHARGED, top=-5.0).value == pytest.approx(found.value, rel=1e-9)
    assert rise_time(TIME, CHARGED).value == pytest.approx(found.value, rel=1e-3)


def test_crossing_and_times_beyond_a_level():
    """Half of the final value is crossed at tau ln 2."""
    half = TAU * math.log(2)
    assert crossing(TIME, CHARGED, 2.5).value == pytest.approx(half, abs=1e-9)
    assert time_above(TIME, CHARGED, 2.5).value == pytest.approx(TIME[-1] - half, abs=1e-8)
    assert time_below(TIME, CHARGED, 2.5).value == pytest.approx(half - TIME[0], abs=1e-8)
    assert crossing(TIME, INRUSH, 1.25, rising=False).value == pytest.approx(half, abs=1e-9)
    assert crossing(TIME, CHARGED, 6.0).status is FigureStatus.NOT_OBSERVABLE
    assert crossing(TIME, CHARGED, 2.5, after=5e-3).status is FigureStatus.NOT_OBSERVABLE


def test_joule_integral_of_an_inrush():
    """A peak of 2.5 A that decays: I² tau / 2; a step of the converter counts twice as much as in the charge."""
    found = joule_integral(TIME, INRUSH, "A")
    assert (found.value, found.unit) == (pytest.approx(2.5**2 * TAU / 2, rel=2e-3), "A².s")
    coarse = joule_integral(TIME, INRUSH, "A", resolution=0.04)
    assert coarse.uncertainty == pytest.approx(2 * 2.5 * TAU * 0.04 / math.sqrt(12), rel=0.01)


def test_peak_and_charge_of_an_inrush():
    """The peak is V/R, the charge that of the capacitor, each within its uncertainty."""
    found = peak(TIME, INRUSH, "A")
    assert (found.value, found.unit) == (2.5, "A")
    assert found.uncertainty == pytest.approx(2.5e-3 / math.sqrt(3), rel=1e-3)
    total = charge(TIME, INRUSH, "A")
    assert total.unit == "A.s"
    assert total.value == pytest.approx(2.5 * TAU, abs=2 * total.uncertainty)
    assert charge(TIME, INRUSH, "A", until=TAU).value == pytest.approx(2.5 * TAU * (1 - math.exp(-1)), rel=2e-3)
    assert charge(TIME, INRUSH + 1.0, "A").value == pytest.approx(total.value, rel=1e-9)
    assert charge(TIME, INRUSH + 1.0, "A", baseline=0.0).value == pytest.approx(total.value + TIME[-1], rel=1e-3)


@pytest.mark.system
def test_errors_stay_within_three_uncertainties():
    """Sampled at any phase and quantised, every figure is where its uncertainty says: 400 captures, fixed seed."""
    random = np.random.default_rng(14)
    truth = {"rise": TAU * math.log(9), "half": TAU * math.log(2), "peak": 2.5, "charge": 2.5 * TAU}
    beyond = dict.fromkeys(truth, 0)
    for _ in range(400):
        step = random.choice([0.02, 0.05])
        time = np.arange(-100, 600) * 12e-3 / 700 + random.uniform(0, 2e-5)
        rail = np.rint(np.where(time < 0, 0, 5 * (1 - np.exp(-np.maximum(time, 0) / TAU))) / step) * step
        draw = np.rint(np.where(time < 0, 0, 2.5 * np.exp(-np.maximum(time, 0) / TAU)) / step) * step
        found = {
            "rise": rise_time(time, rail, top=5.0, base=0.0, resolution=step),
            "half": crossing(time, rail, 2.5, resolution=step),
            "peak": peak(time, draw, "A", resolution=step),
            "charge": charge(time, draw, "A", resolution=step),
        }
        for name, figure in found.items():
            beyond[name] += abs(figure.value - truth[name]) > 3 * figure.uncertainty
    assert max(beyond.values()) <= 4, beyond


def test_noise_and_many_samples_per_count():
    """With noise, and with hundreds of samples per count: within what is said, without bias."""
    random = np.random.default_rng(15)
    pulls = {"rise": [], "half": []}
    for turn in range(100):
        noise = (0.0, 0.08)[turn % 2]
        rail = np.round((CHARGED + noise * random.standard_normal(TIME.size)) / 0.2) * 0.2
        found = {"rise": rise_time(TIME, rail, resolution=0.2), "half": crossing(TIME, rail, 2.5, resolution=0.2)}
        for name, truth in (("rise", TAU * math.log(9)), ("half", TAU * math.log(2))):
            pulls[name].append((found[name].value - truth) / found[name].uncertainty)
    for each in pulls.values():
        assert np.abs(each).max() <= 3
        assert abs(np.mean(each)) <= 1


def test_a_step_between_two_samples():
    """The level may have been crossed anywhere between them."""
    time, values = np.arange(-5.0, 5.0), np.where(np.arange(-5.0, 5.0) < 0, 0.0, 1.0)
    found = crossing(time, values, 0.5)
    assert (found.value, found.uncertainty) == (-0.5, pytest.approx(1 / math.sqrt(3)))


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda: crossing([0, 1], [0, 1], 0.5), "no waveform"),
        (lambda: crossing([0, 1, 2], [0, 1], 0.5), "no waveform"),
        (lambda: crossing([0, 1, 1], [0, 1, 2], 0.5), "do not rise"),
        (lambda: peak([0, 1, 2], [0, math.nan, 2], "A"), "not finite"),
        (lambda: rise_time([0, 1, 2], [0, 1, 2]), "tells the base"),
        (lambda: rise_time([-1, 1, 2], [0, 1, 2], low=0.9, high=0.1), "of the way"),
        (lambda: charge([-3, -2, -1], [0, 1, 2], "A"), "1 samples lie"),
    ],
)
def test_what_is_no_waveform_is_refused(ask, message):
    """In words that say what is missing."""
    with pytest.raises(Refused, match=message):
        ask()


def test_what_cannot_be_seen_is_not_observable():
    """A peak at the end of the capture, a transition of a few counts."""
    assert peak([0, 1, 2], [0, 1, 2], "V").status is FigureStatus.NOT_OBSERVABLE
    small = rise_time(TIME, CHARGED, top=0.1, base=0.0, resolution=0.04)
    assert small.status is FigureStatus.NOT_OBSERVABLE
