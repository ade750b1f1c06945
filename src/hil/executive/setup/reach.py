"""Static check of what a workspace's code reaches for beyond what cases are given."""

from __future__ import annotations

import ast
import math
import operator
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import lru_cache

__all__ = ["beyond", "numbers_in", "parsed", "sleeps"]

_FOR_PLANS = ("hil.analysis", "hil.logs", "hil.model.errors", "hil.model.figure", "hil.plan")
"""What cases and fixtures may import from the product; the rest measures, judges and records them."""

_MODULES = frozenset(
    {
        *("_pytest", "freezegun", "mock", "time_machine", "unittest.mock"),
        *("atexit", "builtins", "code", "codeop", "ctypes", "gc", "importlib", "runpy"),
    }
)
"""Modules by which code can change what it was not given, or run what its source does not show."""

_NAMES = frozenset({"__builtins__", "__import__", "compile", "delattr", "eval", "exec", "globals", "setattr", "vars"})
_ATTRIBUTES = frozenset({"MonkeyPatch", "_getframe", "addaudithook", "meta_path", "modules", "path_hooks"})
_OF_OBJECTS = frozenset({"__init__", "__name__", "__doc__", "__file__", "__post_init__", "__version__"})
_FIXTURES = frozenset({"mocker", "monkeypatch"})
_TRACING = frozenset({"provenance", "stamped", "traced", "with_provenance", "within_library"})


@lru_cache(maxsize=64)
def parsed(source: bytes) -> ast.Module:
    """Return the syntax tree of a file, which several checks walk.

    Raises:
        SyntaxError: if it is not Python.
        ValueError: if it holds NUL bytes.
    """
    return ast.parse(source)


@lru_cache(maxsize=64)
def _nodes(source: bytes) -> tuple[ast.AST, ...]:
    return tuple(ast.walk(parsed(source)))


@lru_cache(maxsize=64)
def sleeps(source: bytes, shown: str) -> tuple[str, ...]:
    """Return every call of `time.sleep` in the source of a module, a sentence each, by line.

    Args:
        source: of the module; nothing is found if it is not Python.
        shown: its path, as people see it.
    """
    try:
        nodes = _nodes(source)
    except (SyntaxError, ValueError):
        return ()
    if not (names := {name for node in nodes for name in _names_of_sleep(node)}):
        return ()
    calls = (node for node in nodes if isinstance(node, ast.Call))
    lines = sorted({call.lineno for call in calls if ast.unparse(call.func) in names})
    return tuple(f"{shown}:{line} calls time.sleep, {_SLEPT}" for line in lines)


_SLEPT = "in which a simulated bench stands still and no limit is watched: use clock.sleep"


def _names_of_sleep(node: ast.AST) -> Iterator[str]:
    """Yield the names under which an import binds `time.sleep`."""
    if isinstance(node, ast.Import):
        yield from (f"{alias.asname or alias.name}.sleep" for alias in node.names if alias.name == "time")
    elif isinstance(node, ast.ImportFrom) and node.module == "time":
        yield from (alias.asname or alias.name for alias in node.names if alias.name == "sleep")


@lru_cache(maxsize=64)
def beyond(source: bytes, shown: str) -> tuple[str, ...]:
    """Return what the source of a module reaches for, a sentence each, by line; nothing if it is not Python.

    A case that does so may be honest. But its source no longer shows plainly what was measured, so that the worth of a
    value cannot be judged from the package.

    Args:
        source: of the module.
        shown: its path, as people see it.
    """
    try:
        nodes = _nodes(source)
    except (SyntaxError, ValueError):
        return ()
    imported = _imported(nodes)
    told = (each for node in nodes for each in (*_of_node(node), *_replaced_by(node, imported)))
    found = sorted(set(told))
    return tuple(f"{shown}:{line} {what}" for line, what in found)


