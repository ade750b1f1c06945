"""Walks over the whole package that keep its conventions true."""

from __future__ import annotations

import ast
from importlib.metadata import entry_points
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "src" / "hil"
LONGEST_MODULE = 400
LONGEST_FUNCTION = 50
NAMES_THAT_SAY_NOTHING = {"common", "helpers", "misc", "stuff", "tools", "utils"}


@pytest.fixture(scope="module")
def modules():
    """Every module of the package by its path in it: its text and its syntax tree."""
    texts = {str(path.relative_to(SOURCE)): path.read_text(encoding="utf-8") for path in sorted(SOURCE.rglob("*.py"))}
    assert len(texts) > 100, "the walk has lost its way"
    return {name: (text, ast.parse(text)) for name, text in texts.items()}


@pytest.fixture(scope="module")
def nodes(modules):
    """The functions and calls of every module by its path in the package."""
    kinds = (ast.Call, ast.FunctionDef)
    return {name: [node for node in ast.walk(tree) if isinstance(node, kinds)] for name, (_, tree) in modules.items()}


def test_every_module_begins_with_one_plain_sentence(modules):
    """The first docstring line tells what is in the module, and ends like a sentence."""
    first = {name: (ast.get_docstring(tree) or "").partition("\n")[0] for name, (_, tree) in modules.items()}
    assert {name: line for name, line in first.items() if not line.endswith((".", "?"))} == {}


def test_no_module_has_a_name_that_says_nothing(modules):
    """What would land in `utils` has a name of its own."""
    assert [name for name in modules if Path(name).stem in NAMES_THAT_SAY_NOTHING] == []


def test_public_names_are_listed_and_sorted(modules):
    """A module with public names lists them once, and each exists; ruff keeps them sorted."""
    wrong = {name: problem for name, (_, tree) in modules.items() if (problem := of_public_names(tree))}
    assert wrong == {}


def of_public_names(tree: ast.Module) -> str:
    """Return what is wrong with a module's `__all__`, empty where nothing is."""
    listed = [
        ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and is_named(node.targets[0], "__all__")
    ]
    defined = {
        node.name
        for node in tree.body
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_")
    }
    if not defined:
        return ""
    if len(listed) != 1:
        return f"{len(listed)} times __all__"
    if len(listed[0]) != len(set(listed[0])):
        return "a name twice"
    unknown = {name for name in listed[0] if not name.isupper()} - defined - assigned(tree)
    return f"not there: {', '.join(sorted(unknown))}" if unknown else ""


def is_named(node: ast.expr, name: str) -> bool:
    """Return whether an expression is a bare name."""
    return isinstance(node, ast.Name) and node.id == name


def assigned(tree: ast.Module) -> set[str]:
    """Return the names that a module assigns at its top."""
    targets = [node.targets[0] for node in tree.body if isinstance(node, ast.Assign)]
    targets += [node.target for node in tree.body if isinstance(node, ast.AnnAssign)]
    return {target.id for target in targets if isinstance(target, ast.Name)}


def test_modules_and_functions_stay_short(modules, nodes):
    """Modules and functions stay short enough to be read in one go."""
    long = [name for name, (text, _) in modules.items() if len(text.splitlines()) > LONGEST_MODULE]
    for name, each in nodes.items():
        functions = (node for node in each if isinstance(node, ast.FunctionDef))
        long += [f"{name}:{function.lineno} {function.name}" for function in functions if is_long(function)]
    assert long == []


def is_long(function: ast.FunctionDef) -> bool:
    """Return whether a function is too long, its docstring left out."""
    doc = ast.get_docstring(function, clean=False) or ""
    return (function.end_lineno or 0) - function.lineno - len(doc.splitlines()) > LONGEST_FUNCTION


def test_every_refusal_says_what_to_do_next(nodes):
    """Whoever is refused reads a way out, not only the reason."""
    without = [
        f"{name}:{node.lineno}"
        for name, each in nodes.items()
        for node in each
        if isinstance(node, ast.Call) and is_named(node.func, "Refused") and len(node.args) + len(node.keywords) < 2
    ]
    assert without == []


def test_every_driver_has_a_peer_and_every_peer_a_driver():
    """What can be driven can be simulated, so that the same cases run in CI."""
    drivers = {point.name for point in entry_points(group="hil.drivers")}
    peers = {point.name for point in entry_points(group="hil.peers")}
    assert drivers
    assert drivers == peers
