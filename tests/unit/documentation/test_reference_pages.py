"""The reference pages name what the code reads, hands out and provides."""

from __future__ import annotations

import re
from dataclasses import fields, is_dataclass
from importlib import import_module
from pathlib import Path
from typing import get_args, get_type_hints

import pytest

from hil.instruments.registry import DRIVERS, ROLES
from hil.model.bench import BenchSpec
from hil.model.identity import Dut
from hil.model.notation import UNWRITTEN
from hil.plugin.plans.case_fixtures import case_fixtures
from hil.registers import instruments
from hil.requirements import parameters, schema
from hil.simulation.registry import PEERS, PLANTS, fault_kinds

ROOT = Path(__file__).parents[3]
SOURCE = ROOT / "src" / "hil"
BENCH_FILE = (ROOT / "docs" / "reference" / "bench-file.md").read_text(encoding="utf-8")
REGISTERS = (ROOT / "docs" / "reference" / "registers.md").read_text(encoding="utf-8")
PLAN_FILES = (ROOT / "docs" / "reference" / "plan-files.md").read_text(encoding="utf-8")
CASE_API = (ROOT / "docs" / "reference" / "case-api.md").read_text(encoding="utf-8")

READERS = sorted((SOURCE / "simulation").rglob("*.py"))


def keys_of(model):
    """Return every key that a declared model reads, in all of its sections."""
    keys, hints = set(), get_type_hints(model)
    for field in fields(model):
        key = field.metadata.get("alias", field.name)
        inner = [] if key.startswith(UNWRITTEN["alias"]) else [hints[field.name]]
        keys.update([key] if inner else [])
        while inner:
            found = inner.pop()
            inner.extend(get_args(found))
            keys |= keys_of(found) if is_dataclass(found) else set()
    return keys


@pytest.mark.parametrize(
    ("model", "page"),
    [
        (BenchSpec, BENCH_FILE),
        (Dut, REGISTERS),
        (instruments._Register, REGISTERS + BENCH_FILE),
        (schema._Plan, PLAN_FILES),
        (parameters._File, PLAN_FILES),
    ],
)
def test_every_declared_key_is_on_its_page(model, page):
    """Whatever key a model declares is named on the page about its file."""
    assert sorted(key for key in keys_of(model) if f"`{key}`" not in page and f"`{key}:" not in page) == []


def declared_in_the_simulation():
    """Return every model that a truth section is read into, and every kind of fault."""
    for path in READERS:
        text = path.read_text(encoding="utf-8")
        names = {*re.findall(r"\.part\(([A-Z]\w+)\)", text), *re.findall(r"^class (\w+Truth)\b", text, re.MULTILINE)}
        module = ".".join(path.relative_to(ROOT / "src").with_suffix("").parts)
        yield from (getattr(import_module(module), name) for name in sorted(names))
    yield from sorted({kind for name in PEERS for kind in fault_kinds(PEERS[name])}, key=lambda kind: kind.__name__)


@pytest.mark.parametrize("model", [*declared_in_the_simulation()], ids=lambda model: model.__name__)
def test_every_declared_key_of_the_simulation_is_on_its_page(model):
    """Whatever key a plant, a peer or a fault declares is named on the page about the bench file."""
    assert sorted(key for key in keys_of(model) if f"`{key}`" not in BENCH_FILE and f"`{key}:" not in BENCH_FILE) == []


def test_the_keys_are_found():
    """The walks above find keys where there are many."""
    simulated = {key for model in declared_in_the_simulation() for key in keys_of(model)}
    assert {"earth_field", "welded", "pause_time", "bias_x", "cool_gain", "turns", "reset_on_open"} <= simulated
    assert {"wiring", "debounce", "while", "epoch", "by"} <= keys_of(BenchSpec)
    assert {"min_tur", "max_gap", "part_numbers"} <= keys_of(schema._Plan)
    assert {"values", "rising"} <= keys_of(parameters._File)
    assert "recognised" in keys_of(Dut)


def test_every_driver_plant_and_fault_is_on_the_page():
    """The bench file's page names every driver, plant model, kind of fault, and state of a role."""
    kinds = {kind.name for name in PEERS for kind in fault_kinds(PEERS[name])}
    states = {state for name in ROLES for state in ROLES[name].states}
    names = {*DRIVERS, *PLANTS, *kinds, *states}
    assert sorted(name for name in names if f"`{name}`" not in BENCH_FILE and f'`"{name}"`' not in BENCH_FILE) == []


def test_the_tables_have_every_driver_and_plant_model():
    """Each driver has its row with the role, and the key `model` of a plant names each model."""
    rows = {row.split("`")[1] for row in BENCH_FILE.partition("## Drivers")[2].splitlines() if row.startswith("| `")}
    assert sorted({*DRIVERS} - rows) == []
    (models,) = re.findall(r"^\| `model` \| yes \| (.*) \|$", BENCH_FILE, re.MULTILINE)
    assert sorted(re.findall(r"`([\w-]+)`", models)) == sorted(PLANTS)


def test_the_row_of_roles_has_every_role():
    """The first table of the page about cases names each role."""
    (row,) = re.findall(r"^\| (.*) \| the \[roles\]", CASE_API, re.MULTILINE)
    assert sorted(re.findall(r"`(\w+)`", row)) == sorted(ROLES)


def test_the_page_says_which_quantities_each_role_has():
    """The table of roles is that of the roles, with what can be read."""
    table = BENCH_FILE.partition("### Quantities of roles")[2].partition("### ")[0]
    told = {
        role: re.findall(r"`(\w+)`", cells[1])
        for cells in (row.strip("| ").split(" | ") for row in table.splitlines() if row.startswith("| `"))
        for role in re.findall(r"`(\w+)`", cells[0])
    }
    read = {name: [each for each in ROLES[name].quantities if each in ROLES[name].operations] for name in ROLES}
    assert told == read


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
