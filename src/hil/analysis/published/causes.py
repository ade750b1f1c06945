"""Likely causes of a published cell that does not follow: common mistakes with tables."""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

from hil.analysis.published.formula import Formula, Missing, Source
from hil.analysis.published.printed import Key, NotANumber, Printed, PrintedTable, as_printed
from hil.analysis.published.ranges import Range, Undefined

__all__ = ["Asked", "causes"]

_SLACK = 1e-12  # relative: what rounding of computers leaves
_MOST = 4
_FEW = 3  # sources of a formula: of more, any could be made to fit
_SHARP = 1e-3  # relative half-width beyond which a cell with so few digits is met by chance
_NEAR = 0.02  # of a power of ten: a factor of ten is a slip also of a number that was rounded once more
_LEAST_DIGITS = 3  # of a cell that is told to be a copy of another

_LEADING_ZERO = re.compile(r"^([-+]?)0(?=[0-9])")

_TENS = {"100": 100.0, "1/100": 0.01, "10": 10.0, "1/10": 0.1, "1000": 1e3, "1/1000": 1e-3, "1e6": 1e6, "1e-6": 1e-6}
_FACTORS = {
    "180/pi": 180 / math.pi, "pi/180": math.pi / 180, "2": 2.0, "1/2": 0.5, "sqrt(2)": math.sqrt(2),
    "1/sqrt(2)": math.sqrt(0.5), "60": 60.0, "1/60": 1 / 60, "3600": 3600.0, "1/3600": 1 / 3600,
    "9.80665": 9.80665, "1/9.80665": 1 / 9.80665, "2 pi": 2 * math.pi, "1/(2 pi)": 0.5 / math.pi,
}  # fmt: skip
_OTHER: Mapping[str, Callable[[float, float], float]] = {
    "200*({1}-{0})/({0}+{1})": lambda a, b: 200 * (b - a) / (a + b),
    "100*({1}-{0})/{0}": lambda a, b: 100 * (b - a) / a,
    "100*({1}-{0})/{1}": lambda a, b: 100 * (b - a) / b,
    "100*{1}/{0}": lambda a, b: 100 * b / a,
    "{1}-{0}": lambda a, b: b - a,
    "{1}/{0}": lambda a, b: b / a,
}
"""Formulas used for the deviation of two numbers."""


@dataclass(frozen=True, kw_only=True)
class Asked:
    """A published cell with the formula that should give it."""

    place: Key
    printed: Printed
    formula: Formula
    tables: Mapping[str, PrintedTable]

    @cached_property
    def sources(self) -> dict[Source, Printed]:
        """The printed source cells of its formula."""
        return self.formula.sources(self.place, self.tables)

    def recomputed(self, cells: Mapping[Source, Printed] | None = None) -> Range:
        """Return the result of the formula, or with replaced source cells."""
        return self.formula.over(self.place, self.tables, self.sources if cells is None else cells)

    def meets(self, found: Range, factor: float = 1.0) -> bool:
        """Return whether these values, times a factor, include a number that rounds to the printed one."""
        low, high = sorted((found.low * factor, found.high * factor))
        slack = _SLACK * max(abs(low), abs(high), abs(self.printed.value))
        return low <= self.printed.high + slack and high >= self.printed.low - slack

    def sharp(self, found: Range) -> bool:
        """Return whether both numbers are too precise to agree by chance."""
        return max(self.printed.half, (found.high - found.low) / 2) <= _SHARP * abs(self.printed.value)


def causes(
    cell: Asked, published: PrintedTable, asked: Sequence[Asked], others: Sequence[PrintedTable]
) -> Iterator[str]:
    """Yield possible causes for a cell that does not follow, likeliest first, at most four.

    Args:
        cell: the cell that does not follow.
        published: its table.
        asked: every cell of the table that has a formula.
        others: tables from which a cell may have been copied by mistake.
    """
    found = cell.recomputed()
    sharp = cell.sharp(found)
    told = [*_factor(cell, found, sharp=sharp), *_misprinted(cell, sharp=sharp), *_copied(cell, published, others)]
    if sharp:
        told += [*_swapped(cell, asked), *_other_formula(cell)]
    yield from dict.fromkeys(told[:_MOST])
    if not told and (needed := list(_needed(cell))):
        yield f"no usual slip: {', or '.join(needed)}"


def _factor(cell: Asked, found: Range, *, sharp: bool) -> Iterator[str]:
    """Find a known factor between printed and recomputed value."""
    if cell.meets(found, -1.0):
        yield "the sign is reversed"
    middle = (found.low + found.high) / 2
    for name, factor in (_TENS | _FACTORS if sharp else _TENS).items():
        for sign, words in ((1.0, ""), (-1.0, ", with the sign reversed")):
            if cell.meets(found, sign * factor):
                yield f"it is {name} times the recomputed value{words}"
            elif name in _TENS and abs(cell.printed.value - sign * factor * middle) <= _NEAR * abs(cell.printed.value):
                yield f"it is about {name} times the recomputed value{words}"


