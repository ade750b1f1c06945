"""Gates of a recording: what its samples, times and noise must fulfil before anything is computed from them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.allan.deviation import deviation
from hil.analysis.sampling import SamplingReport, assess
from hil.analysis.tracing import traced
from hil.model.errors import Refused

__all__ = [
    "FACTORS",
    "Facts",
    "Gate",
    "aliased",
    "celsius",
    "density",
    "density_agrees",
    "finite",
    "judge",
    "repeated",
    "resolved",
    "saturated",
    "stuck",
    "timing",
    "tripped",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Gate:
    """One question to a recording that must be answered well before anything is concluded from it.

    Attributes:
        name: what is asked, such as `stuck`.
        channel: the channel that was asked, empty if it was the recording as a whole.
        ok: the answer; None if a fact is missing, so that nothing could be judged.
        reason: what was found, or which fact is missing, in a sentence.
        cycles: numbers of the battery's cycles that the answer speaks against; empty if that is the recording as a
            whole.
    """

    name: str
    channel: str
    ok: bool | None
    reason: str
    cycles: tuple[int, ...] = ()

    def __str__(self) -> str:
        return f"{self.name} of {self.channel}: {self.reason}" if self.channel else f"{self.name}: {self.reason}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Facts:
    """What is known of a sensor and its settings; None if it is not known. Units are those of the channels.

    Attributes:
        rate: samples per second that were asked for.
        lsb: step between two readings that differ by one count.
        full_scale: largest reading, of either sign.
        bandwidth: frequency at which the sensor's own filter is 3 dB down, in Hz.
        noise_density: of the data sheet, one-sided, per root of a hertz.
        temperature: name of the channel that holds degrees Celsius.
    """

    rate: float | None = None
    lsb: float | None = None
    full_scale: float | None = None
    bandwidth: float | None = None
    noise_density: float | None = None
    temperature: str | None = None


_Array: TypeAlias = NDArray[np.float64]

_ROUNDING = 1e-9  # of the value: a channel that moves less than this does not move
_LONGER = 3.0  # times the longest run that chance makes
_FEWEST = 10  # equal samples that are never called stuck
_MANY = 0.01  # share of repeated rows that is looked at
_NEAR_FULL = 0.999  # of full scale


def finite(channel: str, values: _Array) -> Gate:
    """Trip where a value is NaN or infinite."""
    bad = np.flatnonzero(~np.isfinite(values))
    if not bad.size:
        return Gate(name="finite", channel=channel, ok=True, reason=f"all {values.size} samples are numbers")
    reason = f"{bad.size} of {values.size} samples are not finite numbers, the first is number {bad[0] + 1}"
    return Gate(name="finite", channel=channel, ok=False, reason=reason)


def stuck(channel: str, values: _Array) -> Gate:
    """Trip where a channel never moves, or stands still for much longer than chance explains.

    In n samples of which a share p repeats the one before, the longest run of equal samples is about
    ln(n) / -ln(p); three times that, and ten samples, are allowed.
    """
    present = values[np.isfinite(values)]
    if present.size < 2:
        return Gate(name="stuck", channel=channel, ok=None, reason="fewer than two samples are numbers")
    span = float(np.ptp(present))
    if span <= _ROUNDING * float(np.abs(present).max()):
        return Gate(name="stuck", channel=channel, ok=False, reason=f"all samples are {present[0]:.6g}")
    ends = np.concatenate([[-1], np.flatnonzero(np.diff(present)), [present.size - 1]])
    runs = np.diff(ends)
    longest, place = int(runs.max()), int(ends[int(runs.argmax())] + 1)
    others = max(1, present.size - longest)
    share = min(max((others - runs.size + 1) / others, 0.5 / others), 1.0 - 0.5 / others)
    usual = math.log(present.size) / -math.log(share)
    if longest <= max(_FEWEST, _LONGER * usual):
        return Gate(name="stuck", channel=channel, ok=True, reason=f"at most {longest} equal samples follow each other")
    reason = (
        f"{longest} equal samples follow each other from number {place + 1} on, where chance makes about {usual:.0f}"
    )
    return Gate(name="stuck", channel=channel, ok=False, reason=reason)


def repeated(channels: Mapping[str, _Array]) -> Gate:
    """Trip where whole rows repeat the row before: the sensor was read faster than it measures.

    A few repetitions are chance. With several channels they are expected in the product of the channels' own shares;
    with one, in 0.28 steps over the standard deviation of its noise.
    """
    name = "repeated"
    equal = [np.diff(values) == 0.0 for values in channels.values()]
    if not equal or not equal[0].size:
        return Gate(name=name, channel="", ok=None, reason="there are no two samples to compare")
    share = float(np.logical_and.reduce(equal).mean())
    if len(equal) > 1:
        expected = math.prod(float(each.mean()) for each in equal)
    else:
        expected = _expected(np.diff(next(iter(channels.values()))))
    counted = f"{share:.1%} of the rows repeat the one before, where chance makes {expected:.1%}"
    return Gate(name=name, channel="", ok=not share > max(_MANY, 3.0 * expected), reason=counted)


def _expected(steps: _Array) -> float:
    moving = np.abs(steps[(steps != 0.0) & np.isfinite(steps)])
    if not moving.size:
        return 1.0
    return min(1.0, float(moving.min()) / (2.0 * math.sqrt(math.pi) * float(moving.std() or moving[0])))


def saturated(channel: str, values: _Array, facts: Facts) -> Gate:
    """Trip where a value is at full scale."""
    if facts.full_scale is None:
        return Gate(name="saturated", channel=channel, ok=None, reason="the full scale is not known")
    present = values[np.isfinite(values)]
    count = int((np.abs(present) >= _NEAR_FULL * facts.full_scale).sum())
    reason = f"{count} of {values.size} samples are at full scale, {facts.full_scale:g}"
    return Gate(name="saturated", channel=channel, ok=not count, reason=reason)


_COLDEST, _HOTTEST = -60.0, 150.0  # degC that an electronic part survives
_COARSE = 2.0  # K between neighbours, rms over sqrt(2): no temperature jumps like this
_ZERO = 273.15


def celsius(channel: str, values: NDArray[np.float64]) -> Gate:
    """Trip where a temperature cannot be in degrees Celsius: raw counts, or kelvin.

    Raw counts are whole numbers that lie where no part survives, or whose noise would be kelvins from sample to sample.
    """
    present = values[np.isfinite(values)]
    if not present.size:
        return Gate(name="celsius", channel=channel, ok=None, reason="no sample is a number")
    low, high, middle = float(present.min()), float(present.max()), float(np.median(present))
    whole = bool((present == np.rint(present)).all())
    jumps = float(np.sqrt(np.square(np.diff(present)).mean() / 2.0)) if present.size > 1 else 0.0
    reason = f"from {low:g} to {high:g}"
    if low >= _COLDEST and high <= _HOTTEST and not (whole and jumps > _COARSE):
        return Gate(name="celsius", channel=channel, ok=True, reason=f"{reason} degC")
    if not whole and _COLDEST <= middle - _ZERO <= _HOTTEST:
        reason += ", as of kelvin"
    elif whole:
        reason += f" in whole numbers, {jumps:.2g} from sample to sample: raw counts"
    return Gate(name="celsius", channel=channel, ok=False, reason=f"{reason}; not degrees Celsius")


_JITTER = 0.05  # of an interval, rms: white noise of a slow signal is not changed by less
_OFF = 0.02  # of the rate: Allan times and densities move by half of it


def timing(time: ArrayLike, facts: Facts) -> tuple[SamplingReport | None, tuple[Gate, ...]]:
    """Return what the timestamps say, None if they say nothing, and the gates on them.

    Args:
        time: timestamps in s, shape (n,).
        facts: of these the rate.
    """
    try:
        report = assess(time)
    except Refused as error:
        return None, (Gate(name="order", channel="", ok=False, reason=error.message),)
    backwards = f"{report.duplicates} timestamps repeat and {report.reversals} precede the one before"
    gaps = f"{report.gaps} gaps, the longest {report.longest_gap:.4g} s, about {report.missing} samples missing"
    share = report.jitter_rms * report.rate
    gates = [
        Gate(name="order", channel="", ok=not (report.duplicates or report.reversals), reason=backwards),
        Gate(name="gaps", channel="", ok=not report.gaps, reason=gaps),
        Gate(name="jitter", channel="", ok=share <= _JITTER, reason=f"{share:.2%} of an interval, rms"),
        _rate(report, facts),
    ]
    return report, tuple(gates)


def _rate(report: SamplingReport, facts: Facts) -> Gate:
    if facts.rate is None:
        return Gate(name="rate", channel="", ok=None, reason="the rate that was asked for is not known")
    reason = f"{report.rate:.6g} Hz, where {facts.rate:g} Hz were asked for"
    return Gate(name="rate", channel="", ok=abs(report.rate / facts.rate - 1.0) <= _OFF, reason=reason)


FACTORS = {
    180.0 / math.pi: "degrees and radians",
    9.80665: "g and m/s^2",
    1000.0: "milli, and none",
    math.sqrt(2.0): "one-sided and two-sided densities",
}
"""Factors by which a density is off when two things were taken for each other."""

_LOWEST, _HIGHEST = 0.5, 3.0  # of the data sheet's density: what scatter of parts and settings explains
_NEAR = 1.3  # factor within which a wrong density is reported as one of FACTORS
_ROOT = 1.05  # the same for the root of two, which the scatter of parts explains as well
_RESOLVED = 0.5  # counts: with less noise than this the step is no longer white noise of q^2 / 12


def resolved(channel: str, values: NDArray[np.float64], facts: Facts) -> Gate:
    """Trip where the noise before the quantiser is below half a count.

    Then the noise of the readings does not follow sqrt(s^2 + q^2 / 12) any more, may vanish, and averaging does not
    help. s is taken from differences of neighbours, so that drift does not count as noise.
    """
    if facts.lsb is None:
        return Gate(name="resolved", channel=channel, ok=None, reason="what one count is worth is not known")
    steps = np.diff(values)
    steps = steps[np.isfinite(steps)]
    if not steps.size:
        return Gate(name="resolved", channel=channel, ok=None, reason="no two samples follow each other")
    scatter = math.sqrt(float(np.square(steps).mean()) / 2.0) / facts.lsb
    least = math.sqrt(_RESOLVED**2 + 1.0 / 12.0)
    reason = f"neighbours scatter by {scatter:.2g} counts, and {least:.2g} are needed"
    return Gate(name="resolved", channel=channel, ok=scatter >= least, reason=reason)


def aliased(rate: float, facts: Facts) -> Gate:
    """Trip where the sensor lets frequencies above half of the sampling rate through: their noise adds to the density.

    White noise rises by sqrt(2 bandwidth / rate).
    """
    if facts.bandwidth is None:
        return Gate(name="aliased", channel="", ok=None, reason="the sensor's bandwidth is not known")
    if facts.bandwidth <= rate / 2.0:
        reason = f"the bandwidth, {facts.bandwidth:g} Hz, is within half of the rate, {rate:.4g} Hz"
        return Gate(name="aliased", channel="", ok=True, reason=reason)
    reason = (
        f"the bandwidth, {facts.bandwidth:g} Hz, is beyond half of the rate, {rate:.4g} Hz: "
        f"white noise is folded in and reads up to {math.sqrt(2.0 * facts.bandwidth / rate):.2g} times too large"
    )
    return Gate(name="aliased", channel="", ok=False, reason=reason)


def density(values: NDArray[np.float64], rate: float) -> float:
    """Return the density of white noise from the Allan deviation near 1 s: sigma sqrt(tau), per root of a hertz.

    NaN if the record shows none. A record below 4 s is read at its longest averaging time.
    """
    try:
        curve = deviation(values, rate, [_second(values.size, rate)], holes=True)
    except Refused:
        return math.nan
    return float(curve.deviation[0] * math.sqrt(curve.tau[0]))


def _second(samples: int, rate: float) -> float:
    return max(1.0, min(round(rate), samples // 4)) / rate


def density_agrees(channel: str, measured: float, facts: Facts) -> Gate:
    """Trip where the density is not within 0.5 and 3 times that of the data sheet; name the factor if it is known.

    The root of two lies within; it is named in the reason only.
    """
    name = "density"
    if facts.noise_density is None or not math.isfinite(measured):
        return Gate(name=name, channel=channel, ok=None, reason="the density, or that of the data sheet, is not known")
    ratio = measured / facts.noise_density
    ok = _LOWEST <= ratio <= _HIGHEST
    known = _known(ratio)
    reason = f"{measured:.3g} per root of a hertz, {ratio:.3g} times that of the data sheet"
    return Gate(name=name, channel=channel, ok=ok, reason=f"{reason}: {known}" if known else reason)


def _known(ratio: float) -> str:
    for factor, meaning in FACTORS.items():
        near = _ROOT if factor < _HIGHEST else _NEAR
        for candidate, shown in ((factor, f"{factor:.4g}"), (1.0 / factor, f"1/{factor:.4g}")):
            if ratio > 0.0 and abs(math.log(ratio / candidate)) <= math.log(near):
                return f"near {shown}, as when {meaning} are mixed up"
    return ""


def judge(time: ArrayLike, channels: Mapping[str, ArrayLike], facts: Facts) -> tuple[Gate, ...]:
    """Return every gate for a recording at rest, those that could not be judged included.

    For the recording: order, gaps, jitter, rate, repeated, aliased. For each channel: finite, stuck, saturated,
    resolved and density; for the temperature finite and celsius only, because a temperature may well stand still.

    Args:
        time: timestamps in s, shape (n,).
        channels: values by name, each of shape (n,).
        facts: what is known of the sensor.

    Raises:
        Refused: a channel that has not as many values as there are timestamps.
    """
    arrays = {name: np.asarray(values, dtype=np.float64) for name, values in channels.items()}
    count = np.size(time)
    for name, values in arrays.items():
        if values.shape != (count,):
            raise Refused(f"channel {name} has shape {values.shape}", f"give one value for each of {count} timestamps")
    report, gates = timing(time, facts)
    rates = {name: values for name, values in arrays.items() if name != facts.temperature}
    found = [*gates, repeated(rates)]
    rate = report.rate if report else facts.rate
    if rate is not None:
        found.append(aliased(rate, facts))
    for name, values in rates.items():
        found += [finite(name, values), stuck(name, values), saturated(name, values, facts)]
        found.append(resolved(name, values, facts))
        if rate is not None:
            measured = density(values, rate) if facts.noise_density is not None else float("nan")
            found.append(density_agrees(name, measured, facts))
    if facts.temperature in arrays:
        values = arrays[facts.temperature]
        found += [finite(facts.temperature, values), celsius(facts.temperature, values)]
    return tuple(found)


@traced
def tripped(time: ArrayLike, channels: Mapping[str, ArrayLike], facts: Facts) -> tuple[Gate, ...]:
    """Return the gates that a recording does not pass; see `judge`. A gate that lacks a fact is not among them."""
    return tuple(gate for gate in judge(time, channels, facts) if gate.ok is False)
