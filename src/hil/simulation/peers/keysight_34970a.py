"""A Keysight 34970A as its remote interface shows it: relay multiplexers in slots 1 and 2, digital inputs in slot 3.

Facts, from the user's guide: CONFigure and ROUTe:SCAN both define the scan list; CONFigure returns a channel to 1 power
line cycle and its usual delay, and switches the fields of readings off; a scan keeps 50,000 readings, of which the
oldest give way; DATA:REMove? of more readings than there are is an error; readings are cleared by INITiate. From
memory, like at the driver: a sorted list, the time of a relay (16 ms, of a 34901A), a doubled reading for the zero
correction, 9.9E+37 of open thermocouples and of what is beyond 120 % of its range, -213 for INITiate in a scan.

A terminal `101` goes to a signal of a plant: volts, or degrees for a thermocouple. Where none goes there, the input is
shorted, and a thermocouple open. `301.0` to `302.7` are the bits of the digital bytes: above 1.4 V they are set.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import copysign, sqrt
from typing import Annotated

from hil.analysis.noise.numbers import RandomStream
from hil.clock.port import NANOSECONDS
from hil.model.notation import AnyText, NotNegative, Number, Positive, whole
from hil.simulation.faults import Fault, Identity
from hil.simulation.peers.manner import DeviceTruth
from hil.simulation.peers.model import PeerSetup
from hil.simulation.peers.scpi import ScpiError, channel_list, choice, one, switch, value
from hil.simulation.peers.scpi_instrument import instrument_of
from hil.simulation.peers.scpi_manual import Act, Channel, Manual, Row, Word, alone
from hil.simulation.peers.timing import Alarm
from hil.simulation.plants.terminal import SignalPoint
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import PeerClock

__all__ = ["MODEL", "OpenInput", "ScanUnit"]

_ANALOGUE = (*range(101, 121), *range(201, 221))
_DIGITAL = (301, 302)
_ENDS = (0.1, 1.0, 10.0, 100.0, 300.0)
_CYCLES = (0.02, 0.2, 1.0, 2.0, 10.0, 20.0, 100.0, 200.0)
_TYPES = frozenset("BEJKNRST")
_OVERLOAD, _OVER, _LOGIC = 9.9e37, 1.2, 1.4
_RELAY_S, _BYTE_S, _USUAL_DELAY_S = 0.016, 0.001, 1e-3
_MEMORY = 50_000
_NR3 = "{:+.8E}".format


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenInput(Fault):
    """The wires of an input have come off: `channel`."""

    name = "open-input"

    channel: Annotated[int, whole(0)] = 0

    def concerns(self, part: int) -> bool:
        """Return whether it is this channel."""
        return self.channel == part


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitTruth(DeviceTruth):
    """One device."""

    serial: AnyText = "MY41000001"
    firmware: AnyText = "13-2-2"
    command_time: NotNegative = 2e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class InputTruth:
    """How inputs deviate: relative error and noise [rms, of one cycle] of volts, and offset and noise of degrees."""

    gain: Number = 0.0
    noise: NotNegative = 5e-6
    thermocouple_offset: Number = 0.0
    thermocouple_noise: NotNegative = 0.02
    line_frequency: Positive = 50.0


class _Input(Stateful):
    """How one channel is set up; an end of 0 lets the instrument choose its range."""

    kind: Kept[str]
    end: Kept[float]
    cycles: Kept[float]
    delay_s: Kept[float]
    checked: Kept[bool]
    unit: Kept[str]

    def __init__(self, kind: str) -> None:
        self.become(kind, 0.0)

    def become(self, kind: str, end: float) -> None:
        """Be set up from the start."""
        self.kind, self.end, self.cycles, self.delay_s = kind, end, 1.0, _USUAL_DELAY_S
        self.checked, self.unit = False, "C"


class ScanUnit(Channel):
    """The multiplexer and its meter, the scan that is under way, and its memory.

    Args:
        truth: how it deviates.
        points: what is at its terminals.
        setup: for faults and random numbers.
    """

    inputs: Kept[dict[int, _Input]]
    scanned: Kept[tuple[int, ...]]
    fields: Kept[dict[str, bool]]
    source: Kept[str]
    timer_s: Kept[float]
    count: Kept[float]
    memory: Kept[list[tuple[float, float, int]]]
    _began_ns: Kept[int]
    _sweeps: Kept[int]
    _place: Kept[int]
    _next: Kept[Alarm]

    def __init__(self, truth: InputTruth, points: Mapping[str, SignalPoint | None], setup: PeerSetup) -> None:
        self._truth, self._points, self._faults = truth, points, setup.faults
        self._noise: RandomStream = setup.stream("noise")
        self.inputs = {place: _Input("VOLT" if place in _ANALOGUE else "DIG") for place in (*_ANALOGUE, *_DIGITAL)}
        self.scanned = ()
        self.fields = dict.fromkeys(("TIME", "CHAN", "UNIT", "ALAR"), False)
        self.source, self.timer_s, self.count = "IMM", 10.0, 1.0
        self.memory = []
        self._began_ns = self._sweeps = self._place = 0

    def attach(self, clock: PeerClock) -> None:
        """Learn the clock."""
        self._clock, self._next = clock, Alarm(clock, self._read)

    def reset(self, now_ns: int) -> None:
        """Return to the settings of power-on."""
        del now_ns
        self._next.clear()
        for place, each in self.inputs.items():
            each.become("VOLT" if place in _ANALOGUE else "DIG", 0.0)
        self.scanned, self.memory, self.source, self.timer_s, self.count = (), [], "IMM", 10.0, 1.0

    def takes_ns(self, line: str, now_ns: int) -> int:
        """Return how much of a counted scan is still to come, for a question that waits for it."""
        if "FETC" not in line or self._next.due_ns is None or self.count > 1:
            return 0
        left_ns = sum(self._lasts_ns(place) for place in self.scanned[self._place + 1 :])
        return max(0, self._next.due_ns - now_ns) + left_ns + 1

    def configure(self, kind: str, end: float, places: Sequence[int]) -> None:
        """Set channels up, and scan them."""
        self._must_rest()
        if any((place in _DIGITAL) != (kind == "DIG") for place in places):
            raise ScpiError(-224)
        for place in places:
            self.inputs[place].become(kind, end)
        self.fields = dict.fromkeys(self.fields, False)
        self.scan(places)

    def scan(self, places: Sequence[int]) -> None:
        """Scan these."""
        self._must_rest()
        self.scanned, self.memory = tuple(sorted(set(places))), []

    def begin(self) -> None:
        """Begin a scan."""
        self._must_rest()
        if not self.scanned:
            raise ScpiError(-221)
        self.memory, self._began_ns, self._sweeps, self._place = [], self._clock.now_ns(), 0, 0
        self._next.set(self._began_ns + self._lasts_ns(self.scanned[0]))

    def abort(self) -> None:
        """End it; what was read stays."""
        self._next.clear()

    def told(self, readings: Sequence[tuple[float, float, int]]) -> str:
        """Write readings with the fields that are on."""
        if not readings:
            raise ScpiError(-230)
        form = self.fields
        return ",".join(
            _NR3(value) + f",{at:014.3f}" * form["TIME"] + f",{place}" * form["CHAN"] for value, at, place in readings
        )

    def take(self, count: int) -> str:
        """Take the oldest readings out of the memory."""
        if count > len(self.memory):
            raise ScpiError(-222)
        taken, self.memory = self.memory[:count], self.memory[count:]
        return self.told(taken)

    def listed(self) -> str:
        """Return the scan list as a block."""
        text = f"(@{','.join(map(str, self.scanned))})"
        return f"#{len(str(len(text)))}{len(text)}{text}"

    def byte(self, place: int) -> int:
        """Return the bits of a digital input now."""
        points = [self._points[f"{place}.{bit}"] for bit in range(8)]
        return sum((point is not None and point.observe() > _LOGIC) << bit for bit, point in enumerate(points))

    def _must_rest(self) -> None:
        if self._next.due_ns is not None:
            raise ScpiError(-213)

    def _lasts_ns(self, place: int) -> int:
        its = self.inputs[place]
        reading_s = _RELAY_S + its.delay_s + 2 * its.cycles / self._truth.line_frequency
        return round((_BYTE_S if place in _DIGITAL else reading_s) * NANOSECONDS)

    def _read(self) -> None:
        """Keep a reading, and close the next relay, or wait for the next sweep."""
        now_ns, place = self._clock.now_ns(), self.scanned[self._place]
        at = (now_ns - self._began_ns) / NANOSECONDS
        self.memory.append((self._value(place, now_ns), at, place))
        del self.memory[:-_MEMORY]
        self._place += 1
        if self._place < len(self.scanned):
            self._next.set(now_ns + self._lasts_ns(self.scanned[self._place]))
            return
        self._place = 0
        self._sweeps += 1
        if self._sweeps >= self.count:
            return
        begins_ns = now_ns
        if self.source == "TIM":
            period_ns = round(self.timer_s * NANOSECONDS)
            begins_ns = self._began_ns + -((self._began_ns - now_ns) // period_ns) * period_ns
        self._next.set(begins_ns + self._lasts_ns(self.scanned[0]))

    def _value(self, place: int, now_ns: int) -> float:
        its, truth, point = self.inputs[place], self._truth, self._points.get(str(place))
        if place in _DIGITAL:
            return float(self.byte(place))
        noise = self._noise.normal(now_ns // 1000) / sqrt(its.cycles)
        away = self._faults.now(OpenInput, now_ns, place) is not None
        if its.kind == "TEMP":
            if (away or point is None) and its.checked:
                return _OVERLOAD
            seen = 0.0 if away or point is None else self._mean(point, its, now_ns)
            return seen + truth.thermocouple_offset + truth.thermocouple_noise * noise
        seen = 0.0 if away or point is None else self._mean(point, its, now_ns)
        value = seen * (1 + truth.gain) + truth.noise * noise
        end = its.end or _ENDS[min(bisect_right(_ENDS, abs(value) / _OVER), len(_ENDS) - 1)]
        return value if abs(value) <= _OVER * end else copysign(_OVERLOAD, value)

    def _mean(self, point: SignalPoint, its: _Input, now_ns: int) -> float:
        """Return the mean over the first half of a reading; the second one corrects its zero."""
        span_ns = min(round(its.cycles / self._truth.line_frequency * NANOSECONDS), 900_000_000)
        return sum(point.observe_at(max(0, now_ns - 2 * span_ns + span_ns * part // 4)) for part in range(5)) / 5


_Do = Callable[[ScanUnit, list[str], list[int]], str | None]


def _listed(do: _Do) -> Callable[[ScanUnit, Sequence[str], int], str | None]:
    """Return what splits the channel list off."""

    def act(unit: ScanUnit, given: Sequence[str], now_ns: int) -> str | None:
        del now_ns
        places = channel_list(given[-1]) if given else None
        if places is None:
            raise ScpiError(-109)
        if given[-1].find(":") > 0:  # what a range spans and the modules do not have is passed over
            places = [place for place in places if place in unit.inputs]
        if any(place not in unit.inputs for place in places):
            raise ScpiError(-224)
        return do(unit, list(given[:-1]), places)

    return act


def _sets(act: Callable[[ScanUnit, str], object]) -> Callable[[ScanUnit, Sequence[str], int], None]:
    """Return what takes one parameter."""

    def do(unit: ScanUnit, given: Sequence[str], now_ns: int) -> None:
        del now_ns
        act(unit, one(given))

    return do


def _volts(unit: ScanUnit, given: list[str], places: list[int]) -> None:
    text = given[0].upper() if given else "AUTO"
    end = 0.0 if text in {"AUTO", "DEF"} else value(text, _ENDS[0], _ENDS[-1])
    unit.configure("VOLT", next(each for each in _ENDS if each >= end) if end else 0.0, places)


def _degrees(unit: ScanUnit, given: list[str], places: list[int]) -> None:
    if len(given) < 2 or given[0].upper() not in {"TC", "TCOUPLE"} or given[1].upper() not in _TYPES:
        raise ScpiError(-224)
    unit.configure("TEMP", 0.0, places)


def _of_inputs(name: str, kinds: str, read: Callable[[str], object]) -> _Do:
    """Return what sets an attribute of channels of these kinds."""

    def do(unit: ScanUnit, given: list[str], places: list[int]) -> None:
        found = read(one(given))
        if any(unit.inputs[place].kind not in kinds for place in places):
            raise ScpiError(-221)
        for place in places:
            setattr(unit.inputs[place], name, found)

    return do


def _cycles(text: str) -> float:
    asked = value(text, _CYCLES[0], _CYCLES[-1])
    return next(each for each in _CYCLES if each >= asked)


def _field(header: str) -> Row:
    name = header[:4].upper()
    return Act(f"FORMat:READing:{header}", _sets(lambda unit, text: unit.fields.update({name: switch(text)})))


def _set(name: str, read: Callable[[str], object]) -> Callable[..., None]:
    return _sets(lambda unit, text: setattr(unit, name, read(text)))


def _times(text: str) -> float:
    return _OVERLOAD if text.upper() in {"INF", "INFINITY"} else float(int(value(text, 1, _MEMORY)))


_CHECK = "[SENSe:]TEMPerature:TRANsducer:TCouple:CHECk"
_BYTES = "[SENSe:]DIGital:DATA[:BYTE]"
_MANUAL = Manual(
    identity="Agilent Technologies,34970A,{serial},{firmware}",
    truth=UnitTruth,
    rows=(
        Act("CONFigure:VOLTage[:DC]", _listed(_volts)),
        Act("CONFigure:TEMPerature", _listed(_degrees)),
        Act("CONFigure:DIGital:BYTE", _listed(lambda unit, _, places: unit.configure("DIG", 0.0, places))),
        Act("[SENSe:]VOLTage[:DC]:NPLCycles", _listed(_of_inputs("cycles", "VOLT", _cycles))),
        Act("[SENSe:]TEMPerature:NPLCycles", _listed(_of_inputs("cycles", "TEMP", _cycles))),
        Act(_CHECK, _listed(_of_inputs("checked", "TEMP", switch))),
        Act("UNIT:TEMPerature", _listed(_of_inputs("unit", "TEMP", lambda text: choice(text, "C")))),
        Act("ROUTe:CHANnel:DELay", _listed(_of_inputs("delay_s", "VOLT TEMP", lambda text: value(text, 0, 60)))),
        Act("ROUTe:SCAN", _listed(lambda unit, _, places: unit.scan(places))),
        Act("ROUTe:SCAN", alone(lambda unit: unit.listed()), asked=True),
        *(_field(header) for header in ("TIME", "CHANnel", "UNIT", "ALARm")),
        Act("FORMat:READing:TIME:TYPE", _sets(lambda _, text: choice(text, "RELative"))),
        Word("TRIGger:SOURce", "source", {"IMMediate": "IMM", "TIMer": "TIM"}),
        Act("TRIGger:TIMer", _set("timer_s", lambda text: round(value(text, 0, 359_999), 3))),
        Act("TRIGger:TIMer", alone(lambda unit: _NR3(unit.timer_s)), asked=True),
        Act("TRIGger:COUNt", _set("count", _times)),
        Act("INITiate[:IMMediate]", alone(lambda unit: unit.begin())),
        Act("ABORt", alone(lambda unit: unit.abort())),
        Act("FETCh", alone(lambda unit: unit.told(unit.memory)), asked=True),
        Act("DATA:POINts", alone(lambda unit: f"+{len(unit.memory)}"), asked=True),
        Act("DATA:REMove", lambda unit, given, _: unit.take(int(value(one(given), 1, _MEMORY))), asked=True),
        Act(_BYTES, _listed(lambda unit, _, places: ",".join(f"{unit.byte(each):+d}" for each in places)), asked=True),
    ),
    answers={"*OPC": "1", "*TST": "+0", "SYSTem:VERSion": "1994.0"},
    ignored=("*OPC", "*WAI", "SYSTem:LOCal", "SYSTem:REMote"),
    error_form='{:+d},"{}"',
    faults=(Identity, OpenInput),
)


def _unit(setup: PeerSetup, article: Mapping[str, object]) -> dict[int, Channel]:
    """Return the scanner; its terminals are channels, and bits of the digital ones."""
    del article
    terminals = [*map(str, _ANALOGUE), *(f"{place}.{bit}" for place in _DIGITAL for bit in range(8))]
    points = {name: setup.connections.signal(name) for name in terminals}
    return {1: ScanUnit(setup.truth.part(InputTruth), points, setup)}


MODEL = instrument_of(_MANUAL, _unit)
"""The model for the driver `keysight-34970a`."""
