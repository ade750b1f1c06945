"""Walks over the whole package that keep its conventions true."""

from __future__ import annotations

import ast
from importlib.metadata import entry_points
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "src" / "hil"
MODULES = sorted(path for path in SOURCE.rglob("*.py"))
IDS = [str(path.relative_to(SOURCE)) for path in MODULES]
LONGEST_MODULE = 400
LONGEST_FUNCTION = 50
NAMES_THAT_SAY_NOTHING = {"common", "helpers", "misc", "stuff", "tools", "utils"}


def tree_of(path: Path) -> ast.Module:
    """Return a module's syntax tree."""
    return ast.parse(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("path", MODULES, ids=IDS)
def test_every_module_begins_with_one_plain_sentence(path):
    """The first docstring line tells what is in the room, and ends like a sentence."""
    first = (ast.get_docstring(tree_of(path)) or "").partition("\n")[0]
    assert first.endswith((".", "?")), first
    assert path.stem not in NAMES_THAT_SAY_NOTHING


@pytest.mark.parametrize("path", MODULES, ids=IDS)
def test_public_names_are_listed_and_sorted(path):
    """A module with public names lists them once, sorted, and each exists."""
    tree = tree_of(path)
    listed = [
        ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"
    ]
    defined = {
        node.name
        for node in tree.body
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_")
    }
    if not defined:
        return
    assert len(listed) == 1
    assert len(listed[0]) == len(set(listed[0]))
    assert set(listed[0]) - {name for name in listed[0] if name.isupper()} <= defined | assigned(tree)


def assigned(tree: ast.Module) -> set[str]:
    """Return the names that a module assigns at its top."""
    targets = [node.targets[0] for node in tree.body if isinstance(node, ast.Assign)]
    targets += [node.target for node in tree.body if isinstance(node, ast.AnnAssign)]
    return {target.id for target in targets if isinstance(target, ast.Name)}


@pytest.mark.parametrize("path", MODULES, ids=IDS)
def test_rooms_stay_liveable(path):
    """Modules and functions stay short enough to be read in one go."""
    assert len(path.read_text(encoding="utf-8").splitlines()) <= LONGEST_MODULE
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.FunctionDef):
            length = (node.end_lineno or 0) - node.lineno
            doc = ast.get_docstring(node, clean=False)
            assert length - len((doc or "").splitlines()) <= LONGEST_FUNCTION, f"{node.name} is too long"


def test_every_refusal_says_what_to_do_next():
    """Whoever is refused reads a way out, not only the reason."""
    without = [
        f"{path.relative_to(SOURCE)}:{node.lineno}"
        for path in MODULES
        for node in ast.walk(tree_of(path))
        if isinstance(node, ast.Call)
        and ast.unparse(node.func) == "Refused"
        and len(node.args) + len(node.keywords) < 2
    ]
    assert without == []


def test_every_driver_has_a_peer_and_every_peer_a_driver():
    """What can be driven can be simulated, so that the same cases run in CI."""
    drivers = {point.name for point in entry_points(group="hil.drivers")}
    peers = {point.name for point in entry_points(group="hil.peers")}
    assert drivers
    assert drivers == peers
