"""Drivers and roles by name: entry points of the groups `hil.drivers` and `hil.roles`, ours and other packages'."""

from __future__ import annotations

from collections.abc import Mapping

from hil.documents.offers import Offers
from hil.instruments.driver import Driver, NamesInputs
from hil.instruments.role import Role, problem_with
from hil.model.bench import Wire
from hil.model.errors import Refused

__all__ = ["DRIVERS", "ROLES", "inputs_of", "quantity_units", "role_of", "states_of", "unit_of"]


def _driver_problem(name: str, found: object) -> str:
    del name
    missing = [each for each in ("roles", "identify", "outlets", "role") if not hasattr(found, each)]
    if not isinstance(found, type):
        return f"is {found!r:.80}, not a class"
    return f"has no {', '.join(missing)}" if missing else ""


DRIVERS: Offers[type[Driver]] = Offers(
    "hil.drivers", "driver", _driver_problem, "a class as described in hil.instruments.driver"
)
"""Every driver by the name that bench files use."""

ROLES: Offers[Role] = Offers("hil.roles", "role", problem_with, "a hil.instruments.role.Role of that name")
"""Every role by the name that bench files and cases use."""


def role_of(output: str) -> Role | None:
    """Return the role of an output such as `supply.coil`, None if there is no such role."""
    return ROLES.find(output.partition(".")[0])


def states_of(output: str) -> Mapping[str, str]:
    """Return an output's states and the operations that lead to them, empty where there is no such role."""
    role = role_of(output)
    return role.states if role else {}


def unit_of(output: str, quantity: str) -> str:
    """Return the unit of a quantity of an output's role, empty if it has no such quantity."""
    role = role_of(output)
    return role.quantities.get(quantity, "") if role else ""


def inputs_of(driver: str, wire: Wire) -> Mapping[str, str]:
    """Return the unit of each input that a wire defines, empty where its driver has no named inputs."""
    found = DRIVERS.find(driver)
    return found.inputs(wire) if found is not None and issubclass(found, NamesInputs) else {}


def quantity_units() -> dict[str, tuple[str, ...]]:
    """Return every quantity of any role, with the units in which roles report it.

    Roles that cannot be loaded are left out; wiring one reports why.
    """
    units: dict[str, tuple[str, ...]] = {}
    for name in ROLES:
        try:
            role = ROLES[name]
        except Refused:
            continue
        for quantity, unit in role.quantities.items():
            units[quantity] = (*units.get(quantity, ()), *({unit} - set(units.get(quantity, ()))))
    return units
