"""Units of requirements and figures, by a definition file of our own.

Angle, count (LSB) and ratio are dimensions of their own: nothing turns degrees into plain numbers.
`degC` is a temperature; a difference of temperatures is `K` or `delta_degC`, and the two do not convert.

A unit is names, products, quotients, roots and small powers: what else pint would compute, such as a tower
of powers that never ends, is refused before it sees it.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Mapping
from functools import cache, lru_cache
from typing import TYPE_CHECKING, cast

from hil.model.errors import HilError
from hil.requirements.unit_words import DEFINITIONS, LONGEST, is_product, kind_of, unit_word

if TYPE_CHECKING:
    import pint

__all__ = ["UnitError", "check_unit", "compatible", "convert", "is_plain", "same", "scale"]

_DEEPEST = 3
_POWER = r"[-+]?[0-9](?:\.[0-9]{1,2})?"
_WORD = re.compile(
    rf"(?P<power>(?:\*\*|\^)\s*(?:{_POWER}(?![0-9.A-Za-z])|\(\s*{_POWER}(?:\s*/\s*[1-9])?\s*\)))"
    r"|(?P<name>[A-Za-zµμΩ°%‰_][A-Za-z0-9µμΩ°%‰_]*)"
    r"|(?P<superscript>⁻?[¹²³])"
    r"|(?P<one>1(?![0-9.A-Za-z]))"
    r"|(?P<sign>[*/·.()√ ])"
)
_KINDS = {
    "1": "ratio",
    "A": "current",
    "A.h": "charge",
    "count": "count",
    "deg": "angle",
    "deg/s": "angular rate",
    "Hz": "frequency",
    "K": "temperature",
    "kg": "mass",
    "m": "length",
    "ohm": "resistance",
    "s": "time",
    "T": "magnetic field",
    "V": "voltage",
    "W": "power",
    "W.h": "energy",
}
_NOTATION = (
    (re.compile(r"(?:sqrt|√)\s*\(([^()]+)\)"), r"((\1)**0.5)"),
    (re.compile(r"√([A-Za-zµμΩ°%]+)"), r"((\1)**0.5)"),
    (re.compile(r"(?<=/)(\s*s)2(?![0-9.A-Za-z])"), r"\1**2"),
    (re.compile(r"(?<=[A-Za-z%°Ω)²³])\s*[.·]\s*(?=[A-Za-zµμΩ°(])"), "*"),
)


class UnitError(HilError):
    """An unknown unit, or two that do not convert."""


def check_unit(text: str) -> str | None:
    """Return what is wrong with a unit's text, None if it is a unit."""
    if is_product(text):
        return None
    try:
        _unit(text)
    except UnitError as error:
        return str(error)
    return None


@lru_cache(maxsize=1024)
def compatible(one: str, other: str) -> bool:
    """Return whether numbers in one unit convert to the other.

    Raises:
        UnitError: if one of them is not a unit.
    """
    if (kind := kind_of(one)) and (another := kind_of(other)):
        return kind == another
    first, second = _unit(one), _unit(other)
    return first.dimensionality == second.dimensionality and _is_offset(first) == _is_offset(second)


def convert(value: float, from_unit: str, to_unit: str) -> float:
    """Return `value` in another unit.

    Raises:
        UnitError: if one of them is not a unit, or they do not convert.
    """
    if from_unit == to_unit:
        if not is_product(from_unit):
            _unit(from_unit)
        return value
    if not compatible(from_unit, to_unit):
        raise UnitError(f"'{from_unit}' does not convert to '{to_unit}'", _why_not(from_unit, to_unit))
    return value * scale(from_unit, to_unit)


@lru_cache(maxsize=1024)
def is_plain(text: str) -> bool:
    """Return whether numbers in this unit can be used as they are: SI without a prefix, degC, and degrees of angle.

    Raises:
        UnitError: if it is not a unit.
    """
    if word := unit_word(text):
        return word.offset or _is_coherent(word.size, dict(word.dimension))
    unit = _unit(text)
    if _is_offset(unit):
        return True
    factor = float(_registry().Quantity(1.0, unit).to_root_units().magnitude)
    return _is_coherent(factor, cast("Mapping[str, float]", unit.dimensionality))


def _is_coherent(factor: float, powers: Mapping[str, float]) -> bool:
    # Roots are the gram, where SI has the kilogram, and the radian, where benches have the degree.
    grams = 1000.0 ** powers.get("[mass]", 0)
    degrees = math.radians(1.0) ** powers.get("[angle]", 0)
    return any(math.isclose(factor, grams * angle, rel_tol=1e-12) for angle in (1.0, degrees))


