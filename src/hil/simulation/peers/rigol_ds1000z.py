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

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil.clock.port import NANOSECONDS
from hil.model.notation import AnyText, NotNegative, Number, Positive
from hil.simulation.faults import Fault, Identity
from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.peers.scpi import ScpiError, choice, none, one, switch, value
from hil.simulation.peers.signal_instrument import SignalInstrument
from hil.simulation.peers.timing import Alarm
from hil.simulation.plants.terminal import SignalPoint
from hil.simulation.seeds import RandomStream
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import Line, PeerClock

__all__ = ["MODEL", "Deaf", "InputTruth", "Scope", "ScopeTruth"]

_ACROSS, _COUNTS, _MIDDLE, _HIGHEST = 12, 25, 127, 255
_MOST_PER_READ = 250_000
_DEPTHS = (12_000, 120_000, 1_200_000)
_FASTEST = 1e9
_SLOWEST_TRIGGERED = 0.1
_SCAN_NS = 5_000_000
_STALE_NS = 20_000_000
_HALVINGS = 40
_UNITS = ("VOLTage", "WATT", "AMPere", "UNKNown")


@dataclass(frozen=True, slots=True, kw_only=True)
class Deaf(Fault):
    """Its trigger does not come, whatever the signal does."""

    name = "deaf"


@dataclass(frozen=True, slots=True, kw_only=True)
class ScopeTruth:
    """One device: what it says of itself, and how long a line takes [s]."""

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


class _Input(Stateful):
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
        self.shown, self.unit, self.probe, self.coupling = False, "VOLT", 10.0, "DC"
        self.scale, self.offset, self.memory = 10.0, 0.0, b""

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


