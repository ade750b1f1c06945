"""Results of one charge or discharge: capacity, energy, times and temperatures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil.analysis.battery.counted import counted
from hil.analysis.battery.integration import cumulative, one_way
from hil.analysis.battery.series import SECONDS_PER_HOUR, Series, can_be_warm
from hil.analysis.battery.steps import Segmentation, Step, StepKind, gaps
from hil.analysis.tracing import traced

__all__ = ["Flow", "HalfCycle", "Limits", "end_uncertainty", "first_fall", "first_rise", "flow", "half_cycle"]


def first_rise(time: NDArray[np.float64], value: NDArray[np.float64], level: float) -> float:
    """Return when a value first reaches a level from below.

    The first crossing counts, even if noise takes the value back below the level, with linear interpolation between
    samples. A value that begins at or above the level has reached it at once.

    Args:
        time: times in s, non-decreasing, shape (n,).
        value: values at these times, shape (n,).
        level: level in the unit of the value.

    Returns:
        The time in s; NaN if the level is never reached.
    """
    above = np.flatnonzero(value >= level)
    if not above.size:
        return math.nan
    place = int(above[0])
    if place == 0:
        return float(time[0])
    share = (level - value[place - 1]) / (value[place] - value[place - 1])
    return float(time[place - 1] + share * (time[place] - time[place - 1]))


def first_fall(time: NDArray[np.float64], value: NDArray[np.float64], level: float) -> float:
    """Return when a value first reaches a level from above, once it has been above it.

    Samples before the first one above the level are the approach and do not count. Otherwise as `first_rise`; NaN if
    the value never is above the level.

    Args:
        time: times in s, non-decreasing, shape (n,).
        value: values at these times, shape (n,).
        level: level in the unit of the value.
    """
    above = np.flatnonzero(value > level)
    if not above.size:
        return math.nan
    start = int(above[0])
    return first_rise(time[start:], -value[start:], -level)


_LAST_V = 0.05
"""Span in V before the lower limit that gives the voltage's slope there; larger than any tester's noise."""

_LAST_PART = 1.25
"""Multiple of the cut-off current below which the current gives its rate of decay."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """The limits of a test; None where unknown.

    Attributes:
        upper: end-of-charge voltage [V].
        lower: end-of-discharge voltage [V].
        cut_off: end-of-charge current, magnitude [A].
        tolerance: the upper voltage counts as reached this far below it [V], because a supply only approaches it.
    """

    upper: float | None = None
    lower: float | None = None
    cut_off: float | None = None
    tolerance: float = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Flow:
    """Charge and energy in each interval between samples; arrays of shape (n - 1,), non-negative.

    Attributes:
        charge: by kind of step [Ah].
        energy: by kind of step [Wh].
        open_charge: by kind, standard uncertainty [Ah] from the unknown switching instant, uniform over the interval
            (JCGM 100:2008, 4.3.7). Zero without a switch, or where the instrument counted.
        open_energy: likewise [Wh].
        lost: whether the interval is a gap with a change of state, so that its content is unknown.
        broken: whether it lies between two stretches, so that its content is unknown too.
        bridged: whether it is a gap within one state, bridged by a straight line.
    """

    charge: dict[StepKind, NDArray[np.float64]]
    energy: dict[StepKind, NDArray[np.float64]]
    open_charge: dict[StepKind, NDArray[np.float64]]
    open_energy: dict[StepKind, NDArray[np.float64]]
    lost: NDArray[np.bool_]
    broken: NDArray[np.bool_]
    bridged: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class HalfCycle:
    """The charge or discharge of a cycle; NaN where a value cannot be determined.

    Attributes:
        start: start time on the series' time axis [s].
        duration: time from the first sample to the last, without rests between its parts [s].
        charge: charge [Ah].
        energy: energy [Wh].
        open_charge: standard uncertainty of `charge` from the switching instants [Ah].
        open_energy: likewise of `energy` [Wh].
        own_energy: energy counted by the instrument itself [Wh], NaN where it did not.
        mean_voltage: energy over charge [V].
        current: median magnitude [A].
        cc_time: time at constant current [s].
        cc_charge: charge at constant current [Ah].
        cv_time: time at constant voltage [s].
        cv_charge: charge at constant voltage [Ah].
        time_to_limit: time to the upper voltage of a charge, or the lower of a discharge; first crossing [s].
        charge_to_limit: charge until then [Ah], for a discharge the capacity at the cut-off voltage; linearly
            interpolated, as the voltage. NaN where the limit was not reached.
        energy_to_limit: likewise energy [Wh].
        time_to_cut_off: time until the current fell below the cut-off; first crossing [s].
        limit_sensitivity: shift of a discharge's `time_to_limit` per change of the level or offset of the meter
            [s/V]; from the last 0.05 V before it. NaN for a charge.
        cut_off_sensitivity: shift of `time_to_cut_off` [s/A]; from the last quarter above the cut-off, for an
            exponentially decaying current.
        highest_voltage: highest voltage [V].
        lowest_voltage: lowest voltage [V].
        last_change: change of voltage between the last two samples [V]; the unsampled end lies at most that far
            beyond the last one. NaN where there is only one sample.
        temperature_low: lowest temperature [degC].
        temperature_high: highest temperature [degC].
        temperature_mean: time-weighted mean temperature [degC].
        temperature_rise: highest minus first temperature [K].
        bridged_charge: part of `charge` from straight lines across gaps [Ah].
        gaps: number of gaps within it or at its ends.
    """

    start: float
    duration: float
    charge: float
    energy: float
    open_charge: float
    open_energy: float
    own_energy: float
    mean_voltage: float
    current: float
    cc_time: float
    cc_charge: float
    cv_time: float
    cv_charge: float
    time_to_limit: float
    charge_to_limit: float
    energy_to_limit: float
    time_to_cut_off: float
    limit_sensitivity: float
    cut_off_sensitivity: float
    highest_voltage: float
    lowest_voltage: float
    last_change: float
    temperature_low: float
    temperature_high: float
    temperature_mean: float
    temperature_rise: float
    bridged_charge: float
    gaps: int


def flow(data: Series, steps: Sequence[Step], how: Segmentation | None = None) -> Flow:
    """Return charge and energy of each interval, attributed to the kind of its step.

    The interval between two steps belongs to both; the trapezoid across it is unbiased, because the switching instant
    is uniform over it. Where the instrument counted charge and energy itself, its count replaces such an interval
    between rest and current.

    Args:
        data: the samples.
        steps: from `segment`.
        how: `Segmentation.gap` says what is a gap.
    """
    missing = gaps(data.time, how)
    turns = np.zeros(data.time.size - 1, dtype=bool)
    turns[[step.last for step in steps[:-1]]] = True
    broken = data.broken
    known = ~(missing & turns | broken)
    power = data.voltage * data.current
    signs = {StepKind.CHARGE: 1, StepKind.DISCHARGE: -1}
    edges = counted(data, steps)
    charge = {kind: one_way(data.time, data.current, sign) * known for kind, sign in signs.items()}
    energy = {kind: one_way(data.time, power, sign) * known for kind, sign in signs.items()}
    open_ = turns & known & ~edges.used
    for kind, sign in signs.items():
        used = edges.used & known
        charge[kind][used] = np.maximum(sign * edges.charge[used], 0.0)
        energy[kind][used] = np.maximum(sign * edges.energy[used], 0.0)
    return Flow(
        charge=charge,
        energy=energy,
        open_charge={kind: _open(data.time, sign * data.current) * open_ for kind, sign in signs.items()},
        open_energy={kind: _open(data.time, sign * power) * open_ for kind, sign in signs.items()},
        lost=missing & turns & ~broken,
        broken=broken,
        bridged=missing & ~turns,
    )


def _open(time: NDArray[np.float64], rate: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the standard uncertainty of the amount in each interval for a switching instant uniform over it."""
    most = np.clip(np.maximum(rate[:-1], rate[1:]), 0.0, None) * np.diff(time) / SECONDS_PER_HOUR
    return np.asarray(most / math.sqrt(12.0))


