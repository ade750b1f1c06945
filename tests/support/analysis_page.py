"""The reference page of `hil.analysis`, made from the code: `python tests/support/analysis_page.py` writes it again."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "src" / "hil" / "analysis"
PAGE = ROOT / "docs" / "reference" / "analysis.md"
INTRODUCTION = """# Analyses

Every public function of `hil.analysis`, with its model, units and sources. They know arrays, numbers and unit strings,
but nothing about pytest, benches or files, so they work in a notebook as well as in a case. A `Figure` is a value with
unit, uncertainty and degrees of freedom: see [case interface](case-api.md#figure).

This page is generated from the code by `python tests/support/analysis_page.py`, and a test compares the two.
"""
_SECTIONS = {"Args:": "Arguments", "Attributes:": "Attributes", "Returns:": "Returns", "Raises:": "Errors"}


def page(package: Path = PACKAGE) -> str:
    """Return the whole page."""
    parts = [INTRODUCTION]
    for path in sorted(package.rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        names = public(tree)
        if names:
            parts += [f"## `{module_of(path)}`\n", f"{prose(ast.get_docstring(tree) or '')}\n"]
            parts += [entry(node) for node in tree.body if getattr(node, "name", "") in names]
    return "\n".join(parts)


def module_of(path: Path) -> str:
    """Return the dotted name of a module."""
    return ".".join(path.relative_to(ROOT / "src").with_suffix("").parts)


def public(tree: ast.Module) -> set[str]:
    """Return the names that a module publishes."""
    for node in tree.body:
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__":
            return set(ast.literal_eval(node.value))
    return set()


def entry(node: ast.stmt) -> str:
    """Return the section of one function or class."""
    if isinstance(node, ast.FunctionDef):
        return f"### `{node.name}({arguments(node)})`\n\n{told(node)}\n"
    if isinstance(node, ast.ClassDef):
        inner = [f"- `{item.name}({arguments(item)})`: {first(item)}" for item in methods(node)]
        return f"### `{node.name}`\n\n{told(node)}\n" + ("\n" + "\n".join(inner) + "\n" if inner else "")
    return ""


def methods(node: ast.ClassDef) -> Iterator[ast.FunctionDef]:
    """Give the public methods and properties of a class."""
    yield from (item for item in node.body if isinstance(item, ast.FunctionDef) and not item.name.startswith("_"))


def arguments(node: ast.FunctionDef) -> str:
    """Return the arguments of a function without their types, which its section tells."""
    bare = ast.parse(f"def f({ast.unparse(node.args)}): ...").body[0].args
    for item in (*bare.posonlyargs, *bare.args, *bare.kwonlyargs):
        item.annotation = None
    return ast.unparse(bare).removeprefix("self, ").removeprefix("self")


def first(node: ast.FunctionDef) -> str:
    """Return the first paragraph of a docstring on one line."""
    return " ".join((ast.get_docstring(node) or "").split("\n\n")[0].split())


def told(node: ast.FunctionDef | ast.ClassDef) -> str:
    """Return a docstring as Markdown: prose as it is, and its named parts as lists."""
    lines = []
    for block in inspect.cleandoc(ast.get_docstring(node) or "").split("\n\n"):
        head, _, body = block.partition("\n")
        lines.append(listed(_SECTIONS[head], body) if head in _SECTIONS else prose(block))
    return "\n\n".join(lines)


def prose(text: str) -> str:
    """Return text with what Markdown would take for a mark escaped, outside of code."""
    parts = text.split("`")
    return "`".join(part if place % 2 else re.sub(r"([*_<])", r"\\\1", part) for place, part in enumerate(parts))


def listed(title: str, body: str) -> str:
    """Return the named parts of a docstring as a list."""
    items = re.split(r"\n(?=\S)", inspect.cleandoc(body))
    rows = [" ".join(item.split()) for item in items]
    named = [re.sub(r"^(\w+):", r"`\1`:", row) for row in rows]
    return f"{title}:\n\n" + "\n".join(f"- {prose(row)}" for row in named)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