class Scope(SignalInstrument):
    """The oscilloscope.

    Args:
        identity: what `*IDN?` answers.
        command_ns: how long a line takes.
        setup: for its faults.
        inputs: by number.
    """

    error_form = '{:d},"{}"'

    _inputs: Kept[dict[int, _Input]]
    _words: Kept[dict[str, str]]
    _numbers: Kept[dict[str, float]]
    _armed_ns: Kept[int]
    _scanned_ns: Kept[int]
    _trigger_ns: Kept[int | None]
    _begins_ns: Kept[int]
    _interval: Kept[float]
    _scan: Kept[Alarm]
    _finish: Kept[Alarm]

    def __init__(self, identity: str, command_ns: int, setup: PeerSetup, inputs: dict[int, _Input]) -> None:
        super().__init__(identity, command_ns, setup.faults)
        self._inputs = inputs
        self._words = {"state": "RUN", "source": "1", "slope": "POS", "of": "1", "mode": "NORM", "form": "BYTE"}
        self._numbers = {"scale": 1e-6, "position": 0.0, "depth": 0.0, "level": 0.0, "first": 1.0, "last": 1200.0}
        self._armed_ns = self._scanned_ns = self._begins_ns = 0
        self._trigger_ns = None
        self._interval = 0.0
        self._channels()
        self._time_base()
        self._triggers()
        self._waveforms()

    def attach(self, line: Line, clock: PeerClock) -> None:
        """Connect the line."""
        super().attach(line, clock)
        self._scan, self._finish = Alarm(clock, self._look), Alarm(clock, self._capture)

    def _channels(self) -> None:
        self._of_input("UNITs", "unit", lambda text, _: choice(text, *_UNITS), str)
        self._of_input("COUPling", "coupling", lambda text, _: choice(text, "AC", "DC", "GND"), str)
        self._of_input("DISPlay", "shown", lambda text, _: switch(text), lambda on: str(int(on)))
        self._of_input("PROBe", "probe", lambda text, _: value(text, 0.01, 1000), "{:.2e}".format)
        self._of_input(
            "SCALe", "scale", lambda text, its: value(text, 1e-3 * its.probe, 10 * its.probe), "{:.6e}".format
        )
        self._of_input(
            "OFFSet", "offset", lambda text, its: value(text, -100 * its.probe, 100 * its.probe), "{:.6e}".format
        )

    def _of_input(
        self, header: str, name: str, read: Callable[[str, _Input], object], form: Callable[..., str]
    ) -> None:
        def take(number: int, given: Sequence[str]) -> None:
            found = self._input(number)
            setattr(found, name, read(one(given), found))

        self.know(f"CHANnel<n>:{header}", take)
        self.know(f"CHANnel<n>:{header}?", lambda number, given: none(given, form(getattr(self._input(number), name))))

    def _time_base(self) -> None:
        self.know("RUN", self.does(self._run))
        self.know("STOP", self.does(self._stop))
        self.know("SINGle", self.does(self._arm))
        self.know("TIMebase:MODE", lambda _, given: none([choice(one(given), "MAIN")][1:]))
        self.know("TIMebase:MODE?", lambda _, given: none(given, "MAIN"))
        self._number("TIMebase[:MAIN]:SCALe", "scale", 5e-9, 50, "{:.7e}".format)
        self._number("TIMebase[:MAIN]:OFFSet", "position", -1e3, 1e3, "{:.7e}".format)
        self.know("ACQuire:TYPE", lambda _, given: none([choice(one(given), "NORMal")][1:]))
        self.know("ACQuire:TYPE?", lambda _, given: none(given, "NORM"))
        self.know("ACQuire:MDEPth", lambda _, given: self._set_depth(one(given)))
        self.know(
            "ACQuire:MDEPth?",
            lambda _, given: none(given, f"{self._numbers['depth']:.0f}" if self._numbers["depth"] else "AUTO"),
        )
        self.know("ACQuire:SRATe?", lambda _, given: none(given, f"{1 / self._sampling()[0]:.6e}"))

    def _triggers(self) -> None:
        self.know("TRIGger:MODE", lambda _, given: none([choice(one(given), "EDGE")][1:]))
        self.know("TRIGger:MODE?", lambda _, given: none(given, "EDGE"))
        self._source("TRIGger:EDGe:SOURce", "source")
        self.know(
            "TRIGger:EDGe:SLOPe", lambda _, given: self._words.update(slope=choice(one(given), "POSitive", "NEGative"))
        )
        self.know("TRIGger:EDGe:SLOPe?", lambda _, given: none(given, self._words["slope"]))
        self._number("TRIGger:EDGe:LEVel", "level", -1e4, 1e4, "{:.6e}".format)
        self.know("TRIGger:STATus?", lambda _, given: none(given, self._state()))

    def _waveforms(self) -> None:
        self._source("WAVeform:SOURce", "of")
        self.know(
            "WAVeform:MODE", lambda _, given: self._words.update(mode=choice(one(given), "NORMal", "MAXimum", "RAW"))
        )
        self.know("WAVeform:FORMat", lambda _, given: self._words.update(form=choice(one(given), "BYTE")))
        self._number("WAVeform:STARt", "first", 1, 1.2e7, "{:.0f}".format)
        self._number("WAVeform:STOP", "last", 1, 1.2e7, "{:.0f}".format)
        self.know("WAVeform:PREamble?", lambda _, given: none(given, self._preamble()))
        self.know("WAVeform:DATA?", lambda _, given: self._data() if not given else one([]))

    def _number(self, header: str, name: str, low: float, high: float, form: Callable[[float], str]) -> None:
        self.know(header, lambda _, given: self._numbers.update({name: value(one(given), low, high)}))
        self.know(f"{header}?", lambda _, given: none(given, form(self._numbers[name])))

    def _source(self, header: str, name: str) -> None:
        words = tuple(f"CHANnel{number}" for number in self._inputs)
        self.know(header, lambda _, given: self._words.update({name: choice(one(given), *words)[-1]}))
        self.know(f"{header}?", lambda _, given: none(given, f"CHAN{self._words[name]}"))

    def _input(self, number: int) -> _Input:
        if number not in self._inputs:
            raise ScpiError(-113)
        return self._inputs[number]

    def _set_depth(self, text: str) -> None:
        if self._words["state"] == "STOP":
            raise ScpiError(-221)
        shared = self._shared()
        depth = 0.0 if text.upper() == "AUTO" else value(text, 1, _DEPTHS[-1])
        if depth and depth * shared not in _DEPTHS:
            raise ScpiError(-222)
        self._numbers["depth"] = depth

    def _shared(self) -> int:
        shown = sum(each.shown for each in self._inputs.values())
        return {0: 1, 1: 1, 2: 2}.get(shown, 4)

    def _sampling(self) -> tuple[float, int]:
        """Return the sample interval [s] and the points of the memory: all of the screen, as fast as it can."""
        span, shared = _ACROSS * self._numbers["scale"], self._shared()
        depth = self._numbers["depth"] or _DEPTHS[0] / shared
        interval = max(span / depth, shared / _FASTEST)
        return interval, int(depth)

    def _run(self) -> None:
        self._halt()
        self._words["state"] = "RUN"

    def _stop(self) -> None:
        self._halt()
        self._words["state"] = "STOP"

    def _halt(self) -> None:
        self._scan.clear()
        self._finish.clear()
        self._trigger_ns = None

    def _arm(self) -> None:
        self._halt()
        now_ns = self._clock.now_ns()
        self._words["state"] = "SING"
        self._interval, points = self._sampling()
        before = points * self._interval / 2 - self._numbers["position"]
        self._armed_ns = now_ns
        self._scanned_ns = now_ns + max(_STALE_NS, round(max(0.0, before) * NANOSECONDS))
        if self._numbers["scale"] <= _SLOWEST_TRIGGERED:
            self._scan.set(self._scanned_ns + _SCAN_NS)

    def _state(self) -> str:
        now_ns, state = self._clock.now_ns(), self._words["state"]
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
        after = _ACROSS * self._numbers["scale"] / 2 + self._numbers["position"]
        self._finish.set(max(now_ns, found + round(max(0.0, after) * NANOSECONDS) + 1))

    def _crossing(self, first_ns: int, last_ns: int) -> int | None:
        """Return the first instant after a crossing of the level, None if there is none."""
        its = self._inputs[int(self._words["source"])]
        if its.point is None:
            return None
        sign = 1.0 if self._words["slope"] == "POS" else -1.0
        level = self._numbers["level"]

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
        start = trigger_ns + (self._numbers["position"] - points * self._interval / 2) * NANOSECONDS
        times = np.rint(start + np.arange(points) * self._interval * NANOSECONDS).astype(np.int64)
        self._begins_ns = round(start)
        for its in self._inputs.values():
            its.memory = its.convert(np.maximum(times, 0), trigger_ns) if its.shown else b""
        self._numbers["origin"] = (start - trigger_ns) / NANOSECONDS
        self._words["state"], self._trigger_ns = "STOP", None

    def _preamble(self) -> str:
        its = self._input(int(self._words["of"]))
        if self._words["mode"] == "RAW":
            kind, points, interval = 2, len(its.memory), self._interval
        else:
            kind, points, interval = 0, 100 * _ACROSS, self._numbers["scale"] / 100
        origin = self._numbers.get("origin", 0.0)
        return f"0,{kind},{points},1,{interval:.6e},{origin:.6e},0,{its.step:.6e},{its.origin},{_MIDDLE}"

    def _data(self) -> bytes:
        its = self._input(int(self._words["of"]))
        if self._words["mode"] == "RAW" and self._words["state"] != "STOP":
            raise ScpiError(-221)
        first, last = int(self._numbers["first"]), int(self._numbers["last"])
        memory = its.memory
        if self._words["mode"] != "RAW" and memory:
            places = np.linspace(0, len(memory) - 1, 100 * _ACROSS).astype(int)
            memory = np.frombuffer(memory, np.uint8)[places].tobytes()
        if not 1 <= first <= last <= len(memory) or last - first >= _MOST_PER_READ:
            raise ScpiError(-222)
        data = memory[first - 1 : last]
        return b"#9%09d" % len(data) + data


def build(setup: PeerSetup) -> Scope:
    """Build the oscilloscope; its terminals are `1` to `4`."""
    truth = setup.truth.part(ScopeTruth)
    sections = setup.truth.sections("channels")
    for number in sections.keys() - {"1", "2", "3", "4"}:
        setup.truth.wrong("channels", f"unknown channel '{number}'; known are 1, 2, 3, 4")
    truths: Mapping[str, InputTruth] = {number: section.part(InputTruth) for number, section in sections.items()}
    inputs = {
        number: _Input(
            setup.connections.signal(f"{number}"),
            truths.get(f"{number}", InputTruth()),
            setup.stream(f"noise {number}"),
        )
        for number in (1, 2, 3, 4)
    }
    setup.finish()
    identity = f"RIGOL TECHNOLOGIES,DS1054Z,SIM-{truth.serial},{truth.firmware}"
    return Scope(identity, round(truth.command_time * NANOSECONDS), setup, inputs)


MODEL = PeerModel(link="serial", fault_kinds=(Identity, Deaf), build=build)
"""The model for the driver `rigol-ds1000z`."""
