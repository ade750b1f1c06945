"""Transient analysis of a captured waveform: level crossings, rise time, time beyond a level, peak and charge.

Every function takes times in s and values of one channel, both of shape (n,), times ascending. Between samples the
signal is interpolated linearly. Uncertainties are standard uncertainties of sampling and resolution alone (GUM 4.3.7, a
rectangle of half width a has a / sqrt(3)): an instant is known to one sampling period, and a value to half a
`resolution`, the converter's step, None or 0 where there is none. Noise is estimated from the samples. The instrument's
certificate is not included. Terms for transitions follow IEEE Std 181-2011, from memory.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.statistics import not_observable
from hil.analysis.tracing import traced
from hil.model.errors import Refused
from hil.model.figure import Figure

__all__ = ["charge", "crossing", "joule_integral", "peak", "rise_time", "time_above", "time_below"]

_ROOT_3, _ROOT_12 = math.sqrt(3.0), math.sqrt(12.0)
_MEDIAN_TO_RMS = 1.4826
_SIGMAS = 3.0
_LEAST_STEPS = 5  # of the converter between base and top, for a rise time


@traced
def crossing(
    time: ArrayLike,
    values: ArrayLike,
    level: float,
    *,
    rising: bool = True,
    after: float = -math.inf,
    resolution: float | None = None,
) -> Figure:
    """Return the time of the first crossing of a level in s; not observable if there is none.

    Args:
        time: in s, shape (n,).
        values: samples of the signal, shape (n,).
        level: level in the unit of the values.
        rising: whether it is crossed from below.
        after: crossings before this time are ignored [s].
        resolution: converter step, in the unit of the values.

    Raises:
        Refused: the arrays are not a waveform.
    """
    times, signal = _waveform(time, values)
    over = signal - level if rising else level - signal
    found = _crossings(over)
    found = found[times[found + 1] >= after]
    if not found.size:
        return not_observable("s")
    return _transit(times, over, resolution or 0.0, first=True, place=int(found[0]))


@traced
def rise_time(
    time: ArrayLike,
    values: ArrayLike,
    *,
    base: float | None = None,
    top: float | None = None,
    low: float = 0.1,
    high: float = 0.9,
    resolution: float | None = None,
) -> Figure:
    """Return the transition time in s from `low` to `high`, as fractions of the way from base to top.

    Falling transitions are treated alike. The low level's last crossing before the high level's first one counts. Not
    observable if either is not crossed, or base and top are less than five converter steps apart.

    Args:
        time: in s after the trigger, shape (n,).
        values: samples of the signal, shape (n,).
        base: level before the transition; by default the median of the samples before time 0.
        top: level after it; by default the median of the last tenth of the samples.
        low: lower fraction, from 0 to 1.
        high: upper fraction, above `low`.
        resolution: converter step, in the unit of the values.

    Raises:
        Refused: the arrays are not a waveform, the fractions are out of order, or there is no base.
    """
    times, signal = _waveform(time, values)
    if not 0 < low < high < 1:
        raise Refused(
            f"a rise time from {low:g} to {high:g} of the way", "give shares between 0 and 1, low before high"
        )
    before = signal[times < 0]
    if base is None and not before.size:
        raise Refused("no sample before the trigger tells the base", "capture some time before it, or give `base`")
    start = float(np.median(before)) if base is None else base
    end = float(np.median(signal[-max(1, signal.size // 10) :])) if top is None else top
    step = resolution or 0.0
    if not abs(end - start) > _LEAST_STEPS * step:
        return not_observable("s")
    sign = math.copysign(1.0, end - start)
    below, above = (sign * (signal - start - share * (end - start)) for share in (low, high))
    highs = _crossings(above)
    lows = _crossings(below)
    lows = lows[lows <= highs[0]] if highs.size else lows[:0]
    if not lows.size:
        return not_observable("s")
    # Base and top are also known to half a step, so the levels are as uncertain as the samples.
    coarse = step * math.sqrt(2.0)
    first = _transit(times, below, coarse, first=False, place=int(lows[-1]))
    last = _transit(times, above, coarse, first=True, place=int(highs[0]))
    return last - first


@traced
def time_above(time: ArrayLike, values: ArrayLike, level: float, *, resolution: float | None = None) -> Figure:
    """Return the time that a signal spends at or above a level within the capture, in s.

    Args:
        time: in s, shape (n,).
        values: samples of the signal, shape (n,).
        level: level in the unit of the values.
        resolution: converter step, in the unit of the values.

    Raises:
        Refused: the arrays are not a waveform.
    """
    times, signal = _waveform(time, values)
    over, steps = signal - level, np.diff(times)
    ends, begins = np.maximum(over[1:], 0.0), np.maximum(over[:-1], 0.0)
    size = np.abs(over[1:]) + np.abs(over[:-1])
    mixed = (over[1:] >= 0) != (over[:-1] >= 0)
    share = np.where(mixed, (ends + begins) / np.where(size > 0, size, 1.0), over[:-1] >= 0)
    places = np.flatnonzero(mixed)
    doubt = math.hypot((resolution or 0.0) / _ROOT_12, _noise(signal))
    parts = [math.hypot(steps[each] / _ROOT_3, doubt * steps[each] / size[each]) for each in places]
    return Figure(value=float((share * steps).sum()), unit="s", uncertainty=math.hypot(*parts))


@traced
def time_below(time: ArrayLike, values: ArrayLike, level: float, *, resolution: float | None = None) -> Figure:
    """Return the time that a signal spends at or below a level within the capture, in s.

    Args:
        time: in s, shape (n,).
        values: samples of the signal, shape (n,).
        level: level in the unit of the values.
        resolution: converter step, in the unit of the values.

    Raises:
        Refused: the arrays are not a waveform.
    """
    return time_above(time, -np.asarray(values, dtype=np.float64), -level, resolution=resolution)


@traced
def peak(time: ArrayLike, values: ArrayLike, unit: str, *, resolution: float | None = None) -> Figure:
    """Return the largest value of a capture.

    Between samples the signal may have been larger, by no more than its drop to the nearer neighbour, itself known to
    one converter step: their sum is the half width of the uncertainty. Not observable if only the first or last sample
    has the largest value.

    Args:
        time: in s, shape (n,).
        values: samples of the signal, shape (n,).
        unit: unit of the values.
        resolution: converter step, in that unit.

    Raises:
        Refused: the arrays are not a waveform.
    """
    _, signal = _waveform(time, values)
    largest = np.flatnonzero(signal == signal.max())
    inside = largest[(largest > 0) & (largest < signal.size - 1)]
    if not inside.size:
        return not_observable(unit)
    place = int(inside[0])
    fall = signal[place] - max(signal[place - 1], signal[place + 1])
    step = resolution or 0.0
    uncertainty = math.hypot((float(fall) + step) / _ROOT_3, step / _ROOT_12)
    return Figure(value=float(signal[place]), unit=unit, uncertainty=uncertainty)


@traced
def charge(
    time: ArrayLike,
    values: ArrayLike,
    unit: str,
    *,
    until: float = math.inf,
    baseline: float | None = None,
    resolution: float | None = None,
) -> Figure:
    """Return the integral of a current above its baseline from the trigger on, in `unit`.s, by the trapezoidal rule.

    The uncertainty has two parts: a constant offset of the converter, and the largest step between two samples, which
    may have occurred anywhere between them.

    Args:
        time: in s after the trigger, shape (n,).
        values: samples of the current, shape (n,).
        unit: unit of the values.
        until: end of integration [s]; at most the last sample.
        baseline: quiescent current; by default the mean of the samples before time 0, or 0 if there are none.
        resolution: converter step, in the unit of the values.

    Raises:
        Refused: the arrays are not a waveform, or fewer than two samples are left.
    """
    times, signal = _waveform(time, values)
    before = signal[times < 0]
    floor = baseline if baseline is not None else float(before.mean()) if before.size else 0.0
    # The sample before the trigger belongs to the step at the trigger.
    first = max(0, int(np.searchsorted(times, 0.0)) - 1)
    last = int(np.searchsorted(times, until, side="right"))
    if last - first < 2:
        raise Refused(f"{max(0, last - first)} samples lie between the trigger and {until:g} s", "integrate for longer")
    times, signal = times[first:last], signal[first:last] - floor
    steps = np.diff(times)
    total = float((steps * (signal[1:] + signal[:-1]) / 2).sum())
    jump = float((np.abs(np.diff(signal)) * steps).max()) / _ROOT_12
    offset = (resolution or 0.0) / _ROOT_12 * float(times[-1] - times[0])
    return Figure(value=total, unit=f"{unit}.s", uncertainty=math.hypot(jump, offset))


@traced
def joule_integral(
    time: ArrayLike, values: ArrayLike, unit: str, *, until: float = math.inf, resolution: float | None = None
) -> Figure:
    """Return the integral of a squared current from the trigger on, in `unit`².s, by the trapezoidal rule.

    This I²t value determines fuse heating and contact welding. The uncertainty has the parts of `charge`, each with
    twice the current as sensitivity.

    Args:
        time: in s after the trigger, shape (n,).
        values: samples of the current, shape (n,).
        unit: unit of the values.
        until: end of integration [s]; at most the last sample.
        resolution: converter step, in the unit of the values.

    Raises:
        Refused: the arrays are not a waveform, or fewer than two samples are left.
    """
    squares = charge(time, np.asarray(values, dtype=np.float64) ** 2, unit, until=until, baseline=0.0)
    offset = charge(time, np.abs(values), unit, until=until, baseline=0.0).value * 2 * (resolution or 0.0) / _ROOT_12
    uncertainty = math.hypot(squares.uncertainty or 0.0, offset)
    return Figure(value=squares.value, unit=f"{unit}².s", uncertainty=uncertainty)


def _waveform(time: ArrayLike, values: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    times, signal = np.asarray(time, dtype=np.float64), np.asarray(values, dtype=np.float64)
    if times.ndim != 1 or times.shape != signal.shape or times.size < 3:
        shapes = f"{times.shape} and {signal.shape}"
        raise Refused(
            f"times and values of shapes {shapes} are no waveform", "give three samples or more, one time each"
        )
    if not (np.isfinite(times).all() and np.isfinite(signal).all()):
        raise Refused("a waveform with samples that are not finite", "look for what the instrument marked invalid")
    if not (np.diff(times) > 0).all():
        raise Refused("the times of a waveform do not rise", "is this the time column?")
    return times, signal


def _crossings(over: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the indices at which a signal rises through 0."""
    return np.flatnonzero((over[:-1] < 0) & (over[1:] >= 0))


