"""Drivers by name: entry points of the group `hil.drivers`, this package's and other people's."""

from __future__ import annotations

from functools import cache
from importlib.metadata import EntryPoint, entry_points

from hil.documents.suggest import did_you_mean
from hil.instruments.driver import Driver
from hil.model.errors import Refused

__all__ = ["GROUP", "driver_class", "driver_names"]

GROUP = "hil.drivers"
"""The entry point group in which a package offers its drivers."""


def driver_names() -> tuple[str, ...]:
    """Return the names of all drivers, sorted; no driver is imported."""
    return tuple(sorted(_found()))


def driver_class(name: str) -> type[Driver]:
    """Return the driver of that name; Refused where there is none, or where it cannot be imported."""
    found = _found()
    if name not in found:
        raise Refused(
            f"unknown driver '{name}'{did_you_mean(name, found)}", f"installed are {', '.join(sorted(found)) or 'none'}"
        )
    try:
        loaded: type[Driver] = found[name].load()
    except (ImportError, AttributeError) as error:
        raise Refused(f"driver '{name}' cannot be imported: {error}", "install its package again") from error
    return loaded


@cache
def _found() -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=GROUP)}
