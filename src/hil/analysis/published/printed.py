"""Printed numbers, each of which stands for every number that rounds to it, and tables of these."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from decimal import Decimal

__all__ = ["EXACT", "Key", "NotANumber", "Printed", "PrintedTable", "as_printed", "begins_as_number"]

Key = tuple[str, str]
"""A cell of a table: its row and its column."""

EXACT = 0
"""As the number of significant digits: nothing was rounded, such as in a count."""

_NUMBER = re.compile(
    r"(?P<sign>[-+]?)(?P<mantissa>[0-9]+(?:\.[0-9]*)?|\.[0-9]+)"
    r"(?:[eE](?P<exponent>[-+]?[0-9]{1,3})|\s*[·\u00d7x*]\s*10\^?\{?(?P<power>[-+]?[0-9]{1,3})\}?)?\s*%?"
)
_BEGINS = re.compile(r"[-+<>~\u2212\u2013\u2248\u2264\u2265\u00b1]?\s*[.,]?[0-9]")
_CLOCK = re.compile(r"(?P<hours>[0-9]{1,4}):(?P<minutes>[0-5][0-9]):(?P<seconds>[0-5][0-9](?:\.[0-9]+)?)")
_MINUS = str.maketrans("\u2212\u2013", "--")
_LONGEST = 40


class NotANumber(ValueError):
    """A cell holds something other than a number."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Printed:
    """A printed number.

    Attributes:
        text: as printed.
        value: the number; a duration in seconds.
        half: half of the unit of its last digit: it stands for every number from value - half to value + half.
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
        """Return it times a factor, rounding included."""
        return replace(self, value=self.value * factor, half=self.half * abs(factor))


def as_printed(text: str, digits: int | None = None) -> Printed:
    """Return the number that a cell prints: `0.1234`, `12.289e5`, `12.289·10^5`, `-25.2 %`, or `2:47:58` in seconds.

    Args:
        text: of the cell; a sign of percent is ignored.
        digits: how many significant digits it was rounded to where the text leaves out zeros at the end, `EXACT` where
            it was not rounded; None takes the digits that stand there.

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
    """Return whether a cell that is not a number begins as one: `1.5 ± 0.1`, `1,500`, `< 3`, `12.5*`."""
    return _BEGINS.match(text.strip()) is not None


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedTable:
    """A printed table.

    Attributes:
        name: what reports call it, such as `4.6`.
        rows: names of its rows, in their order.
        columns: names of its columns, in their order.
        cells: its numbers; a blank cell has none.
    """

    name: str
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    cells: Mapping[Key, Printed] = field(default_factory=dict)

    def filled(self) -> Iterator[tuple[Key, Printed]]:
        """Give every cell that holds a number, row by row."""
        for row in self.rows:
            for column in self.columns:
                if (row, column) in self.cells:
                    yield (row, column), self.cells[row, column]
