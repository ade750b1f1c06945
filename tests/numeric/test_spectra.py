"""The spectra against an independent library, noise and sines of known level, and as statistics."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sweeps
from scipy import signal

from hil.analysis import Welch, agreement, characterise, psd, spectrum
from hil.analysis.spectra.lines import find
from hil.analysis.spectra.welch import DETRENDS, WINDOWS
from hil.analysis.tracing import samples
from hil.model.errors import Refused
from hil.model.figure import FigureStatus
from hil.model.provenance import Provenance

RATE = 100.0
TERMS = ("white", "flicker", "random_walk", "quantisation")
CASES = (
    {"white": 0.01},
    {"white": 0.01, "flicker": 0.02},
    {"white": 0.01, "random_walk": 0.02},
    {"white": 0.01, "quantisation": 3e-4},
)


def noise(seed, count, *, white=0.0, flicker=0.0, random_walk=0.0, quantisation=0.0):
    """Rate noise with exact levels, at 100 Hz."""
    generator = np.random.default_rng(seed)
    values = white * math.sqrt(RATE) * generator.standard_normal(count)
    if flicker:
        shaped = np.fft.rfft(generator.standard_normal(2 * count))
        frequency = np.fft.rfftfreq(2 * count, 1.0 / RATE)
        frequency[0] = np.inf
        values += np.fft.irfft(shaped * flicker * np.sqrt(RATE / (2.0 * np.pi * frequency)))[:count]
    values += np.cumsum(random_walk / math.sqrt(RATE) * generator.standard_normal(count))
    angle = quantisation * math.sqrt(3.0) * generator.uniform(-1.0, 1.0, count + 1)
    return values + np.diff(angle) * RATE


def sine(count, frequency, amplitude):
    """A sine at 100 Hz."""
    return amplitude * np.sin(2.0 * np.pi * frequency * np.arange(count) / RATE + 0.4)


@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize("detrend", DETRENDS)
@pytest.mark.parametrize(("segment", "overlap"), [(256, 0.5), (1000, 0.75), (333, 0.0)])
def test_densities_are_those_of_scipy(window, detrend, segment, overlap):
    """To 1e-12, with an offset, for even and odd segments."""
    data = np.random.default_rng(1).standard_normal(5000) + 3.0
    found = spectrum(data, 7.0, how=Welch(segment=segment, window=window, overlap=overlap, detrend=detrend))
    frequency, expected = signal.welch(
        data, 7.0, window=window, nperseg=segment, noverlap=int(overlap * segment),
        detrend=False if detrend == "none" else detrend,
    )  # fmt: skip
    assert found.frequency == pytest.approx(frequency)
    largest = float(expected.max())
    assert found.density == pytest.approx(expected, rel=1e-12, abs=1e-12 * largest)
    taps = signal.get_window(window, segment)
    assert found.bandwidth == pytest.approx(7.0 * (taps**2).sum() / taps.sum() ** 2)


@pytest.mark.system
def test_segments_longer_than_a_block_are_those_of_scipy():
    """Four at a time, the last time fewer."""
    data = np.random.default_rng(1).standard_normal(250_000)
    expected = signal.welch(data, 7.0, nperseg=1 << 16)[1]
    assert spectrum(data, 7.0, how=Welch(segment=1 << 16)).density == pytest.approx(expected, rel=1e-11, abs=1e-12)


@pytest.mark.parametrize("overlap", [0.0, 0.5, 0.75])
def test_intervals_hold_the_true_density_as_often_as_stated(overlap):
    """White noise of known density, pooled over records and every fourth point, which are independent."""
    held = []
    for seed in range(40):
        data = np.random.default_rng(seed).standard_normal(4096)
        found = spectrum(data, RATE, how=Welch(segment=256, overlap=overlap, confidence=0.9))
        true = 2.0 / RATE
        part = slice(4, -4, 4)
        held += ((found.low[part] <= true) & (true <= found.high[part])).tolist()
    assert np.mean(held) == pytest.approx(0.9, abs=4.0 * math.sqrt(0.09 / len(held)))


@pytest.mark.parametrize("window", WINDOWS)
def test_a_sine_has_its_amplitude_and_frequency(window):
    """Off the middle of a point; the one that is stated to be worse, without a window, within its uncertainty, too."""
    data = noise(2, 20_000, white=0.01) + sine(20_000, 12.3456, 0.2)
    (line,) = find(spectrum(data, RATE, unit="deg/s", how=Welch(window=window, segment=2048)))
    assert line.frequency.value == pytest.approx(12.3456, abs=3.0 * line.frequency.uncertainty)
    assert line.amplitude.value == pytest.approx(0.2, rel=0.02, abs=3.0 * line.amplitude.uncertainty)
    assert line.amplitude.unit == "deg/s"
    assert line.narrow
    assert line.false_alarm < 1e-9


def test_a_resonance_is_wider_than_a_sine():
    """Noise of a system that rings at 20 Hz."""
    pole = 0.995 * np.exp(2j * np.pi * 0.2)
    ringing = signal.lfilter(
        [0.05], [1.0, -2.0 * pole.real, abs(pole) ** 2], np.random.default_rng(3).standard_normal(60_000)
    )
    lines = find(spectrum(np.random.default_rng(4).standard_normal(60_000) + ringing, RATE))
    (line,) = [each for each in lines if abs(each.frequency.value - 20.0) < 0.5][:1]
    assert not line.narrow


@pytest.mark.parametrize(
    ("rate", "frequencies", "rotation", "origins"),
    [
        (1000.0, (50.05, 150.1), None, ("50 Hz mains", "harmonic 3 of 50 Hz mains")),
        (1000.0, (60.0,), None, ("60 Hz mains",)),
        (110.0, (10.0, 50.0), None, ("alias of harmonic 2 of 50 Hz mains", "50 Hz mains")),
        (1000.0, (33.0, 66.0), 33.0, ("the table's rotation", "harmonic 2 of the table's rotation")),
        (1000.0, (33.0, 99.0), None, ("", "harmonic 3 of 33")),
    ],
)
def test_lines_are_named(rate, frequencies, rotation, origins):
    """By mains, by what they are an alias of, by the table's rotation, by a lower line."""
    time = np.arange(40_000) / rate
    data = np.random.default_rng(5).standard_normal(time.size)
    data += sum(0.5 * np.sin(2.0 * np.pi * each * time) for each in frequencies)
    lines = find(spectrum(data, rate), rotation=rotation)
    assert [line.origin[: len(origin)] for line, origin in zip(lines, origins, strict=True)] == list(origins)
    assert (lines[0].origin == "") == (origins[0] == "")


