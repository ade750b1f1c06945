"""One output of the simulated DP832: protections with a level and a switch each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import cast

from hil.simulation.faults import Faults
from hil.simulation.peers.supply_output import OutputTruth, Rating, SupplyOutput
from hil.simulation.plants.terminal import Terminal
from hil.simulation.seeds import Stream

__all__ = ["RigolOutput", "RigolRating"]

_SWITCHES = ("over_voltage_on", "over_current_level")


@dataclass(frozen=True, slots=True)
class RigolRating(Rating):
    """What an output can give, and the most that its settings take [V, A].

    Attributes:
        set_volts: the highest voltage setting.
        set_amperes: the highest current setting.
        protection_volts: the highest over-voltage level, and the one after a reset.
        protection_amperes: the highest over-current level, and the one after a reset.
    """

    set_volts: float
    set_amperes: float
    protection_volts: float
    protection_amperes: float

    @property
    def most_volts(self) -> float:
        """The highest voltage that can be set."""
        return self.set_volts

    @property
    def most_amperes(self) -> float:
        """The highest current that can be set."""
        return self.set_amperes

    @property
    def most_protection(self) -> float:
        """The highest over-voltage level that can be set."""
        return self.protection_volts


class RigolOutput(SupplyOutput):
    """One output; a protection acts only while it is switched on.

    Args:
        number: the channel's number.
        rating: what it can give and take.
        truth: how it deviates.
        terminal: what hangs on it.
        faults: of the whole instrument.
        noise: streams of the voltage and the current reading.
    """

    def __init__(
        self,
        number: int,
        rating: RigolRating,
        *,
        truth: OutputTruth,
        terminal: Terminal,
        faults: Faults,
        noise: tuple[Stream, Stream],
    ) -> None:
        super().__init__(number, rating, truth=truth, terminal=terminal, faults=faults, noise=noise)
        self.most_over_current = rating.protection_amperes
        self.over_current_level = rating.protection_amperes
        self.over_voltage_on = False

    def reset(self, now_ns: int) -> None:
        """Return to the settings of power-on."""
        self.over_voltage_on, self.over_current_level = False, self.most_over_current
        super().reset(now_ns)

    def protect(self, now_ns: int) -> None:
        """Trip the protections that are on and due."""
        if not self.on:
            return
        if self.over_voltage_on and self._terminal.volts() > self.protection:
            self.over_voltage = True
        if self.current_protection and self._terminal.amperes() > self.over_current_level:
            self.over_current = True
        if self.over_voltage or self.over_current:
            self.switch(on=False, now_ns=now_ns)

    @property
    def watched(self) -> bool:
        """Whether a protection could trip by itself: more is given than its level."""
        return self.on and (
            (self.over_voltage_on and self._given_volts() > self.protection)
            or (self.current_protection and self._given_limit() > self.over_current_level)
        )

    @property
    def lifted(self) -> bool:
        """Whether something else brings the terminals above the level of a protection that is on."""
        return self.on and self.over_voltage_on and self._terminal.volts() > self.protection

    def listen(self, callback: Callable[[], None]) -> None:
        """Call back when something else has changed what hangs on it."""
        self._terminal.listen(callback)

    def state(self) -> Mapping[str, object]:
        """Return settings and latches as JSON values."""
        return {**super().state(), **{key: getattr(self, key) for key in _SWITCHES}}

    def restore(self, state: Mapping[str, object]) -> None:
        """Go on from what `state` returned."""
        for key in _SWITCHES:
            setattr(self, key, cast("float | bool", state[key]))
        super().restore(state)
