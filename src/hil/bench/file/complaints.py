"""What checks of a bench file say, and where in the file that is."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any, TypeVar

from hil.documents.node import Place
from hil.documents.offers import Offers
from hil.documents.suggest import did_you_mean
from hil.instruments.registry import quantity_units, role_of
from hil.model.errors import Refused

__all__ = ["Complaints", "Located", "known", "quantity", "quantity_of", "usable"]

Complaints = Iterator[tuple[object, str]]
"""What is wrong with which thing of the bench file."""

_Thing = TypeVar("_Thing")


class Located:
    """Remembers where in the file each thing was read."""

    def __init__(self) -> None:
        self._places: dict[int, Place] = {}
        self._things: list[object] = []

    def keep(self, thing: _Thing, place: Place) -> _Thing:
        """Remember and return the thing."""
        self._places[id(thing)] = place
        self._things.append(thing)
        return thing

    def of(self, thing: object) -> Place:
        """Return the place of a thing that was kept."""
        return self._places[id(thing)]


def known(thing: object, what: str, name: str, names: Iterable[str]) -> Complaints:
    """Complain of a name that nothing has; an empty one could not be read, and the reader has said so."""
    if name and name not in names:
        yield thing, f"unknown {what} '{name}'{did_you_mean(name, names)}"


def usable(thing: object, offers: Offers[Any], name: str) -> Complaints:
    """Complain of a name that no package offers, or of an offer that is refused."""
    yield from known(thing, offers.what, name, offers)
    if name in offers:
        try:
            offers[name]
        except Refused as error:
            yield thing, str(error)


def quantity(thing: object, name: str, unit: str) -> Complaints:
    """Complain of a quantity that no role has, or of a unit in which none gives it."""
    yield from _given(thing, name, unit, quantity_units())


def quantity_of(thing: object, output: str, name: str, unit: str) -> Complaints:
    """Complain of a quantity that the output's role does not have, or of a unit in which it does not give it."""
    role, units = role_of(output), quantity_units()
    own = {each: (given,) for each, given in role.quantities.items()} if role else {}
    yield from _given(thing, name, unit, {**units, **own})
    if role and name in units and name not in own:
        yield thing, f"{output} has no {name}"


def _given(thing: object, name: str, unit: str, units: Mapping[str, Collection[str]]) -> Complaints:
    yield from known(thing, "quantity", name, units)
    if unit and name in units and unit not in units[name]:
        yield thing, f"{name} is given in {' or '.join(units[name])} here, not in '{unit}'"
