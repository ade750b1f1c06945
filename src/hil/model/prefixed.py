"""Human-readable values: four significant digits, with an SI prefix instead of many zeros."""

from __future__ import annotations

import math

__all__ = ["prefixed"]

_SCALED = frozenset({"A", "T", "V", "W", "ohm"})
_PREFIXES = {9: "G", 6: "M", 3: "k", 0: "", -3: "m", -6: "u", -9: "n"}


def prefixed(value: float, unit: str) -> str:
    """Return a value with four significant digits and its unit.

    Below 0.001 and from 100 000 on, plain electrical units get a prefix; in between none, for comparison with limits.

    Args:
        value: any number.
        unit: its unit; one with a prefix, or that never takes one, is left unchanged.
    """
    size = math.floor(math.log10(abs(value))) if value and math.isfinite(value) else 0
    exponent = 0 if -3 <= size < 5 or unit not in _SCALED else max(-9, min(9, 3 * (size // 3)))
    digits = f"{value / 10.0**exponent + 0.0:.4g}"  # avoids minus zero
    if exponent and digits in {"1000", "-1000"}:  # rounded up to the next prefix
        exponent, digits = exponent + 3, digits.removesuffix("000")
    return f"{digits} {_PREFIXES[exponent]}{unit}".rstrip()
