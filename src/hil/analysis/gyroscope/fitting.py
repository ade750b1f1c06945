"""Weighted polynomial fits over temperature, with the degree selected from the data."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.gyroscope.calibration import Polynomial
from hil.model.errors import Refused
from hil.model.figure import Figure, effective_dof

__all__ = ["MOST_DEGREE", "Candidate", "Fit", "fit"]

_Array: TypeAlias = NDArray[np.float64]

MOST_DEGREE = 3
"""The highest degree considered."""

_UNLIKELY = 0.01  # a misfit this improbable is a model error, and widens the uncertainties
_ALONE = 0.95  # leverage at which a point determines the fit alone
_FEWEST_LEFT = 3  # degrees of freedom needed to detect an outlier by scatter
_REJECTED = 1e-3  # a misfit this improbable rejects the degree if a higher one fits


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """Quality of the fit of one degree.

    Attributes:
        degree: degree of the polynomial.
        cross_validation: mean square of the leave-one-out errors, each relative to its point's uncertainty if known,
            and then times 1 - 2 / dof to correct the average bias from estimating that uncertainty; otherwise in the
            square of the value's unit.
        aicc: Akaike's information criterion with small-sample correction, infinite where there are too few points.
        chi_square: sum of squared residuals, in the same units.
        tail: probability of a chi-square at least as large if the model is right; NaN without degrees of freedom.
    """

    degree: int
    cross_validation: float
    aicc: float
    chi_square: float
    tail: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """A fitted polynomial, with the selection of its degree.

    Attributes:
        polynomial: the result.
        temperature: temperatures of the points in degC, shape (n,).
        value: fitted values, shape (n,).
        residual: value minus polynomial, shape (n,).
        candidates: every degree that the points allow.
        chosen: how the degree was selected.
        leverage: leverage of each point, 0 to 1, shape (n,).
        deviation: studentised residuals, shape (n,), in the values' unit where uncertainties are unknown; NaN where a
            point determines the fit alone.
        outliers: indices of outliers, at a false-alarm rate of one table in a hundred.
        runs: p-value of as few sign changes of the residuals, in order of temperature; NaN if unknown.
        consistent: whether the scatter agrees with the uncertainties; if not, the covariance is scaled up.
        remark: caveat, otherwise empty.
    """

    polynomial: Polynomial
    temperature: _Array
    value: _Array
    residual: _Array
    candidates: tuple[Candidate, ...]
    chosen: str
    leverage: _Array
    deviation: _Array
    outliers: tuple[int, ...]
    runs: float
    consistent: bool
    remark: str


def fit(
    temperatures: Sequence[float],
    values: Sequence[Figure],
    *,
    reference: float = 25.0,
    shared: ArrayLike | None = None,
    degree: int | None = None,
) -> Fit:
    """Fit a polynomial of degree 1, 2 or 3 to values at temperatures.

    Generalised least squares with the covariance C = diag(u_i^2) + S of the points. A degree is considered if points
    and distinct temperatures outnumber its coefficients; degree 1 always is. Selected is the lower of the two degrees
    that leave-one-out cross-validation and AICc = chi^2 + 2 k + 2 k (k + 1) / (n - k - 1) prefer (for unknown
    uncertainties n ln(chi^2 / n) and one parameter more), k coefficients; then the lowest degree from there on whose
    chi-square is not rejected at 0.001, if any. Residuals and leverages are those of the points whitened by C^(-1/2).
    The uncertainties take the selected degree as given.

    The covariance is Phi = (X' C^-1 X)^-1, widened because the u_i are themselves estimates, and points whose u is too
    small are overweighted: Kenward and Roger, Biometrics 53 (1997) 983, section 2, with w_i = X' C^-1 e_i:
    Phi + 4 Phi [sum_i u_i^4 / dof_i ((C^-1)_ii - w_i' Phi w_i) w_i w_i'] Phi; for a mean of independent points this is
    Meier, Biometrics 9 (1953) 59. The degrees of freedom are the least of the coefficients' (Welch-Satterthwaite), with
    S taken as exactly known. Where the misfit has a probability below 0.01, or an uncertainty is unknown, the
    covariance is scaled by chi^2 / (n - k) and has n - k degrees of freedom; with none left it is unknown.

    Args:
        temperatures: temperatures in degC, shape (n,), at least two different ones.
        values: n values at these temperatures, in one unit.
        reference: reference temperature of the polynomial [degC].
        shared: S, the covariance of errors common to the points, shape (n, n), in the square of the values' unit,
            including its diagonal. Ignored where an uncertainty is unknown.
        degree: the degree to use, None to select it.

    Raises:
        Refused: fewer than two temperatures, numbers that are not finite, or a degree that the points do not allow.
    """
    where = np.asarray(temperatures, dtype=np.float64)
    data = np.array([figure.value for figure in values])
    distinct = np.unique(where).size
    if where.size != data.size or distinct < 2:
        raise Refused(f"{distinct} temperature does not tell a dependence", "measure at two temperatures or more")
    if not (np.isfinite(where).all() and np.isfinite(data).all()):
        raise Refused("a temperature or a mean is not a finite number", "check the record that it came from")
    points = _Points(where=where, offset=where - reference, values=tuple(values), shared=shared)
    highest = max(1, min(MOST_DEGREE, distinct - 2))
    if degree is not None:
        highest = min(MOST_DEGREE, distinct - 1)
        if not 1 <= degree <= highest:
            told = f"degree {degree} is not between 1 and {highest}"
            raise Refused(
                f"{told} for {distinct} temperatures", "choose a lower degree, or measure at more temperatures"
            )
    candidates = tuple(_candidate(points, each) for each in range(1, max(highest, degree or 1) + 1))
    if degree is not None:
        return _chosen(points, candidates[degree - 1], candidates, reference=reference, how="given")
    best, how = _preferred(candidates)
    return _chosen(points, best, candidates, reference=reference, how=how)


class _Points:
    """The points of a fit, with their whitening.

    Attributes:
        where: temperatures in degC.
        offset: temperatures relative to the reference, in K.
        values: measured values.
        known: whether every uncertainty is known.
        spread: standard uncertainties u_i, 1 each if unknown.
        whiten: C^(-1/2), shape (n, n).
    """

    def __init__(self, *, where: _Array, offset: _Array, values: tuple[Figure, ...], shared: ArrayLike | None) -> None:
        self.where, self.offset, self.values = where, offset, values
        self.data = np.array([figure.value for figure in values])
        spread = np.array([math.nan if figure.uncertainty is None else figure.uncertainty for figure in values])
        self.known = bool((spread > 0.0).all())
        self.spread = spread if self.known else np.ones(where.size)
        covariance = np.diag(np.square(self.spread))
        if self.known and shared is not None:
            covariance = covariance + np.asarray(shared, dtype=np.float64)
        self.whiten = np.linalg.inv(np.linalg.cholesky(covariance))

    def design(self, degree: int) -> _Array:
        """Return the design matrix of powers of the offsets, shape (n, degree + 1)."""
        return np.vander(self.offset, degree + 1, increasing=True)


def _candidate(points: _Points, degree: int) -> Candidate:
    from scipy.special import gammaincc  # noqa: PLC0415 - scipy is slow to import

    known = points.known
    design = points.whiten @ points.design(degree)
    estimator = np.linalg.pinv(design)
    scaled = points.whiten @ points.data
    residual = (scaled - design @ (estimator @ scaled)) * (_fair(points.values) if known else 1.0)
    leverage = np.einsum("ij,ji->i", design, estimator)
    chi_square = float(np.square(residual).sum())
    left = scaled.size - degree - 1
    with np.errstate(divide="ignore", invalid="ignore"):
        errors = np.where(leverage < 1.0 - 1e-9, residual / (1.0 - leverage), np.inf)
    return Candidate(
        degree=degree,
        cross_validation=float(np.square(errors).mean()),
        aicc=_aicc(chi_square, scaled.size, degree + 1, known=known),
        chi_square=chi_square,
        tail=float(gammaincc(left / 2.0, chi_square / 2.0)) if known and left > 0 else math.nan,
    )


def _fair(values: Sequence[Figure]) -> _Array:
    """Return the factors that correct residuals for their uncertainties being estimates.

    The squared ratio is F-distributed with mean dof / (dof - 2); three or fewer degrees of freedom count as three.
    """
    dof = np.maximum([figure.dof for figure in values], 3.0)
    return np.asarray(np.sqrt(1.0 - 2.0 / dof), dtype=np.float64)


def _aicc(chi_square: float, points: int, coefficients: int, *, known: bool) -> float:
    parameters = coefficients if known else coefficients + 1
    left = points - parameters - 1
    if left <= 0:
        return math.inf
    scaled = points * math.log(chi_square / points) if chi_square > 0.0 else -math.inf
    likelihood = chi_square if known else scaled
    return likelihood + 2.0 * parameters + 2.0 * parameters * (parameters + 1) / left


def _preferred(candidates: tuple[Candidate, ...]) -> tuple[Candidate, str]:
    validated = min(candidates, key=lambda each: each.cross_validation)
    informed = min(candidates, key=lambda each: each.aicc)
    best, how = validated, "chosen by leave-one-out"
    if not math.isinf(informed.aicc):
        best = min(validated, informed, key=lambda each: each.degree)
        same = validated.degree == informed.degree
        how = (
            "chosen by leave-one-out and AICc"
            if same
            else f"chosen by {'AICc' if best is informed else 'leave-one-out'}"
        )
    if best.tail < _REJECTED:
        fitting = [each for each in candidates if each.degree > best.degree and each.tail >= _REJECTED]
        best, how = (fitting[0], "the lowest whose chi-square is probable") if fitting else (best, how)
    return (best, how) if len(candidates) > 1 else (best, "the only one that the points allow")


def _chosen(points: _Points, best: Candidate, candidates: tuple[Candidate, ...], *, reference: float, how: str) -> Fit:
    plain = points.design(best.degree)
    estimator = np.linalg.pinv(points.whiten @ plain) @ points.whiten
    coefficients = estimator @ points.data
    left = points.data.size - best.degree - 1
    consistent = not best.tail < _UNLIKELY
    residual = points.data - plain @ coefficients
    leverage, deviation = _influence(points, plain, residual)
    scatter = math.nan if points.known and consistent else best.chi_square
    outliers, runs = _outliers(points, deviation, left, scatter), _runs(points.where, residual, best.degree)
    covariance, dof = _covariance(points, plain, estimator)
    if not (points.known and consistent):
        scale = best.chi_square / left if left else math.nan
        covariance, dof = covariance * scale, float(max(left, 1))
    polynomial = Polynomial(
        coefficients=tuple(coefficients.tolist()),
        unit=points.values[0].unit,
        reference=reference,
        low=float(points.where.min()),
        high=float(points.where.max()),
        covariance=tuple(map(tuple, covariance.tolist())) if np.isfinite(covariance).all() else None,
        dof=dof,
    )
    return Fit(
        polynomial=polynomial,
        temperature=points.where,
        value=points.data,
        residual=residual,
        candidates=candidates,
        chosen=how,
        leverage=leverage,
        deviation=deviation,
        outliers=outliers,
        runs=runs,
        consistent=consistent,
        remark="; ".join(
            [*_remarks(best, left, consistent=consistent), *_told(points.where, leverage, outliers, runs)]
        ),
    )


def _influence(points: _Points, plain: _Array, residual: _Array) -> tuple[_Array, _Array]:
    """Return leverages and studentised residuals, each point against all the others.

    With M = C^-1 - C^-1 X Phi X' C^-1 they are 1 - M_ii / (C^-1)_ii and (C^-1 e)_i / sqrt(M_ii). Where uncertainties
    are unknown, the deviations are in the values' unit.
    """
    inverse = points.whiten.T @ points.whiten
    weights = inverse @ plain
    own = np.diag(inverse) - np.einsum("ij,jk,ik->i", weights, np.linalg.pinv(plain.T @ weights), weights)
    leverage = 1.0 - own / np.diag(inverse)
    free = leverage < 1.0 - 1e-9
    deviation = np.full(residual.size, math.nan)
    deviation[free] = (inverse @ residual)[free] / np.sqrt(own[free])
    return leverage, deviation * (_fair(points.values) if points.known else 1.0)


def _outliers(points: _Points, deviation: _Array, left: int, scatter: float) -> tuple[int, ...]:
    """Return the outliers at a false-alarm rate of one table in a hundred.

    Args:
        points: the points.
        deviation: studentised residuals.
        left: degrees of freedom.
        scatter: sum of squared residuals if it must stand in for unknown uncertainties, else NaN.
    """
    from scipy.special import stdtr  # noqa: PLC0415 - scipy is slow to import

    dof = np.array([min(figure.dof, 1e6) for figure in points.values])
    if not math.isnan(scatter):
        if left < _FEWEST_LEFT:
            return ()
        rest = np.clip(scatter - np.square(deviation), 1e-12 * scatter, None)
        deviation, dof = deviation * np.sqrt((left - 1) / rest), np.full(deviation.size, left - 1.0)
    tail = 2.0 * stdtr(dof, -np.abs(np.nan_to_num(deviation)))
    return tuple(np.flatnonzero(tail * deviation.size < _UNLIKELY).tolist())


def _runs(where: _Array, residual: _Array, degree: int) -> float:
    """Return the p-value of the runs test (Wald and Wolfowitz 1940) on the residuals in order of temperature."""
    signs = residual[np.argsort(where, kind="stable")] > 0.0
    above, below = int(signs.sum()), int((~signs).sum())
    if min(above, below) <= degree:
        return math.nan
    found = 1 + int(np.count_nonzero(signs[1:] != signs[:-1]))
    ways = 0
    for runs in range(2, found + 1):
        half, odd = divmod(runs, 2)
        one, other = (math.comb(above - 1, half - 1), math.comb(below - 1, half - 1))
        if odd:
            ways += one * math.comb(below - 1, half) + math.comb(above - 1, half) * other
        else:
            ways += 2 * one * other
    return ways / math.comb(above + below, above)


def _told(where: _Array, leverage: _Array, outliers: tuple[int, ...], runs: float) -> list[str]:
    told = []
    if outliers:
        at = ", ".join(f"{where[place]:g} degC (point {place + 1})" for place in outliers)
        told.append(f"outlier at {at}: look at its recording before you leave it out")
    if where.size > 2 and (alone := np.flatnonzero(leverage > _ALONE)).size and alone.size < where.size:
        at = ", ".join(f"{where[place]:g} degC" for place in alone)
        told.append(
            f"the point at {at} decides the polynomial there alone (leverage above {_ALONE:g}): measure it again"
        )
    if runs < _UNLIKELY:
        told.append(
            f"the residuals still follow the temperature (runs of one sign, probability {runs:.1g}): "
            "try a higher degree, or look for hysteresis"
        )
    return told


def _covariance(points: _Points, plain: _Array, estimator: _Array) -> tuple[_Array, float]:
    inverse = points.whiten.T @ points.whiten
    weights = inverse @ plain
    phi = np.linalg.pinv(plain.T @ weights)
    left = np.diag(inverse) - np.einsum("ij,jk,ik->i", weights, phi, weights)
    dofs = np.array([figure.dof for figure in points.values])
    lost = weights * np.sqrt(np.clip(left, 0.0, None) / dofs)[:, None] * np.square(points.spread)[:, None]
    covariance = phi + 4.0 * phi @ (lost.T @ lost) @ phi
    freedom = []
    for place, row in enumerate(estimator):
        own = np.square(row * points.spread)
        rest = max(0.0, float(phi[place, place]) - float(own.sum()))
        freedom.append(effective_dof([*zip(own.tolist(), dofs.tolist(), strict=True), (rest, math.inf)]))
    return np.asarray(covariance, dtype=np.float64), min(freedom)


def _remarks(best: Candidate, left: int, *, consistent: bool) -> list[str]:
    if not left:
        return ["as many coefficients as points: nothing checks the line; measure at more temperatures"]
    if not consistent:
        more = f"the points scatter more than their uncertainties say (probability {best.tail:.1g})"
        return [f"{more}: the uncertainties are scaled up; look for hysteresis, or measure at more temperatures"]
    return []
