"""What a wire asks of a driver, read strictly into the model that the driver declares."""

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
    """What the wire of a driver without settings may say."""


class WrongSettings(Refused):
    """Settings that the driver does not know, or that cannot be.

    Attributes:
        problems: each with its path below the wire.
    """

    def __init__(self, wire: Wire, problems: tuple[Problem, ...]) -> None:
        text = "; ".join(problem.message for problem in problems)
        super().__init__(text, f"correct the settings of wiring {wire.name}")
        self.problems = problems


def fits(wire: Wire, driver: str, roles: Collection[str], channels: Sequence[int] = ()) -> None:
    """Refuse a role that the driver does not fill, and a channel that its instrument does not have.

    Args:
        wire: what the bench file asks for.
        driver: the driver's name in bench files.
        roles: the roles that it fills.
        channels: the numbers of its instrument's channels; none where it has no channels.
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
    """Return the settings of a wire as a driver declares them; see `hil.model.notation`.

    Args:
        wire: what the bench file asks for.
        model: a frozen dataclass; every field has a default.

    Raises:
        WrongSettings: with everything that is wrong.
    """
    try:
        return validated(model, wire.settings, f"wiring {wire.name}", ("settings",))
    except Invalid as error:
        raise WrongSettings(wire, tuple(_told(wire, model, problem) for problem in error.problems)) from error


def _told(wire: Wire, model: type, problem: Problem) -> Problem:
    """Name wire and driver where a key is unknown: another driver may know it."""
    if not problem.of_key:
        return problem
    known = ", ".join(each.metadata.get("alias", each.name) for each in fields(model)) or "no settings"
    return replace(problem, message=f"wiring {wire.name}: {problem.message} (its driver takes {known})")


def wrong(wire: Wire, key: str, message: str) -> WrongSettings:
    """Return what is wrong with a setting that only its driver can see, such as `must be below the rate`."""
    text = f"wiring {wire.name}: '{key}' {message}, found \"{wire.settings.get(key, '')}\""
    return WrongSettings(wire, (Problem(path=("settings", key), message=text),))
