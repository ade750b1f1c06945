"""Formulas of tables: read by a parser of their own grammar, never executed as code."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from hil.analysis.published.printed import Key, Printed, PrintedTable
from hil.analysis.published.ranges import Range, Undefined, constant, variable

__all__ = ["Formula", "FormulaError", "Missing", "Source", "parse"]

_LONGEST = 500
_LARGEST_POWER = 100
_CONSTANTS = {"pi": math.pi}


class FormulaError(ValueError):
    """A formula that cannot be read.

    Args:
        column: where, from 1 on.
        message: what is wrong.
        known: the names that may stand there; empty where it is not about a name.
        word: the name that was found there.
    """

    def __init__(self, column: int, message: str, known: tuple[str, ...] = (), word: str = "") -> None:
        super().__init__(message)
        self.column, self.message, self.known, self.word = column, message, known, word


class Missing(LookupError):
    """A formula needs a cell that is blank, or that its table does not have."""


class Source(NamedTuple):
    """A cell that a formula uses: the name of the table in the formula, row and column."""

    table: str
    row: str
    column: str


def _exp(value: float) -> float:
    try:
        return math.exp(value)
    except OverflowError:
        raise Undefined("the result is too large, or no number") from None


def _total(values: list[Range]) -> Range:
    found = constant(0.0)
    for each in values:
        found += each
    return found


_Value = Range | list[Range]
_BINARY: Mapping[type[ast.operator], Callable[[Range, Range], Range]] = {
    ast.Add: lambda one, other: one + other,
    ast.Sub: lambda one, other: one - other,
    ast.Mult: lambda one, other: one * other,
    ast.Div: lambda one, other: one / other,
}
_ONE: Mapping[str, Callable[[Range], Range]] = {
    "abs": abs,
    "sqrt": lambda value: value.rising(math.sqrt, lambda at: 0.5 / math.sqrt(at), 0.0),
    "log": lambda value: value.rising(math.log, lambda at: 1 / at, 0.0),
    "log10": lambda value: value.rising(math.log10, lambda at: 1 / (at * math.log(10)), 0.0),
    "exp": lambda value: value.rising(_exp, _exp, -math.inf),
}
_MANY: Mapping[str, Callable[[list[Range]], Range]] = {
    "sum": _total,
    "mean": lambda values: _total(values) / constant(float(len(values))),
    "min": lambda values: Range.extreme(values, min),
    "max": lambda values: Range.extreme(values, max),
    "count": lambda values: constant(float(len(values))),
}
_FUNCTIONS = (*_ONE, *_MANY)
_RESERVED = frozenset((*_FUNCTIONS, *_CONSTANTS))


@dataclass(frozen=True, slots=True)
class Formula:
    """A formula of one cell.

    `a` is the cell of table a in the row and column of the published cell; `a["white"]` the one of another column,
    `a["white", "z"]` that of another column and row. `a["white", :]` is a whole column, `a[:, "z"]` a row, and
    `a["white", "1":"5"]` part of a column. Besides + - * / ** and brackets there are abs, sqrt, log, log10, exp and pi,
    and sum, mean, min, max and count of several numbers or of a column.

    Attributes:
        text: as it is written.
        tree: what it means.
    """

    text: str
    tree: ast.expr = field(compare=False, repr=False)

    def sources(self, place: Key, tables: Mapping[str, PrintedTable]) -> dict[Source, Printed]:
        """Return the printed cells that it uses at a row and column.

        Raises:
            Missing: a cell is blank, or not there.
        """
        used: dict[Source, Printed] = {}

        def take(source: Source) -> Range:
            cell = tables[source.table].cells.get((source.row, source.column))
            if cell is None:
                raise Missing(f"{tables[source.table].name} has no number in row {source.row}, column {source.column}")
            used[source] = cell
            return constant(1.0)

        evaluation = _Evaluation(place, tables, take)
        for node in _references(self.tree):
            evaluation.value(node)
        return used

    def over(self, place: Key, tables: Mapping[str, PrintedTable], cells: Mapping[Source, Printed]) -> Range:
        """Return every value that it has while each cell is anywhere within its rounding.

        The ends are exact where the formula is monotone in each cell, as nearly all are within so little; else they
        are outer bounds.

        Args:
            place: row and column of the published cell.
            tables: by the names in the formula.
            cells: of all sources.

        Raises:
            Undefined: there may be none, as where a divisor may be zero.
        """
        whole = self._with(place, tables, {key: (cell.low, cell.high) for key, cell in cells.items()})
        lower, upper = {}, {}
        for key, cell in cells.items():
            low, high = whole.slopes.get(key, (0.0, 0.0))
            ends = (cell.low, cell.high)
            lower[key] = (ends[0],) * 2 if low >= 0 else (ends[1],) * 2 if high <= 0 else ends
            upper[key] = (ends[1],) * 2 if low >= 0 else (ends[0],) * 2 if high <= 0 else ends
        return Range(self._with(place, tables, lower).low, self._with(place, tables, upper).high)

    def at(self, place: Key, tables: Mapping[str, PrintedTable], values: Mapping[Source, float]) -> float:
        """Return its value where the cells are these numbers."""
        return self._with(place, tables, {key: (value, value) for key, value in values.items()}).low

    def _with(
        self, place: Key, tables: Mapping[str, PrintedTable], ends: Mapping[Source, tuple[float, float]]
    ) -> Range:
        def take(source: Source) -> Range:
            low, high = ends[source]
            return constant(low) if low == high else variable(low, high, source)

        try:
            return _Evaluation(place, tables, take).number(self.tree)
        except (OverflowError, ZeroDivisionError, ValueError):
            raise Undefined("the numbers are too large or too small to compute with") from None


def _references(node: ast.AST) -> Iterator[ast.expr]:
    """Give every part of a formula that stands for cells of a table."""
    if isinstance(node, ast.Subscript) or (isinstance(node, ast.Name) and node.id not in _RESERVED):
        yield node
    else:
        for child in ast.iter_child_nodes(node):
            yield from _references(child)


@dataclass(frozen=True, slots=True)
class _Evaluation:
    """One pass through the tree of a formula, for one published cell."""

    place: Key
    tables: Mapping[str, PrintedTable]
    take: Callable[[Source], Range]

    def number(self, node: ast.expr) -> Range:
        found = self.value(node)
        assert isinstance(found, Range)  # noqa: S101 - the parser has seen to it
        return found

    def value(self, node: ast.expr) -> _Value:
        match node:
            case ast.Constant(value=int() | float() as number):
                return constant(float(number))
            case ast.Name(id=name):
                return constant(_CONSTANTS[name]) if name in _CONSTANTS else self.take(Source(name, *self.place))
            case ast.Subscript(value=ast.Name(id=name), slice=places):
                return self._cells(name, places)
            case ast.Call(func=ast.Name(id=name), args=arguments) if name in _MANY:
                return _MANY[name](self._several(arguments))
        return self._computed(node)

    def _computed(self, node: ast.expr) -> Range:
        match node:
            case ast.UnaryOp(op=operator, operand=operand):
                found = self.number(operand)
                return -found if isinstance(operator, ast.USub) else found
            case ast.BinOp(left=left, op=ast.Pow(), right=right):
                return _raised(self.number(left), self.number(right))
            case ast.BinOp(left=left, op=operator, right=right):
                return _BINARY[type(operator)](self.number(left), self.number(right))
            case ast.Call(func=ast.Name(id=name), args=[argument]):
                return _ONE[name](self.number(argument))
        raise AssertionError(ast.dump(node))  # pragma: no cover - the parser lets nothing else through

    def _several(self, arguments: list[ast.expr]) -> list[Range]:
        found: list[Range] = []
        for each in arguments:
            value = self.value(each)
            found += value if isinstance(value, list) else [value]
        if not found:
            raise Missing("a column without rows has neither sum nor mean")
        return found

    def _cells(self, name: str, places: ast.expr) -> _Value:
        table = self.tables[name]
        parts: list[ast.expr] = places.elts if isinstance(places, ast.Tuple) else [places]
        column, row = parts[0], parts[1] if len(parts) > 1 else None
        columns = _chosen(column, table.columns)
        rows = [self.place[0]] if row is None else _chosen(row, table.rows)
        if isinstance(column, ast.Slice) or isinstance(row, ast.Slice):
            keys = [(each, other) for each in rows for other in columns]
            return [self.take(Source(name, *key)) for key in keys if key in table.cells]
        return self.take(Source(name, rows[0], columns[0]))


def _raised(base: Range, exponent: Range) -> Range:
    if exponent.low == exponent.high and exponent.low.is_integer() and abs(exponent.low) <= _LARGEST_POWER:
        return base.power(int(exponent.low))
    return _ONE["exp"](_ONE["log"](base) * exponent)


def _chosen(node: ast.expr, names: tuple[str, ...]) -> list[str]:
    """Return the rows or columns that a part of a subscript names."""
    if not isinstance(node, ast.Slice):
        return [_label(node)]
    begin = 0 if node.lower is None else names.index(_label(node.lower))
    end = len(names) if node.upper is None else names.index(_label(node.upper)) + 1
    return list(names[begin:end])


def _label(node: ast.expr) -> str:
    return str(node.value) if isinstance(node, ast.Constant) else ""


def parse(text: str, tables: Mapping[str, PrintedTable]) -> Formula:
    """Return a formula.

    Args:
        text: as a person wrote it; see `Formula`.
        tables: by the names that it may use.

    Raises:
        FormulaError: it is no formula, or names what is not there.
    """
    if len(text) > _LONGEST:
        raise FormulaError(1, f"a formula has at most {_LONGEST} characters, found {len(text)}")
    flat = " ".join(text.split("\n"))
    bare = flat.lstrip()
    shift = len(flat) - len(bare)
    try:
        tree = ast.parse(bare, mode="eval").body
    except SyntaxError as error:
        raise FormulaError(shift + (error.offset or 1), "this is no formula") from None
    except (ValueError, RecursionError, MemoryError):
        raise FormulaError(1, "this is no formula: too deep, or with characters that cannot be shown") from None
    reader = _Reader(bare, shift, tables)
    if reader.check(tree):
        raise reader.error(tree, 'a whole column is no number: take its sum or mean, as in sum(a["white", :])')
    return Formula(text=text, tree=tree)


@dataclass(frozen=True, slots=True)
class _Reader:
    """Lets through what a formula may be made of, and nothing else."""

    text: str
    shift: int
    tables: Mapping[str, PrintedTable]

    def error(self, node: ast.expr, message: str, known: tuple[str, ...] = (), word: str = "") -> FormulaError:
        before = len(self.text.encode()[: node.col_offset].decode(errors="replace"))
        return FormulaError(self.shift + before + 1, message, known, word)

    def check(self, node: ast.expr) -> bool:
        """Return whether a part is a column of numbers rather than one."""
        match node:
            case ast.Constant(value=bool() | str() | bytes() | None):
                raise self.error(node, "a number or a table must stand here")
            case ast.Constant(value=int() | float() as number):
                self._number(node, number)
            case ast.Name(id=name):
                if name not in self.tables and name not in _CONSTANTS:
                    raise self.error(node, f"unknown name '{name}'", (*self.tables, *_CONSTANTS), name)
            case ast.Subscript(value=ast.Name(id=name) as table, slice=places):
                return self._places(table, name, places)
            case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
                self._single(operand)
            case ast.BinOp(left=left, op=ast.Add() | ast.Sub() | ast.Mult() | ast.Div() | ast.Pow(), right=right):
                self._single(left)
                self._single(right)
            case ast.BinOp(op=ast.BitXor()):
                raise self.error(node, "a power is written **, as in a**2")
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                self._call(node, name, arguments)
            case _:
                raise self.error(node, "a formula has numbers, tables, + - * / **, brackets and functions only")
        return False

    def _number(self, node: ast.expr, number: float) -> None:
        try:
            large = not math.isfinite(float(number))
        except OverflowError:
            large = True
        if large:
            raise self.error(node, "the number is too large")

    def _single(self, node: ast.expr) -> None:
        if self.check(node):
            raise self.error(node, 'a whole column is no number: take its sum or mean, as in sum(a["white", :])')

    def _call(self, node: ast.expr, name: str, arguments: list[ast.expr]) -> None:
        if name not in _FUNCTIONS:
            raise self.error(node, f"unknown function '{name}'", _FUNCTIONS, name)
        if not arguments or (name in _ONE and len(arguments) != 1):
            raise self.error(node, f"{name} takes {'one number' if name in _ONE else 'numbers or a column'}")
        for each in arguments:
            if self.check(each) and name in _ONE:
                raise self.error(each, f"{name} takes one number, not a whole column")

    def _places(self, table: ast.Name, name: str, places: ast.expr) -> bool:
        if name not in self.tables:
            raise self.error(table, f"unknown name '{name}'", tuple(self.tables), name)
        parts = places.elts if isinstance(places, ast.Tuple) else [places]
        if len(parts) not in {1, 2}:
            raise self.error(places, 'a cell is named by its column and row, as in a["white", "z"]')
        found = self.tables[name]
        for part, names, what in zip(parts, (found.columns, found.rows), ("column", "row"), strict=False):
            ends = [part.lower, part.upper] if isinstance(part, ast.Slice) else [part]
            if isinstance(part, ast.Slice) and part.step is not None:
                raise self.error(part.step, "a part of a column has a first and a last row only")
            for end in ends:
                if end is not None:
                    self._named(end, names, f"{found.name} has no {what}")
        return any(isinstance(part, ast.Slice) for part in parts)

    def _named(self, node: ast.expr, names: tuple[str, ...], lacks: str) -> None:
        if not isinstance(node, ast.Constant) or not isinstance(node.value, str | int):
            raise self.error(node, 'a row or column is named in quotes, as in a["white", "z"]')
        if _label(node) not in names:
            raise self.error(node, f"{lacks} '{_label(node)}'", names, _label(node))
