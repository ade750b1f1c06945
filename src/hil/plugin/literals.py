"""Checks that are written out in a case's code, found before it runs."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable, Iterator
from dataclasses import dataclass

__all__ = ["WrittenCheck", "written_checks"]

_NAMES = frozenset({"check", "check.require"})


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenCheck:
    """A call of `check` whose requirement and parameter are literal texts.

    Attributes:
        requirement: its first argument.
        parameter: its second argument.
        of: its `of` where that is a literal text, too; else None.
        line: line of the file, from 1.
        column: column of the line, from 1.
    """

    requirement: str
    parameter: str
    of: str | None
    line: int
    column: int


def written_checks(function: Callable[..., object]) -> Iterator[WrittenCheck]:
    """Yield the literal checks of a case's own code; what it calls elsewhere shows when it runs."""
    try:
        lines, start = inspect.getsourcelines(function)
    except (OSError, TypeError):
        return
    source = textwrap.dedent("".join(lines))
    indent = len(lines[0]) - len(lines[0].lstrip())
    try:
        tree = ast.parse(source)
    except SyntaxError:  # a text in the first column keeps an indented function from being taken out
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and ast.unparse(node.func) in _NAMES:
            texts = [_text(argument) for argument in node.args[:2]]
            if len(texts) == 2 and texts[0] is not None and texts[1] is not None:
                of = next((_text(keyword.value) for keyword in node.keywords if keyword.arg == "of"), None)
                yield WrittenCheck(
                    requirement=texts[0],
                    parameter=texts[1],
                    of=of,
                    line=start + node.lineno - 1,
                    column=node.col_offset + indent + 1,
                )


def _text(node: ast.expr) -> str | None:
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else None
