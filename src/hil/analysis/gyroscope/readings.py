"""Readings of a gyroscope on a rotation table, and what pairs of opposite rates say of its scale and axes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from hil.analysis.tracing import traced
from hil.model.errors import Refused
from hil.model.figure import Figure, effective_dof

__all__ = ["Reading", "Response", "reading", "responses"]

_Array: TypeAlias = NDArray[np.float64]

_TOGETHER = 2.0  # K: rates measured within this share one temperature


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """The mean reading of every axis at one temperature, at rest or at one rate about one axis.

    Attributes:
        temperature: in degC.
        means: mean by axis, all of one unit, each with the uncertainty of a mean (see
            `hil.analysis.allan.noise.rest_mean`).
        rates: true rate by axis, in the same unit; axes that are absent do not turn.
    """

    temperature: float
    means: Mapping[str, Figure]
    rates: Mapping[str, float] = field(default_factory=dict)

    @property
    def turning(self) -> tuple[str, ...]:
        """The axes about which the table turns."""
        return tuple(axis for axis, rate in self.rates.items() if rate)


@traced
def reading(temperature: float, means: Mapping[str, Figure], rates: Mapping[str, Figure] | None = None) -> Reading:
    """Return a reading of which the true rates were measured, too.

    Args:
        temperature: in degC.
        means: mean by axis.
        rates: true rate by axis, in the same unit; None at rest.
    """
    return Reading(
        temperature=temperature, means=means, rates={axis: rate.value for axis, rate in (rates or {}).items()}
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """How all axes respond to rates about one of them, at one temperature.

    Attributes:
        axis: about which the table turned.
        temperature: mean of the readings' temperatures, in degC.
        low: lowest temperature of the readings, in degC.
        high: highest temperature of the readings, in degC.
        gains: change of each axis' reading per true rate, in unit 1; the biases cancel.
    """

    axis: str
    temperature: float
    low: float
    high: float
    gains: Mapping[str, Figure]


def responses(readings: Sequence[Reading]) -> tuple[Response, ...]:
    """Return the response about each axis at each temperature, in order of axis and temperature.

    Readings about one axis within 2 K belong together. With r the true rates and m the readings, the gain is the slope
    of m over r, with a free intercept, by weighted least squares; for two opposite rates (m+ - m-) / (r+ - r-).

    Raises:
        Refused: a reading turns about several axes, or a temperature lacks positive or negative rates.
    """
    groups: dict[str, list[list[Reading]]] = {}
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
    return tuple(_response(axis, group) for axis in groups for group in groups[axis])


def _response(axis: str, group: list[Reading]) -> Response:
    rates = np.array([reading.rates[axis] for reading in group])
    temperatures = [reading.temperature for reading in group]
    temperature = float(np.mean(temperatures))
    if not (rates.min() < 0.0 < rates.max()):
        raise Refused(
            f"axis {axis} turned in one direction only near {temperature:g} degC",
            "measure positive and negative rates at each temperature, so that the bias cancels",
        )
    gains = {name: _slope(rates, [reading.means[name] for reading in group]) for name in group[0].means}
    return Response(axis=axis, temperature=temperature, low=min(temperatures), high=max(temperatures), gains=gains)


def _slope(rates: _Array, means: Sequence[Figure]) -> Figure:
    spread = [figure.uncertainty for figure in means]
    known = [each for each in spread if each]
    weight = 1.0 / np.array(known) if len(known) == len(spread) else np.ones(rates.size)
    design = np.column_stack([np.ones(rates.size), rates]) * weight[:, None]
    row = np.linalg.pinv(design)[1] * weight
    value = float(row @ np.array([figure.value for figure in means]))
    if len(known) != len(spread):
        return Figure(value=value, unit="1")
    variances = np.square(row / weight).tolist()
    return Figure(
        value=value,
        unit="1",
        uncertainty=math.sqrt(sum(variances)),
        dof=effective_dof(zip(variances, (figure.dof for figure in means), strict=True)),
    )
