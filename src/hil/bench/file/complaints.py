"""Complaints of the checks of a bench file, each with its path in the file."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any, TypeVar

from hil.documents.offers import Offers
from hil.documents.suggest import did_you_mean, nearest
from hil.instruments.registry import quantity_units, role_of
from hil.instruments.role import Role
from hil.model.bench import Bus, InstrumentSpec
from hil.model.errors import Refused
from hil.model.notation import Path

__all__ = ["Complaints", "known", "listed", "named", "quantities_told", "quantity", "quantity_of", "usable"]

Complaints = Iterator[tuple[Path, str]]
"""Paths in the bench file, each with what is wrong there."""

_Thing = TypeVar("_Thing")
_Named = TypeVar("_Named", Bus, InstrumentSpec)


def listed(section: str, items: Sequence[_Thing]) -> Iterator[tuple[Path, _Thing]]:
    """Yield the items of a list in the bench file, each with its path."""
    for index, item in enumerate(items):
        yield (section, index), item


def named(items: Sequence[_Named], *section: str) -> Iterator[tuple[Path, _Named]]:
    """Yield the named entries of a section of the bench file, each with its path."""
    for item in items:
        yield (*section, item.name), item


def known(at: Path, what: str, name: str, names: Iterable[str]) -> Complaints:
    """Complain about an unknown name; an empty one could not be read, which was reported already."""
    if name and name not in names:
        yield at, f"unknown {what} '{name}'{did_you_mean(name, names)}"


def usable(at: Path, offers: Offers[Any], name: str) -> Complaints:
    """Complain about a name that no package offers, or an offer that is refused."""
    yield from known(at, offers.what, name, offers)
    if name in offers:
        try:
            offers[name]
        except Refused as error:
            yield at, str(error)


def quantity(at: Path, name: str, unit: str) -> Complaints:
    """Complain about a quantity that no role has, or a unit in which none of them has it."""
    yield from _given(at, name, unit, quantity_units())


def quantity_of(at: Path, output: str, name: str, unit: str, inputs: Mapping[str, str] | None = None) -> Complaints:
    """Complain about a quantity that the output's role does not have, or a unit in which it does not have it.

    Args:
        at: where in the bench file.
        output: name of a wire.
        name: the quantity.
        unit: its unit.
        inputs: the inputs that the wire names besides its role's quantities, with their units; see `inputs_of`.
    """
    role, units = role_of(output), quantity_units()
    if inputs:
        if name and name not in inputs:
            yield at, f"{output} has no {name}: its wire names {', '.join(inputs)}"
        elif unit and name and unit != inputs[name]:
            yield at, f"{name} is given in {inputs[name]} here, not in '{unit}'"
        return
    if role and name and name not in role.quantities and (name in units or not nearest(name, role.quantities)):
        yield at, f"{output} has no {name}: {quantities_told(role)}"
        return
    own = {each: (given,) for each, given in role.quantities.items()} if role else units
    yield from _given(at, name, unit, own)


def quantities_told(role: Role) -> str:
    """Return which quantities a role has for clamps, envelope and proofs, or what to do if it has none."""
    if role.quantities:
        return f"the role {role.name} has {', '.join(role.quantities)}"
    return f"the role {role.name} has no quantities for clamps, envelope and proofs; name another output"


def _given(at: Path, name: str, unit: str, units: Mapping[str, Collection[str]]) -> Complaints:
    yield from known(at, "quantity", name, units)
    if unit and name in units and unit not in units[name]:
        yield at, f"{name} is given in {' or '.join(units[name])} here, not in '{unit}'"