def _noise(signal: NDArray[np.float64]) -> float:
    """Return the rms noise of samples from the median of their second differences, which cancel a smooth signal."""
    return float(np.median(np.abs(np.diff(signal, 2)))) * _MEDIAN_TO_RMS / math.sqrt(6.0)


def _transit(times: NDArray[np.float64], over: NDArray[np.float64], step: float, *, first: bool, place: int) -> Figure:
    """Return the time at which a signal rises through 0, in s.

    With noise it crosses several times: it has left the level once it is farther away than noise plus a converter step.
    The midpoint of the first and last crossing in between is used.

    Args:
        times: in s.
        over: the signal less the level.
        step: of the converter.
        first: whether `place` is the first crossing of the transit, or the last.
        place: index of the sample before a crossing.
    """
    noise = _noise(over)
    away = _SIGMAS * noise + step
    below = np.flatnonzero(over[: place + 1] <= -away)
    begin = int(below[-1]) if below.size else 0
    above = np.flatnonzero(over[place + 1 :] >= away)
    end = place + 1 + int(above[0]) if above.size else len(over) - 1
    if first and above.size and (again := np.flatnonzero(over[place:end] <= -away)).size:
        begin = place + int(again[-1])
    places = begin + _crossings(over[begin : end + 1])
    one, last = (_between(times, over, int(each)) for each in (places[0], places[-1]))
    slope = abs(over[end] - over[begin]) / (times[end] - times[begin])
    doubt = math.hypot(step / _ROOT_12, noise) / slope if slope > 0 else float(times[end] - times[begin])
    interval = float(times[place + 1] - times[place])
    uncertainty = math.hypot(interval / _ROOT_3, float(doubt), (last - one) / 2 / _ROOT_3)
    return Figure(value=(one + last) / 2, unit="s", uncertainty=uncertainty)


def _between(times: NDArray[np.float64], over: NDArray[np.float64], place: int) -> float:
    """Return the zero of the straight line from a sample to the next, in s."""
    share = over[place] / (over[place] - over[place + 1])
    return float(times[place] + share * (times[place + 1] - times[place]))
