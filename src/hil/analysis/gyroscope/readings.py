"""Readings of a gyroscope on a rotation table, and its scale and axes from pairs of opposite rates."""

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

_FOR_GOOD = 86400.0  # s: what flickers slower counts as part of the bias
_SHORTEST = 5.0  # s: e^-1.5 of 20 s, which is what averaging leaves; of a minute it makes the variance 10 % too large
_UNLIKE = 1.5  # a gain above this, or below one over it, is no tolerance of a sensor
_OTHER = 2.0  # times the own gain: another axis responds
_TOGETHER = 2.0  # K: rates measured within this share one temperature


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """The mean reading of every axis at one temperature, at rest or at one rate about one axis.

    Attributes:
        temperature: in degC.
        means: mean by axis, all of one unit, each with the uncertainty of a mean (see
            `hil.analysis.allan.averaging.rest_mean`).
        rates: true rate by axis, in the same unit; axes that are absent do not turn.
        at: time in s since the sensor was started, over which its bias has wandered.
        mounting: the axis along that of the table, which sees one rate of the Earth however the table stands.
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
        temperature: in degC.
        means: mean by axis.
        rates: true rate by axis, in the same unit; None at rest.
        at: time in s since the sensor was started.
        mounting: the axis along that of the table.
    """
    true = {axis: rate.value for axis, rate in (rates or {}).items()}
    return Reading(temperature=temperature, means=means, rates=true, at=float(at), mounting=mounting)


@traced
def rippling(samples: ArrayLike, rate: float, turning: float) -> _Array:
    """Return the part of samples that repeats once per turn of the table, with zero mean, shape (n,).

    The table's own ripple is in its mean rate, as measured by its encoder: it is not noise of the mean. Without it the
    samples keep their mean, and their scatter is the sensor's.

    Args:
        samples: shape (n,), in a rate's unit; NaN marks a missing sample.
        rate: samples per second.
        turning: rate of the table in deg/s.
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
    """Errors that are slower than a reading, so that its scatter does not show them.

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
        """Return the standard uncertainty that a reading has from all of it, at a time in s since the start."""
        wandered = self.random_walk**2 * at + self.flicker**2 / math.pi * math.log(_FOR_GOOD / _SHORTEST)
        return math.sqrt(self.earth**2 + wandered)

    def covariance(self, readings: Sequence[Reading], axis: str) -> _Array:
        """Return the covariance of an axis' readings from what they have in common, shape (n, n), in unit squared.

        The sum of earth^2, among readings of one mounting for the axis that stands along the table's, for each reading
        by itself for the others, which look another way whenever the table has turned; of K^2 min(t_i, t_j), which is
        zero at the start; and of B^2/pi ln(T / (|t_i - t_j| + s)), the covariance of flicker noise above 1/T: T is a
        day, beyond which it counts as part of the bias, and s is 5 s, about what averaging over a reading leaves. The
        last one is convex and falling, so that it is a covariance (Polya).
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
    """How all axes respond to rates about one of them, at one temperature.

    Attributes:
        axis: about which the table turned.
        temperature: mean of the readings' temperatures, in degC.
        low: lowest temperature of the readings, in degC.
        high: highest temperature of the readings, in degC.
        gains: change of each axis' reading per true rate, in unit 1; the biases cancel.
        one_way: whether the table turned in one direction only, so that readings at rest give the bias.
    """

    axis: str
    temperature: float
    low: float
    high: float
    gains: Mapping[str, Figure]
    one_way: bool = False


def responses(readings: Sequence[Reading], slow: Slow | None = None) -> tuple[Response, ...]:
    """Return the response about each axis at each temperature, in order of axis and temperature.

    Readings about one axis within 2 K belong together. With r the true rates and m the readings, the gain is the slope
    of m over r, with a free intercept, by weighted least squares; for two opposite rates (m+ - m-) / (r+ - r-). Where
    all rates of a group have one sign, readings at rest within 2 K take part with the rate 0: then the gain of the
    other direction is assumed to be the same, and the bias that of rest.

    Args:
        readings: with `at` where the bias wanders.
        slow: what they have in common. Where that changes from one rate to the next, it is not the sensor's response.

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
    """Check the gain of every axis that turned: to its own rate, in the same unit, with the same sign.

    A gain between 2/3 and 1.5 is one that a sensor may have. Another one is named where it is that of radians and
    degrees, or of a thousandth.
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
