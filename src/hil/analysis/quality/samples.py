"""Gates on the values of a channel: not finite, stuck, repeated, saturated."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from hil.analysis.quality.gate import Facts, Gate

__all__ = ["finite", "repeated", "saturated", "stuck"]

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