def half_cycle(data: Series, steps: Sequence[Step], flows: Flow, limits: Limits) -> HalfCycle:
    """Return the results of one or more steps of one kind, charge or discharge.

    Args:
        data: the samples.
        steps: at least one step, all of one kind, in order.
        flows: from `flow`.
        limits: levels for the crossing times.
    """
    kind = steps[0].kind
    parts = _intervals(data, steps)
    charge, energy = float(flows.charge[kind][parts].sum()), float(flows.energy[kind][parts].sum())
    samples = np.concatenate([np.arange(step.first, step.last + 1) for step in steps])
    voltage, elapsed = data.voltage[samples], _elapsed(data, steps)
    cv_time, cv_charge = _constant_voltage(data, steps, flows)
    warmth = _warmth(data, samples, elapsed)
    time_to_limit, limit_sensitivity = _time_to_limit(kind, elapsed, voltage, limits)
    time_to_cut_off, cut_off_sensitivity = _time_to_cut_off(data, steps, flows, elapsed, limits)
    return HalfCycle(
        start=float(data.time[steps[0].first]),
        duration=float(elapsed[-1]),
        charge=charge,
        energy=energy,
        open_charge=float(np.linalg.norm(flows.open_charge[kind][parts])),
        open_energy=float(np.linalg.norm(flows.open_energy[kind][parts])),
        own_energy=_own(data, parts, flows),
        mean_voltage=energy / charge if charge > 0 else math.nan,
        current=float(np.median(np.abs(data.current[samples]))),
        cc_time=float(elapsed[-1]) - cv_time,
        cc_charge=charge - cv_charge,
        cv_time=cv_time,
        cv_charge=cv_charge,
        time_to_limit=time_to_limit,
        charge_to_limit=_until(time_to_limit, elapsed, steps, parts, flows.charge[kind]),
        energy_to_limit=_until(time_to_limit, elapsed, steps, parts, flows.energy[kind]),
        time_to_cut_off=time_to_cut_off,
        limit_sensitivity=limit_sensitivity,
        cut_off_sensitivity=cut_off_sensitivity,
        highest_voltage=float(voltage.max()),
        lowest_voltage=float(voltage.min()),
        last_change=float(voltage[-1] - voltage[-2]) if voltage.size > 1 else math.nan,
        temperature_low=warmth[0],
        temperature_high=warmth[1],
        temperature_mean=warmth[2],
        temperature_rise=warmth[3],
        bridged_charge=float(flows.charge[kind][parts][flows.bridged[parts]].sum()),
        gaps=int((flows.bridged[parts] | flows.lost[parts]).sum()),
    )


