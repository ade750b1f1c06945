"""Evaluation of a solar-cell sweep: figures with uncertainties, corrected to conditions; comparison of sweeps."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from hil.analysis.gates import Gate, finite
from hil.analysis.solar.correction import COEFFICIENTS, IvConditions, corrected
from hil.analysis.solar.fits import ISC, RESISTANCES, UNITS, VOC, Array, Estimates, estimated
from hil.analysis.solar.gates import IvFacts, ask
from hil.analysis.statistics import not_observable
from hil.analysis.tracing import traced
from hil.model.figure import Figure, effective_dof

__all__ = ["IvCurve", "IvSweep", "curve_difference", "iv_curve"]

Values: TypeAlias = Sequence[Figure] | Sequence[float] | Array

_OF_VALUE, _OF_UNCERTAINTY = 9, 6
"""Significant digits; further ones depend on the machine's order of summation."""

_COLUMNS = ("voltage", "current", "irradiance", "temperature")


@dataclass(frozen=True, slots=True, kw_only=True)
class IvSweep:
    """One sweep over the curve, n points in any order.

    The uncertainty of figures is common to all points of a column; plain numbers have only their scatter.

    Attributes:
        voltage: cell voltage [V].
        current: current out of the positive terminal [A].
        irradiance: irradiance at each point [W/m^2].
        temperature: cell temperature at each point [degC].
    """

    voltage: Values
    current: Values
    irradiance: Values
    temperature: Values


@dataclass(frozen=True, slots=True, kw_only=True)
class IvCurve:
    """Results of a sweep at the target conditions; resistance and conductance are those of the measurement.

    Attributes:
        figures: by the names of `hil.analysis.solar.fits.UNITS`; NOT_OBSERVABLE where the sweep does not determine one.
        scatter: the same with uncertainty from scatter alone, for comparing sweeps by the same instruments.
        reach: distance of the lowest point from short circuit, as a share of the open-circuit voltage.
        extrapolated: short-circuit current minus the current of the lowest point [A].
        irradiance, temperature: means over the sweep, uncorrected [W/m^2] and [degC].
        voltage, current: corrected points, (n,) in V and A, voltage ascending.
        gates: the gates with their results.
    """

    figures: Mapping[str, Figure]
    scatter: Mapping[str, Figure]
    reach: float
    extrapolated: float
    irradiance: float
    temperature: float
    voltage: Array
    current: Array
    gates: tuple[Gate, ...]

    @property
    def doubts(self) -> tuple[str, ...]:
        """The reasons to doubt the figures, one sentence each."""
        return tuple(str(gate) for gate in self.gates if gate.ok is False)


@traced
def iv_curve(sweep: IvSweep, conditions: IvConditions | None = None, facts: IvFacts | None = None) -> IvCurve:
    """Return the figures of a sweep, corrected to the conditions if given.

    Scatter is taken from the residuals of the local fits, with their degrees of freedom. Errors common to all points -
    of voltage, current, irradiance, temperature, and each coefficient - are propagated through correction and fits one
    by one (GUM 5.1.3, note 2), so that they cancel in the fill factor as they should. One figure of unknown uncertainty
    makes all results' uncertainties unknown.

    Args:
        sweep: the sweep; all columns have the same length.
        conditions: target conditions; None for those of the sweep itself.
        facts: prior knowledge, for the gates.

    Raises:
        ValueError: fewer than two points are finite.
    """
    columns = [_column(getattr(sweep, name)) for name in _COLUMNS]
    whole = np.array([values for values, _, _ in columns])
    bad = [finite(name, row) for name, row in zip(_COLUMNS, whole, strict=True)]
    kept = np.flatnonzero(np.isfinite(whole).all(axis=0))
    if kept.size < 2:
        raise ValueError("a current-voltage curve has at least two points with numbers")
    kept = kept[np.argsort(whole[0, kept], kind="stable")]
    measured = whole[:, kept]
    found, shown = _estimates(measured, conditions)
    changes: list[tuple[Array, float]] | None = []
    shared = [(place, spread[kept], dof) for place, (_, spread, dof) in enumerate(columns) if spread is not None]
    if any(np.isnan(spread).any() for _, spread, _ in shared) or _unknown(conditions):
        changes = None
    else:
        changes = list(_changes(measured, shared, conditions, found.values))
    figures = {name: _figure(found, place, unit, changes) for place, (name, unit) in enumerate(UNITS.items())}
    scatter = {name: _figure(found, place, unit, []) for place, (name, unit) in enumerate(UNITS.items())}
    return IvCurve(
        figures=figures,
        scatter=scatter,
        reach=_rounded(shown[0].min() / found.values[VOC], _OF_UNCERTAINTY),
        extrapolated=_rounded(found.values[ISC] - shown[1][np.argmin(shown[0])], _OF_UNCERTAINTY),
        irradiance=float(measured[2].mean()),
        temperature=float(measured[3].mean()),
        voltage=np.round(shown[0], _OF_VALUE),
        current=np.round(shown[1], _OF_VALUE),
        gates=(*bad, *ask(measured, shown, found, conditions, facts or IvFacts())),
    )


