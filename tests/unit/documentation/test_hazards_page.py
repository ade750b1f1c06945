"""Every hazard has two controls that do not fail together, something that shows it, and tests that are there."""

from __future__ import annotations

import re

import pytest
from proven_tables import proofs_of, rows_of, why_none
from workspaces import ROOT

PAGE = ROOT / "docs" / "explanations" / "hazards.md"
COLUMNS = ["hazard", "cause", "control by software", "control without it", "detection", "proven by"]
WITHOUT_SOFTWARE = ("passive: ", "device: ")
OWN_PROGRAMS = re.compile(r"\b(hil|executive|guardian|envelope|safe-off|driver|clamp|udev|python)\b", re.IGNORECASE)


ROWS = rows_of(PAGE, COLUMNS)


def shown(row):
    """Return a row as the test's name shows it."""
    return f"{row['hazard']}, {row['cause']}"


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
    assert [why_none(proof) for proof in proofs_of(row) if why_none(proof)] == []


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
    assert what in why_none(proof)
