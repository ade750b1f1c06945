"""Noise coefficients from bands of a spectrum, and their agreement with those of an Allan deviation.

Definitions follow IEEE Std 952-1997, annex C: two-sided spectra of the rate N^2 (white), B^2 / (2 pi f) (flicker),
(K / 2 pi f)^2 (random walk) and (2 pi f)^2 Q^2 / rate (quantisation). One-sided densities are twice that.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.allan.results import NoiseModel
from hil.analysis.spectra.lines import Line, find, lobe
from hil.analysis.spectra.welch import Spectrum, Welch, degrees, interval, smear, spectrum
from hil.analysis.statistics import not_observable
from hil.analysis.tracing import traced
from hil.model.figure import Figure, FigureStatus

__all__ = ["Agreement", "Bands", "SpectralNoise", "agreement", "psd"]

_Array: TypeAlias = NDArray[np.float64]

_USUAL = Welch()
_TERMS, _QUANTISATION = 4, 3
_SUBSETS = tuple(subset for size in range(1, _TERMS + 1) for subset in combinations(range(_TERMS), size))
_PER_DECADE, _LEAST = 10, 3  # bands, and points in a band: neighbouring points are correlated, such bands hardly
_SMEARED = 128  # points from zero within which a slope is not straight over the width of the window
_ROUNDING = 1e-12  # of the value: what moves less does not move
_FEWEST = 6  # bands: one more than terms, and a degree of freedom for the misfit
_WORTH = 9.0  # of -2 ln(likelihood) that a term must explain: three standard deviations
_KNOWN = 2.0  # a measured square is at least twice its standard uncertainty
_WORST_TAIL = 1e-3  # a right model is rejected once in a thousand records
_MODEL_ERROR = 0.03  # of the root of the density
_CLEARLY = 4.0  # standard deviations
_MOST_CUT, _BESIDE = 9, 2  # bands: up to a factor of 8 in frequency; and those next to the ones that show a filter
_PASSED = 0.25  # of a filter's bandwidth: a second order takes 0.2 % of the root of the density there


@dataclass(frozen=True, slots=True, kw_only=True)
class Bands:
    """Band means of a spectrum without its lines, up to ten bands per decade; arrays of one shape (k,).

    Attributes:
        frequency: mean frequency in Hz.
        density: one-sided.
        edf: effective degrees of freedom.
        low: lower ends of the confidence intervals.
        high: upper ends of the confidence intervals.
        fitted: density of the fitted model; NaN where nothing was fitted.
    """

    frequency: _Array
    density: _Array
    edf: _Array
    low: _Array
    high: _Array
    fitted: _Array


@dataclass(frozen=True, slots=True, kw_only=True)
class SpectralNoise:
    """Noise model of a sensor, from the spectrum of a record at rest.

    Attributes:
        density: one-sided white-noise density as in data sheets: sqrt(2) N, in unit/sqrt(Hz).
        white: white noise N (of a gyroscope: angle random walk), in unit/sqrt(Hz).
        flicker: flicker B (bias instability), in the rate's unit.
        random_walk: random walk of the rate K, in unit*sqrt(Hz).
        quantisation: quantisation of the angle Q, in unit*s.
        spectrum: the full spectrum.
        bands: band means, and the fit.
        lines: spectral lines not explained by noise, excluded from the bands.
        false_alarm: probability of any line in pure noise.
        chi: root of chi-square per degree of freedom of the fit, NaN where nothing was fitted.
        lowest: lower end of the fitted range [Hz].
        highest: upper end of the fitted range [Hz]; below half the rate where a filter bends the spectrum.
        model_error: relative model error granted in the fit: 0 or 0.03.
        remark: why something is not observable or the model is rejected, otherwise empty.
    """

    density: Figure
    white: Figure
    flicker: Figure
    random_walk: Figure
    quantisation: Figure
    spectrum: Spectrum
    bands: Bands
    lines: tuple[Line, ...]
    false_alarm: float
    chi: float
    lowest: float
    highest: float
    model_error: float
    remark: str


@traced
def psd(
    data: ArrayLike,
    rate: float,
    unit: str,
    *,
    how: Welch = _USUAL,
    bandwidth: float | None = None,
    rotation: float | None = None,
    false_alarm: float = 0.01,
    holes: bool = False,
) -> SpectralNoise:
    """Return spectrum, lines and noise coefficients of a sensor at rest, each with its uncertainty and status.

    Model of the one-sided density, with s = 2 rate sin(pi f / rate), which is 2 pi f for low frequencies:
    2 N^2 + B^2 / (pi f) + 2 K^2 / s^2 + 2 s^2 Q^2 / rate. Every subset of its terms is fitted to band means by maximum
    likelihood. A term is kept where it lowers -2 ln(likelihood) by at least 9. While the misfit has a probability below
    0.001 and the highest band lies below the fit to the others, the highest bands are dropped, up to a factor of 8 in
    frequency, plus two bands: the sensor's own filter bends the spectrum there, and cannot be distinguished from
    quantisation. If that fails, a model error of 3 % is granted; if the model still does not fit, it is
    rejected.

    A coefficient is MEASURED where its term is kept, no subset without it fits equally well, and its square is known to
    50 % or better; otherwise it is an UPPER_LIMIT at 95 % confidence. Values come from a fit with all terms.

    Args:
        data: evenly spaced rate at rest, shape (n,), in `unit`.
        rate: sampling rate [Hz].
        unit: unit of the data.
        how: segments, window, overlap, detrending, and confidence level of the intervals.
        bandwidth: -3 dB bandwidth of the sensor's own filter [Hz]; frequencies above a quarter of it are not fitted.
        rotation: rotation frequency of a rate table [Hz], to identify its harmonics.
        false_alarm: probability of any line in pure noise.
        holes: whether NaN marks a missing sample.

    Raises:
        Refused: the data have no spectrum; see `spectrum`.
    """
    whole = spectrum(data, rate, unit=unit, how=how, holes=holes)
    still = _still(data)
    found = () if still else find(whole, false_alarm=false_alarm, rotation=rotation)
    bands, design = _bands(whole, found)
    fitted = None if still else _search(bands, design, bandwidth)
    remark = ""
    if still:
        remark = f"all {whole.samples} samples are the same: stuck, or below the resolution"
    elif fitted is None:
        remark = f"{bands.density.size} bands are too few for a fit: take a shorter --segment, or record longer"
    elif fitted.tail < _WORST_TAIL:
        remark = (
            "white noise, flicker, random walk and quantisation together do not describe this spectrum "
            f"(chi {fitted.chi:.1f}): look for motion, temperature, vibration or a filter"
        )
    units = (f"{unit}/sqrt(Hz)", unit, f"{unit}*sqrt(Hz)", f"{unit}*s")
    figures = [_figure(fitted, term, each) for term, each in enumerate(units)]
    return SpectralNoise(
        density=_figure(fitted, 0, units[0], 2.0),
        white=figures[0],
        flicker=figures[1],
        random_walk=figures[2],
        quantisation=figures[3],
        spectrum=whole,
        bands=bands if fitted is None else replace(bands, fitted=design @ fitted.squares),
        lines=found,
        false_alarm=false_alarm,
        chi=fitted.chi if fitted else math.nan,
        lowest=float(bands.frequency[0]) if bands.frequency.size else math.nan,
        highest=fitted.highest if fitted else math.nan,
        model_error=fitted.error if fitted else 0.0,
        remark=remark,
    )


def _still(data: ArrayLike) -> bool:
    values = np.asarray(data)
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    return high - low <= _ROUNDING * max(abs(low), abs(high))


@dataclass(frozen=True, slots=True, kw_only=True)
class Agreement:
    """Ratios of spectral to Allan coefficients; NOT_OBSERVABLE unless both are measured."""

    quantisation: Figure
    white: Figure
    flicker: Figure
    random_walk: Figure

    def doubts(self) -> tuple[str, ...]:
        """Return a sentence for each ratio that differs from 1 by more than four standard uncertainties."""
        ratios = {name.replace("_", " "): getattr(self, name) for name in Agreement.__slots__}
        return tuple(
            f"{name} of the spectrum is {ratio.value:.3g} times that of the Allan deviation"
            for name, ratio in ratios.items()
            if ratio.uncertainty is not None and abs(ratio.value - 1.0) > _CLEARLY * ratio.uncertainty
        )


@traced
def agreement(spectral: SpectralNoise, allan: NoiseModel) -> Agreement:
    """Return the ratios of the coefficients of a spectrum to those of an Allan deviation of the same record.

    Both see the same noise, so their errors are correlated; the uncertainty takes them as independent, which is
    conservative. A wrong rate, a density mistaken for two-sided, or a line shows as a ratio other than 1.

    Args:
        spectral: from `psd`.
        allan: from `characterise`, in the same unit.
    """
    return Agreement(**{name: _ratio(getattr(spectral, name), getattr(allan, name)) for name in Agreement.__slots__})


def _ratio(one: Figure, other: Figure) -> Figure:
    both = one.status is FigureStatus.MEASURED and other.status is FigureStatus.MEASURED
    return one / other if both else not_observable("1")


def _bands(whole: Spectrum, found: tuple[Line, ...]) -> tuple[Bands, _Array]:
    """Return band means without lines, and those of the terms for unit squares, shape (k, 4)."""
    kept = np.ones(whole.density.size, dtype=np.bool_)
    for line in found:
        kept[line.first : line.last + 1] = False
    first = lobe(whole.window) + 1 + (whole.detrend == "linear")
    kept[:first] = False
    kept[-1] = False
    places = np.flatnonzero(kept)
    edges = [first]
    while edges[-1] < kept.size:
        edges.append(max(edges[-1] + _LEAST, round(edges[-1] * 10.0 ** (1.0 / _PER_DECADE))))
    number = np.searchsorted(edges, places, side="right")
    starts = np.flatnonzero(np.diff(number, prepend=-1))
    counts = np.diff(np.append(starts, places.size))
    columns = (*_terms(whole, places), whole.frequency[places], whole.density[places])
    if not starts.size:
        none = np.empty(0)
        return Bands(frequency=none, density=none, edf=none, low=none, high=none, fitted=none), np.empty((0, _TERMS))
    *terms, middle, density = (np.add.reduceat(column, starts) / counts for column in columns)
    edf = np.array([degrees(whole.window, whole.step / whole.segment, whole.segments, n) for n in counts.tolist()])
    low, high = interval(density, edf, whole.confidence)
    return Bands(
        frequency=middle, density=density, edf=edf, low=low, high=high, fitted=np.full(density.size, np.nan)
    ), np.column_stack(terms)


def _terms(whole: Spectrum, places: NDArray[np.intp]) -> tuple[_Array, ...]:
    """Return the density of each term for a unit square at these points, smeared by the window."""

    def at(points: _Array) -> _Array:
        frequency = points * (whole.rate / whole.segment)
        slope = 2.0 * whole.rate * np.sin(np.pi * frequency / whole.rate)
        flat = np.full(points.shape, 2.0)
        return np.stack([flat, 1.0 / (np.pi * frequency), 2.0 / slope**2, 2.0 * slope**2 / whole.rate])

    terms = at(places.astype(np.float64))
    near = np.flatnonzero(places < _SMEARED)
    offsets, weights = smear(whole.window)
    terms[:, near] = at(places[near, None] + offsets) @ weights
    return tuple(terms)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Fit:
    """A fitted model; arrays of shape (4,). `offered` has all terms, unconstrained; `squares` those that were kept."""

    squares: _Array
    offered: _Array
    uncertainty: _Array
    needed: NDArray[np.bool_]
    chi: float
    tail: float
    highest: float
    error: float


def _search(bands: Bands, design: _Array, bandwidth: float | None) -> _Fit | None:
    """Return the first acceptable fit: of all bands, without the highest ones, with a model error; None if none is."""
    usable = int((bands.frequency <= _PASSED * bandwidth).sum()) if bandwidth else bands.frequency.size
    if usable < _FEWEST or not (bands.density > 0.0).all():
        return None
    rejected: _Fit | None = None
    for end, error in _tries(usable):
        found = _fitted(bands, design, end, error, whole=end == usable)
        if found.tail >= _WORST_TAIL and end == usable:
            return found
        if found.tail >= _WORST_TAIL and _filtered(bands, design, usable, found):
            return _fitted(bands, design, max(_FEWEST, end - _BESIDE), error, whole=False)
        rejected = found if end == usable else rejected
    return rejected


def _filtered(bands: Bands, design: _Array, usable: int, found: _Fit) -> bool:
    """Return whether the highest band lies below a fit without it, as with a filter."""
    expected = float(design[usable - 1] @ found.squares)
    return float(bands.density[usable - 1]) < expected * (1.0 - _CLEARLY * math.sqrt(2.0 / bands.edf[usable - 1]))


def _tries(usable: int) -> Iterator[tuple[int, float]]:
    for error in (0.0, _MODEL_ERROR):
        for end in range(usable, max(usable - _MOST_CUT, _FEWEST, usable // 2) - 1, -1):
            yield end, error


def _fitted(bands: Bands, design: _Array, end: int, error: float, *, whole: bool) -> _Fit:
    from scipy.special import gammaincc  # noqa: PLC0415 - scipy is slow to import

    scale = float(np.median(bands.density))
    density = bands.density[:end] / scale
    size = design[:end].max(axis=0)
    terms = design[:end] / size
    degrees = 2.0 / (2.0 / bands.edf[:end] + (2.0 * error) ** 2)
    subsets = [subset for subset in _SUBSETS if whole or _QUANTISATION not in subset]
    tried = {subset: found for subset in subsets if (found := _solve(density, terms, degrees, subset)) is not None}
    chosen = min(tried, key=lambda subset: tried[subset][1] + _WORTH * len(subset))
    part = tried[chosen][0]
    model = terms @ part
    least = min(value for _, value in tried.values())
    without = [min((v for s, (_, v) in tried.items() if term not in s), default=math.inf) for term in range(_TERMS)]
    weights = np.sqrt(degrees / 2.0) / model
    offered = np.linalg.lstsq(terms * weights[:, None], density * weights, rcond=None)[0]
    spread = np.sqrt(np.diag(np.linalg.pinv((terms * weights[:, None]).T @ (terms * weights[:, None]))))
    spread = np.hypot(spread, 2.0 * error * np.abs(offered))
    kept = np.isin(np.arange(_TERMS), chosen)
    spans = 2.0 / (9.0 * degrees)
    misfit = float(np.square((np.cbrt(density / model) - (1.0 - spans)) / np.sqrt(spans)).sum())
    free = max(1, end - len(chosen))
    return _Fit(
        squares=part * scale / size,
        offered=offered * scale / size,
        uncertainty=spread * scale / size,
        needed=kept & (np.array(without) - least >= _WORTH),
        chi=math.sqrt(misfit / free),
        tail=float(gammaincc(free / 2.0, misfit / 2.0)),
        highest=float(bands.frequency[end - 1]),
        error=error,
    )


def _solve(density: _Array, terms: _Array, degrees: _Array, subset: tuple[int, ...]) -> tuple[_Array, float] | None:
    """Return the squares of a subset of terms and -2 ln(likelihood), None if a square is negative.

    Iterated least squares with weights degrees / model^2 is maximum likelihood for chi-square variates.
    """
    columns = terms[:, subset]
    model: _Array = density
    part: _Array = np.zeros(len(subset))
    for _ in range(50):
        weights = np.sqrt(degrees) / model
        part = np.asarray(
            np.linalg.lstsq(columns * weights[:, None], density * weights, rcond=None)[0], dtype=np.float64
        )
        before, model = model, columns @ part
        if not (model > 0.0).all():
            return None
        if (np.abs(model - before) <= 1e-9 * before).all():
            break
    if not (part > 0.0).all():
        return None
    squares = np.zeros(_TERMS)
    squares[list(subset)] = part
    return squares, float((degrees * (np.log(model) + density / model)).sum())


def _figure(found: _Fit | None, term: int, unit: str, factor: float = 1.0) -> Figure:
    """Return the root of `factor` times a square."""
    if found is None:
        return not_observable(unit)
    square, uncertainty = factor * float(found.offered[term]), factor * float(found.uncertainty[term])
    if found.tail < _WORST_TAIL:
        return Figure(
            value=math.sqrt(factor * float(found.squares[term])), unit=unit, status=FigureStatus.MODEL_REJECTED
        )
    status = FigureStatus.MEASURED
    if not (found.needed[term] and square >= _KNOWN * uncertainty):
        square, status = max(square, 0.0) + 1.645 * uncertainty, FigureStatus.UPPER_LIMIT
    value = math.sqrt(square)
    return Figure(
        value=value,
        unit=unit,
        uncertainty=uncertainty / (2.0 * value),
        dof=2.0 * (square / uncertainty) ** 2,
        status=status,
    )
