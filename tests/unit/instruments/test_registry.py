"""Drivers by name: found by entry point, imported when used."""

from __future__ import annotations

import subprocess
import sys

import pytest

from hil.instruments.registry import driver_class, driver_names
from hil.instruments.roles import ROLES
from hil.model.errors import Refused


def test_this_packages_drivers_are_installed():
    """The names that bench files use."""
    assert {"keysight-e36300", "lis3mdl", "waveshare-relay"} <= set(driver_names())
    assert list(driver_names()) == sorted(driver_names())


@pytest.mark.parametrize("name", driver_names())
def test_every_driver_fills_roles_that_exist(name):
    """A role that no case can ask for would never be used."""
    driver = driver_class(name)
    assert driver.roles
    assert driver.roles <= set(ROLES)


@pytest.mark.parametrize("name", driver_names())
def test_every_role_offers_all_of_its_operations(name):
    """The class that fills a role marks the same operations as driving and reading as the role does."""
    module = sys.modules[driver_class(name).__module__]
    classes = [item for item in vars(module).values() if isinstance(item, type)]
    for role in driver_class(name).roles:
        wanted = {
            operation: function.effect
            for base in ROLES[role].__mro__
            for operation, function in vars(base).items()
            if hasattr(function, "effect")
        }
        assert any(
            all(getattr(getattr(item, operation, None), "effect", None) == kind for operation, kind in wanted.items())
            for item in classes
            if item is not ROLES[role]
        )


def test_an_unknown_driver_is_refused_with_the_nearest():
    """A slip of the keyboard gets the right word back."""
    with pytest.raises(Refused, match="unknown driver 'keysight-e36301', did you mean 'keysight-e36300'"):
        driver_class("keysight-e36301")


def test_asking_for_names_imports_no_driver():
    """A bench file is checked without pymodbus."""
    code = (
        "import sys; from hil.instruments.registry import driver_names; driver_names();"
        "sys.exit('pymodbus' in sys.modules or 'hil.instruments.lis3mdl' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
