"""What plans and notebooks import: few flat names, each of them what it is called, and none slow before it is used."""

from __future__ import annotations

import ast
import importlib
import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
FLAT = ("hil.analysis", "hil.plan")
SOURCES = sorted((*ROOT.glob("testplans/*/*.py"), *ROOT.glob("fixtures/*.py")))


@pytest.mark.parametrize("module", FLAT)
def test_every_flat_name_is_there(module):
    """The list, the table of homes and the names for type checkers agree; a name that is none is an AttributeError."""
    found = importlib.import_module(module)
    tree = ast.parse(Path(found.__file__).read_text(encoding="utf-8"))
    (block,) = (node for node in tree.body if isinstance(node, ast.If))
    typed = {alias.name: node.module for node in block.body for alias in node.names}
    assert sorted(typed) == sorted(found.__all__) == sorted(found._HOMES)
    for name, home in typed.items():
        assert getattr(found, name) is getattr(importlib.import_module(home), name)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        found.nothing  # noqa: B018 - asking is the test


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.stem)
def test_plans_and_fixtures_import_flat_names_only(path):
    """Modules of the library may move without a plan noticing."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    imported = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module}
    assert {name for name in imported if name.startswith("hil")} <= set(FLAT)
    plain = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    assert not {name for name in plain if name.startswith("hil")}


def test_asking_for_a_name_loads_no_more_than_it_needs():
    """A plan is collected without SciPy and without any instrument."""
    code = (
        "import sys; from hil.plan import Figure; from hil.analysis import not_observable;"
        "sys.exit('scipy' in sys.modules or 'hil.instruments.roles' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_flat_names_of_plans_are_on_their_page():
    """The page about cases names all that a plan can import."""
    page = (ROOT / "docs/reference/case-api.md").read_text(encoding="utf-8")
    names = importlib.import_module("hil.plan").__all__
    assert [name for name in names if f"`{name}`" not in page and f".{name}(" not in page] == []


def test_every_role_has_its_type_among_them():
    """Whatever a case can ask for, it can annotate."""
    protocols = [entry.load().protocol for entry in entry_points(group="hil.roles") if entry.dist.name == "hil"]
    assert "Supply" in (names := {protocol.__name__ for protocol in protocols})
    assert names <= set(importlib.import_module("hil.plan").__all__)
