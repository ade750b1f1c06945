"""Drivers by name: found by entry point, imported when used."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import EntryPoint, EntryPoints

import pytest

from hil.instruments import registry
from hil.instruments.registry import GROUP, driver_class, driver_names
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


def declared(monkeypatch, tmp_path, code, *values):
    """Let another package declare drivers of one name in a module with this code."""
    (tmp_path / "theirs_of_this_test.py").write_text(code)
    monkeypatch.syspath_prepend(tmp_path)
    points = EntryPoints(EntryPoint("theirs", value, GROUP) for value in values)
    monkeypatch.setattr(registry, "entry_points", points.select)
    monkeypatch.setattr(registry, "_found", registry._found.__wrapped__)


@pytest.mark.parametrize(
    ("code", "why"),
    [
        ("1 / 0", "ZeroDivisionError: division by zero"),
        ("def", "SyntaxError: invalid syntax"),
        ("", "has no attribute"),
    ],
)
def test_a_driver_that_cannot_be_imported_is_refused(monkeypatch, tmp_path, code, why):
    """Whatever its module raises is told in a sentence."""
    declared(monkeypatch, tmp_path, code, "theirs_of_this_test:Driver")
    with pytest.raises(Refused, match="driver 'theirs' cannot be imported: ") as caught:
        driver_class("theirs")
    assert why in str(caught.value)
    sys.modules.pop("theirs_of_this_test", None)


def test_two_packages_with_a_driver_of_one_name_are_refused(monkeypatch, tmp_path):
    """Which of them speaks to the instrument would be chance."""
    declared(monkeypatch, tmp_path, "", "one:Driver", "another:Driver")
    with pytest.raises(Refused, match="several drivers 'theirs': another:Driver, one:Driver; uninstall"):
        driver_class("theirs")


def test_asking_for_names_imports_no_driver():
    """A bench file is checked without pymodbus."""
    code = (
        "import sys; from hil.instruments.registry import driver_names; driver_names();"
        "sys.exit('pymodbus' in sys.modules or 'hil.instruments.lis3mdl' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
