"""Drivers by name: found by entry point, imported when used."""

from __future__ import annotations

import subprocess
import sys

import pytest

from hil.instruments.registry import DRIVERS, ROLES, quantity_units, states_of, unit_of
from hil.instruments.role import Role
from hil.model.errors import Refused


def test_this_packages_drivers_are_installed():
    """The names that bench files use."""
    assert {"keysight-e36300", "lis3mdl", "waveshare-relay"} <= set(DRIVERS)
    assert list(DRIVERS) == sorted(DRIVERS)


@pytest.mark.parametrize("name", DRIVERS.names)
def test_every_driver_fills_roles_that_exist(name):
    """A role that no case can ask for would never be used."""
    driver = DRIVERS[name]
    assert driver.roles
    assert driver.roles <= set(ROLES)


@pytest.mark.parametrize("name", DRIVERS.names)
def test_every_role_offers_all_of_its_operations(name):
    """The class that fills a role marks the same operations as driving and reading as the role does."""
    modules = [sys.modules[base.__module__] for base in DRIVERS[name].__mro__]
    classes = [item for module in modules for item in vars(module).values() if isinstance(item, type)]
    for role in DRIVERS[name].roles:
        wanted = {name: operation.effect for name, operation in ROLES[role].operations.items()}
        assert any(
            all(getattr(getattr(item, operation, None), "effect", None) == kind for operation, kind in wanted.items())
            for item in classes
            if item is not ROLES[role].protocol
        )


def test_an_unknown_driver_is_refused_with_the_nearest():
    """A slip of the keyboard gets the right word back."""
    with pytest.raises(Refused, match="unknown driver 'keysight-e36301', did you mean 'keysight-e36300'"):
        DRIVERS["keysight-e36301"]


def test_asking_for_names_imports_no_driver():
    """A bench file is checked without pymodbus."""
    code = (
        "import sys; from hil.instruments.registry import DRIVERS, ROLES; DRIVERS.names; ROLES['supply'];"
        "sys.exit('pymodbus' in sys.modules or 'hil.instruments.lis3mdl' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("name", ROLES.names)
def test_a_role_describes_itself(name):
    """Its states are reached by its own operations, its clamps have units, and each number that it takes has one."""
    role = ROLES[name]
    assert isinstance(role, Role)
    assert role.hazardous or not role.clamped
    for operation in role.operations.values():
        assert operation.function.__doc__, operation.name
        assert all(argument.unit for argument in operation.arguments.values() if argument.number), operation.name
    for quantity, unit in role.quantities.items():
        assert role.operations[quantity].unit == unit
        assert not role.operations[quantity].arguments


def test_an_output_is_told_by_its_role():
    """Its states and the unit of what it measures; nothing where there is no such role."""
    assert states_of("supply.coil") == {"off": "disable"}
    assert unit_of("supply.coil", "current") == "A"
    assert unit_of("supply.coil", "angle") == ""
    assert (states_of("nothing"), unit_of("nothing", "current")) == ({}, "")
    assert quantity_units()["rate"] == ("deg/s",)
