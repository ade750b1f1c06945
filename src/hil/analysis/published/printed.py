"""Printed numbers, each standing for every number that rounds to it, and tables of them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from decimal import Decimal

__all__ = ["EXACT", "Key", "NotANumber", "Printed", "PrintedTable", "as_printed", "begins_as_number"]

Key = tuple[str, str]
"""Key of a table cell: row and column."""

EXACT = 0
"""Number of significant digits of a number that was not rounded, such as a count."""

_NUMBER = re.compile(
    r"(?P<sign>[-+]?)(?P<mantissa>[0-9]+(?:\.[0-9]*)?|\.[0-9]+)"
    r"(?:[eE](?P<exponent>[-+]?[0-9]{1,3})|\s*[·\u00d7x*]\s*10\^?\{?(?P<power>[-+]?[0-9]{1,3})\}?)?\s*%?"
)
_BEGINS = re.compile(r"[-+<>~\u2212\u2013\u2248\u2264\u2265\u00b1]?\s*[.,]?[0-9]")
_CLOCK = re.compile(r"(?P<hours>[0-9]{1,4}):(?P<minutes>[0-5][0-9]):(?P<seconds>[0-5][0-9](?:\.[0-9]+)?)")
_MINUS = str.maketrans("\u2212\u2013", "--")
_LONGEST = 40


class NotANumber(ValueError):
    """The text of a cell is not a number."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Printed:
    """A printed number.

    Attributes:
        text: the printed text.
        value: the number; a duration in seconds.
        half: half of the unit of its last digit: the number stands for value - half to value + half.
        digits: its significant digits, without sign, point and exponent.
    """

    text: str
    value: float
    half: float
    digits: str = ""

    @property
    def low(self) -> float:
        """The least number that rounds to it."""
        return self.value - self.half

    @property
    def high(self) -> float:
        """The largest number that rounds to it."""
        return self.value + self.half

    def scaled(self, factor: float) -> Printed:
        """Return the number times a factor, rounding included."""
        return replace(self, value=self.value * factor, half=self.half * abs(factor))


def as_printed(text: str, digits: int | None = None) -> Printed:
    """Parse a printed number: `0.1234`, `12.289e5`, `12.289·10^5`, `-25.2 %`, or `2:47:58` in seconds.

    Args:
        text: text of the cell; a percent sign is ignored.
        digits: number of significant digits where trailing zeros are omitted, `EXACT` if it was not rounded; None for
            the digits as printed.

    Raises:
        NotANumber: the text is not a number.
    """
    bare = text.strip().translate(_MINUS)
    if (clock := _CLOCK.fullmatch(bare)) and len(bare) <= _LONGEST:
        whole = int(clock["hours"]) * 3600 + int(clock["minutes"]) * 60
        found = as_printed(clock["seconds"], digits)
        return replace(found, text=text.strip(), value=whole + found.value, digits="")
    match = _NUMBER.fullmatch(bare)
    if match is None or len(bare) > _LONGEST:
        raise NotANumber(text)
    exponent = int(match["exponent"] or match["power"] or 0)
    mantissa = Decimal(match["mantissa"])
    places = -int(mantissa.as_tuple().exponent)
    if digits and mantissa:
        places = max(places, digits - 1 - mantissa.adjusted())
    half = 0.0 if digits == EXACT and digits is not None else float(Decimal(5).scaleb(exponent - places - 1))
    value = float(Decimal(match["sign"] + match["mantissa"]).scaleb(exponent))
    if value in {float("inf"), float("-inf")}:
        raise NotANumber(text)
    return Printed(text=text.strip(), value=value, half=half, digits=match["mantissa"].replace(".", "").lstrip("0"))


def begins_as_number(text: str) -> bool:
    """Return whether a cell that is not a number begins like one: `1.5 ± 0.1`, `1,500`, `< 3`, `12.5*`."""
    return _BEGINS.match(text.strip()) is not None


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedTable:
    """A printed table.

    Attributes:
        name: its name in reports, such as `4.6`.
        rows: row names in order.
        columns: column names in order.
        cells: its numbers by key, without blank cells.
    """

    name: str
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    cells: Mapping[Key, Printed] = field(default_factory=dict)

    def filled(self) -> Iterator[tuple[Key, Printed]]:
        """Yield every cell with a number, row by row."""
        for row in self.rows:
            for column in self.columns:
                if (row, column) in self.cells:
                    yield (row, column), self.cells[row, column]