@lru_cache(maxsize=1024)
def same(one: str, other: str, differences: bool = False) -> bool:  # noqa: FBT002 - an answer is kept for each
    """Return whether numbers in one unit mean the same in the other; a text that is not a unit counts as the same.

    Args:
        one: such as `degC`.
        other: such as `K`, which differences in degC may be called, but no temperature.
        differences: whether the numbers are differences.
    """
    if one == other:
        return True
    kind, another = kind_of(one), kind_of(other)
    if kind and another and kind[0] != another[0]:
        return False
    try:
        return (differences or compatible(one, other)) and math.isclose(scale(one, other), 1.0, rel_tol=1e-12)
    except UnitError:
        return bool(check_unit(one) or check_unit(other))


@lru_cache(maxsize=1024)
def scale(from_unit: str, to_unit: str) -> float:
    """Return the factor for differences and uncertainties; temperature offsets are ignored.

    Raises:
        UnitError: if one of them is not a unit, or they do not convert.
    """
    if from_unit == to_unit and is_product(from_unit):
        return 1.0
    if (word := unit_word(from_unit)) and (another := unit_word(to_unit)):
        if word.name == another.name:
            return 1.0 if word.prefix == another.prefix else word.prefix * another.prefix**-1.0
        if not word.dimension and not another.dimension:
            return float(word.size * another.size**-1.0)
    registry = _registry()
    first, second = _difference(_unit(from_unit)), _difference(_unit(to_unit))
    if first.dimensionality != second.dimensionality:
        raise UnitError(f"'{from_unit}' does not convert to '{to_unit}'", _why_not(from_unit, to_unit))
    factor = _factor(registry, first, second)
    if not math.isfinite(factor) or factor <= 0:
        raise UnitError(f"'{from_unit}' does not convert to '{to_unit}'", "their sizes are too far apart for a number")
    return factor


def _factor(registry: pint.UnitRegistry[float], first: pint.Unit, second: pint.Unit) -> float:
    try:
        return float(registry.convert(1.0, first, second))
    except (OverflowError, ZeroDivisionError):
        return math.inf


@cache
def _registry() -> pint.UnitRegistry[float]:
    import pint  # noqa: PLC0415 - only runs that check units pay for it

    return pint.UnitRegistry(str(DEFINITIONS))


@lru_cache(maxsize=1024)
def _unit(text: str) -> pint.Unit:
    if not text.strip():
        raise UnitError("a unit is missing", "write 1 for a plain number")
    notation = unicodedata.normalize("NFC", text[: LONGEST + 1])
    if len(text) > LONGEST or not _is_spoken(notation):
        raise UnitError(f"'{text[:LONGEST]}' is not a unit", "write it as in deg/s/sqrt(Hz), W.h, uT, 1 or %")
    for pattern, replacement in _NOTATION:
        notation = pattern.sub(replacement, notation)
    try:
        for word in _WORD.finditer(notation):
            if word["name"]:
                _registry().parse_units(word["name"])  # units that cancel out must exist, too
        return _registry().parse_units("dimensionless" if notation.strip() == "1" else notation)
    except Exception as error:  # the parser raises whatever its tokenizer and its arithmetic raise
        raise UnitError(f"'{text}' is not a known unit", "write it as in deg/s/sqrt(Hz), W.h, uT, 1 or %") from error


def _is_spoken(notation: str) -> bool:
    """Return whether a text is made like a unit: no power of a power, no number but 1, few brackets."""
    at, before, depth = 0, "", 0
    while at < len(notation):
        word = _WORD.match(notation, at)
        if word is None:
            return False
        at, kind = word.end(), word.lastgroup or ""
        depth += {"(": 1, ")": -1}.get(word[0], 0)
        if depth > _DEEPEST or {kind, before} <= {"power", "superscript", "one"}:
            return False
        before = before if word[0] == " " else kind
    return True


def _is_offset(unit: pint.Unit) -> bool:
    return str(unit) == "degree_Celsius"


def _difference(unit: pint.Unit) -> pint.Unit:
    return _registry().Unit("delta_degree_Celsius") if _is_offset(unit) else unit


def _why_not(one: str, other: str) -> str:
    first, second = _unit(one), _unit(other)
    if first.dimensionality == second.dimensionality:
        return "degC is a temperature, K and delta_degC are differences of temperatures"
    kinds = {_unit(unit).dimensionality: kind for unit, kind in _KINDS.items()}
    if first.dimensionality in kinds and second.dimensionality in kinds:
        return f"{one} is a unit of {kinds[first.dimensionality]}, {other} of {kinds[second.dimensionality]}"
    return "they are units of different quantities"
