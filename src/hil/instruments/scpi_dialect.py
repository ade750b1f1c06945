"""Dialect of SCPI supplies: one family's commands, reply parsers and wire settings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Annotated

from hil.instruments.scpi_instrument import SwitchedSpeech
from hil.instruments.scpi_session import as_register, as_switch
from hil.model.notation import matching, measured

__all__ = ["BothLevels", "Dialect", "LevelAndFuse", "Levels", "Protection", "VoltageLevel", "mode_of"]

_AtSetting = Annotated[
    str, matching("at setting", "'at setting' or left out: this protection has no level, it trips at the current limit")
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Levels:
    """Wire settings of a family's protections; this base has none."""

    @property
    def over_voltage(self) -> float | None:
        """The level of the over-voltage protection [V]."""
        return None

    @property
    def over_current(self) -> float | str | None:
        """The level of the over-current protection [A]."""
        return None


@dataclass(frozen=True, slots=True, kw_only=True)
class VoltageLevel(Levels):
    """Wire settings: the level of the over-voltage protection [V]."""

    over_voltage: Annotated[float | None, measured("V")] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class BothLevels(VoltageLevel):
    """Wire settings with, in addition, the level of the over-current protection [A]."""

    over_current: Annotated[float | None, measured("A")] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelAndFuse(VoltageLevel):
    """Wire settings with, in addition, a switch for an over-current protection that trips at the current limit."""

    over_current: _AtSetting = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Protection:
    """The commands of one protection; `{channel}` and `{value}` are filled in.

    Attributes:
        tripped: queries whether it has tripped.
        set_level: sets the level (V or A); empty if it has none.
        get_level: queries the level.
        arm: switches it on; empty if it is always on.
        armed: queries whether it is on.
    """

    tripped: str
    set_level: str = ""
    get_level: str = ""
    arm: str = ""
    armed: str = ""


def mode_of(*, voltage: int, current: int) -> Callable[[str, int], str]:
    """Return the parser of a condition register with these CV and CC bits; both at once mean unregulated."""
    modes = {voltage: "CV", current: "CC"}

    def parse(reply: str, channel: int) -> str:
        del channel
        return modes.get(as_register(reply) & (voltage | current), "unregulated")

    return parse


_AS_MODE = mode_of(voltage=1 << 1, current=1 << 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect(SwitchedSpeech):
    """Commands of one family; `{channel}` and `{value}` are filled in.

    Attributes:
        channels: channel numbers of the family.
        mode: queries the regulation mode.
        over_voltage: the over-voltage protection, where there is one.
        over_current: the over-current protection, where a wire may use it.
        levels: model of the wire settings of the protections.
        ratings: highest settings of each channel of a model [V, A]; a model not listed has all of `channels`, and only
            the instrument knows its ratings.
        as_armed: parses whether a protection is on.
        as_trip: parses whether a protection has tripped.
        as_mode: parses a channel's mode, `CV`, `CC` or `unregulated`.
    """

    channels: tuple[int, ...]
    set_voltage: str
    get_voltage: str
    set_current: str
    get_current: str
    measure_voltage: str
    measure_current: str
    mode: str
    over_voltage: Protection | None = None
    over_current: Protection | None = None
    levels: type[Levels] = VoltageLevel
    ratings: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    as_armed: Callable[[str], bool] = as_switch
    as_trip: Callable[[str], bool] = as_switch
    as_mode: Callable[[str, int], str] = _AS_MODE

    def channels_of(self, model: str) -> tuple[int, ...]:
        """Return a model's channel numbers, or all of the family's if it is not listed."""
        return self.channels[: len(self.ratings.get(model, self.channels))]

    @property
    def differs(self) -> bool:
        """Whether some models have fewer channels than the family."""
        return any(len(each) < len(self.channels) for each in self.ratings.values())