@traced
def end_uncertainty(meter: float, last_change: float) -> float:
    """Return the standard uncertainty in V of the end voltage of a half-cycle, which lies after the last sample.

    The voltage changes after the last sample by at most `last_change`, uniformly distributed: JCGM 100:2008, 4.3.7,
    with that as the half-width.

    Args:
        meter: standard uncertainty of the meter [V].
        last_change: `HalfCycle.last_change` [V].
    """
    return math.hypot(meter, last_change / math.sqrt(3.0))


def _own(data: Series, parts: NDArray[np.int64], flows: Flow) -> float:
    """Return the instrument's count over these intervals, whichever sign it counts with."""
    if data.energy is None:
        return math.nan
    counted_there = np.diff(data.energy)[parts[~flows.broken[parts]]]
    return max(float(np.maximum(sign * counted_there, 0.0).sum()) for sign in (1.0, -1.0))


def _intervals(data: Series, steps: Sequence[Step]) -> NDArray[np.int64]:
    """Return the indices of the intervals within the steps and at their ends, without duplicates."""
    ranges = [np.arange(max(step.first - 1, 0), min(step.last + 1, data.time.size - 1)) for step in steps]
    return np.unique(np.concatenate(ranges)).astype(np.int64)


def _elapsed(data: Series, steps: Sequence[Step]) -> NDArray[np.float64]:
    """Return for each sample the accumulated duration of the steps, without the time between them."""
    passed, parts = 0.0, []
    for step in steps:
        part = data.time[step.first : step.last + 1]
        parts.append(part - part[0] + passed)
        passed = float(parts[-1][-1])
    return np.concatenate(parts)


