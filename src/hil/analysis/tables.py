"""Export of tables as CSV: a header line with units, then one line per row."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

__all__ = ["Column", "as_csv"]


@dataclass(frozen=True, slots=True)
class Column:
    """One column.

    Attributes:
        name: column name.
        unit: appended in square brackets, unless it is empty or `1`.
        form: Python format specification of its values, such as `.3f`; empty for text and integers.
        missing: text for NaN; None writes it as Python does.
    """

    name: str
    unit: str = ""
    form: str = ""
    missing: str | None = None

    @property
    def heading(self) -> str:
        """Heading: name and unit."""
        return f"{self.name} [{self.unit}]" if self.unit not in {"", "1"} else self.name

    def written(self, value: float | str) -> str:
        """Format one value."""
        if self.missing is not None and isinstance(value, float) and not math.isfinite(value):
            return self.missing
        return format(value, self.form)


def as_csv(columns: Sequence[Column], rows: Iterable[Sequence[float | str]]) -> str:
    """Return a table as comma-separated text (RFC 4180 without quotes), every line terminated.

    Args:
        columns: from left to right.
        rows: rows with one value per column.

    Raises:
        ValueError: a row has the wrong number of values, or a text contains a comma, a quote or a line break.
    """
    lines = [[column.heading for column in columns]]
    lines += [[column.written(value) for column, value in zip(columns, row, strict=True)] for row in rows]
    wrong = next((text for line in lines for text in line if any(mark in text for mark in ',"\r\n')), None)
    if wrong is not None:
        raise ValueError(f"{wrong!r} is not allowed in a table without quotes")
    return "".join(",".join(line) + "\n" for line in lines)
