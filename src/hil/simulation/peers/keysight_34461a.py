"""A Keysight 34461A multimeter as its remote interface shows it: direct voltage, direct current, resistance.

Facts, from the Truevolt operating and service guide: CONFigure chooses function and range, and returns to 10 power line
cycles; INITiate begins a reading, FETCh? waits for it, READ? does both; a reading beyond 120 % of its range is
+-9.90000000E+37; FUNCtion? tells the function in quotes. From memory: zero correction doubles the time, a second
INITiate is refused with -213, FETCh? without a reading with -230. It integrates what it measures over its time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from math import copysign, inf, sqrt

from hil.analysis.noise.numbers import RandomStream
from hil.clock.port import NANOSECONDS
from hil.model.notation import AnyText, NotNegative, Number, Positive
from hil.simulation.faults import Faults, Identity
from hil.simulation.peers.manner import DeviceTruth
from hil.simulation.peers.model import PeerSetup
from hil.simulation.peers.scpi import ScpiError, number, one, switch, word
from hil.simulation.peers.scpi_instrument import instrument_of
from hil.simulation.peers.scpi_manual import Act, Channel, Manual, Row, alone
from hil.simulation.peers.supply_output import NOT_A_NUMBER, NotANumber
from hil.simulation.plants.terminal import SignalPoint
from hil.wire.checkpoint import Kept

__all__ = ["MODEL", "FrontEnd", "MeterTruth"]

_RANGES = {
    "VOLT": (0.1, 1.0, 10.0, 100.0, 1000.0),
    "CURR": (1e-4, 1e-3, 1e-2, 1e-1, 1.0, 3.0),
    "RES": (1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8),
}
_QUANTITIES = {"VOLT": "voltage", "CURR": "current", "RES": "resistance"}
_HEADERS = {"VOLT": "VOLTage[:DC]", "CURR": "CURRent[:DC]", "RES": "RESistance"}
_CYCLES = (0.02, 0.2, 1.0, 10.0, 100.0)
_OVERLOAD = 9.9e37
_OVER = 1.2
_AVERAGED = 8
_SEEN_NS = 1_900_000_000  # plants can be seen that long after
_NR3 = "{:+.8E}".format


@dataclass(frozen=True, slots=True, kw_only=True)
class TruevoltTruth(DeviceTruth):
    """One device."""

    serial: AnyText = "MY53000001"
    firmware: AnyText = "A.02.14-02.40-02.14-00.49-02-01"
    command_time: NotNegative = 2e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class MeterTruth:
    """How it deviates; gains are relative errors, and the noise [rms] is that of one power line cycle.

    Attributes:
        line_frequency: of the mains [Hz].
        resistor: what is at its terminals where no plant's resistance is [ohm].
    """

    voltage_offset: Number = 0.0
    voltage_gain: Number = 0.0
    voltage_noise: NotNegative = 2e-6
    current_offset: Number = 0.0
    current_gain: Number = 0.0
    current_noise: NotNegative = 2e-8
    resistance_offset: Number = 0.0
    resistance_gain: Number = 0.0
    resistance_noise: NotNegative = 2e-4
    line_frequency: Positive = 50.0
    resistor: Positive = inf


class FrontEnd(Channel):
    """What it measures, in which range, for how long, and the reading that is under way.

    Args:
        truth: how it deviates.
        points: what is at its terminals, by function.
        faults: of the instrument.
        noise: its random numbers.
    """

    function: Kept[str]
    cycles: Kept[dict[str, float]]
    ranges: Kept[dict[str, float]]
    automatic: Kept[dict[str, bool]]
    corrected: Kept[bool]
    _begun_ns: Kept[int]

    def __init__(
        self, truth: MeterTruth, points: Mapping[str, SignalPoint | None], faults: Faults, noise: RandomStream
    ) -> None:
        self._truth = truth
        self._deviates = {name: float(value) for name, value in asdict(truth).items()}
        self._points = points
        self._faults = faults
        self._noise = noise
        self.reset(0)

    def reset(self, now_ns: int) -> None:
        """Return to the settings of power-on."""
        del now_ns
        self.function = "VOLT"
        self.cycles, self.automatic = dict.fromkeys(_RANGES, 10.0), dict.fromkeys(_RANGES, True)
        self.ranges = {function: ends[-1] for function, ends in _RANGES.items()}
        self.corrected = True
        self._begun_ns = -1

    def takes_ns(self, line: str, now_ns: int) -> int:
        """Return how long a reading takes, or is still under way."""
        if "FETC" in line and self._begun_ns >= 0:
            return max(0, self._begun_ns + self._lasts_ns() - now_ns)
        return self._lasts_ns() if "READ" in line else 0

    def configure(self, function: str, parameters: Sequence[str], now_ns: int) -> None:
        """Choose a function, and its range."""
        del now_ns
        end = 0.0 if not parameters or parameters[0].upper() == "AUTO" else self._end(function, parameters[0])
        self.function, self.corrected, self._begun_ns = function, True, -1
        self.cycles[function], self.automatic[function] = 10.0, not end
        self.ranges[function] = end or self.ranges[function]

    def integrate(self, function: str, parameters: Sequence[str], now_ns: int) -> None:
        """Set the time of a reading in power line cycles; what lies between two is the longer one."""
        del now_ns
        bound = word(parameters[0]) if parameters else None
        asked = {"MIN": _CYCLES[0], "MAX": _CYCLES[-1], "DEF": 10.0}[bound] if bound else number(one(parameters), {})
        longer = [cycles for cycles in _CYCLES if cycles >= asked]
        if not longer or asked < _CYCLES[0]:
            raise ScpiError(-222)
        self.cycles[function] = longer[0]

    def set_range(self, function: str, parameters: Sequence[str], now_ns: int) -> None:
        """Choose a range."""
        del now_ns
        self.ranges[function], self.automatic[function] = self._end(function, one(parameters)), False

    def set_automatic(self, function: str, parameters: Sequence[str], now_ns: int) -> None:
        """Let it choose, or not."""
        del now_ns
        self.automatic[function] = switch(one(parameters))

    def begin(self, parameters: Sequence[str], now_ns: int) -> None:
        """Begin a reading."""
        del parameters
        if self._begun_ns >= 0 and now_ns < self._begun_ns + self._lasts_ns():
            raise ScpiError(-213)
        self._begun_ns = now_ns

    def fetch(self, parameters: Sequence[str], now_ns: int) -> str:
        """Return the reading that was begun last."""
        del parameters, now_ns
        if self._begun_ns < 0:
            raise ScpiError(-230)
        return self._reading(self._begun_ns)

    def read(self, parameters: Sequence[str], now_ns: int) -> str:
        """Return the reading that has just ended."""
        del parameters
        self._begun_ns = now_ns - self._lasts_ns()
        return self._reading(self._begun_ns)

    def _lasts_ns(self) -> int:
        seconds = self.cycles[self.function] / self._truth.line_frequency
        return round(seconds * NANOSECONDS * (2 if self.corrected else 1))

    def _end(self, function: str, text: str) -> float:
        """Return the end of the range that holds a number."""
        ends = _RANGES[function]
        if bound := word(text):
            return {"MIN": ends[0], "MAX": ends[-1], "DEF": ends[-1]}[bound]
        asked = number(text, {})
        holding = [end for end in ends if end >= asked * (1 - 1e-9)]
        if not holding:
            raise ScpiError(-222)
        return holding[0]

    def _reading(self, begun_ns: int) -> str:
        """Return what it shows of the first part of its time; the second one corrects its zero."""
        function = self.function
        span_ns = self._lasts_ns() // (2 if self.corrected else 1)
        if self._faults.now(NotANumber, begun_ns):
            return _NR3(NOT_A_NUMBER)
        seen = self._mean(function, begun_ns, span_ns)
        quantity = _QUANTITIES[function]
        noise = self._deviates[f"{quantity}_noise"] / sqrt(self.cycles[function])
        value = seen * (1 + self._deviates[f"{quantity}_gain"]) + self._deviates[f"{quantity}_offset"]
        value += noise * self._noise.normal(begun_ns // 1000)
        ends = _RANGES[function]
        if self.automatic[function]:
            self.ranges[function] = next((end for end in ends if abs(value) <= _OVER * end), ends[-1])
        return _NR3(value if abs(value) <= _OVER * self.ranges[function] else copysign(_OVERLOAD, value))

    def _mean(self, function: str, begun_ns: int, span_ns: int) -> float:
        point = self._points[function]
        if point is None:
            return self._truth.resistor if function == "RES" else 0.0
        first_ns = max(begun_ns, begun_ns + 2 * span_ns - _SEEN_NS)
        step_ns = max(0, begun_ns + span_ns - first_ns) // _AVERAGED
        return sum(point.observe_at(first_ns + place * step_ns) for place in range(1, _AVERAGED + 1)) / _AVERAGED


def _rows(function: str, header: str) -> tuple[Row, ...]:
    """Return the headers of one function."""

    def of(action: Callable[[FrontEnd, str, Sequence[str], int], None]) -> Callable[..., None]:
        return lambda meter, parameters, now_ns: action(meter, function, parameters, now_ns)

    sense = f"[SENSe:]{header}"
    return (
        Act(f"CONFigure:{header}", of(FrontEnd.configure)),
        Act(f"{sense}:NPLCycles", of(FrontEnd.integrate)),
        Act(f"{sense}:NPLCycles", alone(lambda meter: _NR3(meter.cycles[function])), asked=True),
        Act(f"{sense}:RANGe[:UPPer]", of(FrontEnd.set_range)),
        Act(f"{sense}:RANGe[:UPPer]", alone(lambda meter: _NR3(meter.ranges[function])), asked=True),
        Act(f"{sense}:RANGe:AUTO", of(FrontEnd.set_automatic)),
        Act(f"{sense}:RANGe:AUTO", alone(lambda meter: str(int(meter.automatic[function]))), asked=True),
    )


_MANUAL = Manual(
    identity="Keysight Technologies,34461A,{serial},{firmware}",
    truth=TruevoltTruth,
    rows=(
        *(row for function, header in _HEADERS.items() for row in _rows(function, header)),
        Act("[SENSe:]FUNCtion[:ON]", alone(lambda meter: f'"{meter.function}"'), asked=True),
        Act("INITiate[:IMMediate]", FrontEnd.begin),
        Act("FETCh", FrontEnd.fetch, asked=True),
        Act("READ", FrontEnd.read, asked=True),
    ),
    answers={"*OPC": "1", "*TST": "+0", "SYSTem:VERSion": "1994.0"},
    ignored=("*OPC", "*WAI", "ABORt", "SYSTem:LOCal", "SYSTem:REMote"),
    error_form='{:+d},"{}"',
    faults=(Identity, NotANumber),
)


def _front_end(setup: PeerSetup, article: Mapping[str, object]) -> dict[int, Channel]:
    """Return the front end; terminals `voltage`, `current` and `resistance` go to plant signals."""
    del article
    points = {function: setup.connections.signal(name) for function, name in _QUANTITIES.items()}
    return {1: FrontEnd(setup.truth.part(MeterTruth), points, setup.faults, setup.stream("noise"))}


MODEL = instrument_of(_MANUAL, _front_end)
"""The model for the driver `keysight-34461a`."""
