"""The reference pages name what the code reads, hands out and provides."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from hil.instruments.registry import DRIVERS, ROLES
from hil.plugin.plans.case_fixtures import case_fixtures
from hil.simulation.registry import PEERS, PLANTS, fault_kinds

ROOT = Path(__file__).parents[3]
SOURCE = ROOT / "src" / "hil"
BENCH_FILE = (ROOT / "docs" / "reference" / "bench-file.md").read_text(encoding="utf-8")
PLAN_FILES = (ROOT / "docs" / "reference" / "plan-files.md").read_text(encoding="utf-8")
CASE_API = (ROOT / "docs" / "reference" / "case-api.md").read_text(encoding="utf-8")

READERS = [
    *((path, BENCH_FILE) for path in sorted((SOURCE / "bench").rglob("*.py"))),
    *((path, BENCH_FILE) for path in sorted((SOURCE / "simulation").rglob("*.py"))),
    *((SOURCE / "requirements" / name, PLAN_FILES) for name in ("schema.py", "parameters.py")),
]
KEY = re.compile(
    r"\b(?:reader|item|entry|document|head|truth|recognised)\."
    r"(?:text|texts|number|decimal|integer|integers|vector|flag|duration|duration_ns|frequency|plain|child|children|entries|sections)"
    r'\(\s*"([a-z_]+)"'
)


@pytest.mark.parametrize(("path", "page"), READERS, ids=lambda value: value.stem if isinstance(value, Path) else "")
def test_every_key_of_a_file_is_on_its_page(path, page):
    """Whatever key a reader asks for is named on the page about its file."""
    keys = set(KEY.findall(path.read_text(encoding="utf-8")))
    assert sorted(key for key in keys if f"`{key}`" not in page and f"`{key}:" not in page) == []


def test_the_keys_are_found():
    """The walk above finds keys where there are many."""
    found = {key for path, _ in READERS for key in KEY.findall(path.read_text(encoding="utf-8"))}
    assert {"wiring", "debounce", "earth_field", "min_tur", "values", "recognised", "welded", "by"} <= found


def test_every_driver_plant_and_fault_is_on_the_page():
    """The bench file's page names every driver, plant model, kind of fault, and state of a role."""
    kinds = {kind.name for name in PEERS for kind in fault_kinds(PEERS[name])}
    states = {state for name in ROLES for state in ROLES[name].states}
    names = {*DRIVERS, *PLANTS, *kinds, *states}
    assert sorted(name for name in names if f"`{name}`" not in BENCH_FILE and f'`"{name}"`' not in BENCH_FILE) == []


def test_every_fixture_is_on_the_page():
    """The page about cases has a row or a section for every fixture that a case can ask for."""
    module = case_fixtures(lambda: None, ROLES)
    names = [name for name in vars(module) if not name.startswith("_")]
    assert {"step", "record", "check", *ROLES} <= set(names)
    assert [name for name in names if f"\n## `{name}`\n" not in CASE_API and f"\n### `{name}`\n" not in CASE_API] == []


@pytest.mark.parametrize("role", sorted(ROLES))
def test_every_operation_of_a_role_is_on_the_page(role):
    """A role's table shows every operation with its arguments, and no operation more."""
    section = re.split(r"\n##", CASE_API.partition(f"\n### `{role}`\n")[2])[0]
    operations = {f"{name}({', '.join(operation.arguments)})" for name, operation in ROLES[role].operations.items()}
    assert set(re.findall(r"^\| `([a-z_]+\([a-z_, ]*\))` \|", section, re.MULTILINE)) == operations
