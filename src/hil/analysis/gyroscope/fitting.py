"""Weighted polynomials of temperature whose degree the evidence chooses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from hil.analysis.gyroscope.calibration import Polynomial
from hil.model.errors import Refused
from hil.model.figure import Figure, effective_dof

__all__ = ["MOST_DEGREE", "Candidate", "Fit", "fit"]

_Array: TypeAlias = NDArray[np.float64]

MOST_DEGREE = 3
"""The highest degree that is offered."""

_UNLIKELY = 0.01  # a misfit this improbable is an error of the model, and widens the uncertainties
_REJECTED = 1e-3  # one this improbable rejects the degree where a higher one fits


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """How well one degree does.

    Attributes:
        degree: of the polynomial.
        cross_validation: mean square of the leave-one-out errors, each in units of its point's uncertainty where that
            is known, and then times 1 - 2 / dof, which is what an estimated uncertainty makes too large on average;
            else in the square of the value's unit.
        aicc: Akaike's information criterion with correction for few points, infinite where there are too few.
        chi_square: sum of squared residuals, in the same units.
        tail: probability of a chi-square at least as large if the model is right; NaN where nothing is left to judge.
    """

    degree: int
    cross_validation: float
    aicc: float
    chi_square: float
    tail: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """A fitted polynomial and why it has its degree.

    Attributes:
        polynomial: the result.
        temperature: temperatures of the points in degC, shape (n,).
        value: fitted values, shape (n,).
        residual: value minus polynomial, shape (n,).
        candidates: all degrees that the points allow.
        consistent: whether the points scatter as their uncertainties say; where not, the covariance is scaled up.
        remark: what a reader must know, else empty.
    """

    polynomial: Polynomial
    temperature: _Array
    value: _Array
    residual: _Array
    candidates: tuple[Candidate, ...]
    consistent: bool
    remark: str


def fit(temperatures: Sequence[float], values: Sequence[Figure], *, reference: float = 25.0) -> Fit:
    """Fit a polynomial of degree 1, 2 or 3 to values at temperatures.

    Weighted least squares, weights 1 / u^2. A degree is offered where the points and their different temperatures
    outnumber its coefficients, and the first degree always. Chosen is the lower of the two that leave-one-out
    cross-validation and AICc = chi^2 + 2 k + 2 k (k + 1) / (n - k - 1) prefer (with unknown uncertainties
    n ln(chi^2 / n) and one parameter more), k coefficients; raised to the lowest degree whose chi-square is not
    rejected at 0.001, if there is one. What was chosen is taken as given in the uncertainties.

    The covariance is that of the stated uncertainties, widened because weights that are estimates themselves let the
    points with too small a u count too much: Kenward and Roger, Biometrics 53 (1997) 983, section 2, for independent
    points: Phi + 4 Phi [sum_i (1 - h_i) / (dof_i u_i^2) x_i x_i'] Phi, with Phi = (sum_i x_i x_i' / u_i^2)^-1 and the
    leverage h_i; for a mean it is that of Meier, Biometrics 9 (1953) 59. The degrees of freedom are the least of those
    of the coefficients (Welch and Satterthwaite). Where the misfit has a probability below 0.01, and where an
    uncertainty is unknown, the covariance is scaled by chi^2 / (n - k) and has n - k degrees of freedom; with none left
    it is unknown.

    Args:
        temperatures: in degC, shape (n,), at least two different ones.
        values: at these temperatures, of one unit.
        reference: temperature about which the powers are taken, in degC.

    Raises:
        Refused: fewer than two temperatures, or numbers that are not finite.
    """
    where = np.asarray(temperatures, dtype=np.float64)
    data = np.array([figure.value for figure in values])
    distinct = np.unique(where).size
    if where.size != data.size or distinct < 2:
        raise Refused(f"{distinct} temperature does not tell a dependence", "measure at two temperatures or more")
    if not (np.isfinite(where).all() and np.isfinite(data).all()):
        raise Refused("a temperature or a mean is not a finite number", "check the record that it came from")
    spread = np.array([math.nan if figure.uncertainty is None else figure.uncertainty for figure in values])
    known = bool((spread > 0.0).all())
    weight = 1.0 / spread if known else np.ones(where.size)
    highest = max(1, min(MOST_DEGREE, distinct - 2))
    candidates = tuple(
        _candidate(where - reference, values, weight, degree, known=known) for degree in range(1, highest + 1)
    )
    return _chosen(where, values, weight, candidates, reference=reference, known=known)


def _design(offset: _Array, degree: int) -> _Array:
    return np.vander(offset, degree + 1, increasing=True)


def _candidate(offset: _Array, values: Sequence[Figure], weight: _Array, degree: int, *, known: bool) -> Candidate:
    from scipy.special import gammaincc  # noqa: PLC0415 - scipy is slow to import

    design = _design(offset, degree) * weight[:, None]
    estimator = np.linalg.pinv(design)
    scaled = np.array([figure.value for figure in values]) * weight
    residual = (scaled - design @ (estimator @ scaled)) * (_fair(values) if known else 1.0)
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
    """Return what makes a residual over an estimated uncertainty as large as one over the true one.

    Its square is F-distributed, with the mean dof / (dof - 2); three degrees of freedom or fewer count as three.
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


