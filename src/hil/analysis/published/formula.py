"""Formulas of tables: parsed by a grammar of their own, never executed as code."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

from hil.analysis.published.printed import Key, Printed, PrintedTable
from hil.analysis.published.ranges import Range, Undefined, constant, variable

__all__ = ["Formula", "FormulaError", "Missing", "Source", "parse"]

_LONGEST = 500
_LARGEST_POWER = 100
_CONSTANTS = {"pi": math.pi}


class FormulaError(ValueError):
    """A formula that cannot be parsed.

    Args:
        column: position of the error, counted from 1.
        message: description of the error.
        known: the valid names at that position; empty if the error is not about a name.
        word: the name found there.
    """

    def __init__(self, column: int, message: str, known: tuple[str, ...] = (), word: str = "") -> None:
        super().__init__(message)
        self.column, self.message, self.known, self.word = column, message, known, word


class Missing(LookupError):
    """A formula refers to a blank or nonexistent cell."""


class Source(NamedTuple):
    """A source cell of a formula: table name in the formula, row and column."""

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


def _raised(base: Range, exponent: Range) -> Range:
    if exponent.low == exponent.high and exponent.low.is_integer() and abs(exponent.low) <= _LARGEST_POWER:
        return base.power(int(exponent.low))
    return _ONE["exp"](_ONE["log"](base) * exponent)


_BINARY: Mapping[type[ast.operator], Callable[[Range, Range], Range]] = {
    ast.Add: lambda one, other: one + other,
    ast.Sub: lambda one, other: one - other,
    ast.Mult: lambda one, other: one * other,
    ast.Div: lambda one, other: one / other,
    ast.Pow: _raised,
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


@dataclass(frozen=True, slots=True)
class _Scope:
    """Context of an evaluation: the published cell, the tables by name, and the lookup of source cells."""

    place: Key
    tables: Mapping[str, PrintedTable]
    take: Callable[[Source], Range]


_Number: TypeAlias = Callable[[_Scope], Range]
_Numbers: TypeAlias = Callable[[_Scope], list[Range]]


@dataclass(frozen=True, slots=True)
class Formula:
    """A formula of one cell.

    `a` is the cell of table a in the row and column of the published cell; `a["white"]` the one of another column,
    `a["white", "z"]` that of another column and row. `a["white", :]` is a whole column, `a[:, "z"]` a row, and
    `a["white", "1":"5"]` part of a column. Besides + - * / ** and brackets there are abs, sqrt, log, log10, exp and pi,
    and sum, mean, min, max and count of several numbers or of a column.

    Attributes:
        text: the formula as written.
        compute: evaluates it.
        references: collects its source cells.
    """

    text: str
    compute: _Number = field(compare=False, repr=False)
    references: tuple[_Numbers, ...] = field(compare=False, repr=False)

    def sources(self, place: Key, tables: Mapping[str, PrintedTable]) -> dict[Source, Printed]:
        """Return its printed source cells for a row and column.

        Raises:
            Missing: a cell is blank or does not exist.
        """
        used: dict[Source, Printed] = {}

        def take(source: Source) -> Range:
            cell = tables[source.table].cells.get((source.row, source.column))
            if cell is None:
                raise Missing(f"{tables[source.table].name} has no number in row {source.row}, column {source.column}")
            used[source] = cell
            return constant(1.0)

        for reference in self.references:
            reference(_Scope(place, tables, take))
        return used

    def over(self, place: Key, tables: Mapping[str, PrintedTable], cells: Mapping[Source, Printed]) -> Range:
        """Return the range of its values with each cell anywhere within its rounding.

        The ends are exact where the formula is monotone in each cell, as nearly all are over so small a range;
        otherwise they are outer bounds.

        Args:
            place: row and column of the published cell.
            tables: by the names in the formula.
            cells: of all sources.

        Raises:
            Undefined: it may have no value, for example where a divisor may be zero.
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
        """Return its value for these numbers in the cells."""
        return self._with(place, tables, {key: (value, value) for key, value in values.items()}).low

    def _with(
        self, place: Key, tables: Mapping[str, PrintedTable], ends: Mapping[Source, tuple[float, float]]
    ) -> Range:
        def take(source: Source) -> Range:
            low, high = ends[source]
            return constant(low) if low == high else variable(low, high, source)

        try:
            return self.compute(_Scope(place, tables, take))
        except (OverflowError, ZeroDivisionError, ValueError):
            raise Undefined("the numbers are too large or too small to compute with") from None


def _chosen(node: ast.expr, names: tuple[str, ...]) -> list[str]:
    """Return the rows or columns selected by a part of a subscript."""
    if not isinstance(node, ast.Slice):
        return [_label(node)]
    begin = 0 if node.lower is None else names.index(_label(node.lower))
    end = len(names) if node.upper is None else names.index(_label(node.upper)) + 1
    return list(names[begin:end])


def _label(node: ast.expr) -> str:
    return str(node.value) if isinstance(node, ast.Constant) else ""


