"""The settings of a level 2 device: how they are written, and the CRC that START names."""

from __future__ import annotations

import math
from binascii import crc_hqx
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

from hil.instruments import settings
from hil.model.bench import Wire
from hil.model.errors import Refused

__all__ = ["SETTINGS", "Setting", "Wiring", "checked", "crc_of"]

_NEGLIGIBLE = 1e-9
_SHORTEST_BEAT_S, _LONGEST_BEAT_S = 15, 600
_MOST_CYCLES = 9999


@dataclass(frozen=True, slots=True)
class Setting:
    """One setting: its name, unit, decimals and default, as the page's table has them."""

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
"""Every setting, in the order of the page's table, which is that of the CRC."""


def checked(device: str, given: Mapping[str, float]) -> dict[str, str]:
    """Return every setting as it is written, those that are not given with their defaults.

    Raises:
        Refused: a value is no number, or has more decimals than can be written.
    """
    return {setting.name: _written(device, setting, given.get(setting.name)) for setting in SETTINGS}


def crc_of(settings: Mapping[str, str]) -> str:
    """Return the CRC of all settings, four hexadecimal digits."""
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Wiring:
    """The settings of a wire.

    Attributes:
        level: of the protocol that the device must speak: `1` or `2.0`.
        beat_s: the device's longest time between heartbeats; the driver sends one three times as often.
        cycles: how many a device of level 1 runs, for it cannot be told.
    """

    level: str
    beat_s: float
    cycles: int

    @classmethod
    def read(cls, wire: Wire) -> Self:
        """Read the settings `level`, `beat` and `cycles`; Refused where one cannot be."""
        settings.only(wire, "level", "beat", "cycles")
        level = "1" if settings.choice(wire, "level", "", (1.0, 2.0), 2.0) == 1 else "2.0"
        beat = settings.quantity(wire, "beat", "s")
        cycles = settings.quantity(wire, "cycles", "")
        for key, of_level in (("beat", "2.0"), ("cycles", "1")):
            if key in wire.settings and level != of_level:
                raise Refused(f"wiring {wire.name}: a device of level {level} has no {key} here", f"leave {key} out")
        return cls(
            level=level,
            beat_s=60.0 if beat is None else float(_within(wire, "beat", beat, _SHORTEST_BEAT_S, _LONGEST_BEAT_S)),
            cycles=10 if cycles is None else _within(wire, "cycles", cycles, 1, _MOST_CYCLES),
        )


def _within(wire: Wire, key: str, value: float, lowest: int, highest: int) -> int:
    if value not in range(lowest, highest + 1):
        raise Refused(
            f"wiring {wire.name}: {key} cannot be {value:g}", f"write a whole number from {lowest} to {highest}"
        )
    return int(value)