def _preferred(candidates: tuple[Candidate, ...]) -> Candidate:
    validated = min(candidates, key=lambda each: each.cross_validation)
    informed = min(candidates, key=lambda each: each.aicc)
    best = validated if math.isinf(informed.aicc) else min(validated, informed, key=lambda each: each.degree)
    if best.tail < _REJECTED:
        fitting = [each for each in candidates if each.degree > best.degree and each.tail >= _REJECTED]
        best = fitting[0] if fitting else best
    return best


def _chosen(
    where: _Array, values: Sequence[Figure], weight: _Array, candidates: tuple[Candidate, ...],
    *, reference: float, known: bool,
) -> Fit:  # fmt: skip
    best = _preferred(candidates)
    data = np.array([figure.value for figure in values])
    plain = _design(where - reference, best.degree)
    estimator = np.linalg.pinv(plain * weight[:, None]) * weight
    coefficients = estimator @ data
    left = data.size - best.degree - 1
    consistent = not best.tail < _UNLIKELY
    covariance, dof = _covariance(plain, estimator, weight, values)
    if not (known and consistent):
        scale = best.chi_square / left if left else math.nan
        covariance, dof = covariance * scale, float(max(left, 1))
    polynomial = Polynomial(
        coefficients=tuple(coefficients.tolist()),
        unit=values[0].unit,
        reference=reference,
        low=float(where.min()),
        high=float(where.max()),
        covariance=tuple(map(tuple, covariance.tolist())) if np.isfinite(covariance).all() else None,
        dof=dof,
    )
    return Fit(
        polynomial=polynomial,
        temperature=where,
        value=data,
        residual=data - plain @ coefficients,
        candidates=candidates,
        consistent=consistent,
        remark=_remark(best, left, consistent=consistent),
    )


def _covariance(plain: _Array, estimator: _Array, weight: _Array, values: Sequence[Figure]) -> tuple[_Array, float]:
    shares = estimator / weight
    leverage = np.einsum("ij,ji->i", plain, estimator)
    dofs = np.array([figure.dof for figure in values])
    widened = shares * np.sqrt(1.0 + 4.0 * np.clip(1.0 - leverage, 0.0, 1.0) / dofs)
    covariance = np.asarray(widened @ widened.T, dtype=np.float64)
    return covariance, min(effective_dof(zip(np.square(row).tolist(), dofs.tolist(), strict=True)) for row in shares)


def _remark(best: Candidate, left: int, *, consistent: bool) -> str:
    if not left:
        return "as many coefficients as points: nothing checks the line; measure at more temperatures"
    if not consistent:
        return (
            f"the points scatter more than their uncertainties say (probability {best.tail:.1g}): "
            "the uncertainties are scaled up; look for hysteresis, or measure at more temperatures"
        )
    return ""
