"""Interval arithmetic with partial derivatives."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

__all__ = ["Range", "Undefined", "constant", "variable"]

_Ends = tuple[float, float]
_FLAT = (0.0, 0.0)


class Undefined(ArithmeticError):
    """A formula has no value for some numbers within the intervals of its operands."""


def _product(one: _Ends, other: _Ends) -> _Ends:
    ends = [first * second for first in one for second in other]
    return min(ends), max(ends)


def _sum(one: _Ends, other: _Ends) -> _Ends:
    return one[0] + other[0], one[1] + other[1]


@dataclass(frozen=True, slots=True)
class Range:
    """An interval from `low` to `high`, with its partial derivatives.

    Results contain every value that the operands allow (interval arithmetic), and `slopes` contains every partial
    derivative with respect to each variable (automatic differentiation). Where none of them changes sign, the result is
    monotone, and its ends are taken at two corners: see `Formula.over`.

    Attributes:
        low: the lower end.
        high: the upper end.
        slopes: interval of the derivative with respect to each variable.
    """

    low: float
    high: float
    slopes: Mapping[Hashable, _Ends] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high)):
            raise Undefined("the result is too large, or no number")

    @property
    def ends(self) -> _Ends:
        """Both ends."""
        return self.low, self.high

    def __neg__(self) -> Range:
        return Range(-self.high, -self.low, {key: (-high, -low) for key, (low, high) in self.slopes.items()})

    def __abs__(self) -> Range:
        if self.low >= 0:
            return self
        if self.high <= 0:
            return -self
        return self._through((0.0, max(-self.low, self.high)), (-1.0, 1.0))

    def __add__(self, other: Range) -> Range:
        return Range(self.low + other.low, self.high + other.high, _joined(self.slopes, other.slopes))

    def __sub__(self, other: Range) -> Range:
        return self + -other

    def __mul__(self, other: Range) -> Range:
        mine = {key: _product(each, other.ends) for key, each in self.slopes.items()}
        others = {key: _product(each, self.ends) for key, each in other.slopes.items()}
        return Range(*_product(self.ends, other.ends), _joined(mine, others))

    def __truediv__(self, other: Range) -> Range:
        return self * other.inverse()

    def inverse(self) -> Range:
        """Return the reciprocal.

        Raises:
            Undefined: it may be zero.
        """
        if self.low <= 0 <= self.high:
            raise Undefined("the divisor may be zero")
        return self._through((1 / self.high, 1 / self.low), _negative(self.low, self.high))

    def power(self, exponent: int) -> Range:
        """Return an integer power."""
        if exponent < 0:
            return self.power(-exponent).inverse()
        if exponent == 0:
            return constant(1.0)
        return self._through(_power(self.ends, exponent), tuple(exponent * each for each in _slope(self, exponent)))

    def rising(self, function: Callable[[float], float], slope: Callable[[float], float], least: float) -> Range:
        """Apply an increasing function with monotone slope, defined above `least`.

        Raises:
            Undefined: it may be at or below `least`.
        """
        if self.low <= least:
            raise Undefined(f"a root or logarithm needs numbers above {least:g}, and may get {self.low:.4g}")
        ends = slope(self.low), slope(self.high)
        return self._through((function(self.low), function(self.high)), (min(ends), max(ends)))

    @staticmethod
    def extreme(ranges: Sequence[Range], choose: Callable[[Iterable[float]], float]) -> Range:
        """Return the minimum or maximum of several intervals, by `min` or `max`."""
        slopes: dict[Hashable, _Ends] = {}
        for key in {key for each in ranges for key in each.slopes}:
            all_ends = [end for each in ranges for end in each.slopes.get(key, _FLAT)]
            slopes[key] = min(all_ends), max(all_ends)
        return Range(choose(each.low for each in ranges), choose(each.high for each in ranges), slopes)

    def _through(self, ends: _Ends, slope: Sequence[float]) -> Range:
        outer = (slope[0], slope[1])
        return Range(*ends, {key: _product(each, outer) for key, each in self.slopes.items()})


def _negative(low: float, high: float) -> _Ends:
    one, other = -1 / low**2, -1 / high**2
    return min(one, other), max(one, other)


def _power(ends: _Ends, exponent: int) -> _Ends:
    try:
        low, high = ends[0] ** exponent, ends[1] ** exponent
    except OverflowError:
        raise Undefined("the result is too large, or no number") from None
    if exponent % 2 == 0 and ends[0] <= 0 <= ends[1]:
        return 0.0, max(low, high)
    return min(low, high), max(low, high)


def _slope(of: Range, exponent: int) -> _Ends:
    return _power(of.ends, exponent - 1) if exponent > 1 else (1.0, 1.0)


def _joined(one: Mapping[Hashable, _Ends], other: Mapping[Hashable, _Ends]) -> dict[Hashable, _Ends]:
    return {key: _sum(one.get(key, _FLAT), other.get(key, _FLAT)) for key in {**one, **other}}


def constant(value: float) -> Range:
    """Return an exactly known number."""
    return Range(value, value)


def variable(low: float, high: float, key: Hashable) -> Range:
    """Return a variable with an interval, identified in `slopes` by `key`."""
    return Range(low, high, {key: (1.0, 1.0)})