def _of_node(node: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield each line with what is reached for there."""
    if isinstance(node, ast.Import):
        yield from ((node.lineno, f"imports {each.name}") for each in node.names if not _allowed(each.name))
    elif isinstance(node, ast.ImportFrom) and not node.level:
        names = [f"{node.module}.{each.name}" for each in node.names]
        yield from ((node.lineno, f"imports {name}") for name in names if not _allowed(name) or _traces(name))
    elif isinstance(node, ast.Name) and node.id in _NAMES:
        yield node.lineno, f"uses {node.id}"
    elif isinstance(node, ast.arg) and node.arg in _FIXTURES:
        yield node.lineno, f"uses {node.arg}"
    elif isinstance(node, ast.Attribute) and _hidden(node):
        yield node.lineno, f"uses .{node.attr}"
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "getattr":
        given = node.args[1].value if len(node.args) > 1 and isinstance(node.args[1], ast.Constant) else ""
        if isinstance(given, str) and (given.startswith("_") or given in _ATTRIBUTES | _TRACING):
            yield node.lineno, f"uses .{given}"


def _imported(nodes: tuple[ast.AST, ...]) -> frozenset[str]:
    """Return the names of modules and their contents: as bound by imports, and as rebound later."""
    found = {
        alias.asname or alias.name.partition(".")[0]
        for node in nodes
        if isinstance(node, ast.Import | ast.ImportFrom)
        for alias in node.names
    }
    bound = [
        (target.id, node.value)
        for node in nodes
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Name | ast.Attribute)
        for target in node.targets
        if isinstance(target, ast.Name)
    ]
    for name, value in bound:
        if _root(value) in found:
            found.add(name)
    return frozenset(found)


def _root(node: ast.expr) -> str:
    """Return the name at the beginning of a chain of attributes, empty if it begins with something else."""
    while isinstance(node, ast.Attribute):
        node = node.value
    return node.id if isinstance(node, ast.Name) else ""


def _replaced_by(node: ast.AST, imported: frozenset[str]) -> Iterator[tuple[int, str]]:
    """Yield each line with what is replaced there in a module, or in a class of one."""
    if not isinstance(node, ast.Attribute) or isinstance(node.ctx, ast.Load):
        return
    given = node.value
    by_name = isinstance(given, ast.Call) and isinstance(given.func, ast.Name) and given.func.id == "getattr"
    if by_name or _root(node) in imported:
        yield node.lineno, f"replaces {ast.unparse(node)}"


def _allowed(name: str) -> bool:
    """Return whether a case may import this module, or this name from a module."""
    parts = name.split(".")
    heads = {".".join(parts[:length]) for length in range(1, len(parts) + 1)}
    if parts[0] == "hil":
        return not heads.isdisjoint(_FOR_PLANS)
    return heads.isdisjoint(_MODULES)


def _traces(name: str) -> bool:
    """Return whether this gives a value its provenance, from whatever module of the product it is imported."""
    return name.startswith("hil.") and (name.startswith("hil.analysis.tracing.") or name.rpartition(".")[2] in _TRACING)


def _hidden(node: ast.Attribute) -> bool:
    """Return whether an attribute is private to its object."""
    if node.attr in _ATTRIBUTES:
        return isinstance(node.value, ast.Name) and node.value.id in {"sys", "pytest"}
    if node.attr in _TRACING:
        return True
    own = isinstance(node.value, ast.Name) and node.value.id in {"self", "cls"}
    return node.attr.startswith("_") and not own and node.attr not in _OF_OBJECTS


_CONSTANTS = {"pi": math.pi, "tau": math.tau, "e": math.e}
_OPERATIONS: Mapping[type, Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: math.pow,
}


@lru_cache(maxsize=64)
def numbers_in(source: bytes) -> frozenset[float]:
    """Return the magnitude of every number in a module's source, including `1 / 3.6`, `np.pi / 180` or a name.

    A name counts if the module sets it to such a number; a source that is not Python has none.
    """
    try:
        tree = parsed(source)
    except (SyntaxError, ValueError):
        return frozenset()
    names: dict[str, float] = {}
    for node in tree.body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            value = _folded(node.value, names)
            if value is not None:
                names[node.targets[0].id] = value
    found = (_folded(node, names) for node in _nodes(source) if isinstance(node, ast.expr))
    return frozenset(abs(value) for value in found if value is not None)


def _folded(node: ast.expr, names: Mapping[str, float]) -> float | None:
    """Return the value of an expression of numbers only, None for any other."""
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return float(node.value) if abs(node.value) < sys.float_info.max else None
    if isinstance(node, ast.Name):
        return names.get(node.id)
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        return _CONSTANTS.get(node.attr)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        value = _folded(node.operand, names)
        return None if value is None else -value
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATIONS:
        left, right = _folded(node.left, names), _folded(node.right, names)
        if left is not None and right is not None:
            with suppress(ArithmeticError, ValueError):
                return _OPERATIONS[type(node.op)](left, right)
    return None
