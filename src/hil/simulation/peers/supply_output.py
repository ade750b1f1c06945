"""One output of a simulated supply: settings, actual output and read-back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf
from typing import Annotated, Self

from hil.analysis.noise.numbers import RandomStream
from hil.model.notation import NotNegative, Number, Positive, one_of, whole
from hil.simulation.faults import Fault, Faults
from hil.simulation.peers.model import PeerSetup
from hil.simulation.peers.scpi_manual import Channel
from hil.simulation.plants.terminal import Terminal
from hil.wire.checkpoint import Kept

__all__ = [
    "NOT_A_NUMBER",
    "CoarseTruth",
    "NotANumber",
    "OutputTruth",
    "Rating",
    "RefuseOff",
    "SupplyOutput",
    "read_outputs",
]

NOT_A_NUMBER = 9.91e37
"""SCPI's word for not a number (SCPI-1999 vol. 1, 7.2.1.5)."""

_OVER_RANGE = 1.03
_PROTECTION_RANGE = 1.1
_READING_NS = 1_000_000
_EPSILON = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class RefuseOff(Fault):
    """An output stays on when switched off: `channel`, or all for 0; `says` is the state it then reports."""

    name = "refuse-off"

    channel: Annotated[int, whole(0)] = 0
    says: Annotated[str, one_of("off", "on")] = "on"

    def concerns(self, part: int) -> bool:
        """Return whether it is this channel."""
        return self.channel in {0, part}


@dataclass(frozen=True, slots=True, kw_only=True)
class NotANumber(Fault):
    """The outputs' measurements are not a number."""

    name = "not-a-number"


@dataclass(frozen=True, slots=True)
class Rating:
    """Rating of an output, and limits of its settings [V, A].

    Attributes:
        volts, amperes: what it can give.
        most_volts, most_amperes: the highest settings.
        most_protection: the highest over-voltage level, and the one after a reset.
        most_over_current: the highest over-current level, and the one after a reset. None if the over-current
            protection has no level, but trips in constant current, and the over-voltage protection no switch.
    """

    volts: float
    amperes: float
    most_volts: float
    most_amperes: float
    most_protection: float
    most_over_current: float | None = None

    @classmethod
    def programmable(cls, volts: float, amperes: float) -> Self:
        """Return that of an output that can be programmed to 103 % of what it can give, its protection to 110 %."""
        return cls(volts, amperes, volts * _OVER_RANGE, amperes * _OVER_RANGE, volts * _PROTECTION_RANGE)


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputTruth:
    """How one output deviates from its settings and readings; gains are relative errors, 0.001 is +0.1 %.

    Attributes:
        output_voltage_offset: [V], and the gain, of what is given against what is set.
        output_current_offset: [A], and the gain, of the limit against what is set.
        voltage_offset: [V], the gain, and the noise [V rms] of the reading.
        current_offset: [A], the gain, and the noise [A rms] of the reading.
        voltage_resolution: [V] of settings.
        current_resolution: [A] of settings.
        load: resistor [ohm] at an output that no plant is connected to.
    """

    output_voltage_offset: Number = 0.0
    output_voltage_gain: Number = 0.0
    output_current_offset: Number = 0.0
    output_current_gain: Number = 0.0
    voltage_offset: Number = 0.0
    voltage_gain: Number = 0.0
    voltage_noise: NotNegative = 1e-4
    current_offset: Number = 0.0
    current_gain: Number = 0.0
    current_noise: NotNegative = 1e-5
    voltage_resolution: Positive = 1e-3
    current_resolution: Positive = 1e-4
    load: Positive = inf


@dataclass(frozen=True, slots=True, kw_only=True)
class CoarseTruth(OutputTruth):
    """One output with steps of 10 mV and 1 mA."""

    voltage_resolution: Positive = 0.01
    current_resolution: Positive = 0.001


def read_outputs(
    setup: PeerSetup, ratings: Mapping[int, Rating], model: type[OutputTruth], make: type[SupplyOutput]
) -> dict[int, SupplyOutput]:
    """Make every output of a supply from its truth, its terminals and its noise.

    Args:
        setup: of the supply; its truth has the outputs' common part, and `channels` what differs.
        ratings: by number of the output, which is the name of its terminal, too.
        model: what a truth says of such an output.
        make: the class of the outputs.
    """
    truth = setup.truth
    common = truth.part(model)
    sections = truth.sections("channels")
    known = {str(number) for number in ratings}
    for number in sections.keys() - known:
        truth.wrong("channels", f"unknown channel '{number}'; known are {', '.join(sorted(known))}")
    own = {number: section.part(model) for number, section in sections.items()}
    return {
        number: make(
            number,
            rating,
            truth=(deviates := own.get(str(number), common)),
            terminal=setup.connections.port(str(number), deviates.load),
            faults=setup.faults,
            noise=(setup.stream(f"voltage{number}"), setup.stream(f"current{number}")),
        )
        for number, rating in ratings.items()
    }


