"""Units of requirements and figures, by a definition file of our own.

Angle, count (LSB) and ratio are dimensions of their own: nothing turns degrees into plain numbers.
`degC` is a temperature; a difference of temperatures is `K` or `delta_degC`, and the two do not convert.
"""

from __future__ import annotations

import re
import unicodedata
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from hil.model.errors import HilError

if TYPE_CHECKING:
    import pint

__all__ = ["UnitError", "check_unit", "compatible", "convert", "scale"]

_DEFINITIONS = Path(__file__).with_name("units.txt")
_LONGEST = 80
_ALLOWED = re.compile(r"[A-Za-z0-9_µμΩ°%‰√·.²³⁻¹*^/()\- ]+")
_NOTATION = (
    (re.compile(r"(?:sqrt|√)\s*\(([^()]+)\)"), r"((\1)**0.5)"),
    (re.compile(r"√([A-Za-zµμΩ°%]+)"), r"((\1)**0.5)"),
    (re.compile(r"(?<=[A-Za-z%°Ω)²³])\s*[.·]\s*(?=[A-Za-zµμΩ°(])"), "*"),
)


class UnitError(HilError):
    """A unit that nobody knows, or two that do not convert."""


def check_unit(text: str) -> str | None:
    """Return what is wrong with a unit's text, None where it is a unit."""
    try:
        _unit(text)
    except UnitError as error:
        return str(error)
    return None


def compatible(one: str, other: str) -> bool:
    """Return whether numbers in one unit convert to the other.

    Raises:
        UnitError: where one of them is no unit.
    """
    first, second = _unit(one), _unit(other)
    return first.dimensionality == second.dimensionality and _is_offset(first) == _is_offset(second)


def convert(value: float, from_unit: str, to_unit: str) -> float:
    """Return `value` in another unit.

    Raises:
        UnitError: where one of them is no unit, or they do not convert.
    """
    if from_unit == to_unit:
        _unit(from_unit)
        return value
    if not compatible(from_unit, to_unit):
        raise UnitError(f"'{from_unit}' does not convert to '{to_unit}'", _why_not(from_unit, to_unit))
    return value * scale(from_unit, to_unit)


@lru_cache(maxsize=1024)
def scale(from_unit: str, to_unit: str) -> float:
    """Return the factor for differences and uncertainties; offsets of temperatures play no part.

    Raises:
        UnitError: where one of them is no unit, or they do not convert.
    """
    registry = _registry()
    first, second = _difference(_unit(from_unit)), _difference(_unit(to_unit))
    if first.dimensionality != second.dimensionality:
        raise UnitError(f"'{from_unit}' does not convert to '{to_unit}'", _why_not(from_unit, to_unit))
    return float(registry.convert(1.0, first, second))


@cache
def _registry() -> pint.UnitRegistry[float]:
    import pint  # noqa: PLC0415 - only runs that check units pay for it

    return pint.UnitRegistry(str(_DEFINITIONS))


@lru_cache(maxsize=1024)
def _unit(text: str) -> pint.Unit:
    if not text.strip():
        raise UnitError("a unit is missing", "write 1 for a plain number")
    if len(text) > _LONGEST or not _ALLOWED.fullmatch(unicodedata.normalize("NFC", text)):
        raise UnitError(f"'{text[:_LONGEST]}' is not a unit", "write it as in deg/s/sqrt(Hz), W.h, uT, 1 or %")
    notation = unicodedata.normalize("NFC", text)
    for pattern, replacement in _NOTATION:
        notation = pattern.sub(replacement, notation)
    try:
        return _registry().parse_units("dimensionless" if notation.strip() == "1" else notation)
    except Exception as error:  # the parser raises whatever its tokenizer and its arithmetic raise
        raise UnitError(f"'{text}' is not a known unit", "write it as in deg/s/sqrt(Hz), W.h, uT, 1 or %") from error


def _is_offset(unit: pint.Unit) -> bool:
    return str(unit) == "degree_Celsius"


def _difference(unit: pint.Unit) -> pint.Unit:
    return _registry().Unit("delta_degree_Celsius") if _is_offset(unit) else unit


def _why_not(one: str, other: str) -> str:
    first, second = _unit(one), _unit(other)
    if first.dimensionality == second.dimensionality:
        return "degC is a temperature, K and delta_degC are differences of temperatures"
    return f"the one is {first.dimensionality}, the other {second.dimensionality}"
