"""Characterisation of a coil: expected field, resistance, and linearity of its field with current."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hil.analysis.statistics import not_observable, root_sum_square
from hil.analysis.tracing import traced
from hil.model.figure import Figure, FigureStatus, effective_dof

__all__ = [
    "copper_at",
    "expected_field",
    "field_ratio",
    "line_residuals",
    "linearity",
    "on_axis_rectangle",
    "resistance",
]

_MU_0 = 1.25663706127e-6  # magnetic constant in N/A^2, CODATA 2022
_COPPER = 0.00393  # temperature coefficient of annealed copper at 20 degC, per K, IEC 60028
_REFERENCE = 20.0  # degC
_LENGTHS_AND_CURRENT = ("m", "m", "m", "A")


def on_axis_rectangle(turns: float, side_a: float, side_b: float, distance: float, current: float) -> float:
    """Return the field in T on the axis of a thin rectangular coil, along the normal of the right-hand rule.

    Sum of four straight wires (Biot and Savart): with D^2 = z^2 + a^2/4 + b^2/4,
    B = mu0 N I a b / (4 pi D) (1 / (z^2 + a^2/4) + 1 / (z^2 + b^2/4)); for a = b it is the square's
    mu0 N I a^2 / (2 pi (z^2 + a^2/4) sqrt(z^2 + a^2/2)). Air core, with all turns in one place.

    Args:
        turns: number of turns.
        side_a: one side in m, above zero.
        side_b: the other side in m, above zero.
        distance: z in m, from the plane of the coil.
        current: in A, with sign.
    """
    if not (side_a > 0 and side_b > 0):
        raise ValueError(f"the sides of a coil are above zero, got {side_a} m and {side_b} m")
    square, quarter_a, quarter_b = distance**2, side_a**2 / 4, side_b**2 / 4
    factor = _MU_0 * turns * current * side_a * side_b / (4 * math.pi * math.sqrt(square + quarter_a + quarter_b))
    return factor * (1 / (square + quarter_a) + 1 / (square + quarter_b))


@traced
def expected_field(turns: float, side_a: Figure, side_b: Figure, distance: Figure, current: Figure) -> Figure:
    """Return `on_axis_rectangle` in uT, with the uncertainties of its arguments propagated (GUM 10).

    Args:
        turns: number of turns, exact.
        side_a: one side in m.
        side_b: the other side in m.
        distance: from the plane of the coil in m.
        current: in A, with sign.
    """
    arguments = (side_a, side_b, distance, current)
    point = [float(_values([figure], unit)[0]) for figure, unit in zip(arguments, _LENGTHS_AND_CURRENT, strict=True)]
    if not all(map(math.isfinite, point)):
        return not_observable("uT")
    slopes = [_slope(turns, point, index) for index in range(len(point))]
    uncertainty, dof = root_sum_square(zip(slopes, arguments, strict=True))
    return Figure(value=_microtesla(turns, point), unit="uT", uncertainty=uncertainty, dof=dof)


@traced
def field_ratio(measured: Figure, expected: Figure, *, gain: float = 0.0) -> Figure:
    """Return the ratio of measured to expected field in `1`; negative where the field points the wrong way.

    Uncertainty to first order, all inputs independent. Not observable for an expected field of zero.

    Args:
        measured: along the normal.
        expected: along the normal, in the same unit.
        gain: relative standard uncertainty of the magnetometer's scale, which repetitions do not reveal.
    """
    above, below = _values([measured, expected], measured.unit).tolist()
    if not math.isfinite(above + below) or not below:
        return not_observable("1")
    ratio = above / below
    scale = Figure(value=1.0, unit="1", uncertainty=gain)
    uncertainty, dof = root_sum_square([(1 / below, measured), (ratio / below, expected), (ratio, scale)])
    return Figure(value=ratio, unit="1", uncertainty=uncertainty, dof=dof)


@traced
def resistance(voltages: Sequence[Figure], currents: Sequence[Figure]) -> Figure:
    """Return the resistance in ohm from pairs of voltage and current.

    R = sum(V I) / sum(I^2), the straight line through the origin: a reading without current has no weight, and equal
    currents of both signs cancel a constant voltage. Uncertainty to first order (GUM 13): the readings of one
    instrument share its errors, so voltages are treated as fully correlated, currents too, and the scatter about the
    line (n - 1 degrees of freedom) is added. One unknown uncertainty makes that of the resistance unknown.

    Args:
        voltages: in V, with sign.
        currents: in A, with sign; the pairs of `voltages`.
    """
    if len(voltages) != len(currents):
        raise ValueError(f"{len(voltages)} voltages need as many currents, got {len(currents)}")
    volts, amperes = _values(voltages, "V"), _values(currents, "A")
    if volts.size == 0 or not np.isfinite(volts).all() or not np.isfinite(amperes).all() or not amperes.any():
        return not_observable("ohm")
    power = float(amperes @ amperes)
    value = float(volts @ amperes) / power
    by_volt = np.abs(amperes) / power
    by_ampere = np.abs(volts - 2 * value * amperes) / power
    known = [_uncertainties(voltages), _uncertainties(currents)]
    if known[0] is None or known[1] is None:
        return Figure(value=value, unit="ohm")
    rest = volts - value * amperes
    dof = max(volts.size - 1.0, 1.0)
    parts = [
        (float(by_volt @ known[0]) ** 2, min(figure.dof for figure in voltages)),
        (float(by_ampere @ known[1]) ** 2, min(figure.dof for figure in currents)),
        (float(rest @ rest) / dof / power, dof),
    ]
    spread = math.sqrt(sum(variance for variance, _ in parts))
    return Figure(value=value, unit="ohm", uncertainty=spread, dof=effective_dof(parts))


@traced
def copper_at(measured: Figure, temperature: Figure, *, reference: float = _REFERENCE) -> Figure:
    """Convert a copper resistance measured at one temperature to another.

    R_ref = R (1 + a (T_ref - 20)) / (1 + a (T - 20)), a = 0.00393 per K taken as exact (IEC 60028, annealed copper).

    Args:
        measured: resistance in ohm.
        temperature: temperature of the copper during the measurement [degC].
        reference: temperature of the result [degC].
    """
    now = 1 + _COPPER * (float(_values([temperature], "degC")[0]) - _REFERENCE)
    ohm = float(_values([measured], "ohm")[0])
    if not math.isfinite(ohm) or not 0 < now < math.inf:
        return not_observable("ohm")
    factor = (1 + _COPPER * (reference - _REFERENCE)) / now
    value = ohm * factor
    uncertainty, dof = root_sum_square([(factor, measured), (value * _COPPER / now, temperature)])
    return Figure(value=value, unit="ohm", uncertainty=uncertainty, dof=dof)


@traced
def linearity(currents: Sequence[Figure], fields: Sequence[Figure], *, significant: float = 5.0) -> Figure:
    """Return the largest deviation of the field from a straight line over the current, relative to full scale.

    The line is a weighted least-squares fit with an intercept. Weights are 1 / u^2, with u from the field and, through
    the slope, from the current; all weights are equal where an uncertainty is unknown or zero. Full scale is the
    largest |field|. The uncertainty is that of the one deviation, to first order: r = (1 - H) B with covariance (1 - H)
    diag(u^2) (1 - H)^T. The largest of several deviations is biased upwards, so an upper limit stays safe. Not
    observable for currents that differ only by noise, as with a welded contact.

    Args:
        currents: in A, with sign; at least three different ones.
        fields: along the normal, in one unit; the pairs of `currents`.
        significant: least spread of the currents, in multiples of their largest standard uncertainty.
    """
    if len(currents) != len(fields):
        raise ValueError(f"{len(currents)} currents need as many fields, got {len(fields)}")
    amperes = _values(currents, "A")
    field = _values(fields, fields[0].unit if fields else "uT")
    known = _uncertainties(currents)
    if not _makes_line(amperes, field) or (known is not None and not np.ptp(amperes) > significant * known.max()):
        return not_observable("1")
    spread = _line_uncertainties(currents, fields, amperes, field)
    away = np.eye(field.size) - _hat(amperes, spread)
    distances = away @ field
    worst = int(np.argmax(np.abs(distances)))
    top = int(np.argmax(np.abs(field)))
    full_scale = abs(float(field[top]))
    value = abs(float(distances[worst])) / full_scale
    if spread is None:
        return Figure(value=value, unit="1")
    shares = np.append(away[worst] * spread, value * spread[top]) / full_scale
    parts = list(zip((shares**2).tolist(), [figure.dof for figure in (*fields, fields[top])], strict=True))
    return Figure(value=value, unit="1", uncertainty=float(np.linalg.norm(shares)), dof=effective_dof(parts))


@traced
def line_residuals(currents: Sequence[Figure], fields: Sequence[Figure]) -> NDArray[np.float64]:
    """Return the residual of each field from the straight line of `linearity`, shape (n,); NaN if there is no line.

    Args:
        currents: in A, with sign; at least three different ones.
        fields: along the normal, in one unit; the pairs of `currents`.
    """
    amperes = _values(currents, "A")
    field = _values(fields, fields[0].unit if fields else "uT")
    if len(currents) != len(fields) or not _makes_line(amperes, field):
        return np.full(len(fields), math.nan)
    spread = _line_uncertainties(currents, fields, amperes, field)
    return field - _hat(amperes, spread) @ field


def _makes_line(amperes: NDArray[np.float64], field: NDArray[np.float64]) -> bool:
    finite = np.isfinite(amperes).all() and np.isfinite(field).all()
    return bool(finite and np.unique(amperes).size >= 3 and field.any())


def _microtesla(turns: float, point: Sequence[float]) -> float:
    side_a, side_b, distance, current = point
    return on_axis_rectangle(turns, side_a, side_b, distance, current) * 1e6


def _slope(turns: float, point: Sequence[float], index: int) -> float:
    """Return the derivative of the expected field with respect to one argument, by central difference."""
    step = 1e-6 * (abs(point[index]) or 1e-3)
    low, high = list(point), list(point)
    low[index] -= step
    high[index] += step
    return (_microtesla(turns, high) - _microtesla(turns, low)) / (2 * step)


def _values(figures: Sequence[Figure], unit: str) -> NDArray[np.float64]:
    """Return the values of figures, all in one unit; NaN where not measured."""
    for figure in figures:
        if figure.unit != unit:
            raise ValueError(f"expected figures in {unit!r}, got one in {figure.unit!r}")
    return np.array(
        [figure.value if figure.status is FigureStatus.MEASURED else math.nan for figure in figures], dtype=float
    )


def _uncertainties(figures: Sequence[Figure]) -> NDArray[np.float64] | None:
    """Return the standard uncertainties, or None if one is unknown."""
    known = [figure.uncertainty for figure in figures if figure.uncertainty is not None]
    return np.array(known, dtype=float) if len(known) == len(figures) else None


def _line_uncertainties(
    currents: Sequence[Figure], fields: Sequence[Figure], amperes: NDArray[np.float64], field: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Return the uncertainty of each field, that of its current propagated through the slope included."""
    of_currents, of_fields = _uncertainties(currents), _uncertainties(fields)
    if of_currents is None or of_fields is None:
        return None
    slope = float(np.polynomial.polynomial.polyfit(amperes, field, 1)[1])
    carried: NDArray[np.float64] = np.hypot(of_fields, slope * of_currents)
    return carried


def _hat(amperes: NDArray[np.float64], spread: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """Return the hat matrix H, from measured to fitted fields."""
    weights = np.ones(amperes.size) if spread is None or not spread.all() else 1 / spread
    design = np.column_stack([np.ones(amperes.size), amperes])
    solved: NDArray[np.float64] = np.linalg.pinv(weights[:, None] * design) * weights
    return design @ solved