@pytest.mark.parametrize(
    "level", [{"white": 0.01}, pytest.param({"white": 0.01, "random_walk": 0.05}, marks=pytest.mark.system)]
)
def test_noise_gives_lines_no_more_often_than_stated(level):
    """A false-alarm rate of 5 %, pooled over records."""
    rounds = 80 if level == {"white": 0.01} else 400
    found = [bool(find(spectrum(noise(seed, 3000, **level), RATE), false_alarm=0.05)) for seed in range(rounds)]
    assert np.mean(found) <= 0.05 + 3.0 * math.sqrt(0.05 * 0.95 / rounds)


@pytest.mark.parametrize("level", CASES, ids="+".join)
def test_coefficients_are_those_put_in(level):
    """Within 4 standard uncertainties each; what was not put in is bounded, and not measured."""
    found = psd(noise(21, 1 << 16, **level), RATE, "deg/s")
    for term in TERMS:
        figure, truth = getattr(found, term), level.get(term, 0.0)
        assert figure.status is (FigureStatus.MEASURED if truth else FigureStatus.UPPER_LIMIT), term
        assert abs(figure.value - truth) <= 4.0 * figure.uncertainty or not truth
    assert [getattr(found, term).unit for term in TERMS] == ["deg/s/sqrt(Hz)", "deg/s", "deg/s*sqrt(Hz)", "deg/s*s"]
    assert found.density.value == pytest.approx(math.sqrt(2.0) * found.white.value)
    assert found.white.uncertainty < 0.01 * found.white.value


@pytest.mark.system
def test_uncertainties_of_coefficients_are_true():
    """Pulls of every term have a spread of 1, and 1 in 100 at most is invented, 1 in 100 records rejected."""
    pulls, invented, missed, bounds, rejected = {term: [] for term in TERMS}, 0, 0, 0, 0
    rounds = sweeps.chosen(25, 100)
    for level in CASES:
        for seed in range(rounds):
            found = psd(noise(1000 + seed, 1 << 15, **level), RATE, "deg/s")
            rejected += bool(found.remark)
            for term in TERMS:
                figure, truth = getattr(found, term), level.get(term, 0.0)
                if figure.status is FigureStatus.MEASURED:
                    invented += not truth
                    pulls[term] += [(figure.value - truth) / figure.uncertainty] if truth else []
                elif figure.status is FigureStatus.UPPER_LIMIT:
                    bounds += 1
                    missed += figure.value < truth
    for term, values in pulls.items():
        assert 0.8 <= np.std(values) <= 1.2, term
        assert abs(np.mean(values)) <= 0.35, term
    assert invented <= 0.01 * rounds * len(CASES) * 3
    assert missed <= 0.05 * bounds
    assert rejected <= 0.01 * rounds * len(CASES)


