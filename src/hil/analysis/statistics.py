"""Statistics of correlated samples, and combination of uncertainties with degrees of freedom."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.tracing import traced
from hil.model.figure import Figure, FigureStatus, effective_dof

__all__ = [
    "correlation_time",
    "magnitude",
    "mean",
    "not_observable",
    "observed",
    "root_sum_square",
    "share_known",
    "standard_deviation",
    "widened",
]


@traced
def mean(samples: ArrayLike, unit: str, *, systematic: float | None = None) -> Figure:
    """Return the mean of evenly spaced samples, with an uncertainty that accounts for their correlation.

    With correlation time tau (see `correlation_time`) the n samples are equivalent to n / tau independent ones. Then
    s^2 = sum (x - mean)^2 / (n - tau), u^2 = s^2 tau / n + systematic^2, and the first part has n / tau - 1 degrees of
    freedom. The 95 % interval has its nominal coverage from about a hundred correlation times; below thirty it is too
    narrow, because the samples do not reveal how slowly they wander.

    A record without scatter gives zero uncertainty: the resolution of the instrument belongs in
    `systematic`.

    Args:
        samples: shape (n,), in `unit`. With fewer than two, or any not finite, the mean is NOT_OBSERVABLE.
        unit: unit of samples and result.
        systematic: standard uncertainty common to all samples, in `unit`; taken as exactly known.
    """
    values = np.asarray(samples, dtype=float)
    if values.ndim != 1:
        raise ValueError(f"a mean is taken over one row of samples, got an array of shape {values.shape}")
    if values.size == 0 or not np.isfinite(values).all():
        return not_observable(unit)
    centre = float(values.mean())
    if values.size == 1:
        return not_observable(unit, centre)
    tau = correlation_time(values)
    square = float(np.sum((values - centre) ** 2)) / (values.size - tau) * tau / values.size
    dof = max(values.size / tau - 1.0, 1.0)
    shared = systematic or 0.0
    return Figure(
        value=centre,
        unit=unit,
        uncertainty=math.sqrt(square + shared**2),
        dof=effective_dof([(square, dof), (shared**2, math.inf)]),
    )


def correlation_time(samples: NDArray[np.float64]) -> float:
    """Return the correlation time tau = 1 + 2 (rho_1 + rho_2 + ...) in samples, from 1 to half the record.

    The sum is truncated by the initial monotone positive sequence: adjacent autocorrelations are added in pairs, each
    pair is limited to the one before, and the sum ends before the first non-positive pair. Values below 1 (alternating
    samples) are raised to 1, so that correlation never improves a mean.

    Source: C. J. Geyer, Practical Markov Chain Monte Carlo, Statistical Science 7 (1992), section 3.3.

    Args:
        samples: shape (n,), n at least 2, finite.
    """
    size = samples.size
    spectrum = np.fft.rfft(samples - samples.mean(), 2 * size)
    covariance = np.fft.irfft(np.abs(spectrum) ** 2)[:size]
    if covariance[0] <= 0:
        return 1.0
    even = size // 2 * 2
    pairs = np.minimum.accumulate((covariance[0:even:2] + covariance[1:even:2]) / covariance[0])
    tau = 2.0 * float(pairs[pairs > 0].sum()) - 1.0
    return min(max(tau, 1.0), size / 2)


def root_sum_square(parts: Iterable[tuple[float, Figure]]) -> tuple[float | None, float]:
    """Return standard uncertainty (None if unknown) and degrees of freedom of a sum of independent figures (GUM 10).

    Args:
        parts: pairs of sensitivity coefficient and figure. One figure of unknown uncertainty makes the result unknown.
    """
    variances: list[tuple[float, float]] = []
    for sensitivity, figure in parts:
        if figure.uncertainty is None:
            return None, math.inf
        variances.append(((sensitivity * figure.uncertainty) ** 2, figure.dof))
    return math.sqrt(sum(variance for variance, _ in variances)), effective_dof(variances)


@traced
def standard_deviation(samples: ArrayLike, unit: str) -> Figure:
    """Return the standard deviation s of independent samples with its standard uncertainty s / sqrt(2 (n - 1)).

    Source: JCGM 100:2008 (GUM), E.4.3. With fewer than two samples, or any not finite, it is NOT_OBSERVABLE.

    Args:
        samples: shape (n,), in `unit`.
        unit: unit of samples and result.
    """
    values = np.asarray(samples, dtype=float)
    if values.size < 2 or not np.isfinite(values).all():
        return not_observable(unit)
    spread = float(np.std(values, ddof=1))
    dof = values.size - 1
    return Figure(value=spread, unit=unit, uncertainty=float(spread / np.sqrt(2 * dof)), dof=dof)


@traced
def magnitude(components: Sequence[Figure]) -> Figure:
    """Return the magnitude of a vector, with the uncertainty of independent components propagated (GUM 10).

    Args:
        components: components in one unit.
    """
    unit = components[0].unit
    if any(each.unit != unit for each in components):
        raise ValueError(f"the components of a vector are in one unit, got {', '.join(x.unit for x in components)}")
    vector = np.array([each.value for each in components])
    length = float(np.linalg.norm(vector))
    if not length > 0:
        return not_observable(unit)
    uncertainty, dof = root_sum_square(zip((vector / length).tolist(), components, strict=True))
    return Figure(value=length, unit=unit, uncertainty=uncertainty, dof=dof)


@traced
def share_known(values: Sequence[float]) -> Figure:
    """Return the share of finite values, in unit 1.

    Args:
        values: at least one value.
    """
    return Figure(value=sum(map(math.isfinite, values)) / len(values), unit="1")


@traced
def widened(figure: Figure, *, absolute: float = 0.0, relative: float = 0.0) -> Figure:
    """Return a figure with further uncertainty added in quadrature.

    Args:
        figure: the figure; an unknown uncertainty stays unknown.
        absolute: further standard uncertainty in the figure's unit, taken as exact.
        relative: further standard uncertainty over |value|, taken as exact.
    """
    if figure.uncertainty is None:
        return figure
    more = math.hypot(absolute, relative * figure.value)
    uncertainty = math.hypot(figure.uncertainty, more)
    dof = effective_dof([(figure.uncertainty**2, figure.dof), (more**2, math.inf)])
    return replace(figure, uncertainty=uncertainty, dof=dof)


def not_observable(unit: str, value: float = math.nan) -> Figure:
    """Return a NOT_OBSERVABLE figure, which never passes a check.

    Args:
        unit: unit of the figure.
        value: value to show, in `unit`; it is not a measurement.
    """
    return Figure(value=value, unit=unit, status=FigureStatus.NOT_OBSERVABLE)


@traced
def observed(value: float | None, unit: str, uncertainty: float | None = None) -> Figure:
    """Return a reported number as a figure, NOT_OBSERVABLE if there is none.

    Args:
        value: value in `unit`, or None.
        unit: unit of the value.
        uncertainty: standard uncertainty in `unit`, or None if unknown.
    """
    return not_observable(unit) if value is None else Figure(value=value, unit=unit, uncertainty=uncertainty)
