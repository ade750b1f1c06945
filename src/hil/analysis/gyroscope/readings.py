"""Readings of a gyroscope on a rotation table, and its gains from pairs of opposite rates."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.gates import Gate, factor_of
from hil.analysis.tracing import traced
from hil.model.errors import Refused
from hil.model.figure import Figure, effective_dof

__all__ = ["Reading", "Response", "Slow", "implausible", "reading", "responses", "rippling"]

_Array: TypeAlias = NDArray[np.float64]

_FOR_GOOD = 86400.0  # s: slower flicker counts as part of the bias
_SHORTEST = 5.0  # s: e^-1.5 of 20 s, the effect of averaging; for one minute it makes the variance 10 % too large
_UNLIKE = 1.5  # a gain above this, or below its reciprocal, exceeds any sensor's tolerance
_OTHER = 2.0  # multiple of the own gain at which another axis is the one that responds
_TOGETHER = 2.0  # K: rates within this belong to one temperature


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """Mean reading of every axis at one temperature, at rest or at one rate about one axis.

    Attributes:
        temperature: temperature [degC].
        means: mean by axis, all in one unit, each with the uncertainty of a mean (see
            `hil.analysis.allan.averaging.rest_mean`).
        rates: true rate by axis, in the same unit; absent axes do not turn.
        at: time since the sensor was started [s], over which its bias has wandered.
        mounting: the axis along the table's, which senses the same Earth rate at every table angle.
    """

    temperature: float
    means: Mapping[str, Figure]
    rates: Mapping[str, float] = field(default_factory=dict)
    at: float = 0.0
    mounting: str = ""

    @property
    def turning(self) -> tuple[str, ...]:
        """The axes about which the table turns."""
        return tuple(axis for axis, rate in self.rates.items() if rate)


@traced
def reading(
    temperature: float,
    means: Mapping[str, Figure],
    rates: Mapping[str, Figure] | None = None,
    *,
    at: float = 0.0,
    mounting: str = "",
) -> Reading:
    """Return a reading whose true rates were measured as well.

    Args:
        temperature: temperature [degC].
        means: mean by axis.
        rates: true rate by axis, in the same unit; None at rest.
        at: time since the sensor was started [s].
        mounting: the axis along the table's.
    """
    true = {axis: rate.value for axis, rate in (rates or {}).items()}
    return Reading(temperature=temperature, means=means, rates=true, at=float(at), mounting=mounting)


@traced
def rippling(samples: ArrayLike, rate: float, turning: float) -> _Array:
    """Return the zero-mean component of samples that is periodic with the turn of the table, shape (n,).

    The table's ripple is part of the mean rate that its encoder measures, not noise of the mean. With it subtracted,
    the samples keep their mean, and their scatter is the sensor's.

    Args:
        samples: shape (n,), in a rate's unit; NaN marks a missing sample.
        rate: sampling rate [Hz].
        turning: rate of the table [deg/s].
    """
    values = np.asarray(samples, dtype=np.float64)
    angle = np.radians(turning) / rate * np.arange(values.size)
    design = np.column_stack([np.ones(values.size), np.cos(angle), np.sin(angle)])
    present = np.isfinite(values)
    if present.sum() <= design.shape[1]:
        return np.zeros(values.size)
    found = np.linalg.lstsq(design[present], values[present], rcond=None)[0]
    wave = design[:, 1:] @ found[1:]
    return np.asarray(wave - wave[present].mean(), dtype=np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class Slow:
    """Errors slower than one reading, so that its scatter does not show them.

    Attributes:
        earth: standard uncertainty of the Earth's rate about an axis, in the readings' unit.
        flicker: B of the bias, in the readings' unit.
        random_walk: K of the bias, in the readings' unit times sqrt(Hz).
    """

    earth: float = 0.0
    flicker: float = 0.0
    random_walk: float = 0.0

    @traced
    def uncertainty(self, at: float) -> float:
        """Return a reading's standard uncertainty from these errors, at a time in s since the start, in their unit."""
        wandered = self.random_walk**2 * at + self.flicker**2 / math.pi * math.log(_FOR_GOOD / _SHORTEST)
        return math.sqrt(self.earth**2 + wandered)

    def covariance(self, readings: Sequence[Reading], axis: str) -> _Array:
        """Return the covariance of an axis's readings from their common errors, shape (n, n), in unit squared.

        The sum of earth^2, common to the readings of one mounting for the axis along the table's, and independent
        between readings for the others, whose direction changes with the table angle; of K^2 min(t_i, t_j), which is
        zero at the start; and of B^2/pi ln(T / (|t_i - t_j| + s)), the covariance of flicker noise above 1/T: T is one
        day, beyond which it counts as part of the bias, and s is 5 s, about the effect of averaging over a reading. The
        last is convex and decreasing, and therefore a covariance (Polya).
        """
        at = np.array([each.at for each in readings])
        mounting = np.array([each.mounting for each in readings])
        same = (mounting[:, None] == axis) & (mounting[None, :] == axis) | np.eye(at.size, dtype=bool)
        apart = np.abs(at[:, None] - at[None, :])
        flicker = self.flicker**2 / math.pi * np.log(np.maximum(_FOR_GOOD / (apart + _SHORTEST), 1.0))
        walk = self.random_walk**2 * np.minimum(at[:, None], at[None, :])
        return np.asarray(self.earth**2 * same + flicker + walk, dtype=np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """Response of all axes to rates about one of them, at one temperature.

    Attributes:
        axis: axis of rotation.
        temperature: mean temperature of the readings [degC].
        low: lowest temperature of the readings [degC].
        high: highest temperature of the readings [degC].
        gains: change of each axis's reading per true rate, in unit 1; the biases cancel.
        one_way: whether the table turned in one direction only, with readings at rest as the bias.
    """

    axis: str
    temperature: float
    low: float
    high: float
    gains: Mapping[str, Figure]
    one_way: bool = False


def responses(readings: Sequence[Reading], slow: Slow | None = None) -> tuple[Response, ...]:
    """Return the response about each axis at each temperature, in order of axis and temperature.

    Readings about one axis within 2 K form a group. With r the true rates and m the readings, the gain is the slope of
    m over r, with a free intercept, by weighted least squares; for two opposite rates (m+ - m-) / (r+ - r-). Where all
    rates of a group have one sign, readings at rest within 2 K are included at rate 0: the gain in the other direction
    is then assumed equal, and the bias that of rest.

    Args:
        readings: readings, with `at` where the bias wanders.
        slow: their common errors; a change of these between rates is not the sensor's response.

    Raises:
        Refused: a reading turns about several axes, or a temperature has rates in one direction only
            and no reading at rest.
    """
    groups: dict[str, list[list[Reading]]] = {}
    resting = [reading for reading in readings if not reading.turning]
    for reading in sorted(readings, key=lambda each: each.temperature):
        if len(reading.turning) > 1:
            raise Refused(
                f"at {reading.temperature:g} degC the table turns about {' and '.join(reading.turning)}",
                "give readings with a rate about one axis each",
            )
        for axis in reading.turning:
            found = groups.setdefault(axis, [])
            if found and reading.temperature - found[-1][0].temperature <= _TOGETHER:
                found[-1].append(reading)
            else:
                found.append([reading])
    return tuple(_response(axis, group, resting, slow or Slow()) for axis in groups for group in groups[axis])


def _response(axis: str, group: list[Reading], resting: list[Reading], slow: Slow) -> Response:
    temperatures = [reading.temperature for reading in group]
    temperature = float(np.mean(temperatures))
    signs = {reading.rates[axis] > 0.0 for reading in group}
    if len(signs) == 1:
        still = [reading for reading in resting if abs(reading.temperature - temperature) <= _TOGETHER]
        if not still:
            raise Refused(
                f"axis {axis} turned in one direction only near {temperature:g} degC, and no reading at rest is there",
                "measure positive and negative rates at each temperature, or at rest as well, so that the bias cancels",
            )
        group = [*group, *still]
    rates = np.array([reading.rates.get(axis, 0.0) for reading in group])
    gains = {
        name: _slope(rates, [reading.means[name] for reading in group], slow.covariance(group, name))
        for name in group[0].means
    }
    low, high = min(temperatures), max(temperatures)
    return Response(axis=axis, temperature=temperature, low=low, high=high, gains=gains, one_way=len(signs) == 1)


def implausible(found: Sequence[Response]) -> tuple[Gate, ...]:
    """Return a gate per turned axis on its gain: response to its own rate, in the same unit, with the same sign.

    A gain between 2/3 and 1.5 is plausible. Other gains are identified where they match radians against degrees, or a
    factor of a thousand.
    """
    return tuple(_asked(axis, found) for axis in dict.fromkeys(each.axis for each in found))


def _asked(axis: str, found: Sequence[Response]) -> Gate:
    gains = {
        name: float(np.median([each.gains[name].value for each in found if each.axis == axis]))
        for name in found[0].gains
    }
    own, most = gains[axis], max(gains, key=lambda name: abs(gains[name]))
    reason = f"{own:.4g} of its rate is read"
    factor = factor_of(abs(own)) or factor_of(1.0 / abs(own) if own else math.inf)
    if most != axis and abs(gains[most]) > max(_OTHER * abs(own), 1.0 / _UNLIKE):
        reason += f", and {gains[most]:.4g} by {most}: the axis does not move, or is another one"
    elif abs(own) < 1.0 / _UNLIKE or abs(own) > _UNLIKE:
        reason += f", {factor}" if factor else ": it does not move as it was turned, or its unit or range is another"
    elif own < 0.0:
        reason += ": the sign of its rates, or of its readings, is wrong"
    else:
        return Gate(name="gain", channel=axis, ok=True, reason=reason)
    return Gate(name="gain", channel=axis, ok=False, reason=reason)


def _slope(rates: _Array, means: Sequence[Figure], wandering: _Array) -> Figure:
    spread = [figure.uncertainty for figure in means]
    known = [each for each in spread if each]
    weight = 1.0 / np.array(known) if len(known) == len(spread) else np.ones(rates.size)
    design = np.column_stack([np.ones(rates.size), rates]) * weight[:, None]
    row = np.linalg.pinv(design)[1] * weight
    value = float(row @ np.array([figure.value for figure in means]))
    if len(known) != len(spread):
        return Figure(value=value, unit="1")
    variances = [*np.square(row / weight).tolist(), max(0.0, float(row @ wandering @ row))]
    return Figure(
        value=value,
        unit="1",
        uncertainty=math.sqrt(sum(variances)),
        dof=effective_dof(zip(variances, (*(figure.dof for figure in means), math.inf), strict=True)),
    )
