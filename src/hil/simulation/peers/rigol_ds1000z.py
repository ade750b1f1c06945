"""A Rigol DS1054Z oscilloscope as its remote interface shows it: four inputs, a memory, one trigger.

Facts, from the DS1000Z programming guide: the headers below, the ten fields of the preamble with the guide's example
`0,2,600,2,0.000000,-0.000006,0,0.008000,50,127`, the block header `#9` with nine digits, at most 250,000 bytes a read,
an interval of a hundredth of a division in NORM and of one sample in RAW. Assumed, because the guide does not say it or
it is from memory: a screen of 12 by 8 divisions, 25 counts per division around 127, a memory that the inputs share that
are on, set only while it runs and read only while it stands; that the time before the trigger is filled before a
trigger counts; that STOP is still reported for 20 ms after `:SING`; and that noise does not trigger.

A terminal `1` to `4` goes to a signal of a plant. What happens between two grid points is seen: see `Plant.waveform`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from hil.analysis.noise.numbers import RandomStream
from hil.clock.port import NANOSECONDS
from hil.model.notation import AnyText, NotNegative, Number, Positive
from hil.simulation.faults import Fault, Faults, Identity
from hil.simulation.peers.manner import DeviceTruth
from hil.simulation.peers.model import PeerSetup
from hil.simulation.peers.scpi import ScpiError, one, value
from hil.simulation.peers.scpi_instrument import instrument_of
from hil.simulation.peers.scpi_manual import Act, Channel, Manual, Reading, Setting, Switch, Word, alone
from hil.simulation.peers.timing import Alarm
from hil.simulation.plants.terminal import SignalPoint
from hil.wire.checkpoint import Kept
from hil.wire.peer import PeerClock

__all__ = ["MODEL", "Deaf", "InputTruth", "Scope", "ScopeTruth"]

_ACROSS, _COUNTS, _MIDDLE, _HIGHEST = 12, 25, 127, 255
_NUMBERS = (1, 2, 3, 4)
_PROBES = (0.01, 1000.0)
_MOST_PER_READ = 250_000
_DEPTHS = (12_000, 120_000, 1_200_000)
_FASTEST = 1e9
_SLOWEST_TRIGGERED = 0.1
_SCAN_NS = 5_000_000
_STALE_NS = 20_000_000
_HALVINGS = 40


@dataclass(frozen=True, slots=True, kw_only=True)
class Deaf(Fault):
    """Its trigger does not come, whatever the signal does."""

    name = "deaf"


@dataclass(frozen=True, slots=True, kw_only=True)
class ScopeTruth(DeviceTruth):
    """One device."""

    serial: AnyText = "DS1ZA000000001"
    firmware: AnyText = "00.04.04.SP4"
    command_time: NotNegative = 2e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class InputTruth:
    """One input: the true factor of its probe, relative error, offset and rms noise in divisions."""

    probe: Positive = 1.0
    gain: Number = 0.0
    offset: Number = 0.0
    noise: NotNegative = 0.02


class _Input(Channel):
    """One input: its settings, and what was captured."""

    shown: Kept[bool]
    unit: Kept[str]
    probe: Kept[float]
    coupling: Kept[str]
    scale: Kept[float]
    offset: Kept[float]
    memory: Kept[bytes]

    def __init__(self, point: SignalPoint | None, truth: InputTruth, noise: RandomStream) -> None:
        self.point, self.truth, self._noise = point, truth, noise
        self.reset(0)

    def reset(self, now_ns: int) -> None:
        """Return to the settings of power-on."""
        del now_ns
        self.shown, self.unit, self.probe, self.coupling = False, "VOLT", 10.0, "DC"
        self.scale, self.offset, self.memory = 10.0, 0.0, b""

    @property
    def rating(self) -> _Input:
        """The bounds of its settings."""
        return self

    def take(self, name: str, least: float, found: float) -> None:
        """Take a setting that is at least so much for each unit of its probe's factor."""
        if found < least * self.probe:
            raise ScpiError(-222)
        setattr(self, name, found)

    @property
    def step(self) -> float:
        """Volts or amperes per count."""
        return self.scale / _COUNTS

    @property
    def origin(self) -> int:
        """Counts of the offset."""
        return round(self.offset / self.step)

    def seen(self, times_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return what it shows of the signal: a probe of another factor than it is told falsifies it."""
        physical = np.zeros(times_ns.size) if self.point is None else self.point.waveform(times_ns)
        shown = physical / self.truth.probe * self.probe * (1 + self.truth.gain) + self.truth.offset * self.scale
        if self.coupling == "AC":
            return np.asarray(shown - shown.mean())
        return np.zeros(times_ns.size) if self.coupling == "GND" else np.asarray(shown)

    def convert(self, times_ns: NDArray[np.int64], number: int) -> bytes:
        """Return the bytes of these samples, with noise that belongs to this capture."""
        noise = self.truth.noise * _COUNTS * self._noise.normal_block(number, times_ns.size)
        counts = np.rint(self.seen(times_ns) / self.step + self.origin + _MIDDLE + noise)
        return np.clip(counts, 0, _HIGHEST).astype(np.uint8).tobytes()


class Scope(Channel):
    """What is common to its inputs: time base, trigger, memory, and which part of that is read.

    Args:
        faults: of the instrument.
        inputs: by number.
    """

    form, kind, base, edge = "BYTE", "NORM", "MAIN", "EDGE"  # it knows no others here

    doing: Kept[str]
    source: Kept[str]
    slope: Kept[str]
    of: Kept[str]
    mode: Kept[str]
    scale: Kept[float]
    position: Kept[float]
    depth: Kept[float]
    level: Kept[float]
    first: Kept[float]
    last: Kept[float]
    origin: Kept[float]
    _armed_ns: Kept[int]
    _scanned_ns: Kept[int]
    _trigger_ns: Kept[int | None]
    _interval: Kept[float]
    _scan: Kept[Alarm]
    _finish: Kept[Alarm]

    def __init__(self, faults: Faults, inputs: Mapping[int, _Input]) -> None:
        self._faults, self._inputs = faults, inputs
        self._set_up()

    def attach(self, clock: PeerClock) -> None:
        """Learn the clock."""
        self._clock, self._scan, self._finish = clock, Alarm(clock, self._look), Alarm(clock, self._capture)

    def reset(self, now_ns: int) -> None:
        """Return to the settings of power-on."""
        del now_ns
        self._halt()
        self._set_up()

    def _set_up(self) -> None:
        self.doing, self.source, self.slope, self.of, self.mode = "RUN", "1", "POS", "1", "NORM"
        self.scale, self.position, self.depth, self.level, self.origin = 1e-6, 0.0, 0.0, 0.0, 0.0
        self.first, self.last = 1.0, 1200.0
        self._armed_ns = self._scanned_ns = 0
        self._trigger_ns = None
        self._interval = 0.0

    def set_depth(self, text: str) -> None:
        """Choose the memory of each input."""
        if self.doing == "STOP":
            raise ScpiError(-221)
        depth = 0.0 if text.upper() == "AUTO" else value(text, 1, _DEPTHS[-1])
        if depth and depth * self._shared() not in _DEPTHS:
            raise ScpiError(-222)
        self.depth = depth

    def rate(self) -> float:
        """Return the sample rate [Hz]."""
        return 1 / self._sampling()[0]

    def _shared(self) -> int:
        shown = sum(each.shown for each in self._inputs.values())
        return {0: 1, 1: 1, 2: 2}.get(shown, 4)

    def _sampling(self) -> tuple[float, int]:
        """Return the sample interval [s] and the points of the memory: all of the screen, as fast as it can."""
        span, shared = _ACROSS * self.scale, self._shared()
        depth = self.depth or _DEPTHS[0] / shared
        interval = max(span / depth, shared / _FASTEST)
        return interval, int(depth)

    def run(self) -> None:
        """Sample on and on."""
        self._halt()
        self.doing = "RUN"

    def stop(self) -> None:
        """Stop sampling."""
        self._halt()
        self.doing = "STOP"

    def _halt(self) -> None:
        self._scan.clear()
        self._finish.clear()
        self._trigger_ns = None

    def arm(self) -> None:
        """Wait for one trigger."""
        self._halt()
        now_ns = self._clock.now_ns()
        self.doing = "SING"
        self._interval, points = self._sampling()
        before = points * self._interval / 2 - self.position
        self._armed_ns = now_ns
        self._scanned_ns = now_ns + max(_STALE_NS, round(max(0.0, before) * NANOSECONDS))
        if self.scale <= _SLOWEST_TRIGGERED:
            self._scan.set(self._scanned_ns + _SCAN_NS)

    def status(self) -> str:
        """Return what it does, by its word."""
        now_ns, state = self._clock.now_ns(), self.doing
        if state != "SING":
            return "AUTO" if state == "RUN" else state
        if now_ns < self._armed_ns + _STALE_NS:
            return "STOP"
        if self._trigger_ns is not None:
            return "TD"
        return "RUN" if now_ns < self._scanned_ns or not self._scan.due_ns else "WAIT"

    def _look(self) -> None:
        """Look for the trigger in what happened since the last look."""
        now_ns = self._clock.now_ns()
        found = None if self._faults.now(Deaf, now_ns) else self._crossing(self._scanned_ns, now_ns)
        if found is None:
            self._scanned_ns = now_ns
            self._scan.set(now_ns + _SCAN_NS)
            return
        self._trigger_ns = found
        after = _ACROSS * self.scale / 2 + self.position
        self._finish.set(max(now_ns, found + round(max(0.0, after) * NANOSECONDS) + 1))

    def _crossing(self, first_ns: int, last_ns: int) -> int | None:
        """Return the first instant after a crossing of the level, None if there is none."""
        its = self._inputs[int(self.source)]
        if its.point is None:
            return None
        sign = 1.0 if self.slope == "POS" else -1.0
        level = self.level

        def above(times_ns: Sequence[int] | NDArray[np.int64]) -> NDArray[np.bool_]:
            return np.asarray(sign * (its.seen(np.asarray(times_ns, dtype=np.int64)) - level) >= 0)

        times = its.point.shape_ns(first_ns, last_ns)
        flags = above(times)
        edges = np.flatnonzero(~flags[:-1] & flags[1:])
        if not edges.size:
            return None
        low, high = int(times[edges[0]]), int(times[edges[0] + 1])
        for _ in range(_HALVINGS):
            if high - low <= 1:
                break
            middle = (low + high) // 2
            low, high = (low, middle) if above([middle])[0] else (middle, high)
        return high

    def _capture(self) -> None:
        """Fill the memory with what the signals were around the trigger."""
        trigger_ns = self._trigger_ns or 0
        _, points = self._sampling()
        start = trigger_ns + (self.position - points * self._interval / 2) * NANOSECONDS
        times = np.rint(start + np.arange(points) * self._interval * NANOSECONDS).astype(np.int64)
        for its in self._inputs.values():
            its.memory = its.convert(np.maximum(times, 0), trigger_ns) if its.shown else b""
        self.origin = (start - trigger_ns) / NANOSECONDS
        self.doing, self._trigger_ns = "STOP", None

    def preamble(self) -> str:
        """Return what turns bytes into seconds and volts."""
        its = self._inputs[int(self.of)]
        if self.mode == "RAW":
            kind, points, interval = 2, len(its.memory), self._interval
        else:
            kind, points, interval = 0, 100 * _ACROSS, self.scale / 100
        origin = self.origin
        return f"0,{kind},{points},1,{interval:.6e},{origin:.6e},0,{its.step:.6e},{its.origin},{_MIDDLE}"

    def data(self) -> bytes:
        """Return points of the memory as a block."""
        its = self._inputs[int(self.of)]
        if self.mode == "RAW" and self.doing != "STOP":
            raise ScpiError(-221)
        first, last = int(self.first), int(self.last)
        memory = its.memory
        if self.mode != "RAW" and memory:
            places = np.linspace(0, len(memory) - 1, 100 * _ACROSS).astype(int)
            memory = np.frombuffer(memory, np.uint8)[places].tobytes()
        if not 1 <= first <= last <= len(memory) or last - first >= _MOST_PER_READ:
            raise ScpiError(-222)
        data = memory[first - 1 : last]
        return b"#9%09d" % len(data) + data


def _of_input(header: str, name: str, low: float, high: float) -> Setting:
    """Return a number of an input, whose bounds grow with its probe's factor."""
    return Setting(
        header,
        name,
        _E6,
        lambda its: high * its.probe,
        write=lambda its, found: its.take(name, low, found),
        least=low * _PROBES[low < 0],
        by="number",
    )


_number = partial(Setting, by="instrument")
_word = partial(Word, by="instrument")
_act = partial(Act, by="instrument")
_ask = partial(Act, by="instrument", asked=True)
_E6, _E7, _WHOLE = "{:.6e}".format, "{:.7e}".format, "{:.0f}".format
_SHORT = {"VOLTage": "VOLT", "WATT": "WATT", "AMPere": "AMP", "UNKNown": "UNKN"}
_SOURCES = {f"CHANnel{number}": f"{number}" for number in _NUMBERS}
_TOLD = {f"{number}": f"CHAN{number}" for number in _NUMBERS}
_MANUAL = Manual(
    identity="RIGOL TECHNOLOGIES,DS1054Z,{serial},{firmware}",
    truth=ScopeTruth,
    rows=(
        Word("CHANnel<n>:UNITs", "unit", _SHORT, by="number"),
        Word("CHANnel<n>:COUPling", "coupling", {"AC": "AC", "DC": "DC", "GND": "GND"}, by="number"),
        Switch("CHANnel<n>:DISPlay", "shown", by="number"),
        Setting("CHANnel<n>:PROBe", "probe", "{:.2e}".format, lambda _: _PROBES[1], least=_PROBES[0], by="number"),
        _of_input("CHANnel<n>:SCALe", "scale", 1e-3, 10),
        _of_input("CHANnel<n>:OFFSet", "offset", -100, 100),
        _act("RUN", alone(Scope.run)),
        _act("STOP", alone(Scope.stop)),
        _act("SINGle", alone(Scope.arm)),
        _word("TIMebase:MODE", "base", {"MAIN": "MAIN"}),
        _number("TIMebase[:MAIN]:SCALe", "scale", _E7, lambda _: 50, least=5e-9),
        _number("TIMebase[:MAIN]:OFFSet", "position", _E7, lambda _: 1e3, least=-1e3),
        _word("ACQuire:TYPE", "kind", {"NORMal": "NORM"}),
        _act("ACQuire:MDEPth", lambda scope, given, _: scope.set_depth(one(given))),
        _ask("ACQuire:MDEPth", alone(lambda scope: f"{scope.depth:.0f}" if scope.depth else "AUTO")),
        Reading("ACQuire:SRATe", lambda scope, _: scope.rate(), _E6, by="instrument"),
        _word("TRIGger:MODE", "edge", {"EDGE": "EDGE"}),
        _word("TRIGger:EDGe:SOURce", "source", _SOURCES, _TOLD),
        _word("TRIGger:EDGe:SLOPe", "slope", {"POSitive": "POS", "NEGative": "NEG"}),
        _number("TRIGger:EDGe:LEVel", "level", _E6, lambda _: 1e4, least=-1e4),
        _ask("TRIGger:STATus", alone(Scope.status)),
        _word("WAVeform:SOURce", "of", _SOURCES, _TOLD),
        _word("WAVeform:MODE", "mode", {"NORMal": "NORM", "MAXimum": "MAX", "RAW": "RAW"}),
        _word("WAVeform:FORMat", "form", {"BYTE": "BYTE"}),
        _number("WAVeform:STARt", "first", _WHOLE, lambda _: 1.2e7, least=1),
        _number("WAVeform:STOP", "last", _WHOLE, lambda _: 1.2e7, least=1),
        _ask("WAVeform:PREamble", alone(Scope.preamble)),
        _ask("WAVeform:DATA", alone(Scope.data)),
    ),
    error_form='{:d},"{}"',
    faults=(Identity, Deaf),
)


def _channels(setup: PeerSetup, article: Mapping[str, object]) -> dict[int, Channel]:
    """Return the instrument as 0, and its inputs; terminals `1` to `4` go to signals."""
    del article
    sections = setup.truth.sections("channels")
    for number in sections.keys() - {str(each) for each in _NUMBERS}:
        setup.truth.wrong("channels", f"unknown channel '{number}'; known are 1, 2, 3, 4")
    truths: Mapping[str, InputTruth] = {number: section.part(InputTruth) for number, section in sections.items()}
    inputs = {
        number: _Input(
            setup.connections.signal(f"{number}"),
            truths.get(f"{number}", InputTruth()),
            setup.stream(f"noise {number}"),
        )
        for number in _NUMBERS
    }
    return {0: Scope(setup.faults, inputs), **inputs}


MODEL = instrument_of(_MANUAL, _channels)
"""The model for the driver `rigol-ds1000z`."""