@traced
def curve_difference(first: IvCurve, second: IvCurve, name: str) -> Figure:
    """Return the relative difference (second - first) / mean of one figure in `1`, for sweeps by the same instruments.

    Common errors cancel, so the uncertainty is that of the scatter.

    Args:
        first: the reference sweep.
        second: the sweep to compare.
        name: name of the figure, a key of `hil.analysis.solar.fits.UNITS`.
    """
    one, other = first.scatter[name], second.scatter[name]
    mean = (one.value + other.value) / 2.0
    if not (math.isfinite(mean) and mean) or one.uncertainty is None or other.uncertainty is None:
        return not_observable("1")
    return Figure(
        value=(other.value - one.value) / mean,
        unit="1",
        uncertainty=math.hypot(one.uncertainty, other.uncertainty) / abs(mean),
        dof=effective_dof([(one.uncertainty**2, one.dof), (other.uncertainty**2, other.dof)]),
    )


def _column(given: Values) -> tuple[Array, Array | None, float]:
    """Return values, uncertainties (NaN for an unknown one, None for plain numbers) and degrees of freedom."""
    figures = [each for each in given if isinstance(each, Figure)]
    if len(figures) != len(given):
        return np.asarray(given, dtype=float), None, math.inf
    spread = np.array([math.nan if each.uncertainty is None else each.uncertainty for each in figures])
    return np.array([each.value for each in figures]), spread, min((each.dof for each in figures), default=math.inf)


def _estimates(measured: Array, conditions: IvConditions | None) -> tuple[Estimates, tuple[Array, Array]]:
    """Return the figures at the conditions, and the corrected points; the resistances are those of the measurement."""
    shown = corrected(measured, conditions)
    found = estimated(*shown)
    if conditions is not None:
        own = estimated(measured[0], measured[1])
        for mine, others in ((found.values, own.values), (found.variances, own.variances), (found.dofs, own.dofs)):
            mine[RESISTANCES] = others[RESISTANCES]
    return found, shown


def _unknown(conditions: IvConditions | None) -> bool:
    return conditions is not None and any(getattr(conditions, name).uncertainty is None for name in COEFFICIENTS)


def _changes(
    measured: Array, shared: Sequence[tuple[int, Array, float]], conditions: IvConditions | None, base: Array
) -> Iterator[tuple[Array, float]]:
    """Yield the change of the figures by each common error, with its degrees of freedom."""
    for place, spread, dof in shared:
        moved = measured.copy()
        moved[place] += spread
        yield _estimates(moved, conditions)[0].values - base, dof
    for name in COEFFICIENTS if conditions is not None else ():
        figure: Figure = getattr(conditions, name)
        if figure.uncertainty and conditions is not None:
            value: Any = replace(figure, value=figure.value + figure.uncertainty)
            yield _estimates(measured, replace(conditions, **{name: value}))[0].values - base, figure.dof


def _figure(found: Estimates, place: int, unit: str, changes: Sequence[tuple[Array, float]] | None) -> Figure:
    value = float(found.values[place])
    if not math.isfinite(value):
        return not_observable(unit)
    parts = [(float(found.variances[place]), float(found.dofs[place]))]
    parts += [(float(change[place]) ** 2, dof) for change, dof in changes or ()]
    total = math.sqrt(sum(variance for variance, _ in parts))
    known = changes is not None and math.isfinite(total)
    dof = effective_dof(parts) if known else math.inf
    spread = _rounded(total, _OF_UNCERTAINTY) if known else None
    return Figure(value=_rounded(value, _OF_VALUE), unit=unit, uncertainty=spread, dof=_rounded(dof, _OF_UNCERTAINTY))


def _rounded(number: float, digits: int) -> float:
    return float(f"{number:.{digits}g}")
