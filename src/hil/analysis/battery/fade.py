"""Fade of a quantity over cycles: slope with confidence interval, never the difference of two ends."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.tracing import traced
from hil.model.errors import Refused
from hil.model.figure import Figure

__all__ = ["EndOfLife", "Fade", "fade"]

_LEAST = 3  # cycles: a slope and one degree of freedom


@dataclass(frozen=True, slots=True, kw_only=True)
class EndOfLife:
    """The cycle at which a fraction of the initial value is left, by linear extrapolation.

    Attributes:
        level: the end-of-life value, in the unit of the quantity.
        cycle: cycle at which the line reaches it; NaN if it never does.
        low: lower end of the confidence interval; NaN if there is none.
        high: upper end; infinite where the slope is not significant.
    """

    level: float
    cycle: float
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Fade:
    """A straight line over cycles.

    Attributes:
        slope: least-squares change per cycle, with its standard uncertainty and degrees of freedom.
        beginning: value of the line at the first cycle used.
        low: lower end of the slope's confidence interval.
        high: upper end of it.
        probability: two-sided p-value of the slope under no change.
        significant: whether `probability` is below 1 - confidence.
        robust: Theil-Sen slope, the median of the slopes of all pairs.
        robust_low: lower end of its confidence interval.
        robust_high: upper end of it.
        first_significant: earliest cycle from which the slope of all cycles so far stays significant; None if never.
        end_of_life: the extrapolated end of life.
        confidence: confidence level of all intervals.
    """

    slope: Figure
    beginning: Figure
    low: float
    high: float
    probability: float
    significant: bool
    robust: float
    robust_low: float
    robust_high: float
    first_significant: int | None
    end_of_life: EndOfLife
    confidence: float


@dataclass(frozen=True, slots=True, kw_only=True)
class _Line:
    middle: float
    height: float
    slope: float
    variance: float  # of one value about the line
    spread: float  # sum of squares of the cycles about their mean
    size: int


@traced
def fade(
    cycles: ArrayLike,
    values: ArrayLike,
    unit: str,
    *,
    skip: int = 0,
    remaining: float = 0.8,
    confidence: float = 0.95,
) -> Fade:
    """Return the change of a quantity per cycle, by least squares and by the Theil-Sen estimator.

    Least squares: slope b = Sxy / Sxx, u(b) = s / sqrt(Sxx), s^2 = sum of squared residuals / (n - 2), interval by
    Student's t with n - 2 degrees of freedom. Theil and Sen: median of all pairs' slopes, interval by Kendall's
    statistic (P. K. Sen, J. Am. Stat. Assoc. 63, 1968). End of life: where the line reaches
    remaining * beginning, interval by E. C. Fieller's theorem (J. R. Stat. Soc. B 16, 1954).

    Args:
        cycles: cycle numbers, shape (n,).
        values: one value per cycle, shape (n,); values that are not finite are left out.
        unit: unit of the values.
        skip: number of initial cycles to leave out, because a cell settles in them.
        remaining: end of life as a fraction of the initial value.
        confidence: confidence level of the intervals, between 0 and 1.

    Raises:
        Refused: fewer than three cycles are left, or all have the same number.
    """
    from scipy import special  # noqa: PLC0415 - start-up stays light

    where, what = (np.asarray(each, dtype=float)[skip:] for each in (cycles, values))
    kept = np.isfinite(what) & np.isfinite(where)
    where, what = where[kept], what[kept]
    if where.size < _LEAST or np.ptp(where) == 0:
        raise Refused(f"{where.size} cycles show no slope", f"give at least {_LEAST} different ones")
    line = _fitted(where, what)
    quantile = float(special.stdtrit(line.size - 2, 0.5 + confidence / 2.0))
    error = math.sqrt(line.variance / line.spread)
    robust, robust_low, robust_high = _theil_sen(where, what, float(special.ndtri(0.5 + confidence / 2.0)))
    probability = _probability(line)
    return Fade(
        slope=Figure(value=line.slope, unit=f"{unit}/cycle", uncertainty=error, dof=line.size - 2),
        beginning=_beginning(line, float(where[0]), unit),
        low=line.slope - quantile * error,
        high=line.slope + quantile * error,
        probability=probability,
        significant=probability < 1.0 - confidence,
        robust=robust,
        robust_low=robust_low,
        robust_high=robust_high,
        first_significant=_first_significant(where, what, 1.0 - confidence),
        end_of_life=_end_of_life(line, float(where[0]), remaining, quantile),
        confidence=confidence,
    )


def _theil_sen(where: NDArray[np.float64], what: NDArray[np.float64], quantile: float) -> tuple[float, float, float]:
    """Return the median of the slopes of all pairs, and the ends of its interval (Sen 1968, see `fade`).

    Kendall's statistic has the variance (n (n - 1) (2 n + 5) - sum of t (t - 1) (2 t + 5)) / 18 over the sizes t of
    groups of ties. SciPy has this in its statistics module, whose import takes longer than a plan's whole analysis.
    """
    apart, change = np.subtract.outer(where, where), np.subtract.outer(what, what)
    slopes = np.sort(change[apart > 0] / apart[apart > 0])
    ties = np.concatenate([np.unique(each, return_counts=True)[1] for each in (where, what)])
    sizes = np.concatenate(([where.size], ties))
    parts = sizes * (sizes - 1) * (2 * sizes + 5)
    reach = quantile * math.sqrt(max(int(parts[0] - parts[1:].sum()), 0) / 18)
    low = max(round((slopes.size - reach) / 2) - 1, 0)
    high = min(round((slopes.size + reach) / 2), slopes.size - 1)
    return float(np.median(slopes)), float(slopes[low]), float(slopes[high])


def _fitted(where: NDArray[np.float64], what: NDArray[np.float64]) -> _Line:
    middle, height = float(where.mean()), float(what.mean())
    spread = float(np.sum((where - middle) ** 2))
    slope = float(np.sum((where - middle) * (what - height))) / spread
    residual = what - height - slope * (where - middle)
    variance = float(np.sum(residual**2)) / (where.size - 2)
    return _Line(middle=middle, height=height, slope=slope, variance=variance, spread=spread, size=where.size)


def _at(line: _Line, cycle: float) -> float:
    return line.height + line.slope * (cycle - line.middle)


def _beginning(line: _Line, cycle: float, unit: str) -> Figure:
    variance = line.variance * (1.0 / line.size + (cycle - line.middle) ** 2 / line.spread)
    return Figure(value=_at(line, cycle), unit=unit, uncertainty=math.sqrt(variance), dof=line.size - 2)


def _probability(line: _Line) -> float:
    from scipy import special  # noqa: PLC0415 - start-up stays light

    error = math.sqrt(line.variance / line.spread)
    if error <= 1e-12 * abs(line.slope):
        return 0.0 if line.slope else 1.0
    return float(2.0 * special.stdtr(line.size - 2, -abs(line.slope) / error))


def _first_significant(where: NDArray[np.float64], what: NDArray[np.float64], level: float) -> int | None:
    found: int | None = None
    for size in range(where.size, _LEAST - 1, -1):
        if np.ptp(where[:size]) == 0 or not _probability(_fitted(where[:size], what[:size])) < level:
            break
        found = int(where[size - 1])
    return found


def _end_of_life(line: _Line, first: float, remaining: float, quantile: float) -> EndOfLife:
    """Solve part * beginning + slope * d = 0 for d, the cycles after the first, as a ratio of two correlated figures.

    Fieller: (p a + b d)^2 = q^2 var(p a + b d), with var(a) = s^2 (1/n + x^2/Sxx), cov(a, b) = s^2 x/Sxx,
    var(b) = s^2/Sxx, and x the first cycle less the mean one.
    """
    part, beginning, before = 1.0 - remaining, _at(line, first), first - line.middle
    level = remaining * beginning
    if line.slope * beginning >= 0:
        return EndOfLife(level=level, cycle=math.nan, low=math.nan, high=math.inf)
    reach = quantile**2 * line.variance
    square = line.slope**2 - reach / line.spread
    linear = part * (beginning * line.slope - reach * before / line.spread)
    rest = part**2 * (beginning**2 - reach * (1.0 / line.size + before**2 / line.spread))
    root = linear**2 - square * rest
    cycle = first - part * beginning / line.slope
    if root < 0 or square == 0:
        return EndOfLife(level=level, cycle=cycle, low=math.nan, high=math.inf)
    low, high = sorted(first + (-linear + sign * math.sqrt(root)) / square for sign in (-1.0, 1.0))
    # Where the slope may be zero, the interval is outside the two roots, and therefore open.
    return EndOfLife(level=level, cycle=cycle, low=high if square < 0 else low, high=math.inf if square < 0 else high)
