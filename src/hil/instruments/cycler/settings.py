"""Settings of a level 2 device: their text form, and the CRC that START quotes."""

from __future__ import annotations

import math
from binascii import crc_hqx
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Self

from hil.instruments import settings
from hil.model.bench import Wire
from hil.model.errors import Refused
from hil.model.notation import Notation, measured, whole

__all__ = ["SETTINGS", "Setting", "Wiring", "checked", "crc_of"]

_NEGLIGIBLE = 1e-9
_SHORTEST_BEAT_S, _LONGEST_BEAT_S = 15, 600
_MOST_CYCLES = 9999


@dataclass(frozen=True, slots=True)
class Setting:
    """One setting: name, unit, decimals and default, as in the protocol page's table."""

    name: str
    unit: str
    decimals: int
    default: str


SETTINGS = (
    Setting("cycles", "", 0, "10"),
    Setting("rest", "s", 0, "0"),
    Setting("beat", "s", 0, "60"),
    Setting("vfull", "V", 3, "4.150"),
    Setting("iend", "A", 3, "0.050"),
    Setting("vend", "V", 3, "2.700"),
    Setting("vmax", "V", 3, "4.250"),
    Setting("vmin", "V", 3, "2.600"),
    Setting("imax", "A", 3, "1.000"),
    Setting("tmax", "degC", 1, "45.0"),
    Setting("tmin", "degC", 1, "0.0"),
    Setting("time", "s", 0, "28800"),
    Setting("charge", "Ah", 3, "3.000"),
)
"""Every setting, in the order of the protocol page's table, which the CRC follows."""


def checked(device: str, given: Mapping[str, float]) -> dict[str, str]:
    """Return the text of every setting, with defaults for those not given.

    Raises:
        Refused: a value is not a number, or has more decimals than the setting allows.
    """
    return {setting.name: _written(device, setting, given.get(setting.name)) for setting in SETTINGS}


def crc_of(settings: Mapping[str, str]) -> str:
    """Return the CRC of all settings as four hexadecimal digits."""
    text = ";".join(f"{setting.name}={settings[setting.name]}" for setting in SETTINGS)
    return f"{crc_hqx(text.encode('ascii'), 0xFFFF):04X}"


def _written(device: str, setting: Setting, value: float | None) -> str:
    if value is None:
        return setting.default
    shown = f"{value:g} {setting.unit}".rstrip()
    if not math.isfinite(value):
        raise Refused(f"{device}: {setting.name} cannot be {shown}", "give a number")
    rounded = round(value, setting.decimals) + 0.0  # never -0.0
    if abs(rounded - value) > _NEGLIGIBLE:
        raise Refused(
            f"{device}: {setting.name} cannot be {value} {setting.unit}".rstrip(),
            f"it has {setting.decimals} decimals" if setting.decimals else "it is a whole number",
        )
    return f"{rounded:.{setting.decimals}f}"


def _level(value: object) -> str:
    return "1" if measured(choices=(1.0, 2.0)).read(value) == 1 else "2.0"


@dataclass(frozen=True, slots=True, kw_only=True)
class Wiring:
    """Wire settings.

    Attributes:
        level: protocol level that the device must speak: `1` or `2.0`.
        beat_s: heartbeat timeout of the device; the driver sends heartbeats three times as often.
        cycles: number of cycles that a level 1 device runs; it cannot be set there.
    """

    level: Annotated[str, Notation(_level, "2.0")] = "2.0"
    beat_s: Annotated[float, measured("s", minimum=_SHORTEST_BEAT_S, maximum=_LONGEST_BEAT_S)] = field(
        default=60.0, metadata={"alias": "beat"}
    )
    cycles: Annotated[int, whole(1, _MOST_CYCLES)] = 10

    @classmethod
    def read(cls, wire: Wire) -> Self:
        """Read the settings of a wire; Refused where one is invalid, or not available at that level."""
        own = settings.read(wire, cls)
        for key, of_level in (("beat", "2.0"), ("cycles", "1")):
            if key in wire.settings and own.level != of_level:
                raise settings.wrong(wire, key, f"must be left out: a device of level {own.level} has no {key} here")
        if own.beat_s != int(own.beat_s):
            raise settings.wrong(wire, "beat", "must be whole seconds")
        return own
