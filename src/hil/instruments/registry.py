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
    """Return the driver of that name; Refused where there is none, or several, or where it cannot be imported."""
    found = _found()
    if name not in found:
        raise Refused(
            f"unknown driver '{name}'{did_you_mean(name, found)}", f"installed are {', '.join(sorted(found)) or 'none'}"
        )
    offers = {point.value: point for point in entry_points(group=GROUP, name=name)}
    if len(offers) > 1:
        raise Refused(
            f"there are several drivers '{name}': {', '.join(sorted(offers))}", "uninstall the packages of all but one"
        )
    try:
        loaded: type[Driver] = found[name].load()
    except Exception as error:  # importing somebody's module can raise anything
        why = str(error) if isinstance(error, ImportError | AttributeError) else f"{type(error).__name__}: {error}"
        raise Refused(f"driver '{name}' cannot be imported: {why}", "install its package again, or mend it") from error
    return loaded


@cache
def _found() -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=GROUP)}
