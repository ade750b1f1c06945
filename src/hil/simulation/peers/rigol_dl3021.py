"""A Rigol DL3021 electronic load as its remote interface shows it: one input, four modes.

Facts, from the programming guide of the DL3000 series: `[:SOURce]:FUNCtion` takes CURRent, RESistance, VOLTage or POWer
and is told as CC, CR, CV or CP; `[:SOURce]:INPut[:STATe]` is told as 0 or 1; 150 V, 40 A and 200 W; a level beyond the
chosen range is refused; public programs ask it line by line without a pause. From memory: the ends of the ranges.
Assumed: beyond 200 W the protection switches off.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from hil.analysis.noise.numbers import RandomStream
from hil.model.notation import AnyText, NotNegative, Number
from hil.simulation.faults import Fault, Faults, Identity
from hil.simulation.peers.manner import DeviceTruth
from hil.simulation.peers.model import PeerSetup
from hil.simulation.peers.scpi_instrument import instrument_of
from hil.simulation.peers.scpi_manual import Channel, Manual, Reading, Row, Setting, Switch, Word
from hil.simulation.peers.supply_output import NOT_A_NUMBER, NotANumber, RefuseOff
from hil.simulation.plants.terminal import LoadTerminal
from hil.wire.checkpoint import Kept

__all__ = ["MODEL", "LoadInput", "LoadTruth"]

_MODES = {"CC": "current", "CR": "resistance", "CP": "power", "CV": "voltage"}
_WATTS = 200.0
_OVER = 1.05
_READING_NS = 1_000_000
_LEAST_AMPERES = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class RigolLoadTruth(DeviceTruth):
    """One device."""

    serial: AnyText = "DL3A000000001"
    firmware: AnyText = "00.01.05.00.01"
    command_time: NotNegative = 5e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadTruth:
    """How the input deviates from its settings and readings; gains are relative errors.

    Attributes:
        level_gain: of what it keeps constant against what is set.
        voltage_offset: [V], the gain, and the noise [V rms] of the reading.
        current_offset: [A], the gain, and the noise [A rms] of the reading.
    """

    level_gain: Number = 0.0
    voltage_offset: Number = 0.0
    voltage_gain: Number = 0.0
    voltage_noise: NotNegative = 2e-4
    current_offset: Number = 0.0
    current_gain: Number = 0.0
    current_noise: NotNegative = 2e-5


class LoadInput(Channel):
    """The input: a mode, a level and a range of each, and whether it is on.

    Args:
        truth: how it deviates.
        terminal: what it draws from.
        faults: of the instrument.
        noise: streams of the voltage and the current reading.
    """

    mode: Kept[str]
    current: Kept[float]
    resistance: Kept[float]
    power: Kept[float]
    voltage: Kept[float]
    current_range: Kept[float]
    resistance_range: Kept[float]
    voltage_range: Kept[float]
    on: Kept[bool]
    stuck_on: Kept[bool]

    def __init__(
        self, truth: LoadTruth, terminal: LoadTerminal, faults: Faults, noise: tuple[RandomStream, RandomStream]
    ) -> None:
        self._truth = truth
        self._terminal = terminal
        self._faults = faults
        self._noise = noise
        self.on = self.stuck_on = False
        self._set_up()

    @property
    def rating(self) -> LoadInput:
        """The bounds of its levels."""
        return self

    def reset(self, now_ns: int) -> None:
        """Return to the settings of power-on."""
        self._set_up()
        self.switch(on=False, now_ns=now_ns)

    def switch(self, on: bool, now_ns: int) -> None:
        """Switch the input; the fault `refuse-off` keeps it on whatever it says."""
        drawing = self.on or self.stuck_on
        refused = self._faults.now(RefuseOff, now_ns, 0) if drawing and not on else None
        self.on = on or (refused is not None and refused.says == "on")
        self.stuck_on = refused is not None and not self.on
        self.apply()

    def apply(self) -> None:
        """Draw what the settings say."""
        level = getattr(self, _MODES[self.mode]) * (1.0 + self._truth.level_gain)
        self._terminal.draw(self.mode if self.on or self.stuck_on else "", level)

    def protect(self, now_ns: int) -> None:
        """Follow what was just set, and switch off beyond the rated power."""
        self.apply()
        if self.on and self._terminal.volts() * self._terminal.amperes() > _WATTS * _OVER:
            self.switch(on=False, now_ns=now_ns)

    def restored(self) -> None:
        """Draw again."""
        self.apply()

    def read_volts(self, now_ns: int) -> float:
        """Return the voltage as it measures it; readings of one millisecond are equal."""
        truth, noise = self._truth, self._noise[0].normal(now_ns // _READING_NS)
        reading = self._terminal.volts() * (1 + truth.voltage_gain) + truth.voltage_offset
        return NOT_A_NUMBER if self._faults.now(NotANumber, now_ns) else reading + truth.voltage_noise * noise

    def read_amperes(self, now_ns: int) -> float:
        """Return the current as it measures it; readings of one millisecond are equal."""
        truth, noise = self._truth, self._noise[1].normal(now_ns // _READING_NS)
        reading = self._terminal.amperes() * (1 + truth.current_gain) + truth.current_offset
        return NOT_A_NUMBER if self._faults.now(NotANumber, now_ns) else reading + truth.current_noise * noise

    def read_watts(self, now_ns: int) -> float:
        """Return the product of both readings."""
        volts, amperes = self.read_volts(now_ns), self.read_amperes(now_ns)
        return NOT_A_NUMBER if NOT_A_NUMBER in {volts, amperes} else volts * amperes

    def read_ohms(self, now_ns: int) -> float:
        """Return the quotient of both readings."""
        volts, amperes = self.read_volts(now_ns), self.read_amperes(now_ns)
        known = abs(amperes) > _LEAST_AMPERES and NOT_A_NUMBER not in {volts, amperes}
        return volts / amperes if known else NOT_A_NUMBER

    def _set_up(self) -> None:
        self.mode = "CC"
        self.current, self.resistance, self.power, self.voltage = 0.0, 15000.0, 0.0, 150.0
        self.current_range, self.resistance_range, self.voltage_range = 40.0, 15000.0, 150.0


_SIX = "{:.6f}".format


def _level(word: str, quantity: str, *, ranged: bool = True) -> tuple[Row, ...]:
    """Return the headers of one mode's level, and of its range."""

    def most(load: LoadInput) -> float:
        return float(getattr(load, f"{quantity}_range")) if ranged else _WATTS

    level = Setting(f"[SOURce:]{word}[:LEVel][:IMMediate]", quantity, _SIX, most)
    if not ranged:
        return (level,)
    highest = {"current": 40.0, "resistance": 15000.0, "voltage": 150.0}[quantity]
    return level, Setting(f"[SOURce:]{word}:RANGe", f"{quantity}_range", _SIX, lambda _: highest)


