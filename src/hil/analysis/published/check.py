"""Verification of a published table: which cells follow from its sources."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

from hil.analysis.published.causes import Asked, causes
from hil.analysis.published.formula import Formula, Missing
from hil.analysis.published.printed import Key, Printed, PrintedTable
from hil.analysis.published.ranges import Undefined

__all__ = ["CellVerdict", "CheckedCell", "check"]


class CellVerdict(StrEnum):
    """Verdict on a published cell."""

    FOLLOWS = "follows"
    DOES_NOT_FOLLOW = "does not follow"
    UNKNOWN = "unknown"
    """It cannot be recomputed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedCell:
    """A published cell with the result of its formula.

    Attributes:
        row: row of the published table.
        column: column of the published table.
        printed: the printed text.
        verdict: whether it follows.
        low: least value of the formula with each source within its rounding; None where unknown.
        high: likewise the largest value.
        reason: why it is unknown, otherwise empty.
        causes: possible causes if it does not follow, likeliest first; may be empty.
    """

    row: str
    column: str
    printed: Printed
    verdict: CellVerdict
    low: float | None = None
    high: float | None = None
    reason: str = ""
    causes: tuple[str, ...] = ()


def check(
    published: PrintedTable,
    formulas: Mapping[Key, Formula],
    tables: Mapping[str, PrintedTable],
    others: Sequence[PrintedTable] = (),
) -> tuple[CheckedCell, ...]:
    """Recompute the cells of a published table, and return the verdict on each.

    A printed number stands for every number that rounds to it. A cell follows if one of these is among the values of
    the formula with each source anywhere within its own rounding. So a cell that does not follow cannot have been
    computed from these sources by this formula, however they were rounded.

    Args:
        published: the table to verify.
        formulas: formulas by row and column; cells without one, and blank cells, are left out.
        tables: the source tables, by their names in the formulas.
        others: further tables from which a cell may have been copied by mistake.
    """
    asked = [
        Asked(place=place, printed=cell, formula=formulas[place], tables=tables)
        for place, cell in published.filled()
        if place in formulas
    ]
    return tuple(_checked(each, published, asked, others) for each in asked)


def _checked(
    cell: Asked, published: PrintedTable, asked: Sequence[Asked], others: Sequence[PrintedTable]
) -> CheckedCell:
    row, column = cell.place
    try:
        found = cell.recomputed()
    except (Missing, Undefined) as error:
        return CheckedCell(row=row, column=column, printed=cell.printed, verdict=CellVerdict.UNKNOWN, reason=str(error))
    follows = cell.meets(found)
    return CheckedCell(
        row=row,
        column=column,
        printed=cell.printed,
        verdict=CellVerdict.FOLLOWS if follows else CellVerdict.DOES_NOT_FOLLOW,
        low=found.low,
        high=found.high,
        causes=() if follows else tuple(causes(cell, published, asked, others)),
    )
