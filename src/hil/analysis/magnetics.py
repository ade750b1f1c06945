"""Field of a coil, separated from the Earth's: odd response to the current, and its direction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.statistics import mean, not_observable
from hil.analysis.tracing import traced
from hil.model.figure import Figure, effective_dof

__all__ = ["Direction", "Response", "direction", "odd_response"]

_AXES = ("x", "y", "z")
_Vector = NDArray[np.float64]
_Phase = Sequence[ArrayLike] | _Vector


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Response:
    """A coil's contribution to the field.

    Attributes:
        odd: (3,), the part that changes sign with the current: the coil's field at +I.
        odd_covariance: (3, 3), covariance of `odd`; NaN where not observable.
        even: (3,), the part common to both signs of the current. It should be zero: heating, remanence, or
            interference from the supply shows here.
        even_covariance: (3, 3), covariance of `even`; NaN where not observable.
        drift: (3,), slope of the ambient field that was removed, in `unit` per unit of `times`.
        unit: unit of the field.
        repetitions: number of repetitions of the three phases.
    """

    odd: _Vector
    odd_covariance: _Vector
    even: _Vector
    even_covariance: _Vector
    drift: _Vector
    unit: str
    repetitions: int

    @property
    def dof(self) -> float:
        """Degrees of freedom of both covariances."""
        return max(self.repetitions - 1.0, 1.0)

    @property
    def observable(self) -> bool:
        """Whether the data determine the field and its uncertainty."""
        return bool(np.isfinite(self.odd_covariance).all())

    @traced
    def component(self, axis: str) -> Figure:
        """Return one component (`x`, `y` or `z`) of the odd part."""
        if axis not in _AXES:
            raise ValueError(f"axes are x, y and z, got {axis!r}")
        return _along(self, np.eye(3)[_AXES.index(axis)])


@dataclass(frozen=True, slots=True, kw_only=True)
class Direction:
    """Direction of a coil's field.

    Significance and sense are statistics, exact as computed, so limits on them use the decision rule `simple`.

    Attributes:
        angle: angle between the field and the outward normal, 0 to 180 deg.
        projection: projection of the field on the outward normal; its sign determines the winding sense.
        significance: |projection| over its standard uncertainty.
        sense: +1 where the field leaves the outer face, -1 where it enters; NOT_OBSERVABLE where the projection is
            not significant. Current that runs counter-clockwise, seen from outside, gives +1 by the right-hand
            rule.
    """

    angle: Figure
    projection: Figure
    significance: Figure
    sense: Figure


@traced
def odd_response(
    plus: _Phase,
    zero: _Phase,
    minus: _Phase,
    *,
    times: ArrayLike | None = None,
    unit: str = "uT",
) -> Response:
    """Separate a coil's field from the Earth's field, the magnetometer's offset, and their drift.

    Model for phase p (current +I, 0, -I) of repetition r at time t: B = E + d t + s b + s^2 e + noise, with s = +1, 0
    or -1. The drift d is the slope of the repetitions' means over time; with it removed,
    odd_r = (B+ - B-) / 2 and even_r = (B+ + B- - 2 B0) / 2. A linear drift cancels exactly, in any order of the
    phases. A quadratic drift q t^2 in equally spaced phases of one order cancels in the mean of `odd`, but shows in its
    scatter, and `even` keeps q times the square of the spacing. Faster changes are noise.

    The covariance is the scatter of the repetitions over their number, plus that of the slope; degrees of freedom are
    repetitions - 1. Its diagonal is at least the contribution of the noise within the phases. With one repetition, or a
    value that is not finite, the result is not observable.

    Args:
        plus: at +I: (repetitions, 3) means, or (repetitions, samples, 3) raw samples; phases may differ in length.
        zero: the same without current.
        minus: the same at -I.
        times: (repetitions, 3), midpoints of the phases at +I, 0, -I in any unit of time; by default consecutive
            phases of equal length in the order +I, 0, -I.
        unit: unit of the fields.

    Raises:
        ValueError: the phases differ in their number of repetitions, or the shapes do not match.
    """
    (high, high_noise), (rest, rest_noise), (low, low_noise) = (_phase(data) for data in (plus, zero, minus))
    if not len(high) == len(rest) == len(low):
        raise ValueError(f"+I was measured {len(high)} times, no current {len(rest)} times, -I {len(low)} times")
    fields = np.stack([high, rest, low], axis=1)  # (repetitions, phase, axis)
    when = _times(times, len(fields))
    if len(fields) < 2 or not np.isfinite(fields).all():  # one repetition cannot separate drift from current
        return _unobservable(fields, unit)
    drift, drift_covariance = _drift(fields, when)
    when = when - when.mean()
    high, rest, low = np.moveaxis(fields - when[:, :, None] * drift, 1, 0)
    lever = when.mean(axis=0)  # sensitivity of the phases to an error of the slope
    quarter = 4 * len(fields) ** 2
    odd, even = (high - low) / 2, (high + low - 2 * rest) / 2
    return Response(
        odd=odd.mean(axis=0),
        odd_covariance=_covariance(
            odd,
            drift_covariance * (lever[0] - lever[2]) ** 2 / 4,
            (high_noise + low_noise).sum(axis=0) / quarter,
        ),
        even=even.mean(axis=0),
        even_covariance=_covariance(
            even,
            drift_covariance * (lever[0] + lever[2] - 2 * lever[1]) ** 2 / 4,
            (high_noise + low_noise + 4 * rest_noise).sum(axis=0) / quarter,
        ),
        drift=drift,
        unit=unit,
        repetitions=len(fields),
    )


@traced
def direction(
    response: Response, outward_normal: ArrayLike, *, alignment: float = 0.0, significant: float = 5.0
) -> Direction:
    """Compare the direction of a coil's field with the outward normal of its board.

    Angle = atan2(|b x n|, b . n), uncertainty to first order. Noise in the second transverse direction affects the
    angle only to second order, unless the angle is within its own noise; it is included to that extent.

    Args:
        response: the coil's response, from `odd_response`.
        outward_normal: (3,), in the magnetometer's axes, of any nonzero length.
        alignment: standard uncertainty of the magnetometer's alignment with the board [deg].
        significant: significance in standard uncertainties needed for the sign of the projection, and for the
            angle of a field.
    """
    normal = np.asarray(outward_normal, dtype=float)
    if normal.shape != (3,) or not np.isfinite(normal).all() or not normal.any():
        raise ValueError(f"the outward normal must be three finite numbers that are not all zero, got {normal}")
    normal = normal / np.linalg.norm(normal)
    projection = _along(response, normal)
    if not projection.uncertainty:  # unknown; or no scatter at all, which shows nothing about the noise
        ratio, sense = not_observable("1"), not_observable("1")
    else:
        score = abs(projection.value) / projection.uncertainty
        ratio = Figure(value=score, unit="1", uncertainty=0.0)
        sign = math.copysign(1.0, projection.value)
        seen = score >= significant
        sense = Figure(value=sign, unit="1", uncertainty=0.0) if seen else not_observable("1", sign)
    angle = _angle(response, normal, alignment, significant)
    return Direction(angle=angle, projection=projection, significance=ratio, sense=sense)


def _phase(data: _Phase) -> tuple[_Vector, _Vector]:
    """Return means and their variances within the phases, both (repetitions, 3); zero variance for given means."""
    means, variances = [], []
    for item in data:
        block = np.asarray(item, dtype=float)
        if block.ndim == 2 and block.shape[1] == 3:
            figures = [mean(block[:, axis], "1") for axis in range(3)]
            means.append([figure.value for figure in figures])
            variances.append([(figure.uncertainty or 0.0) ** 2 for figure in figures])
        elif block.shape == (3,):
            means.append(block.tolist())
            variances.append([0.0, 0.0, 0.0])
        else:
            raise ValueError(f"a phase is one vector (3,) or samples (n, 3), got an array of shape {block.shape}")
    return np.array(means).reshape(-1, 3), np.array(variances).reshape(-1, 3)


def _times(times: ArrayLike | None, repetitions: int) -> _Vector:
    """Return the midpoints of the phases, (repetitions, 3), validated."""
    if times is None:
        return np.arange(3.0 * repetitions).reshape(repetitions, 3)
    when = np.asarray(times, dtype=float)
    if when.shape != (repetitions, 3):
        raise ValueError(f"times have shape {when.shape}, the phases need ({repetitions}, 3)")
    if not np.isfinite(when).all() or (repetitions > 1 and not np.ptp(when.mean(axis=1))):
        raise ValueError("times must be finite, and the repetitions must follow each other")
    return when


def _drift(fields: _Vector, when: _Vector) -> tuple[_Vector, _Vector]:
    """Return the slope (3,) of the repetitions' means and its covariance (3, 3).

    In the mean of the three phases the coil's odd part cancels and the even part is constant; for equal noise in all
    phases it is independent of the odd part.
    """
    middles = when.mean(axis=1) - when.mean()
    level = fields.mean(axis=1)
    length = float(middles @ middles)
    slope = middles @ level / length
    if len(fields) > 2:
        rest = level - level.mean(axis=0) - np.outer(middles, slope)
        spread = rest.T @ rest / (len(fields) - 2)
    else:  # two points leave no residual; for equal noise the mean of three has 2/3 of half a difference's variance
        spread = np.cov((fields[:, 0] - fields[:, 2]).T / 2) * 2 / 3
    return slope, spread / length


def _covariance(parts: _Vector, drift: _Vector, floor: _Vector) -> _Vector:
    """Return the covariance (3, 3) of the mean of `parts` (repetitions, 3), its diagonal not below `floor` (3,)."""
    covariance: _Vector = np.cov(parts.T) / len(parts) + drift
    covariance += np.diag(np.maximum(floor - np.diag(covariance), 0.0))
    return covariance


def _unobservable(fields: _Vector, unit: str) -> Response:
    """Return the response of one repetition, or of values that are not finite: values without uncertainty."""
    plus, zero, minus = fields.sum(axis=0) / len(fields) if len(fields) else np.full((3, 3), np.nan)
    unknown = np.full((3, 3), np.nan)
    return Response(
        odd=(plus - minus) / 2,
        odd_covariance=unknown,
        even=(plus + minus - 2 * zero) / 2,
        even_covariance=unknown,
        drift=np.full(3, np.nan),
        unit=unit,
        repetitions=len(fields),
    )


def _along(response: Response, normal: _Vector) -> Figure:
    """Return the odd part along a unit vector."""
    value = float(response.odd @ normal)
    if not response.observable:
        return not_observable(response.unit, value)
    spread = math.sqrt(max(float(normal @ response.odd_covariance @ normal), 0.0))
    return Figure(value=value, unit=response.unit, uncertainty=spread, dof=response.dof)


def _angle(response: Response, normal: _Vector, alignment: float, significant: float) -> Figure:
    """Return the angle between the odd part and a unit vector; not observable for a field within its noise."""
    field, covariance = response.odd, response.odd_covariance
    along = float(field @ normal)
    across = field - along * normal
    offside = float(np.linalg.norm(across))
    value = math.degrees(math.atan2(offside, along))
    square = along**2 + offside**2
    if not response.observable or not square > significant**2 * float(np.linalg.eigvalsh(covariance)[-1]):
        return not_observable("deg", value)
    aside = across / offside if offside else _any_perpendicular(normal)
    third = np.cross(normal, aside)
    slope = (along * aside - offside * normal) / square
    first = float(slope @ covariance @ slope)
    second = float(third @ covariance @ third)
    noise = second + float(aside @ covariance @ aside)
    share = min(1.0, noise / offside**2) if offside else 1.0
    variance = (first + share * second / square) * math.degrees(1.0) ** 2
    return Figure(
        value=value,
        unit="deg",
        uncertainty=math.sqrt(max(variance, 0.0) + alignment**2),
        dof=effective_dof([(variance, response.dof), (alignment**2, math.inf)]),
    )


def _any_perpendicular(normal: _Vector) -> _Vector:
    """Return a unit vector perpendicular to a unit vector."""
    across: _Vector = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    return across / float(np.linalg.norm(across))
