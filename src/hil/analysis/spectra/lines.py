"""Spectral lines: detection above the noise floor, amplitude, and likely origin."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from hil.analysis.spectra.welch import WINDOWS, Spectrum, degrees
from hil.model.figure import Figure

__all__ = ["Line", "find", "lobe"]

_Array: TypeAlias = NDArray[np.float64]

_FIRST = 7  # point from which on there are neighbours on both sides to compare with
_REACH = 64  # points on either side that the floor is taken from
_EVERY = 16  # points between two floors, where they are far from zero
_SKIRT = 0.01  # probability below which a neighbour belongs to the line
_NARROW = 0.98  # part of a sine's power that lies within the main lobe
_BENT = {"boxcar": 0.2}  # points by which a parabola misses the frequency
_MISSED = 0.02  # the same for all other windows
_MAINS, _MAINS_OFF = (50.0, 60.0), 0.2  # Hz
_ROTATION_OFF = 0.005  # of the table's rate
_HARMONICS, _ALIASES = 20, 3
_CROWDED = 0.02  # of the spectrum: an alias that is known no better names everything


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """A peak of the spectrum not explained by noise.

    Attributes:
        frequency: frequency [Hz]; its uncertainty excludes the clock error of the rate.
        amplitude: peak amplitude of the sine of equal power, in the unit of the data.
        height: density relative to the noise around it.
        false_alarm: probability that noise makes such a peak anywhere in the spectrum.
        first: index of its first point.
        last: index of its last point.
        narrow: whether it is as narrow as a sine; otherwise it is a resonance, or its frequency drifts.
        origin: likely origin: mains, the table's rotation, a harmonic; empty if unknown.
    """

    frequency: Figure
    amplitude: Figure
    height: float
    false_alarm: float
    first: int
    last: int
    narrow: bool
    origin: str


def lobe(window: str) -> int:
    """Return the half-width of the window's main lobe in points."""
    return len(WINDOWS[window])


def _shared(spectrum: Spectrum) -> float:
    """Return the number of neighbouring points equivalent to one independent point."""
    many = 1 << 16
    return (
        float(spectrum.edf[1])
        * many
        / degrees(spectrum.window, spectrum.step / spectrum.segment, spectrum.segments, many)
    )


def find(spectrum: Spectrum, *, false_alarm: float = 0.01, rotation: float | None = None) -> tuple[Line, ...]:
    """Return the lines of a spectrum, in ascending order of frequency.

    The noise floor at a point is the median of up to 64 points on either side, equally many on both, so that a slope
    has no effect. Density over noise is F-distributed; a peak is a line if noise would make one as high anywhere in the
    spectrum with a probability of at most `false_alarm` (Bonferroni). Its power is the excess over the noise in its
    points; its frequency is the vertex of a parabola through three log densities.

    Args:
        spectrum: with at least 16 points.
        false_alarm: probability of any line in a spectrum of pure noise.
        rotation: rotation frequency of a rate table [Hz], to identify its harmonics.
    """
    from scipy.special import fdtrc  # noqa: PLC0415 - scipy is slow to import

    if spectrum.density.size < 2 * (_FIRST + 1) or not (spectrum.density[1:] > 0.0).any():
        return ()
    noise, worth = _floor(spectrum)
    safe = np.where(noise > 0.0, noise, np.inf)
    chance = np.asarray(fdtrc(spectrum.edf, spectrum.edf * worth, spectrum.density / safe), dtype=np.float64)
    chance[:_FIRST] = 1.0
    alarm = np.minimum(chance * chance.size, 1.0)
    found: list[Line] = []
    for peak in sorted(np.flatnonzero(alarm <= false_alarm).tolist(), key=lambda k: -spectrum.density[k] / safe[k]):
        if not any(line.first <= peak <= line.last for line in found):
            found.append(_line(spectrum, noise, chance, peak))
    return _named(sorted(found, key=lambda line: line.frequency.value), spectrum, rotation)


def _floor(spectrum: Spectrum) -> tuple[_Array, _Array]:
    """Return the noise floor at each point, and the number of independent points behind it."""
    from scipy.special import gammaincinv  # noqa: PLC0415 - scipy is slow to import

    density, size, near = spectrum.density, spectrum.density.size, lobe(spectrum.window)
    places = sorted({*range(_FIRST, min(2 * _REACH, size)), *range(_FIRST, size, _EVERY), size - 1})
    middle = np.array(places, dtype=np.float64)
    known, counts = np.empty(middle.size), np.empty(middle.size)
    inner = [index for index, k in enumerate(places) if 2 * _REACH <= k < size - _REACH]
    if inner:
        rows = sliding_window_view(density, 2 * _REACH + 1)[np.array(places)[inner] - _REACH]
        known[inner], counts[inner] = np.median(rows, axis=1), rows.shape[1]
    for index in sorted(set(range(len(places))) - set(inner)):
        k = places[index]
        reach = max(near + 3, min(_REACH, k - 2, size - 1 - k))
        around = np.arange(max(2, k - reach), min(size, k + reach + 1))
        around = around[np.abs(around - k) > near] if around.size < _REACH else around
        known[index], counts[index] = np.median(density[around]), around.size
    half = float(spectrum.edf[1]) / 2.0
    known *= half / gammaincinv(half, 0.5)
    every = np.arange(size)
    floor = np.exp(np.interp(every, middle, np.log(np.maximum(known, np.finfo(float).tiny))))
    return floor, np.interp(every, middle, counts) * 2.0 / (math.pi * _shared(spectrum))