def _constant_voltage(data: Series, steps: Sequence[Step], flows: Flow) -> tuple[float, float]:
    time = charge = 0.0
    for step in steps:
        if step.cv is not None:
            time += float(data.time[step.last] - data.time[step.cv])
            charge += float(flows.charge[step.kind][step.cv : min(step.last + 1, data.time.size - 1)].sum())
    return time, charge


def _time_to_limit(
    kind: StepKind, elapsed: NDArray[np.float64], voltage: NDArray[np.float64], limits: Limits
) -> tuple[float, float]:
    """Return when the voltage first reached its limit, and for a discharge the sensitivity of that time in s/V."""
    if kind is StepKind.CHARGE:
        upper = limits.upper
        return math.nan if upper is None else first_rise(elapsed, voltage, upper - limits.tolerance), math.nan
    if limits.lower is None:
        return math.nan, math.nan
    reached = first_fall(elapsed, voltage, limits.lower)
    return reached, (reached - first_fall(elapsed, voltage, limits.lower + _LAST_V)) / _LAST_V


def _until(
    moment: float,
    elapsed: NDArray[np.float64],
    steps: Sequence[Step],
    parts: NDArray[np.int64],
    flowing: NDArray[np.float64],
) -> float:
    """Return the charge or energy up to an instant of the steps, in Ah or Wh."""
    first = int(parts[0]) if parts.size else steps[0].first
    own = np.zeros(steps[-1].last - first)
    inside = parts[parts < steps[-1].last]
    own[inside - first] = flowing[inside]
    reached = cumulative(own)
    at = np.concatenate([reached[step.first - first : step.last + 1 - first] for step in steps])
    return math.nan if math.isnan(moment) else float(np.interp(moment, elapsed, at))


def _time_to_cut_off(
    data: Series, steps: Sequence[Step], flows: Flow, elapsed: NDArray[np.float64], limits: Limits
) -> tuple[float, float]:
    """Return when a charge's current first fell below the cut-off, and the sensitivity of that time in s/A.

    At the latest this is between the last sample and the next: a cycler that opens its relay at the cut-off may log no
    sample below it. A charge aborted well above the cut-off did not reach it.
    """
    if steps[0].kind is not StepKind.CHARGE or limits.cut_off is None:
        return math.nan, math.nan
    samples = np.concatenate([np.arange(step.first, step.last + 1) for step in steps])
    end = steps[-1].last
    ends_low = abs(data.current[end]) <= 2.0 * limits.cut_off
    if ends_low and end + 1 < data.time.size and not (flows.lost[end] or flows.broken[end]):
        samples = np.append(samples, end + 1)
        elapsed = np.append(elapsed, elapsed[-1] + data.time[end + 1] - data.time[end])
    current = np.maximum(data.current[samples], 0.0)
    reached = first_fall(elapsed, current, limits.cut_off)
    fades = (reached - first_fall(elapsed, current, _LAST_PART * limits.cut_off)) / math.log(_LAST_PART)
    return reached, fades / limits.cut_off


def _warmth(
    data: Series, samples: NDArray[np.int64], elapsed: NDArray[np.float64]
) -> tuple[float, float, float, float]:
    """Return lowest, highest and time-weighted mean temperature in degC, and the rise in K."""
    if data.temperature is None:
        return math.nan, math.nan, math.nan, math.nan
    kept = can_be_warm(data.temperature[samples])
    values, times = data.temperature[samples][kept], elapsed[kept]
    if not values.size:
        return math.nan, math.nan, math.nan, math.nan
    lasted = float(times[-1] - times[0])
    mean = float(np.trapezoid(values, times)) / lasted if lasted > 0 else float(values.mean())
    return float(values.min()), float(values.max()), mean, float(values.max() - values[0])