_FAULTS: tuple[type[Fault], ...] = (Identity, NotANumber, RefuseOff)

_MANUAL = Manual(
    identity="RIGOL TECHNOLOGIES,DL3021,{serial},{firmware}",
    truth=RigolLoadTruth,
    rows=(
        Reading("MEASure:VOLTage[:DC]", LoadInput.read_volts, _SIX),
        Reading("MEASure:CURRent[:DC]", LoadInput.read_amperes, _SIX),
        Reading("MEASure:POWer[:DC]", LoadInput.read_watts, _SIX),
        Reading("MEASure:RESistance[:DC]", LoadInput.read_ohms, "{:.6g}".format),
        Word(
            "[SOURce:]FUNCtion",
            "mode",
            words={"CURRent": "CC", "RESistance": "CR", "POWer": "CP", "VOLTage": "CV"},
            told={mode: mode for mode in _MODES},
        ),
        *_level("CURRent", "current"),
        *_level("RESistance", "resistance"),
        *_level("VOLTage", "voltage"),
        *_level("POWer", "power", ranged=False),
        Switch("[SOURce:]INPut[:STATe]", "on"),
    ),
    answers={"*OPC": "1"},
    error_form='{:d},"{}"',
    faults=_FAULTS,
)


def _input(setup: PeerSetup, article: Mapping[str, object]) -> dict[int, Channel]:
    """Return the input; the terminal `input` goes to a plant's sink."""
    del article
    noise = (setup.stream("voltage"), setup.stream("current"))
    return {1: LoadInput(setup.truth.part(LoadTruth), setup.connections.load("input"), setup.faults, noise)}


MODEL = instrument_of(_MANUAL, _input)
"""The model for the driver `rigol-dl3021`."""
