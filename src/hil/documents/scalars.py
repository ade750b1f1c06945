"""What a scalar means where text, a number, a flag, a duration or a frequency is expected."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping
from decimal import Decimal

from hil.documents.node import Node, Scalar, ScalarKind
from hil.documents.suggest import did_you_mean

__all__ = [
    "Complaint",
    "decimal_of",
    "duration_of",
    "flag_of",
    "frequency_of",
    "integer_of",
    "number_of",
    "text_of",
]

_LONGEST_NUMBER = 100
_DECIMAL = re.compile(r"[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]{1,3})?")
_INTEGER = re.compile(r"[-+]?(0|[1-9][0-9]{0,17})")
_HEXADECIMAL = re.compile(r"0[xX][0-9a-fA-F]{1,16}")
_QUANTITY = re.compile(r"([0-9]+(?:\.[0-9]+)?)\s*([^\s0-9.]+)")
_SECONDS = {
    "us": Decimal("1e-6"),
    "µs": Decimal("1e-6"),
    "ms": Decimal("1e-3"),
    "s": Decimal(1),
    "min": Decimal(60),
    "h": Decimal(3600),
    "d": Decimal(86400),
}
_HERTZ = {
    "mHz": Decimal("1e-3"),
    "Hz": Decimal(1),
    "kHz": Decimal("1e3"),
    "MHz": Decimal("1e6"),
    "GHz": Decimal("1e9"),
}


class Complaint(Exception):
    """What is wrong with a scalar, in words that follow the key's name."""


def text_of(node: Node, pattern: str = "", choices: Collection[str] = ()) -> str:
    """Return the text; unquoted numbers and flags are no text."""
    scalar = _scalar(node, "text")
    if scalar.kind is not ScalarKind.TEXT:
        raise Complaint(f"must be text, found {scalar.described}{_in_quotes(scalar)}")
    if choices and scalar.text not in choices:
        known = ", ".join(choices)
        raise Complaint(f"must be one of {known}, found '{scalar.text}'{did_you_mean(scalar.text, choices)}")
    if pattern and not re.fullmatch(pattern, scalar.text):
        raise Complaint(f"must look like {pattern}, found '{scalar.text}'")
    return scalar.text


def decimal_of(node: Node) -> str:
    """Return a quoted decimal number as it is written."""
    scalar = _scalar(node, "a number in quotes")
    if scalar.kind is ScalarKind.INTEGER:
        raise Complaint(f"must be a number in quotes, found {scalar.described}{_in_quotes(scalar)}")
    if scalar.kind is not ScalarKind.TEXT or not _DECIMAL.fullmatch(scalar.text):
        raise Complaint(f"must be a decimal number in quotes, found {scalar.described}")
    if len(scalar.text) > _LONGEST_NUMBER or not math.isfinite(float(scalar.text)):
        raise Complaint(f"is too large for a number, or too long: {scalar.described}")
    return scalar.text


def number_of(node: Node) -> float:
    """Return the value of a quoted decimal number."""
    return float(decimal_of(node))


def integer_of(node: Node, minimum: int | None = None) -> int:
    """Return a whole number, decimal or with 0x, quoted or not."""
    scalar = _scalar(node, "a whole number")
    if scalar.kind is ScalarKind.TEXT or scalar.kind is ScalarKind.INTEGER:
        number = _integer(scalar.text)
        if number is not None and (minimum is None or number >= minimum):
            return number
        if number is not None:
            raise Complaint(f"must be at least {minimum}, found {scalar.described}")
    raise Complaint(f"must be a whole number, decimal or with 0x, found {scalar.described}")


def flag_of(node: Node) -> bool:
    """Return an unquoted true or false."""
    scalar = _scalar(node, "true or false")
    if scalar.kind is not ScalarKind.FLAG:
        raise Complaint(f"must be true or false without quotes, found {scalar.described}")
    return scalar.text == "true"


def duration_of(node: Node) -> float:
    """Return seconds from a number with a unit, such as `10 ms` or `4 h`."""
    return _quantity_of(node, _SECONDS, "a duration such as 10 ms, 4 h or 90 d")


def frequency_of(node: Node) -> float:
    """Return hertz from a number with a unit, such as `400 kHz`."""
    hertz = _quantity_of(node, _HERTZ, "a frequency such as 100 Hz or 400 kHz")
    if not hertz > 0:
        raise Complaint("must be a frequency above zero")
    return hertz


def _integer(text: str) -> int | None:
    if _INTEGER.fullmatch(text):
        return int(text)
    return int(text, 16) if _HEXADECIMAL.fullmatch(text) else None


def _quantity_of(node: Node, units: Mapping[str, Decimal], expected: str) -> float:
    scalar = _scalar(node, expected)
    match = _QUANTITY.fullmatch(scalar.text) if scalar.kind is ScalarKind.TEXT else None
    if match is None or len(scalar.text) > _LONGEST_NUMBER:
        raise Complaint(f"must be {expected}, found {scalar.described}")
    number, unit = match.groups()
    if unit not in units:
        known = ", ".join(units)
        raise Complaint(f"must be {expected}; the unit '{unit}' is none of {known}")
    value = float(Decimal(number) * units[unit])
    if not math.isfinite(value):
        raise Complaint(f"is too large: {scalar.described}")
    return value


def _scalar(node: Node, expected: str) -> Scalar:
    if not isinstance(node, Scalar):
        raise Complaint(f"must be {expected}, found {node.described}")
    if node.kind is ScalarKind.NOTHING:
        raise Complaint(f"has no value, {expected} is expected")
    return node


def _in_quotes(scalar: Scalar) -> str:
    return f', write it in quotes: "{scalar.text[:60]}"'
