"""Quality of a recording or log: gates on its samples, timestamps and noise before anything is computed."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.allan.deviation import deviation
from hil.analysis.changes import interleaved, jumps, steady, wrapped
from hil.analysis.extremes import resolved, saturated, spikes
from hil.analysis.gates import (
    HIGHEST,
    LOWEST,
    Facts,
    Gate,
    alike,
    celsius,
    factor_of,
    finite,
    numbers,
    repeated,
    stuck,
)
from hil.analysis.sampling import SamplingReport, assess
from hil.analysis.tracing import traced
from hil.model.errors import Refused

__all__ = ["aliased", "density", "density_agrees", "judge", "read", "sampled", "timing", "tripped"]

_JITTER = 0.05  # of an interval, rms: less does not affect white noise of a slow signal
_FIRST = 40_000  # samples from which the scatter of siblings is compared
_OFF = 0.02  # of the rate: Allan times and densities move by half of it


def timing(time: ArrayLike, facts: Facts) -> tuple[SamplingReport | None, tuple[Gate, ...]]:
    """Return the sampling report of timestamps, None if there is none, and the gates on them.

    Args:
        time: timestamps in s, shape (n,).
        facts: known properties; only the rate is used.
    """
    try:
        report = assess(time)
    except Refused as error:
        return None, (Gate(name="order", channel="", ok=False, reason=error.message),)
    return report, sampled(time, report, facts)


def sampled(time: ArrayLike, report: SamplingReport, facts: Facts) -> tuple[Gate, ...]:
    """Return the gates on timestamps with a known report: order, gaps, jitter and rate.

    Args:
        time: timestamps in s, shape (n,).
        report: their sampling report.
        facts: known properties; only the rate is used.
    """
    backwards = f"{report.duplicates} timestamps repeat and {report.reversals} precede the one before"
    ordered = not (report.duplicates or report.reversals)
    places = () if ordered else numbers(np.flatnonzero(np.diff(np.asarray(time)) <= 0.0) + 1)
    if places:
        backwards += f", the first is number {places[0]}"
    gaps = f"{report.gaps} gaps, the longest {report.longest_gap:.4g} s, about {report.missing} samples missing"
    return (
        Gate(name="order", channel="", ok=ordered, reason=backwards, samples=places),
        Gate(name="gaps", channel="", ok=not report.gaps, reason=gaps),
        Gate(name="jitter", channel="", ok=report.jitter <= _JITTER, reason=f"{report.jitter:.2%} of an interval, rms"),
        _rate(report, facts),
    )


def _rate(report: SamplingReport, facts: Facts) -> Gate:
    if facts.rate is None:
        return Gate(name="rate", channel="", ok=None, reason="the rate that was asked for is not known")
    reason = f"{report.rate:.6g} Hz, where {facts.rate:g} Hz were asked for"
    return Gate(name="rate", channel="", ok=abs(report.rate / facts.rate - 1.0) <= _OFF, reason=reason)


def aliased(rate: float, facts: Facts) -> Gate:
    """Trip where the sensor passes frequencies above half the sampling rate, whose noise aliases into the band.

    White noise rises by sqrt(2 bandwidth / rate): by less than 1 % if the bandwidth is half the nominal rate.
    """
    if facts.bandwidth is None:
        return Gate(name="aliased", channel="", ok=None, reason="the sensor's bandwidth is not known")
    if facts.bandwidth <= rate / 2.0 * (1.0 + _OFF):
        reason = f"the bandwidth, {facts.bandwidth:g} Hz, is within half of the rate, {rate:.4g} Hz"
        return Gate(name="aliased", channel="", ok=True, reason=reason)
    reason = (
        f"the bandwidth, {facts.bandwidth:g} Hz, is beyond half of the rate, {rate:.4g} Hz: "
        f"white noise is folded in and reads up to {math.sqrt(2.0 * facts.bandwidth / rate):.2g} times too large"
    )
    return Gate(name="aliased", channel="", ok=False, reason=reason)


def density(values: NDArray[np.float64], rate: float) -> float:
    """Return the one-sided white-noise density per root Hz: sqrt(2 tau) times the Allan deviation near 1 s.

    Data sheets state this; the coefficient N of the Allan deviation is two-sided, smaller by sqrt(2). NaN if the record
    shows none. A record below 4 s is read at its longest averaging time. `values` is (n,), `rate` in Hz.
    """
    try:
        curve = deviation(values, rate, [_second(values.size, rate)], holes=True)
    except Refused:
        return math.nan
    return float(curve.deviation[0] * math.sqrt(2.0 * curve.tau[0]))


def _second(samples: int, rate: float) -> float:
    return max(1.0, min(round(rate), samples // 4)) / rate


def density_agrees(channel: str, measured: float, facts: Facts) -> Gate:
    """Trip where the density is outside 0.5 to 3 times that of the data sheet; name the factor if it is known.

    The root of two lies within; it is named in the reason only.

    Args:
        channel: name of the channel.
        measured: one-sided density, from `density`.
        facts: known properties, with the data sheet's one-sided density.
    """
    name = "density"
    if facts.noise_density is None or not math.isfinite(measured):
        return Gate(name=name, channel=channel, ok=None, reason="the density, or that of the data sheet, is not known")
    ratio = measured / facts.noise_density
    ok = LOWEST <= ratio <= HIGHEST
    known = factor_of(ratio)
    reason = f"{measured:.3g} per root of a hertz, {ratio:.3g} times that of the data sheet"
    return Gate(name=name, channel=channel, ok=ok, reason=f"{reason}: {known}" if known else reason)


def judge(time: ArrayLike, channels: Mapping[str, ArrayLike], facts: Facts) -> tuple[Gate, ...]:
    """Return every gate for a recording at rest, including those that could not be judged.

    For the recording: order, gaps, jitter, rate, repeated, aliased, alike. For each channel: finite, stuck, saturated,
    spikes, resolved, wrapped, jumps, steady, interleaved and density; for the temperature finite and celsius only,
    because a temperature may well be constant.

    Args:
        time: timestamps in s, shape (n,).
        channels: values by name, each of shape (n,).
        facts: known properties of the sensor.

    Raises:
        Refused: a channel does not have as many values as there are timestamps.
    """
    arrays = {name: np.asarray(values, dtype=np.float64) for name, values in channels.items()}
    count = np.size(time)
    for name, values in arrays.items():
        if values.shape != (count,):
            raise Refused(f"channel {name} has shape {values.shape}", f"give one value for each of {count} timestamps")
    report, gates = timing(time, facts)
    return (*gates, *read(arrays, facts, report.rate if report else facts.rate))


def read(channels: Mapping[str, NDArray[np.float64]], facts: Facts, rate: float | None) -> tuple[Gate, ...]:
    """Return the gates on the channels' values: those of `judge` except order, gaps, jitter and rate.

    Args:
        channels: values by name, all of one shape (n,).
        facts: facts about the sensor.
        rate: samples per second, None if it is not known.
    """
    given = {name: values for name, values in channels.items() if name != facts.temperature}
    rates = {name: _without_infinities(values) for name, values in given.items()}
    found = [repeated(rates)]
    if rate is not None:
        found.append(aliased(rate, facts))
    found.append(alike({name: _scatter(values) for name, values in rates.items()}))
    for name, values in rates.items():
        found += [finite(name, given[name]), stuck(name, values), saturated(name, values, facts)]
        found += [spikes(name, values), resolved(name, values, facts), wrapped(name, values, facts)]
        found += [jumps(name, values), steady(name, values), interleaved(name, values)]
        if rate is not None:
            measured = density(values, rate) if facts.noise_density is not None else float("nan")
            found.append(density_agrees(name, measured, facts))
    if facts.temperature is not None and facts.temperature in channels:
        values = channels[facts.temperature]
        found += [finite(facts.temperature, values), celsius(facts.temperature, values)]
    return tuple(found)


def _without_infinities(values: NDArray[np.float64]) -> NDArray[np.float64]:
    if math.isfinite(values.sum()):  # one pass without extra memory, enough for nearly every record
        return values
    infinite = np.isinf(values)
    return np.where(infinite, np.nan, values) if infinite.any() else values


def _scatter(values: NDArray[np.float64]) -> float:
    """Return the robust scatter of differences of neighbours; NaN if there are none."""
    steps = np.abs(np.diff(values[:_FIRST]))
    steps = steps[np.isfinite(steps)]
    return float(np.median(steps)) if steps.size else math.nan


@traced
def tripped(time: ArrayLike, channels: Mapping[str, ArrayLike], facts: Facts) -> tuple[Gate, ...]:
    """Return the gates of `judge` that trip, without those that lack a fact.

    Args:
        time: timestamps in s, shape (n,).
        channels: values by name, each of shape (n,).
        facts: known properties of the sensor.

    Raises:
        Refused: a channel does not have as many values as there are timestamps.
    """
    return tuple(gate for gate in judge(time, channels, facts) if gate.ok is False)
