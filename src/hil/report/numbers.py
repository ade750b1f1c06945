"""How a report writes numbers: as many digits as the uncertainty allows, and never a float's noise."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from decimal import ROUND_HALF_EVEN, ROUND_HALF_UP, Context, Decimal

__all__ = [
    "bench_time",
    "duration",
    "limit_text",
    "measured",
    "number",
    "prefixed",
    "quantity",
    "rounded",
    "span",
    "with_unit",
]

NOT_A_NUMBER = "not a number"
_DIGITS = 6
_DIGITS_ALONE = 4  # of a measured value of unknown uncertainty
_FINEST = 1e13  # beyond this ratio a double no longer holds the digits that the uncertainty asks for
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_WIDE = Context(prec=700)
_PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}
_MEANT = {prefix: power for power, prefix in _PREFIXES.items()} | {"u": -6, "μ": -6}
_TAKE_ALL = {"A", "Ah", "C", "F", "Hz", "J", "N", "Pa", "S", "V", "W", "Wb", "Wh", "bar", "g", "m", "ohm", "Ω"}
_TAKE_SMALL = {"G", "H", "K", "L", "T", "cd", "lm", "lx", "rad", "s"}
"""Nobody says kiloseconds."""
_FIRST = re.compile(r"([A-Za-zµμΩ]+)(?![A-Za-z\d^²³⁻(]|\*\*)")


def number(value: object, digits: int = _DIGITS) -> str:
    """Return a value without uncertainty: text as it is, a number with at most `digits` significant digits."""
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "true" if value else "false"
    if not isinstance(value, int | float) or not math.isfinite(value):
        return NOT_A_NUMBER
    return _scaled(*_parts(value, digits))


def quantity(value: object, unit: str, digits: int = _DIGITS) -> str:
    """Return a value without uncertainty and its unit, which has a prefix instead of a power of ten where it may."""
    if not isinstance(value, int | float) or isinstance(value, bool) or not math.isfinite(value):
        return with_unit(number(value), unit)
    shown, exponent = _parts(value, digits)
    return _with_power(shown, exponent, unit)


def span(low: float, high: float, unit: str, digits: int = _DIGITS) -> str:
    """Return `low to high unit`, or one value where they read alike."""
    first, last = quantity(low, unit, digits), quantity(high, unit, digits)
    if first == last:
        return first
    ends = [_parts(each, digits) if math.isfinite(each) else (NOT_A_NUMBER, 0) for each in (low, high)]
    alike = len({exponent for digits_, exponent in ends if digits_ != "0"}) == 1
    if not alike:
        return f"{first} to {last}" if any(exponent for _, exponent in ends) else f"{ends[0][0]} to {last}"
    exponent = next(exponent for digits_, exponent in ends if digits_ != "0")
    both = f"{ends[0][0]} to {ends[1][0]}"
    left, known = prefixed(unit, exponent)
    return with_unit(_scaled(f"({both})", left) if left else both, known)


def prefixed(unit: str, exponent: int) -> tuple[int, str]:
    """Return the power of ten that is left when a unit takes as much of it as a prefix, and the unit then.

    Only the first factor of a unit takes one, and only where it stands alone: mV/s, but no prefix for m^2 or 1/s.

    Args:
        unit: as the catalogue or the bench has it, with or without a prefix.
        exponent: a power of ten, a multiple of three.
    """
    first = _FIRST.match(unit) if exponent else None
    if first is None:
        return exponent, unit
    name = first[1]
    prefix, base = ("", name) if name in _TAKE_ALL | _TAKE_SMALL else (name[0], name[1:])
    power = exponent + _MEANT.get(prefix, 99)
    if (base not in _TAKE_ALL and not (base in _TAKE_SMALL and power <= 0)) or power not in _PREFIXES:
        return exponent, unit
    return 0, f"{_PREFIXES[power]}{base}{unit[first.end() :]}"


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
        return quantity(value, unit, _DIGITS_ALONE)
    if abs(value) > expanded * _FINEST:
        return with_unit(f"({number(value, 15)} ± {number(float(expanded), 2)})", unit)
    digits, spread, exponent = rounded(value, expanded)
    pair = f"{digits} ± {spread}"
    return _with_power(f"({pair})" if exponent or unit not in {"", "1"} else pair, exponent, unit)


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
    """Return a duration in the units that a person would use."""
    if not isinstance(seconds, int | float) or not math.isfinite(seconds):
        return ""
    if seconds < 60:
        return quantity(float(seconds), "s", 3)
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


def _parts(value: float, digits: int) -> tuple[str, int]:
    """Return a finite number with at most this many digits, and the power of ten that they are of."""
    exact = Decimal(repr(value))
    if exact == exact.to_integral_value() and abs(exact) < Decimal("1e9"):
        return str(int(exact)), 0
    short = Context(prec=digits, rounding=ROUND_HALF_EVEN).plus(exact)
    exponent = _engineering(short.adjusted(), short.adjusted() - digits)
    return _bare(short.scaleb(-exponent)), exponent


def _with_power(digits: str, exponent: int, unit: str) -> str:
    left, known = prefixed(unit, exponent)
    return with_unit(_scaled(digits, left), known)


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
