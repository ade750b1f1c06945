"""What checks of a bench file say, and where in the file that is."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import TypeVar

from hil.documents.node import Place
from hil.documents.suggest import did_you_mean
from hil.instruments.roles import ROLES

__all__ = ["QUANTITIES", "Complaints", "Located", "known", "quantity", "quantity_of"]

QUANTITIES = {
    "voltage": "V",
    "current": "A",
    "temperature": "degC",
    "output": "%",
    "angle": "deg",
    "rate": "deg/s",
    "turns": "turn",
}
"""The quantities that ratings, clamps, envelope and proofs may name, and their unit."""

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


def known(thing: object, what: str, name: str, names: Collection[str]) -> Complaints:
    """Complain of a name that nothing has; an empty one could not be read, and the reader has said so."""
    if name and name not in names:
        yield thing, f"unknown {what} '{name}'{did_you_mean(name, names)}"


def quantity(thing: object, name: str, unit: str) -> Complaints:
    """Complain of a quantity that does not exist, or of a unit that is not its own."""
    yield from known(thing, "quantity", name, QUANTITIES)
    if unit and name in QUANTITIES and unit != QUANTITIES[name]:
        yield thing, f"{name} is given in {QUANTITIES[name]} here, not in '{unit}'"


def quantity_of(thing: object, output: str, name: str, unit: str) -> Complaints:
    """Complain besides of a quantity that the output's role does not have."""
    yield from quantity(thing, name, unit)
    role = output.partition(".")[0]
    if role in ROLES and name in QUANTITIES and not hasattr(ROLES[role], name):
        yield thing, f"{output} has no {name}"
