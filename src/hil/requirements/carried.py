"""Which cases carry which requirements, read from the sources of the plans; nothing is imported or run."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from hil.documents.findings import shown

__all__ = ["CarryingCase", "carrying_cases"]

_MARKER = "requirement"
_MARKS = "pytestmark"
_DEEPEST = 4
"""How many aliased names are followed."""
_Function = ast.FunctionDef | ast.AsyncFunctionDef
_Literals = dict[str, ast.expr]


@dataclass(frozen=True, slots=True, kw_only=True)
class CarryingCase:
    """One case as its plan has it, without its parameters.

    Attributes:
        case: its id without the part in brackets.
        place: file and line.
        requirements: the ids in its markers, as far as they are written out.
        marked: whether it has a marker at all; one may compute its ids.
    """

    case: str
    place: str
    requirements: tuple[str, ...]
    marked: bool


def carrying_cases(root: Path, plans: Iterable[Path]) -> tuple[CarryingCase, ...]:
    """Return the cases of plans, in the order of their files.

    A file that Python cannot read has no cases: it cannot be collected either.

    Args:
        root: the workspace, which ids begin at.
        plans: the folders of the plans.
    """
    found: list[CarryingCase] = []
    for file in (file for plan in plans for file in sorted(plan.glob("test_*.py"))):
        try:
            tree = ast.parse(file.read_bytes() if file.is_file() else b"")
        except (OSError, SyntaxError, ValueError, RecursionError, MemoryError):
            continue
        found += _cases(tree.body, shown(file, root))
    return tuple(found)


def _cases(body: Sequence[ast.stmt], file: str) -> Iterator[CarryingCase]:
    literals = {
        target.id: each.value
        for each in body
        if isinstance(each, ast.Assign)
        for target in each.targets
        if isinstance(target, ast.Name)
    }
    yield from _within(body, f"{file}::", file, literals, _inherited(body))


def _within(
    body: Sequence[ast.stmt], prefix: str, file: str, literals: _Literals, above: Sequence[ast.expr]
) -> Iterator[CarryingCase]:
    for node in body:
        if isinstance(node, _Function) and node.name.startswith("test"):
            marks = tuple(_marks((*above, *node.decorator_list)))
            ids = (name for mark in marks for argument in mark.args for name in _texts(argument, literals))
            yield CarryingCase(
                case=f"{prefix}{node.name}",
                place=f"{file}:{node.lineno}",
                requirements=tuple(dict.fromkeys(ids)),
                marked=bool(marks),
            )
        elif isinstance(node, ast.ClassDef) and node.name.startswith("Test"):
            inherited = (*above, *node.decorator_list, *_inherited(node.body))
            yield from _within(node.body, f"{prefix}{node.name}::", file, literals, inherited)


def _inherited(body: Sequence[ast.stmt]) -> tuple[ast.expr, ...]:
    """Return the marks that a module or class gives to all of its cases."""
    return tuple(
        each.value
        for each in body
        if isinstance(each, ast.Assign) and any(getattr(target, "id", "") == _MARKS for target in each.targets)
    )


def _marks(places: Iterable[ast.expr]) -> Iterator[ast.Call]:
    """Give every use of the marker, also in the parameters of a case."""
    for place in places:
        for node in ast.walk(place):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == _MARKER:
                yield node


def _texts(node: ast.expr, literals: _Literals, depth: int = 0) -> Iterator[str]:
    """Give the texts that an argument writes out, takes from a name of its module, or makes of such texts."""
    match node:
        case ast.Constant(value=str(text)):
            yield text
        case ast.Starred(value=value) | ast.FormattedValue(value=value, conversion=-1, format_spec=None):
            yield from _texts(value, literals, depth)
        case ast.Tuple(elts=several) | ast.List(elts=several) | ast.Dict(values=several):
            for each in several:
                yield from _texts(each, literals, depth)
        case ast.Name(id=name) | ast.Call(func=ast.Attribute(value=ast.Name(id=name), attr="values"), args=[]):
            if name in literals and depth < _DEEPEST:
                yield from _texts(literals[name], literals, depth + 1)
        case ast.JoinedStr(values=several):
            parts = [tuple(_texts(each, literals, depth)) for each in several]
            if all(len(part) == 1 for part in parts):
                yield "".join(text for (text,) in parts)
        case (ast.GeneratorExp() | ast.ListComp()) as made:
            yield from _made(made, literals, depth)


def _made(node: ast.GeneratorExp | ast.ListComp, literals: _Literals, depth: int) -> Iterator[str]:
    """Give the texts of a comprehension over one name, such as `f"LOAD-{n}" for n in ("010", "020")`."""
    match node.generators:
        case [ast.comprehension(target=ast.Name(id=name), iter=several, ifs=[])]:
            for text in _texts(several, literals, depth):
                yield from _texts(node.elt, {**literals, name: ast.Constant(text)}, depth)
