"""What a dialect of SCPI supplies is: the commands of one family, how its replies read, and what a wire may set."""

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
    """What a wire may set of protections: nothing here, where a family has none."""

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
    """What a wire may set: the level of the over-voltage protection [V]."""

    over_voltage: Annotated[float | None, measured("V")] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class BothLevels(VoltageLevel):
    """The level of the over-current protection [A] besides, where there is one."""

    over_current: Annotated[float | None, measured("A")] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelAndFuse(VoltageLevel):
    """Whether the over-current protection is on besides, where it trips at the current limit."""

    over_current: _AtSetting = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Protection:
    """The commands of one protection; `{channel}` and `{value}` are filled in.

    Attributes:
        tripped: asks whether it has tripped.
        set_level: sets the level (V or A); empty if it has none.
        get_level: asks for it.
        arm: switches it on; empty if it is always on.
        armed: asks whether it is on.
    """

    tripped: str
    set_level: str = ""
    get_level: str = ""
    arm: str = ""
    armed: str = ""


def mode_of(*, voltage: int, current: int) -> Callable[[str, int], str]:
    """Return what reads a condition register with these bits for the two ways of regulating; both are neither."""
    modes = {voltage: "CV", current: "CC"}

    def parse(reply: str, channel: int) -> str:
        del channel
        return modes.get(as_register(reply) & (voltage | current), "unregulated")

    return parse


_AS_MODE = mode_of(voltage=1 << 1, current=1 << 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect(SwitchedSpeech):
    """One family's commands; `{channel}` and `{value}` are filled in.

    Attributes:
        channels: the outputs that the family has.
        mode: asks how the output regulates.
        over_voltage: the protection that switches off at too high a voltage, where there is one.
        over_current: the protection that switches off at too high a current, where a wire may use it.
        levels: what a wire may set of the protections.
        ratings: what each channel of a model can be set to at most [V, A]; a model that is not listed has all of
            `channels`, and only the instrument knows its ratings.
        as_armed: reads whether a protection is on.
        as_trip: reads whether a protection has tripped.
        as_mode: reads `CV`, `CC` or `unregulated` of a channel.
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
        """Return the outputs that a model has, all of the family's where it is not listed."""
        return self.channels[: len(self.ratings.get(model, self.channels))]

    @property
    def differs(self) -> bool:
        """Whether models have fewer outputs than the family."""
        return any(len(each) < len(self.channels) for each in self.ratings.values())
