"""What a wire asks of a driver, read strictly."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

from hil.documents.suggest import did_you_mean
from hil.model.bench import Wire
from hil.model.errors import Refused

__all__ = ["choice", "fits", "only", "quantity"]


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
    if channels and wire.channel not in channels:
        raise Refused(
            f"wiring {wire.name}: the instrument of {driver} has no channel {wire.channel}",
            f"it has {', '.join(str(channel) for channel in channels)}",
        )


def only(wire: Wire, *known: str) -> None:
    """Refuse a setting that the driver does not know, and name the nearest that it does."""
    for key in wire.settings:
        if key not in known:
            raise Refused(
                f"wiring {wire.name}: unknown setting '{key}'{did_you_mean(key, known)}",
                f"known here: {', '.join(sorted(known)) or 'none'}",
            )


def quantity(wire: Wire, key: str, unit: str) -> float | None:
    """Return the number of a setting like `5.5` or `5.5 V`, or None where the wire does not name it."""
    text = wire.settings.get(key)
    if text is None:
        return None
    number = text.strip().removesuffix(unit).strip()
    try:
        value = float(number)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise Refused(f"wiring {wire.name}: setting {key} is {text!r}", f"write a number in {unit}, like '5.5 {unit}'")
    return value


def choice(wire: Wire, key: str, unit: str, allowed: Sequence[float], default: float) -> float:
    """Return the number of a setting that must be one of a few."""
    value = quantity(wire, key, unit)
    if value is None:
        return default
    if value not in allowed:
        listed = ", ".join(f"{number:g}" for number in allowed)
        asked, known = (f"{text} {unit}".rstrip() for text in (f"{value:g}", listed))
        raise Refused(f"wiring {wire.name}: {key} {asked} does not exist", f"choose one of {known}")
    return value