def parse(text: str, tables: Mapping[str, PrintedTable]) -> Formula:
    """Parse a formula.

    Args:
        text: the formula as written; see `Formula`.
        tables: tables by the names that it may use.

    Raises:
        FormulaError: it is not a formula, or refers to an unknown name.
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
    compute = reader.number(tree)
    return Formula(text=text, compute=compute, references=tuple(reader.references))


@dataclass(frozen=True, slots=True)
class _Reader:
    """Compiles the syntax tree of a formula to closures; a disallowed element is an error with its position."""

    text: str
    shift: int
    tables: Mapping[str, PrintedTable]
    references: list[_Numbers] = field(default_factory=list)

    def error(self, node: ast.expr, message: str, known: tuple[str, ...] = (), word: str = "") -> FormulaError:
        before = len(self.text.encode()[: node.col_offset].decode(errors="replace"))
        return FormulaError(self.shift + before + 1, message, known, word)

    def number(self, node: ast.expr) -> _Number:
        """Compile an expression for one number."""
        match node:
            case ast.Constant(value=number):
                return self._constant(node, number)
            case ast.Name(id=name):
                return self._name(node, name)
            case ast.Subscript(value=ast.Name() as table, slice=places):
                cells = self._cells(table, places)
                if _is_column(node):
                    message = 'a whole column is no number: take its sum or mean, as in sum(a["white", :])'
                    raise self.error(node, message)
                return self._one(cells)
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                return self._call(node, name, arguments)
        return self._operation(node)

    def _operation(self, node: ast.expr) -> _Number:
        match node:
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                found = self.number(operand)
                return lambda scope: -found(scope)
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self.number(operand)
            case ast.BinOp(left=left, op=operator, right=right) if type(operator) in _BINARY:
                binary, one, other = _BINARY[type(operator)], self.number(left), self.number(right)
                return lambda scope: binary(one(scope), other(scope))
            case ast.BinOp(op=ast.BitXor()):
                raise self.error(node, "a power is written **, as in a**2")
        raise self.error(node, "a formula has numbers, tables, + - * / **, brackets and functions only")

    def _constant(self, node: ast.expr, number: object) -> _Number:
        if isinstance(number, bool) or not isinstance(number, int | float):
            raise self.error(node, "a number or a table must stand here")
        try:
            value = constant(float(number))
        except (OverflowError, Undefined):
            raise self.error(node, "the number is too large") from None
        return lambda _: value

    def _name(self, node: ast.expr, name: str) -> _Number:
        if name in _CONSTANTS:
            value = constant(_CONSTANTS[name])
            return lambda _: value
        if name not in self.tables:
            raise self.error(node, f"unknown name '{name}'", (*self.tables, *_CONSTANTS), name)
        return self._one(self._refer(lambda scope: [scope.take(Source(name, *scope.place))]))

    def _one(self, numbers: _Numbers) -> _Number:
        return lambda scope: numbers(scope)[0]

    def _refer(self, numbers: _Numbers) -> _Numbers:
        self.references.append(numbers)
        return numbers

    def _call(self, node: ast.expr, name: str, arguments: list[ast.expr]) -> _Number:
        if name not in _FUNCTIONS:
            raise self.error(node, f"unknown function '{name}'", _FUNCTIONS, name)
        if not arguments or (name in _ONE and len(arguments) != 1):
            raise self.error(node, f"{name} takes {'one number' if name in _ONE else 'numbers or a column'}")
        parts = [self._several(each) for each in arguments]
        if name in _MANY:
            many = _MANY[name]
            return lambda scope: many(_present([number for part in parts for number in part(scope)]))
        if _is_column(arguments[0]):
            raise self.error(arguments[0], f"{name} takes one number, not a whole column")
        function, number = _ONE[name], self._one(parts[0])
        return lambda scope: function(number(scope))

    def _several(self, node: ast.expr) -> _Numbers:
        """Compile an expression that may be a column of numbers."""
        if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name):
            return self._cells(node.value, node.slice)
        number = self.number(node)
        return lambda scope: [number(scope)]

    def _cells(self, table: ast.Name, places: ast.expr) -> _Numbers:
        """Compile a subscript: one cell, or the filled cells of a row or column."""
        name = table.id
        if name not in self.tables:
            raise self.error(table, f"unknown name '{name}'", tuple(self.tables), name)
        parts: list[ast.expr] = places.elts if isinstance(places, ast.Tuple) else [places]
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
        column, row, some = parts[0], parts[1] if len(parts) > 1 else None, any(map(_is_slice, parts))

        def take(scope: _Scope) -> list[Range]:
            table = scope.tables[name]
            rows = [scope.place[0]] if row is None else _chosen(row, table.rows)
            keys = [(each, other) for each in rows for other in _chosen(column, table.columns)]
            return [scope.take(Source(name, *key)) for key in keys if not some or key in table.cells]

        return self._refer(take)

    def _named(self, node: ast.expr, names: tuple[str, ...], lacks: str) -> None:
        if not isinstance(node, ast.Constant) or not isinstance(node.value, str | int):
            raise self.error(node, 'a row or column is named in quotes, as in a["white", "z"]')
        if _label(node) not in names:
            raise self.error(node, f"{lacks} '{_label(node)}'", names, _label(node))


def _present(values: list[Range]) -> list[Range]:
    if not values:
        raise Missing("a column without rows has neither sum nor mean")
    return values


def _is_slice(node: ast.expr) -> bool:
    return isinstance(node, ast.Slice)


def _is_column(node: ast.expr) -> bool:
    """Return whether an expression is a column of numbers rather than one."""
    if not isinstance(node, ast.Subscript):
        return False
    return any(map(_is_slice, node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]))
