"""How a report writes numbers: as many digits as the uncertainty allows, and never a float's noise."""

from __future__ import annotations

import math
from collections.abc import Mapping
from decimal import ROUND_HALF_EVEN, ROUND_HALF_UP, Context, Decimal

__all__ = ["bench_time", "duration", "limit_text", "measured", "number", "rounded", "with_unit"]

NOT_A_NUMBER = "not a number"
_DIGITS = 6
_DIGITS_ALONE = 4  # of a measured value whose uncertainty nobody knows
_FINEST = 1e13  # beyond this ratio a double no longer holds the digits that the uncertainty asks for
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_WIDE = Context(prec=700)


def number(value: object, digits: int = _DIGITS) -> str:
    """Return a value without uncertainty: text as it is, a number with at most `digits` significant digits."""
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "true" if value else "false"
    if not isinstance(value, int | float) or not math.isfinite(value):
        return NOT_A_NUMBER
    exact = Decimal(repr(value))
    if exact == exact.to_integral_value() and abs(exact) < Decimal("1e9"):
        return str(int(exact))
    short = Context(prec=digits, rounding=ROUND_HALF_EVEN).plus(exact)
    exponent = _engineering(short.adjusted(), short.adjusted() - digits)
    return _scaled(_bare(short.scaleb(-exponent)), exponent)


def rounded(value: float, expanded: float) -> tuple[str, str, int]:
    """Return value and expanded uncertainty as digits that end at the same place, and a power of ten for both.

    The uncertainty keeps two significant digits and the value ends where it ends (GUM 7.2.6).

    Args:
        value: a finite number.
        expanded: its expanded uncertainty, finite and above zero.
    """
    exact, spread = Decimal(repr(float(value))), Decimal(repr(float(expanded)))
    spread = Context(prec=2, rounding=ROUND_HALF_UP).plus(spread)
    quantum = spread.adjusted() - 1
    step = Decimal(1).scaleb(quantum)
    exact = exact.quantize(step, rounding=ROUND_HALF_EVEN, context=_WIDE)
    exponent = _engineering(max(abs(exact), spread).adjusted(), quantum)
    places = exponent - quantum
    return _fixed(exact, exponent, places), _fixed(spread, exponent, places), exponent


def measured(value: object, expanded: object, unit: str) -> str:
    """Return `(value ± U) unit`; without an uncertainty the value and its unit alone."""
    if not isinstance(value, int | float):
        return number(value)
    if not math.isfinite(value) or not isinstance(expanded, int | float) or not 0 < expanded < math.inf:
        return with_unit(number(value, _DIGITS_ALONE), unit)
    if abs(value) > expanded * _FINEST:
        return with_unit(f"({number(value, 15)} ± {number(float(expanded), 2)})", unit)
    digits, spread, exponent = rounded(value, expanded)
    pair = f"{digits} ± {spread}"
    return with_unit(_scaled(f"({pair})", exponent) if exponent or unit not in {"", "1"} else pair, unit)


def with_unit(text: str, unit: str) -> str:
    """Return the text with its unit; the unit of a plain number is not written."""
    return text if unit in {"", "1"} or text == NOT_A_NUMBER else f"{text} {unit}"


def limit_text(limit: Mapping[str, object] | None, unit: str) -> str:
    """Return a limit in words and signs; its decimal strings are written as the catalogue has them."""
    bounds = limit or {}
    low, high, equals = (bounds.get(name) for name in ("min", "max", "equals"))
    if equals is not None:
        return with_unit(f"= {equals}", unit)
    if low is not None and high is not None:
        return with_unit(f"{low} to {high}", unit)
    if low is not None:
        return with_unit(f"≥ {low}", unit)
    return with_unit(f"≤ {high}", unit) if high is not None else ""


def duration(seconds: object) -> str:
    """Return how long something took or takes, in the units that a person would say."""
    if not isinstance(seconds, int | float) or not math.isfinite(seconds):
        return ""
    if seconds < 60:
        return f"{number(float(seconds), 3)} s"
    whole = round(seconds)
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s" if whole % 60 else f"{whole // 60} min"
    hours, minutes = divmod(round(seconds / 60), 60)
    return f"{hours} h {minutes:02d} min" if minutes else f"{hours} h"


def bench_time(seconds: object) -> str:
    """Return an instant of the bench's clock as `h:mm:ss.s`."""
    if not isinstance(seconds, int | float) or not math.isfinite(seconds):
        return ""
    tenths = round(seconds * 10)
    minutes, tenths = divmod(tenths, 600)
    return f"{minutes // 60}:{minutes % 60:02d}:{tenths // 10:02d}.{tenths % 10}"


def _engineering(size: int, quantum: int) -> int:
    """Return the power of ten, a multiple of three, to write in front; 0 where plain digits read well.

    Args:
        size: power of ten of the leading digit.
        quantum: power of ten of the last digit; it may not end left of the decimal point.
    """
    if -3 <= size < 6 and quantum <= 0:
        return 0
    return max(3 * (size // 3), 3 * -(-quantum // 3))


def _fixed(value: Decimal, exponent: int, places: int) -> str:
    scaled = value.scaleb(-exponent, context=_WIDE)
    digits = f"{scaled:.{max(places, 0)}f}"
    return digits.removeprefix("-") if not scaled else digits


def _bare(value: Decimal) -> str:
    digits = f"{value:f}"
    return digits.rstrip("0").rstrip(".") if "." in digits else digits


def _scaled(digits: str, exponent: int) -> str:
    return f"{digits} \N{MULTIPLICATION SIGN} 10{str(exponent).translate(_SUPERSCRIPT)}" if exponent else digits