class SupplyOutput(Channel):
    """One output: settings, protection, and the connected load.

    Args:
        number: the channel's number.
        rating: what it can give.
        truth: how it deviates.
        terminal: what hangs on it.
        faults: of the whole instrument.
        noise: streams of the voltage and the current reading.
    """

    volts: Kept[float]
    limit: Kept[float]
    protection: Kept[float]
    over_current_level: Kept[float | None]
    over_voltage_on: Kept[bool]
    current_protection: Kept[bool]
    on: Kept[bool]
    over_voltage: Kept[bool]
    over_current: Kept[bool]
    _stuck_on: Kept[bool]

    def __init__(
        self,
        number: int,
        rating: Rating,
        *,
        truth: OutputTruth,
        terminal: Terminal,
        faults: Faults,
        noise: tuple[RandomStream, RandomStream],
    ) -> None:
        self.number = number
        self.rating = rating
        self._truth = truth
        self._terminal = terminal
        self._faults = faults
        self._unreadable = bool(faults.of(NotANumber))
        self._noise = noise
        self.on = False
        self._stuck_on = False
        self._set_up()

    def set_volts(self, volts: float) -> None:
        """Take a voltage setting, rounded to the resolution."""
        self.volts = _rounded(volts, self._truth.voltage_resolution)
        self.apply()

    def set_limit(self, amperes: float) -> None:
        """Take a current limit, rounded to the resolution."""
        self.limit = _rounded(amperes, self._truth.current_resolution)
        self.apply()

    def switch(self, on: bool, now_ns: int) -> None:
        """Switch the output; the fault `refuse-off` keeps it on whatever it says."""
        giving = self.on or self._stuck_on
        refused = self._faults.now(RefuseOff, now_ns, self.number) if giving and not on else None
        self.on = on or (refused is not None and refused.says == "on")
        self._stuck_on = refused is not None and not self.on
        self.apply()

    def reset(self, now_ns: int) -> None:
        """Return to the settings of power-on."""
        self._set_up()
        self.switch(on=False, now_ns=now_ns)

    def _set_up(self) -> None:
        self.volts, self.limit, self.protection = 0.0, self.rating.amperes, self.rating.most_protection
        self.over_current_level = self.rating.most_over_current
        self.over_voltage_on = self.over_current_level is None
        self.current_protection = self.over_voltage = self.over_current = False

    def protect(self, now_ns: int) -> None:
        """Trip the protections that are due."""
        if not self.on:
            return
        if self.lifted:
            self.over_voltage = True
        if self.current_protection and self._gives_too_much():
            self.over_current = True
        if self.tripped:
            self.switch(on=False, now_ns=now_ns)

    def _gives_too_much(self) -> bool:
        level = self.over_current_level
        return self.mode() == "CC" if level is None else self._terminal.amperes() > level

    @property
    def tripped(self) -> bool:
        """Whether a protection has tripped and was not cleared."""
        return self.over_voltage or self.over_current

    @property
    def watched(self) -> bool:
        """Whether a protection could trip without another command: more is given than its level."""
        level = self.over_current_level
        return self.on and (
            (self.over_voltage_on and self._given_volts() > self.protection)
            or (self.current_protection and (level is None or self._given_limit() > level))
        )

    @property
    def lifted(self) -> bool:
        """Whether the terminals are above the level of an over-voltage protection that is on."""
        return self.on and self.over_voltage_on and self._terminal.volts() > self.protection

    def listen(self, callback: Callable[[], None]) -> None:
        """Call back when the connected circuit was changed by something else."""
        self._terminal.listen(callback)

    def mode(self) -> str:
        """Return `CV`, `CC` or `off`, from what the terminals show."""
        if not self.on:
            return "off"
        limiting = self._terminal.amperes() >= self._given_limit() * (1 - _EPSILON)
        return "CC" if limiting and self._terminal.volts() < self._given_volts() * (1 - _EPSILON) else "CV"

    def read_volts(self, now_ns: int) -> float:
        """Return the voltage as this instrument measures it; readings of one millisecond are equal."""
        truth = self._truth
        noise = truth.voltage_noise * self._noise[0].normal(now_ns // _READING_NS)
        reading = self._terminal.volts() * (1 + truth.voltage_gain) + truth.voltage_offset + noise
        return NOT_A_NUMBER if self._unreadable and self._faults.now(NotANumber, now_ns, self.number) else reading

    def read_amperes(self, now_ns: int) -> float:
        """Return the current as this instrument measures it; readings of one millisecond are equal."""
        truth = self._truth
        noise = truth.current_noise * self._noise[1].normal(now_ns // _READING_NS)
        reading = self._terminal.amperes() * (1 + truth.current_gain) + truth.current_offset + noise
        return NOT_A_NUMBER if self._unreadable and self._faults.now(NotANumber, now_ns, self.number) else reading

    def apply(self) -> None:
        """Apply the settings to the terminals."""
        giving = self.on or self._stuck_on
        self._terminal.drive(self._given_volts() if giving else 0.0, self._given_limit())

    def restored(self) -> None:
        """Drive a resistor again; a plant restores itself."""
        self.apply()

    def _given_volts(self) -> float:
        return max(0.0, self.volts * (1 + self._truth.output_voltage_gain) + self._truth.output_voltage_offset)

    def _given_limit(self) -> float:
        return max(0.0, self.limit * (1 + self._truth.output_current_gain) + self._truth.output_current_offset)


def _rounded(value: float, resolution: float) -> float:
    return round(value / resolution) * resolution
