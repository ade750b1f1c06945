"""Axes: from numbers to places on the paper, with round numbers at the ticks."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal

__all__ = ["Band", "Scale", "finite", "spread"]

_LARGEST = 1e300  # beyond it a difference could be infinite
_NARROWEST = 1e-9  # of the largest value: less is the noise of a float, and no two ticks would differ
_EXACT = Context(prec=60)
_ROUND = (1, 2, 5, 10)
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """Limits to be drawn behind values of the same unit; None is open on that side."""

    unit: str
    low: float | None
    high: float | None

    @property
    def edges(self) -> tuple[float, ...]:
        """The limits that there are."""
        return tuple(edge for edge in (self.low, self.high) if edge is not None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scale:
    """A linear axis: `low` is drawn at `first`, `high` at `last`, in units of the drawing."""

    low: float
    high: float
    first: int
    last: int

    def at(self, value: float) -> int:
        """Return where a value stands; what is outside the axis stands at its end."""
        share = (min(max(value, self.low), self.high) - self.low) / (self.high - self.low)
        return round(self.first + share * (self.last - self.first))

    @property
    def exponent(self) -> int:
        """The power of ten that the labels leave to the axis' title: a multiple of three, 0 for ordinary numbers."""
        size = math.floor(math.log10(max(abs(self.low), abs(self.high))))
        return 0 if -3 <= size < 6 else 3 * (size // 3)

    def ticks(self, most: int) -> list[tuple[float, str]]:
        """Return at most about `most` round values within the axis, each with its label."""
        low, high = Decimal(repr(self.low)), Decimal(repr(self.high))
        rough = _EXACT.divide(high - low, Decimal(most))
        step = next(size for size in (Decimal(digit).scaleb(rough.adjusted()) for digit in _ROUND) if size >= rough)
        first = int(_EXACT.divide(low, step).to_integral_value(ROUND_CEILING))
        last = int(_EXACT.divide(high, step).to_integral_value(ROUND_FLOOR))
        places = max(0, self.exponent - step.adjusted())
        found = (_EXACT.multiply(step, Decimal(number)) for number in range(first, last + 1))
        return [(float(value), f"{_EXACT.scaleb(value, -self.exponent):.{places}f}") for value in found]

    def titled(self, unit: str) -> str:
        """Return the unit with the power of ten that the labels leave out."""
        if not self.exponent:
            return unit
        power = f"10{str(self.exponent).translate(_SUPERSCRIPT)}"
        return f"({power} {unit})" if unit else power


def spread(values: Iterable[float], margin: float) -> tuple[float, float]:
    """Return the ends of an axis for these finite values, with a margin as a share of what they span.

    Without values, or where all are alike, it is an axis around them that shows where they lie.
    """
    known = list(values) or [0.0]
    low, high = min(known), max(known)
    size = max(abs(low), abs(high))
    if high - low <= _NARROWEST * size:
        wide = 0.05 * size or 1.0
        return low - wide, high + wide
    return low - margin * (high - low), high + margin * (high - low)


def finite(value: object) -> float | None:
    """Return a number that can be drawn, or None."""
    if isinstance(value, str):
        try:
            value = float(value)
        except ValueError:
            return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < _LARGEST:
        return None
    return float(value)