def _line(spectrum: Spectrum, noise: _Array, chance: _Array, peak: int) -> Line:
    density, near, size = spectrum.density, lobe(spectrum.window), spectrum.density.size
    peak = max(range(max(1, peak - 1), min(size, peak + 2)), key=lambda k: density[k])
    first = last = peak
    while first > 1 and (chance[first - 1] <= _SKIRT or peak - first < near):
        first -= 1
    while last < size - 1 and (chance[last + 1] <= _SKIRT or last - peak < near):
        last += 1
    part, own = slice(first, last + 1), slice(max(first, peak - near), min(last, peak + near) + 1)
    above = density - noise
    apart = float(spectrum.rate) / spectrum.segment
    power = max(float(above[part].sum()), float(above[peak]))
    sines = np.maximum(above[part], 0.0)
    variance = float(((noise[part] ** 2 + 2.0 * noise[part] * sines) * 2.0 / spectrum.edf[part]).sum())
    amplitude = math.sqrt(2.0 * apart * power)
    spread = apart * math.sqrt(variance * _shared(spectrum))
    offset, doubt = _offset(spectrum, noise, peak)
    narrow = float(above[own].sum()) >= _NARROW * power - 3.0 * spread / apart
    return Line(
        frequency=Figure(
            value=(peak + offset) * apart,
            unit="Hz",
            uncertainty=apart * (doubt if narrow else (last - first) / math.sqrt(12.0)),
        ),
        amplitude=Figure(value=amplitude, unit=spectrum.unit, uncertainty=spread / amplitude),
        height=float(density[peak] / noise[peak]),
        false_alarm=min(1.0, float(chance[peak]) * size),
        first=first,
        last=last,
        narrow=narrow,
        origin="",
    )


def _offset(spectrum: Spectrum, noise: _Array, peak: int) -> tuple[float, float]:
    """Return the fractional offset of the peak in points, and its standard uncertainty."""
    missed = _BENT.get(spectrum.window, _MISSED) / math.sqrt(3.0)
    if peak + 2 > spectrum.density.size - 1:
        return 0.0, 0.5
    three = slice(peak - 1, peak + 2)
    above = np.maximum(spectrum.density[three] - noise[three], noise[three] * 0.05)
    low, top, high = np.log(above).tolist()
    bend = 2.0 * top - low - high
    if not bend > 0.0:
        return 0.0, 0.5
    ratio = above[[0, 2]] / noise[[peak - 1, peak + 1]]
    relative = float(np.sqrt((2.0 / spectrum.edf[peak] * (1.0 + 2.0 * ratio) / ratio**2).mean()))
    return 0.5 * (high - low) / bend, min(0.5, math.hypot(missed, relative / (math.sqrt(2.0) * bend)))


def _named(found: Sequence[Line], spectrum: Spectrum, rotation: float | None) -> tuple[Line, ...]:
    named: list[Line] = []
    for line in found:
        origin = _origin(line.frequency.value, spectrum, rotation) or _harmonic(line, named)
        named.append(replace(line, origin=origin))
    return tuple(named)


def _origin(frequency: float, spectrum: Spectrum, rotation: float | None) -> str:
    wide, rate = spectrum.rate / spectrum.segment, spectrum.rate
    bases = [(rotation, _ROTATION_OFF * rotation, "the table's rotation")] if rotation else []
    bases += [(mains, _MAINS_OFF, f"{mains:g} Hz mains") for mains in _MAINS]
    for base, off, name in bases:
        number = round(frequency / base)
        if 1 <= number <= _HARMONICS and abs(frequency - number * base) <= number * off + wide:
            return name if number == 1 else f"harmonic {number} of {name}"
    for base, off, name in bases:
        for number in range(1, _ALIASES + 1):
            folded = abs((number * base + rate / 2.0) % rate - rate / 2.0)
            near = number * off + wide
            known = number * base > rate / 2.0 and near < min(_CROWDED * rate / 2.0, folded)
            if known and abs(frequency - folded) <= near:
                return f"alias of {name}" if number == 1 else f"alias of harmonic {number} of {name}"
    return ""


def _harmonic(line: Line, lower: Sequence[Line]) -> str:
    for other in lower:
        number = round(line.frequency.value / other.frequency.value)
        off = 3.0 * math.hypot(line.frequency.uncertainty or 0.0, number * (other.frequency.uncertainty or 0.0))
        near = abs(line.frequency.value - number * other.frequency.value) <= off
        if 2 <= number <= _HARMONICS and other.narrow and near:
            return f"harmonic {number} of {other.frequency.value:.5g} Hz"
    return ""
