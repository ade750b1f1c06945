"""What looks like a case in a plan and would not run: nobody would miss it."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from hil.executive.setup.configuration import Configuration
from hil.model.errors import Finding

__all__ = ["lost_cases"]

_Function = ast.FunctionDef | ast.AsyncFunctionDef
_MARKER = "requirement"
_WHY = (
    "looks like a case, and pytest does not collect it: cases are functions test_* in a file test_*.py, in no class or"
    " in a class Test* without __init__; name otherwise what is none"
)


def lost_cases(items: Sequence[pytest.Item], configuration: Configuration) -> Iterator[Finding]:
    """Yield every function in the files of the plans that is a case by its name or its marker, and was not collected.

    Args:
        items: what was collected from the plans as a whole.
        configuration: names plans and workspace.
    """
    collected = {place for item in items for place in _places(item)}
    for path in sorted(path for plan in configuration.plans for path in plan.glob("*.py")):
        try:
            tree = ast.parse(path.read_bytes())
        except (SyntaxError, ValueError):  # importing it tells, if anybody does
            continue
        for name, node in _candidates(tree.body):
            if not {(path, name), (path, _first_line(node))} & collected:
                yield Finding(configuration.workspace.shown(path), node.lineno, node.col_offset + 1, f"'{name}' {_WHY}")


def _places(item: pytest.Item) -> Iterator[tuple[Path, str | int]]:
    """Yield where a case stands: its name in its file, and the first line of its code, which a base class may hold."""
    yield item.path, item.nodeid.partition("::")[2].partition("[")[0].replace("::", ".")
    code = getattr(inspect.unwrap(getattr(item, "function", item.runtest)), "__code__", None)
    if code is not None:
        yield Path(code.co_filename), code.co_firstlineno


def _candidates(body: Sequence[ast.stmt], within: str = "") -> Iterator[tuple[str, _Function]]:
    """Yield what a person takes for a case, with its qualified name, also below conditions."""
    for node in body:
        if isinstance(node, _Function):
            marks = {_last_name(each) for each in node.decorator_list}
            if _MARKER in marks or (node.name.startswith("test") and "fixture" not in marks):
                yield f"{within}{node.name}", node
        elif isinstance(node, ast.ClassDef):
            yield from _candidates(node.body, f"{within}{node.name}.")
        else:
            for part in ("body", "orelse", "finalbody"):
                yield from _candidates(getattr(node, part, ()), within)


def _first_line(node: _Function) -> int:
    return min(node.lineno, *(each.lineno for each in node.decorator_list), node.lineno)


def _last_name(decorator: ast.expr) -> str:
    function = decorator.func if isinstance(decorator, ast.Call) else decorator
    return getattr(function, "attr", getattr(function, "id", ""))
