"""A Keysight 33522B function generator as its remote interface shows it: two outputs, one shape each.

From memory, to be checked on the first article: the headers below; amplitudes peak to peak; at most 10 V peak into
50 ohm, twice that into a high impedance; that amplitude and offset together must stay within that (-221); that a
change of shape keeps the phase, and switching on begins at phase zero.

A terminal `1` or `2` goes to the input `drive` of a `signal-node`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hil.clock.port import NANOSECONDS
from hil.model.notation import AnyText, NotNegative, Number
from hil.simulation.faults import Identity
from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.peers.scpi import ScpiError, choice, none, one, switch, value
from hil.simulation.peers.signal_instrument import SignalInstrument
from hil.simulation.peers.supply_output import RefuseOff
from hil.simulation.plants.signal_node import driven
from hil.simulation.plants.terminal import InputPoint
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import Line, PeerClock

__all__ = ["MODEL", "Generator", "GeneratorTruth"]

_SHAPES = ("SINusoid", "SQUare", "RAMP", "DC")
_INFINITY = 9.9e37
_MOST_VOLTS, _MATCHED = 5.0, 50.0


@dataclass(frozen=True, slots=True, kw_only=True)
class GeneratorTruth:
    """One device: what it says of itself, how long a line takes [s], and the relative error of what it gives."""

    serial: AnyText = "MY57800001"
    firmware: AnyText = "5.03-3.15-2.00-58-00"
    command_time: NotNegative = 2e-3
    gain: Number = 0.0


class _Output(Stateful):
    """One output."""

    on: Kept[bool]
    shape: Kept[str]
    frequency: Kept[float]
    amplitude: Kept[float]
    offset: Kept[float]
    load: Kept[float]
    since_ns: Kept[int]

    def __init__(self, point: InputPoint | None, gain: float) -> None:
        self._point, self._gain = point, 1 + gain
        self.on, self.shape, self.frequency, self.amplitude, self.offset = False, "SIN", 1000.0, 0.1, 0.0
        self.load, self.since_ns = _MATCHED, 0

    def fits(self) -> bool:
        """Return whether amplitude and offset are within what it can give."""
        most = _MOST_VOLTS * (2 if self.load > _MATCHED else 1)
        swing = 0.0 if self.shape == "DC" else self.amplitude / 2
        return abs(self.offset) + swing <= most * (1 + 1e-9)

    def apply(self) -> None:
        """Give to the terminals what the settings say: a load that is not there gets twice what was meant for it."""
        if self._point is not None:
            gain = self._gain * (1 if self.load > _MATCHED else 2)
            told = driven(self.shape, self.frequency, gain * self.amplitude, gain * self.offset, self.since_ns)
            self._point.command(told if self.on else "")


class Generator(SignalInstrument):
    """The generator."""

    _outputs: Kept[dict[int, _Output]]

    def __init__(self, identity: str, command_ns: int, setup: PeerSetup, outputs: dict[int, _Output]) -> None:
        super().__init__(identity, command_ns, setup.faults)
        self._outputs = outputs
        self._setting("[SOURce<n>:]FREQuency", "frequency", 1e-6, 3e7)
        self._setting("[SOURce<n>:]VOLTage", "amplitude", 1e-3, 20)
        self._setting("[SOURce<n>:]VOLTage:OFFSet", "offset", -10, 10)
        self.know("[SOURce<n>:]FUNCtion", self._choose)
        self.know("[SOURce<n>:]FUNCtion?", lambda number, given: none(given, self._output(number).shape))
        self.know("OUTPut<n>:LOAD", self._load)
        self.know("OUTPut<n>:LOAD?", lambda number, given: none(given, f"{self._output(number).load:+.15E}"))
        self.know("OUTPut<n>[:STATe]", self._switch)
        self.know("OUTPut<n>[:STATe]?", lambda number, given: none(given, self._says(number)))

    def attach(self, line: Line, clock: PeerClock) -> None:
        """Connect the line; both outputs are off."""
        super().attach(line, clock)
        for output in self._outputs.values():
            output.apply()

    def _output(self, number: int) -> _Output:
        if number not in self._outputs:
            raise ScpiError(-113)
        return self._outputs[number]

    def _setting(self, header: str, name: str, low: float, high: float) -> None:
        def take(number: int, given: Sequence[str]) -> None:
            self._change(self._output(number), name, value(one(given), low, high))

        self.know(header, take)
        self.know(f"{header}?", lambda number, given: none(given, f"{getattr(self._output(number), name):+.15E}"))

    def _change(self, output: _Output, name: str, found: float | str) -> None:
        before = getattr(output, name)
        setattr(output, name, found)
        if not output.fits():
            setattr(output, name, before)
            raise ScpiError(-221)
        output.apply()

    def _choose(self, number: int, given: Sequence[str]) -> None:
        self._change(self._output(number), "shape", choice(one(given), *_SHAPES))

    def _load(self, number: int, given: Sequence[str]) -> None:
        text = one(given)
        infinite = text.upper() in {"INF", "INFINITY"}
        self._change(self._output(number), "load", _INFINITY if infinite else value(text, 1, 1e4))

    def _switch(self, number: int, given: Sequence[str]) -> None:
        output, on = self._output(number), switch(one(given))
        if not on and self._faults.now(RefuseOff, self._clock.now_ns(), number):
            return
        if on and not output.on:
            output.since_ns = self._clock.now_ns()
        output.on = on
        output.apply()

    def _says(self, number: int) -> str:
        fault = self._faults.now(RefuseOff, self._clock.now_ns(), number)
        return str(int(fault.says == "on" if fault else self._output(number).on))


def build(setup: PeerSetup) -> Generator:
    """Build the generator; its terminals are `1` and `2`."""
    truth = setup.truth.part(GeneratorTruth)
    outputs = {number: _Output(setup.connections.input(f"{number}"), truth.gain) for number in (1, 2)}
    setup.finish()
    identity = f"Agilent Technologies,33522B,SIM-{truth.serial},{truth.firmware}"
    return Generator(identity, round(truth.command_time * NANOSECONDS), setup, outputs)


MODEL = PeerModel(link="serial", fault_kinds=(Identity, RefuseOff), build=build)
"""The model for the driver `keysight-33500`."""
