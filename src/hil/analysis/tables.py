"""Tables as text for use in other programs: one line for the columns with their units, then one for each row."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

__all__ = ["Column", "as_csv"]


@dataclass(frozen=True, slots=True)
class Column:
    """One column.

    Attributes:
        name: its heading.
        unit: follows the name in square brackets; not if there is none, or it is `1`.
        form: how its values are written, as a format of Python such as `.3f`; empty for text and whole numbers.
        missing: the text for a number that is not finite; None writes it as Python does.
    """

    name: str
    unit: str = ""
    form: str = ""
    missing: str | None = None

    @property
    def heading(self) -> str:
        """Name and unit."""
        return f"{self.name} [{self.unit}]" if self.unit not in {"", "1"} else self.name

    def written(self, value: float | str) -> str:
        """Return one value as text."""
        if self.missing is not None and isinstance(value, float) and not math.isfinite(value):
            return self.missing
        return format(value, self.form)


def as_csv(columns: Sequence[Column], rows: Iterable[Sequence[float | str]]) -> str:
    """Return a table as comma-separated text (RFC 4180 without quotes), each line with an end.

    Args:
        columns: from left to right.
        rows: one value for each column.

    Raises:
        ValueError: a row has another number of values, or a text holds a comma, a quote or an end of line.
    """
    lines = [[column.heading for column in columns]]
    lines += [[column.written(value) for column, value in zip(columns, row, strict=True)] for row in rows]
    wrong = next((text for line in lines for text in line if any(mark in text for mark in ',"\r\n')), None)
    if wrong is not None:
        raise ValueError(f"{wrong!r} is not allowed in a table without quotes")
    return "".join(",".join(line) + "\n" for line in lines)
