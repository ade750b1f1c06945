"""A Keysight 33522B function generator as its remote interface shows it: two outputs, one shape each.

From memory, to be checked on the first article: the headers below; amplitudes peak to peak; at most 10 V peak into
50 ohm, twice that into a high impedance; that amplitude and offset together must stay within that (-221); that a
change of shape keeps the phase, and switching on begins at phase zero.

A terminal `1` or `2` goes to the input `drive` of a `signal-node`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from hil.model.notation import AnyText, NotNegative, Number
from hil.simulation.faults import Faults, Identity
from hil.simulation.peers.manner import DeviceTruth
from hil.simulation.peers.model import PeerSetup
from hil.simulation.peers.scpi import ScpiError, none, one, value
from hil.simulation.peers.scpi_instrument import instrument_of
from hil.simulation.peers.scpi_manual import Act, Channel, Manual, Switch, Word
from hil.simulation.peers.supply_output import RefuseOff
from hil.simulation.plants.signal_node import driven
from hil.simulation.plants.terminal import InputPoint
from hil.wire.checkpoint import Kept

__all__ = ["MODEL", "GeneratorOutput", "GeneratorTruth"]

_INFINITY = 9.9e37
_MOST_VOLTS, _MATCHED = 5.0, 50.0
_NR3 = "{:+.15E}".format


@dataclass(frozen=True, slots=True, kw_only=True)
class GeneratorTruth(DeviceTruth):
    """One device, and the relative error of what it gives."""

    serial: AnyText = "MY57800001"
    firmware: AnyText = "5.03-3.15-2.00-58-00"
    command_time: NotNegative = 2e-3
    gain: Number = 0.0


class GeneratorOutput(Channel):
    """One output; its faults are those of its `number`."""

    on: Kept[bool]
    stuck_on: Kept[bool]
    settings: Kept[dict[str, float]]
    waveform: Kept[str]
    since_ns: Kept[int]

    def __init__(self, number: int, point: InputPoint | None, gain: float, faults: Faults) -> None:
        self._number, self._point, self._gain, self._faults = number, point, 1 + gain, faults
        self.reset(0)

    def reset(self, now_ns: int) -> None:
        """Return to the settings of power-on."""
        self.on, self.stuck_on, self.waveform, self.since_ns = False, False, "SIN", now_ns
        self.settings = {"frequency": 1000.0, "amplitude": 0.1, "offset": 0.0, "load": _MATCHED}
        self.apply()

    def change(self, name: str, number: float) -> None:
        """Take a setting, if amplitude and offset stay within what it can give."""
        self._become({**self.settings, name: number}, self.waveform)

    @property
    def shape(self) -> str:
        """The shape, by its short word."""
        return self.waveform

    @shape.setter
    def shape(self, word: str) -> None:
        self._become(self.settings, word)

    def _become(self, settings: dict[str, float], waveform: str) -> None:
        most = _MOST_VOLTS * (2 if settings["load"] > _MATCHED else 1)
        swing = 0.0 if waveform == "DC" else settings["amplitude"] / 2
        if abs(settings["offset"]) + swing > most * (1 + 1e-9):
            raise ScpiError(-221)
        self.settings, self.waveform = settings, waveform
        self.apply()

    def switch(self, on: bool, now_ns: int) -> None:
        """Switch it; phase zero is when it comes on. The fault `refuse-off` keeps it on whatever it says."""
        giving = self.on or self.stuck_on
        refused = self._faults.now(RefuseOff, now_ns, self._number) if giving and not on else None
        if on and not giving:
            self.since_ns = now_ns
        self.on = on or (refused is not None and refused.says == "on")
        self.stuck_on = refused is not None and not self.on
        self.apply()

    def apply(self) -> None:
        """Give to the terminals what the settings say: a load that is not there gets twice what was meant for it."""
        if self._point is not None:
            its = self.settings
            gain = self._gain * (1 if its["load"] > _MATCHED else 2)
            told = driven(self.shape, its["frequency"], gain * its["amplitude"], gain * its["offset"], self.since_ns)
            self._point.command(told if self.on or self.stuck_on else "")


def _setting(header: str, name: str, low: float, high: float) -> tuple[Act, Act]:
    """Return the headers of a number that is taken, and asked for."""

    def take(output: GeneratorOutput, given: Sequence[str], now_ns: int) -> None:
        del now_ns
        infinite = name == "load" and one(given).upper() in {"INF", "INFINITY"}
        output.change(name, _INFINITY if infinite else value(one(given), low, high))

    def tell(output: GeneratorOutput, given: Sequence[str], now_ns: int) -> str | None:
        del now_ns
        return none(given, _NR3(output.settings[name]))

    return Act(header, take, by="number"), Act(header, tell, asked=True, by="number")


_MANUAL = Manual(
    identity="Agilent Technologies,33522B,{serial},{firmware}",
    truth=GeneratorTruth,
    rows=(
        *_setting("[SOURce<n>:]FREQuency", "frequency", 1e-6, 3e7),
        *_setting("[SOURce<n>:]VOLTage", "amplitude", 1e-3, 20),
        *_setting("[SOURce<n>:]VOLTage:OFFSet", "offset", -10, 10),
        *_setting("OUTPut<n>:LOAD", "load", 1, 1e4),
        Word(
            "[SOURce<n>:]FUNCtion",
            "shape",
            words={"SINusoid": "SIN", "SQUare": "SQU", "RAMP": "RAMP", "DC": "DC"},
            by="number",
        ),
        Switch("OUTPut<n>[:STATe]", "on", by="number"),
    ),
    error_form='{:+d},"{}"',
    faults=(Identity, RefuseOff),
)


def _outputs(setup: PeerSetup, article: Mapping[str, object]) -> dict[int, Channel]:
    """Return the outputs; terminals `1` and `2` go to inputs of plants."""
    gain = float(str(article["gain"]))
    return {
        number: GeneratorOutput(number, setup.connections.input(f"{number}"), gain, setup.faults) for number in (1, 2)
    }


MODEL = instrument_of(_MANUAL, _outputs)
"""The model for the driver `keysight-33500`."""