def _misprinted(cell: Asked, *, sharp: bool) -> Iterator[str]:
    """Find one source cell that would explain it with another sign, factor or digit."""
    sources = cell.sources
    for source, printed in sources.items():
        told = _name(cell, source)
        changes: list[tuple[str, Printed]] = [(f"{told} had the sign reversed", printed.scaled(-1.0))]
        if sharp:
            factors = (_TENS | _FACTORS).items()
            changes += [(f"{told} had {name} times what is printed", printed.scaled(by)) for name, by in factors]
            changes += [(f"{told} had {each.text}, not {printed.text}", each) for each in _slips(printed)]
        for words, other in changes:
            if _explains(cell, {**sources, source: other}):
                yield f"it would follow if {words}"


def _slips(printed: Printed) -> Iterator[Printed]:
    """Yield the numbers that differ in one digit, or by a swap of two adjacent digits."""
    text = printed.text
    places = [place for place, each in enumerate(text) if each.isdigit()][: len(printed.digits) + 6]
    for place in places:
        yield from _read(text[:place] + digit + text[place + 1 :] for digit in "0123456789" if digit != text[place])
    for one, other in pairwise(places):
        if text[one] != text[other] and other == one + 1:
            yield from _read([text[:one] + text[other] + text[one] + text[other + 1 :]])


def _read(texts: Iterable[str]) -> Iterator[Printed]:
    for text in texts:
        with contextlib.suppress(NotANumber):  # a minute of a duration has no more than 59 seconds
            yield as_printed(_LEADING_ZERO.sub(r"\1", text))


def _copied(cell: Asked, published: PrintedTable, others: Sequence[PrintedTable]) -> Iterator[str]:
    """Find another cell that prints the same number."""
    if len(cell.printed.digits) < _LEAST_DIGITS:
        return
    for table in {each.name: each for each in (published, *others)}.values():
        for place, other in table.filled():
            if other.value == cell.printed.value and (table.name, place) != (published.name, cell.place):
                yield f"the same number is printed in {table.name}, row {place[0]}, column {place[1]}"


def _swapped(cell: Asked, asked: Sequence[Asked]) -> Iterator[str]:
    """Find another cell of the table whose recomputed value is printed here."""
    for other in asked:
        if other.place != cell.place:
            try:
                if cell.meets(other.recomputed()):
                    yield f"it is what row {other.place[0]}, column {other.place[1]} should be"
            except (Missing, Undefined):
                continue


def _other_formula(cell: Asked) -> Iterator[str]:
    """Find another formula of the same two numbers."""
    sources = cell.sources
    if len(sources) != 2:
        return
    (first, one), (second, other) = sources.items()
    for names, ends in (((first, second), (one, other)), ((second, first), (other, one))):
        for pattern, compute in _OTHER.items():
            corners = [(a, b) for a in (ends[0].low, ends[0].high) for b in (ends[1].low, ends[1].high)]
            try:
                values = [compute(a, b) for a, b in corners]
                found = Range(min(values), max(values))
            except ArithmeticError:
                continue
            if cell.meets(found):
                yield f"it follows by another formula, {pattern.format(*(each.table for each in names))}"


def _needed(cell: Asked) -> Iterator[str]:
    """Yield the value that each source cell would need.

    Formulas of tables are nearly always linear-fractional in each cell, which preserves the cross-ratio: three values
    determine the inverse, which is then verified with the formula.
    """
    sources = cell.sources
    if len(sources) > _FEW:
        return
    values = {source: printed.value for source, printed in sources.items()}
    for source, printed in sources.items():
        needed = _inverse(cell, values, source)
        if needed is not None and math.isfinite(needed):
            yield f"{_name(cell, source)} would have to be {needed:.5g}, not {printed.text}"


def _inverse(cell: Asked, values: Mapping[Source, float], source: Source) -> float | None:
    target, here = cell.printed.value, values[source]
    if here == 0:
        return None
    points = [here, 2 * here, 3 * here]

    def at(value: float) -> float:
        return cell.formula.at(cell.place, cell.tables, {**values, source: value})

    try:
        one, two, three = map(at, points)
        ratio = (target - one) * (two - three) / ((target - three) * (two - one))
        # (x - x1)(x2 - x3) / ((x - x3)(x2 - x1)) is the same of the values.
        weight = ratio * (points[1] - points[0]) / (points[1] - points[2])
        needed = (points[0] - weight * points[2]) / (1 - weight)
        back = at(needed)
    except ArithmeticError:
        return None
    return needed if abs(back - target) <= cell.printed.half + _SLACK * abs(target) else None


def _explains(cell: Asked, cells: Mapping[Source, Printed]) -> bool:
    try:
        return cell.meets(cell.recomputed(cells))
    except Undefined:
        return False


def _name(cell: Asked, source: Source) -> str:
    where = [cell.tables[source.table].name]
    if source.row != cell.place[0]:
        where.append(f"row {source.row}")
    if source.column != cell.place[1]:
        where.append(f"column {source.column}")
    return ", ".join(where)
