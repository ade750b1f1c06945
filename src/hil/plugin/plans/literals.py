"""Literals in a case's code, found before it runs: its checks, and the names that it takes from fixtures."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache

__all__ = ["WrittenCheck", "WrittenName", "given_to", "returned_lines", "written_checks", "written_names"]

_NAMES = frozenset({"check", "check.require"})


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenCheck:
    """A call of `check` whose requirement and parameter are literal texts.

    Attributes:
        requirement: its first argument.
        parameter: its second argument.
        of: its `of` if that is a literal text, too; otherwise None.
        line: line of the file, from 1.
        column: column of the line, from 1.
    """

    requirement: str
    parameter: str
    of: str | None
    line: int
    column: int


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenName:
    """An attribute of one of a function's arguments, such as `supply.coil.voltage`.

    Attributes:
        path: the argument and the attributes taken from it, in order.
        line: line of the file, from 1.
        column: column of the line, from 1.
    """

    path: tuple[str, ...]
    line: int
    column: int


@lru_cache(maxsize=256)
def written_checks(function: Callable[..., object]) -> tuple[WrittenCheck, ...]:
    """Return the literal checks in a case's own code; those in code that it calls show when it runs.

    The code is read once: a parametrised case is one function.
    """
    return tuple(_checks(function))


@lru_cache(maxsize=256)
def written_names(function: Callable[..., object]) -> tuple[WrittenName, ...]:
    """Return the attributes that a function takes from its arguments, the longest paths only.

    An argument that the function rebinds is left out: it may then be something else.
    """
    return tuple(_taken(function))


def _checks(function: Callable[..., object]) -> Iterator[WrittenCheck]:
    for node, line, column in _nodes(function):
        if isinstance(node, ast.Call) and ast.unparse(node.func) in _NAMES:
            texts = [_text(argument) for argument in node.args[:2]]
            if len(texts) == 2 and texts[0] is not None and texts[1] is not None:
                of = next((_text(keyword.value) for keyword in node.keywords if keyword.arg == "of"), None)
                yield WrittenCheck(requirement=texts[0], parameter=texts[1], of=of, line=line, column=column)


def _taken(function: Callable[..., object]) -> Iterator[WrittenName]:
    nodes = list(_nodes(function))
    stored = {node.id for node, _, _ in nodes if isinstance(node, ast.Name) and not isinstance(node.ctx, ast.Load)}
    arguments = {node.arg for node, _, _ in nodes if isinstance(node, ast.arg)} - stored
    inner = {id(node.value) for node, _, _ in nodes if isinstance(node, ast.Attribute)}
    for node, line, column in nodes:
        if isinstance(node, ast.Attribute) and id(node) not in inner:
            path = tuple(ast.unparse(node).split(".")) if _is_path(node) else ()
            if path and path[0] in arguments:
                yield WrittenName(path=path, line=line, column=column)


@lru_cache(maxsize=256)
def returned_lines(function: Callable[..., object]) -> tuple[int, ...]:
    """Return the lines of the file in which a function itself, not one defined within it, returns something."""
    return tuple(
        first + each.lineno - 1
        for node, first, _ in _nodes(function)
        if isinstance(node, ast.Module)
        for each in _returns(node.body[0])
    )


def _returns(node: ast.AST) -> Iterator[ast.Return]:
    for each in ast.iter_child_nodes(node):
        if isinstance(each, ast.Return) and each.value is not None and ast.unparse(each.value) != "None":
            yield each
        elif not isinstance(each, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda | ast.ClassDef):
            yield from _returns(each)


@lru_cache(maxsize=64)
def given_to(source: bytes, argument: str) -> frozenset[str]:
    """Return the functions that code calls with an argument of exactly this name; none if it cannot be parsed."""
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError):
        return frozenset()
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)]
    return frozenset(
        ast.unparse(call.func)
        for call in calls
        for value in (*call.args, *(keyword.value for keyword in call.keywords))
        if isinstance(value, ast.Name) and value.id == argument
    )


def _is_path(node: ast.expr) -> bool:
    while isinstance(node, ast.Attribute):
        node = node.value
    return isinstance(node, ast.Name)


def _nodes(function: Callable[..., object]) -> Iterator[tuple[ast.AST, int, int]]:
    """Yield every node of a function's source with its line and column in the file; none if it has no source."""
    try:
        lines, start = inspect.getsourcelines(function)
    except (OSError, TypeError):
        return
    source = textwrap.dedent("".join(lines))
    indent = len(lines[0]) - len(lines[0].lstrip())
    try:
        tree = ast.parse(source)
    except SyntaxError:  # a text in the first column prevents dedenting an indented function
        return
    for node in ast.walk(tree):
        yield node, start + getattr(node, "lineno", 1) - 1, getattr(node, "col_offset", 0) + indent + 1


def _text(node: ast.expr) -> str | None:
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else None