def test_a_line_and_a_filter_leave_the_white_noise():
    """A sine of ten times the noise is in no band; what a sensor's filter bends is left out, known or not."""
    data = noise(8, 1 << 16, white=0.01) + sine(1 << 16, 3.0, 1.0)
    clean = psd(data, RATE, "deg/s")
    assert clean.white.value == pytest.approx(0.01, abs=4.0 * clean.white.uncertainty)
    smooth = signal.lfilter(*signal.butter(2, 20.0, fs=RATE), noise(9, 1 << 16, white=0.01))
    for found in (psd(smooth, RATE, "deg/s"), psd(smooth, RATE, "deg/s", bandwidth=20.0)):
        assert found.white.status is FigureStatus.MEASURED
        assert found.white.value == pytest.approx(0.01, abs=3.0 * found.white.uncertainty)
        assert found.highest < 12.0
    assert found.highest <= 5.0


def test_noise_that_is_none_of_the_four_is_rejected():
    """A wide hump of noise."""
    low, high = signal.butter(1, [2.0, 6.0], "bandpass", fs=RATE)
    data = noise(10, 1 << 16, white=0.001) + signal.lfilter(low, high, noise(11, 1 << 16, white=0.05))
    found = psd(data, RATE, "deg/s")
    assert found.white.status is FigureStatus.MODEL_REJECTED
    assert found.white.uncertainty is None
    assert "do not describe this spectrum" in found.remark


def test_missing_samples_leave_the_level():
    """4 % of single samples, and a long gap: its segments are left out."""
    data = noise(12, 1 << 16, white=0.01) + 0.5
    data[np.random.default_rng(1).random(data.size) < 0.04] = np.nan
    data[20_000:24_000] = np.nan
    with pytest.raises(Refused, match="not all finite"):
        psd(data, RATE, "deg/s")
    found = psd(data, RATE, "deg/s", holes=True)
    assert found.spectrum.missing == np.isnan(data).sum()
    assert found.white.value == pytest.approx(0.01, abs=4.0 * found.white.uncertainty)
    with pytest.raises(Refused, match="misses more than 5%"):
        spectrum(np.where(np.arange(4000) % 10, data[:4000], np.nan), RATE, holes=True)


@pytest.mark.parametrize(
    ("give", "message"),
    [
        (lambda x: spectrum(x[:8], RATE), "too few for a spectrum"),
        (lambda x: spectrum(x, 0.0), "no sampling rate"),
        (lambda x: spectrum(x, RATE, how=Welch(segment=5000)), "segment of 5000"),
        (lambda x: spectrum(x, RATE, how=Welch(overlap=1.0)), "overlap 1"),
        (lambda x: spectrum(x, RATE, how=Welch(window="kaiser")), "no window that is known"),
        (lambda x: spectrum(np.append(x, np.inf), RATE, holes=True), "not all finite"),
    ],
)
def test_what_is_not_possible_is_refused(give, message):
    """Each with what can be chosen."""
    with pytest.raises(Refused, match=message):
        give(np.ones(4000))


@pytest.mark.parametrize(
    ("data", "remark"), [(np.full(4000, 17.9), "stuck"), (np.random.default_rng(1).random(20), "too few")]
)
def test_what_shows_no_noise_is_not_observable(data, remark):
    """All samples the same, and twenty of them."""
    found = psd(data, RATE, "deg/s")
    assert found.white.status is FigureStatus.NOT_OBSERVABLE
    assert remark in found.remark


@pytest.mark.parametrize("factor", [1e-90, 1e90])
def test_the_unit_may_be_any(factor):
    """Very small and very large numbers give the same figures in their unit."""
    data = noise(13, 1 << 14, white=0.01)
    one, other = psd(data, RATE, "1"), psd(data * factor, RATE, "1")
    assert other.white.value == pytest.approx(one.white.value * factor)
    assert other.white.uncertainty == pytest.approx(one.white.uncertainty * factor)


def test_a_spectrum_agrees_with_the_allan_deviation():
    """The ratios are 1 within their uncertainties, know where they come from, and show a wrong rate."""
    where = Provenance(instruments=("imu",), sources=("recording rest, x",))
    data = samples(noise(14, 1 << 16, white=0.01, flicker=0.02), where)
    spectral = psd(data, RATE, "deg/s")
    found = agreement(spectral, characterise(data, RATE, "deg/s"))
    assert found.white.value == pytest.approx(1.0, abs=3.0 * found.white.uncertainty)
    assert found.flicker.value == pytest.approx(1.0, abs=3.0 * found.flicker.uncertainty)
    assert found.white.unit == "1"
    assert found.white.provenance.sources == where.sources
    assert found.random_walk.status is found.quantisation.status is FigureStatus.NOT_OBSERVABLE
    wrong = agreement(spectral, characterise(data, 1.0, "deg/s"))
    assert abs(wrong.white.value - 1.0) > 10.0 * wrong.white.uncertainty
    assert found.doubts() == ()
    assert wrong.doubts()[0].startswith("white of the spectrum is 0.1 times")
