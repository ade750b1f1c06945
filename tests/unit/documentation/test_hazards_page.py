"""Every hazard has two controls that do not fail together, something that shows it, and tests that are there."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
PAGE = ROOT / "docs" / "explanations" / "hazards.md"
COLUMNS = ["hazard", "cause", "control by software", "control without it", "detection", "proven by"]
WITHOUT_SOFTWARE = ("passive: ", "device: ")
OWN_PROGRAMS = re.compile(r"\b(hil|executive|guardian|envelope|safe-off|driver|clamp|udev|python)\b", re.IGNORECASE)


def cells(line):
    """Return the cells of a table's line."""
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


def hazards(text):
    """Return every row of every table with the columns of hazards."""
    rows, inside = [], False
    for line in text.splitlines():
        if not line.startswith("|"):
            inside = False
        elif cells(line) == COLUMNS:
            inside = True
        elif inside and set(line) - set("|-"):
            rows.append(dict(zip(COLUMNS, cells(line), strict=True)))
    return rows


ROWS = hazards(PAGE.read_text(encoding="utf-8"))


def shown(row):
    """Return a row as the test's name shows it."""
    return f"{row['hazard']}, {row['cause']}"


@cache
def names_in(path):
    """Return the names of a file's tests, and every text in it, which names of parameters are among."""
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    names = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
    texts = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    return {name for name in names if name.startswith("test_")}, texts


def problem(proof):
    """Return why a proof is none, empty where it is one."""
    found = re.fullmatch(r"`(tests/[\w/]+\.py)::(\w+)(?:\[([^\]]+)\])?`", proof)
    if found is None:
        return f"{proof} names no test"
    path, name, parameter = found.groups()
    if not (ROOT / path).is_file():
        return f"there is no {path}"
    names, texts = names_in(path)
    if name not in names:
        return f"{path} has no {name}"
    return f"{path} has no parameter '{parameter}'" if parameter and parameter not in texts else ""


def test_the_page_has_its_hazards():
    """The walk below finds rows, and no row twice."""
    assert len(ROWS) >= 30
    assert len({shown(row) for row in ROWS}) == len(ROWS)


@pytest.mark.parametrize("row", ROWS, ids=shown)
def test_a_hazard_has_two_controls_and_a_detection(row):
    """No cell is empty, the controls differ, and the second one is no program of this machine."""
    assert all(row.values())
    without = row["control without it"]
    assert without.startswith(WITHOUT_SOFTWARE)
    assert without != row["control by software"]
    assert OWN_PROGRAMS.search(without) is None


@pytest.mark.parametrize("row", ROWS, ids=shown)
def test_a_hazard_has_a_test_that_is_there(row):
    """Every test that a row names is in its file, and so is its parameter."""
    assert [problem(proof) for proof in row["proven by"].split("<br>") if problem(proof)] == []


@pytest.mark.parametrize(
    ("proof", "what"),
    [
        ("not proven", "names no test"),
        ("`tests/fault/test_nowhere.py::test_a`", "there is no"),
        ("`tests/fault/test_guardian.py::test_a`", "has no test_a"),
        ("`tests/fault/test_guardian.py::test_every_end_of_an_executive_leaves_its_outputs_safe[x y]`", "no parameter"),
        ("`tests/fault/test_guardian.py::plan_of`", "has no plan_of"),
    ],
)
def test_what_proves_nothing_is_found(proof, what):
    """The look at proofs is no formality."""
    assert what in problem(proof)
