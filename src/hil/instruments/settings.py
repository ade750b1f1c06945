"""Wire settings, read strictly into the model that the driver declares."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields, replace
from typing import TypeVar

from hil.documents.declared import Invalid, Problem, validated
from hil.model.bench import Wire
from hil.model.errors import Refused

__all__ = ["NoSettings", "WrongSettings", "fits", "read", "wrong"]

_Model = TypeVar("_Model")


@dataclass(frozen=True, slots=True)
class NoSettings:
    """Model for the wire of a driver without settings."""


class WrongSettings(Refused):
    """Unknown or invalid wire settings.

    Attributes:
        problems: the problems, each with its path below the wire.
    """

    def __init__(self, wire: Wire, problems: tuple[Problem, ...]) -> None:
        text = "; ".join(problem.message for problem in problems)
        super().__init__(text, f"correct the settings of wiring {wire.name}")
        self.problems = problems


def fits(wire: Wire, driver: str, roles: Collection[str], channels: Sequence[int] = ()) -> None:
    """Refuse a role that the driver does not fill, or a channel that its instrument does not have.

    Args:
        wire: the bench file's wire.
        driver: the driver's name in bench files.
        roles: the roles that it fills.
        channels: channel numbers of its instrument; empty where it has no channels.
    """
    if wire.role not in roles:
        raise Refused(
            f"wiring {wire.name}: the driver {driver} does not fill the role {wire.role}",
            f"it fills the role {' or '.join(sorted(roles))}",
        )
    if wire.channel and not channels:
        raise Refused(f"wiring {wire.name}: the instrument of {driver} has no channels", "leave `channel` out")
    if channels and not wire.channel:
        named = " or ".join(f"`channel: {channel}`" for channel in channels)
        raise Refused(
            f"wiring {wire.name}: the instrument of {driver} has channels, and none is named", f"write {named}"
        )
    if channels and wire.channel not in channels:
        raise Refused(
            f"wiring {wire.name}: the instrument of {driver} has no channel {wire.channel}",
            f"it has {', '.join(str(channel) for channel in channels)}",
        )


def read(wire: Wire, model: type[_Model]) -> _Model:
    """Parse the settings of a wire into a driver's model; see `hil.model.notation`.

    Args:
        wire: the bench file's wire.
        model: a frozen dataclass in which every field has a default.

    Raises:
        WrongSettings: with every problem found.
    """
    try:
        return validated(model, wire.settings, f"wiring {wire.name}", ("settings",))
    except Invalid as error:
        raise WrongSettings(wire, tuple(_told(wire, model, problem) for problem in error.problems)) from error


def _told(wire: Wire, model: type, problem: Problem) -> Problem:
    """Add wire and driver to the problem of an unknown key: another driver may know it."""
    if not problem.of_key:
        return problem
    known = ", ".join(each.metadata.get("alias", each.name) for each in fields(model)) or "no settings"
    return replace(problem, message=f"wiring {wire.name}: {problem.message} (its driver takes {known})")


def wrong(wire: Wire, key: str, message: str) -> WrongSettings:
    """Return the error for a setting that only its driver can judge, such as `must be below the rate`."""
    text = f"wiring {wire.name}: '{key}' {message}, found \"{wire.settings.get(key, '')}\""
    return WrongSettings(wire, (Problem(path=("settings", key), message=text),))
