"""The figures of one charge or one discharge: capacity, energy, times, and temperatures."""

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

    The first crossing counts, even if noise takes the value back below the level. Between the two samples around it the
    value is interpolated linearly. A value that begins at the level or above it has reached it at once.

    Args:
        time: in s, not falling, shape (n,).
        value: at these times.
        level: in the unit of the value.

    Returns:
        The time in s, NaN where the level is never reached.
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
    """Return when a value, having been above a level, first reaches it from above; else as `first_rise`.

    Samples before the first one above the level do not count. NaN where the value never was
    above the level.

    Args:
        time: in s, not falling, shape (n,).
        value: at these times.
        level: in the unit of the value.
    """
    above = np.flatnonzero(value > level)
    if not above.size:
        return math.nan
    start = int(above[0])
    return first_rise(time[start:], -value[start:], -level)


_LAST_V = 0.05
"""Over these V before its lower limit a voltage says how fast it comes there; beyond the noise of any tester."""

_LAST_PART = 1.25
"""From this many times the cut-off on a current says how fast it fades."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """The levels that a test is run between; None if they are not known.

    Attributes:
        upper: end of charge, in V.
        lower: end of discharge, in V.
        cut_off: magnitude of the current in A at which charging ends.
        tolerance: the upper voltage counts as reached this far below it, in V, because a supply only approaches it.
    """

    upper: float | None = None
    lower: float | None = None
    cut_off: float | None = None
    tolerance: float = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Flow:
    """What flows in each interval between samples; arrays of shape (n - 1,), none below zero.

    Attributes:
        charge: by kind of step, in Ah.
        energy: by kind of step, in Wh.
        open_charge: by kind, standard uncertainty in Ah that the unknown moment of a switch leaves in an interval: any
            moment of it is as likely (JCGM 100:2008, 4.3.7). Zero where no switch is, or where the instrument counted.
        open_energy: likewise in Wh.
        lost: whether the interval is a gap across which the state changed, so that nothing is known of it.
        broken: whether it lies between two stretches, so that nothing is known of it either.
        bridged: whether it is a gap within one state, where a straight line replaces the missing samples.
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
    """The charge or the discharge of a cycle. What cannot be determined is NaN.

    Attributes:
        start: s after the series' own zero.
        duration: s from the first sample to the last, rests between its parts not counted.
        charge: Ah.
        energy: Wh.
        open_charge: standard uncertainty of `charge` in Ah that the moments of switching leave.
        open_energy: likewise of `energy`, in Wh.
        own_energy: Wh that the instrument itself counted, NaN where it did not.
        mean_voltage: energy over charge, in V.
        current: median magnitude in A.
        cc_time: s at constant current.
        cc_charge: Ah at constant current.
        cv_time: s at constant voltage.
        cv_charge: Ah at constant voltage.
        time_to_limit: s to the upper voltage of a charge, to the lower of a discharge; first crossing.
        charge_to_limit: Ah until then, for a discharge the capacity at the cut-off voltage; between two samples on a
            straight line, as the voltage. NaN where the limit was not reached.
        energy_to_limit: likewise Wh.
        time_to_cut_off: s until the current fell below the cut-off; first crossing.
        limit_sensitivity: by how many s `time_to_limit` of a discharge moves per V of the level, or of an offset of
            the meter; from the last 0.05 V before it. NaN for a charge.
        cut_off_sensitivity: by how many s `time_to_cut_off` moves per A; from the last quarter above the cut-off, as
            of a current that fades exponentially.
        highest_voltage: V.
        lowest_voltage: V.
        last_change: V from the last sample but one to the last; the end, which no sample shows, lies as far beyond the
            last one at most. NaN where there is one sample only.
        temperature_low: degC.
        temperature_high: degC.
        temperature_mean: degC, over time.
        temperature_rise: highest less first, in K.
        bridged_charge: Ah of `charge` that come from straight lines across gaps.
        gaps: how many gaps lie within or at its ends.
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
    """Return what flows in each interval, each part given to the kind of step that it belongs to.

    The interval between two steps lies in both; the trapezoid across it is right on average, because the switch may
    have come at any moment of it. Where the instrument counted charge and energy itself, its count stands for such an
    interval between rest and current.

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
    """Return the standard uncertainty of what flowed in each interval if it was switched at any moment of it."""
    most = np.clip(np.maximum(rate[:-1], rate[1:]), 0.0, None) * np.diff(time) / SECONDS_PER_HOUR
    return np.asarray(most / math.sqrt(12.0))


def half_cycle(data: Series, steps: Sequence[Step], flows: Flow, limits: Limits) -> HalfCycle:
    """Return the figures of one or more steps of one kind, charge or discharge.

    Args:
        data: the samples.
        steps: of one kind, in order, at least one.
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
    """Return the standard uncertainty in V of the voltage at the end of a half-cycle, which no sample shows.

    The end lies after the last sample, by a change of voltage that is at most `last_change` and as likely anywhere up
    to it: JCGM 100:2008, 4.3.7, with that as the half-width.

    Args:
        meter: standard uncertainty of the meter, in V.
        last_change: of `HalfCycle`, in V.
    """
    return math.hypot(meter, last_change / math.sqrt(3.0))


def _own(data: Series, parts: NDArray[np.int64], flows: Flow) -> float:
    """Return what the instrument counted in these intervals; the sign of its count may be either."""
    if data.energy is None:
        return math.nan
    counted_there = np.diff(data.energy)[parts[~flows.broken[parts]]]
    return max(float(np.maximum(sign * counted_there, 0.0).sum()) for sign in (1.0, -1.0))


def _intervals(data: Series, steps: Sequence[Step]) -> NDArray[np.int64]:
    """Return the intervals within the steps and those at their ends, each once."""
    ranges = [np.arange(max(step.first - 1, 0), min(step.last + 1, data.time.size - 1)) for step in steps]
    return np.unique(np.concatenate(ranges)).astype(np.int64)


def _elapsed(data: Series, steps: Sequence[Step]) -> NDArray[np.float64]:
    """Return for each sample the time that the steps have lasted so far, what lies between them left out."""
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
    """Return when the voltage first reached its limit, and for a discharge by how many s that moves per V."""
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
    """Return what has flowed until a moment of the steps, in Ah or Wh."""
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
    """Return when a charge's current first fell below the cut-off, and by how many s that moves per A.

    It is at the latest between its last sample and the next. A cycler that opens its relay at the cut-off may show no
    sample below it. A charge that was broken off well above the cut-off did not reach it.
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
    """Return lowest, highest, mean over time, and rise."""
    if data.temperature is None:
        return math.nan, math.nan, math.nan, math.nan
    kept = can_be_warm(data.temperature[samples])
    values, times = data.temperature[samples][kept], elapsed[kept]
    if not values.size:
        return math.nan, math.nan, math.nan, math.nan
    lasted = float(times[-1] - times[0])
    mean = float(np.trapezoid(values, times)) / lasted if lasted > 0 else float(values.mean())
    return float(values.min()), float(values.max()), mean, float(values.max() - values[0])
