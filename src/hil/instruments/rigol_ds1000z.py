"""Rigol DS1000Z series oscilloscopes, such as the DS1054Z.

Commands: DS1000Z Programming Guide. Its text and examples give the preamble's ten fields, the block header `#9` and
nine digits, volts as (byte - YORigin - YREFerence) x YINCrement, an interval of one over the sample rate in RAW mode,
and at most 250,000 bytes per read. From memory, to be checked on the first article: 25 counts per division, 12
divisions per screen, that memory can be read only while stopped, that memory depth can be set only while running and
is shared by the active channels, that the scope rolls without a trigger from 200 ms per division, and that
`:TRIG:STAT?` may still report STOP for a moment after `:SING`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, cast

from hil.instruments import settings
from hil.instruments.driver import Connection
from hil.instruments.marks import begins, drives, reads
from hil.instruments.sampled import Channel, Frame, Screen
from hil.instruments.scpi_block import BlockSession
from hil.instruments.scpi_instrument import ReadBack, ScpiInstrument, Speech
from hil.instruments.scpi_session import as_number
from hil.model.bench import Wire
from hil.model.errors import Garbled, Refused, Rejected
from hil.model.notation import AnyText, Positive, one_of

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["RigolDs1000z", "ScopeWire"]

_CHANNELS = (1, 2, 3, 4)
_DIVISIONS = 12
_COUNTS = 25  # of the converter, per division
_HIGHEST = 255
_SLOWEST = 0.1  # s per division
_DEPTHS = (12_000, 120_000, 1_200_000, 12_000_000)  # of one channel; two share it, three and four too
_BLOCK = 10_000  # points per read, far below 250,000 to keep each read short
_LOOK_S = 0.01
_ARMS_WITHIN_S = 1.0
_UNITS = {"V": "VOLT", "A": "AMP"}
_SLOPES = {"rising": "POS", "falling": "NEG"}
_STATES = {"TD": "triggered", "WAIT": "waiting", "RUN": "armed", "AUTO": "armed", "STOP": "stopped"}

_Unit = Annotated[str, one_of("V", "A")]


@dataclass(frozen=True, slots=True, kw_only=True)
class ScopeWire:
    """Wire settings of the channels: a name for each one used, its probe factor and its unit."""

    ch1: AnyText = ""
    ch2: AnyText = ""
    ch3: AnyText = ""
    ch4: AnyText = ""
    probe1: Positive = 1.0
    probe2: Positive = 1.0
    probe3: Positive = 1.0
    probe4: Positive = 1.0
    unit1: _Unit = "V"
    unit2: _Unit = "V"
    unit3: _Unit = "V"
    unit4: _Unit = "V"


@dataclass(frozen=True, slots=True)
class _Input:
    """One channel in use."""

    number: int
    name: str
    probe: float
    unit: str


@dataclass(frozen=True, slots=True)
class _Preamble:
    """Scaling of points and bytes to seconds and volts."""

    points: int
    interval: float
    first: float
    step: float
    zero: float

    def screen(self, probe: float) -> Screen:
        """Return the channel's range and resolution."""
        return Screen(probe, self.step, -self.zero * self.step, (_HIGHEST - self.zero) * self.step)


class RigolScope:
    """The oscilloscope; fills the role `oscilloscope`. Scales are rounded up to the next 1-2-5 step.

    Args:
        name: the wire's dotted name.
        device: the instrument's name.
        session: the instrument's session.
        connection: for its clock.
        inputs: the channels that are used.
    """

    def __init__(self, name: str, session: BlockSession, connection: Connection, inputs: Sequence[_Input]) -> None:
        self._name = name
        self._device = connection.device
        self._session = session
        self._settings = ReadBack(name, connection.device, session)
        self._clock = connection.clock
        self._inputs = {each.name: each for each in inputs}
        self._window: tuple[float, float] | None = None
        self._fill_s = 0.0
        self._trigger: tuple[str, float, Literal["rising", "falling"]] | None = None
        self._armed = False
        self._preambles: tuple[_Preamble, ...] = ()
        self._from = 0

    def channels(self) -> tuple[Channel, ...]:
        """Return the wired channels."""
        return tuple(Channel(each.name, each.unit) for each in self._inputs.values())

    @drives
    def vertical(self, channel: str, scale: float, offset: float = 0.0, coupling: str = "DC") -> None:
        """Set probe factor, unit, coupling, scale and the value at mid-screen; everything is read back."""
        found, step = self._input(channel), _step(scale, f"{self._name}: scale")
        if coupling not in {"DC", "AC", "GND"}:
            raise Refused(f"{self._name}: unknown coupling '{coupling}'", "it is DC, AC or GND")
        header = f":CHAN{found.number}"
        self._settings.word(f"{header}:UNIT", _UNITS[found.unit])
        self._settings.number(f"{header}:PROB", found.probe, 0.0)
        self._settings.word(f"{header}:COUP", coupling)
        self._settings.number(f"{header}:SCAL", step, 1e-3 * step)
        self._settings.number(f"{header}:OFFS", 0.0 - offset, step / _COUNTS)
        self._armed = False

    @drives
    def window(self, before: float, after: float, points: int = 6000) -> None:
        """Set time base, trigger position and memory depth, and switch on exactly the channels in use.

        Raises:
            Refused: the window exceeds the longest triggered screen, or the memory is too small.
        """
        span = before + after
        if before < 0 or after <= 0 or not math.isfinite(span):
            raise Refused(f"{self._name}: no window from -{before:g} to {after:g} s", "both are times, not below 0")
        scale = _step(span / _DIVISIONS, f"{self._name}: window")
        if scale > _SLOWEST:
            longest = f"{_SLOWEST * _DIVISIONS:g} s"
            raise Refused(
                f"{self._name}: a window of {span:g} s", f"up to {longest} are triggered; use a data acquisition"
            )
        depth = self._depth(points * scale * _DIVISIONS / span)
        self._session.setting(":RUN")
        for number in _CHANNELS:
            self._settings.switch(f":CHAN{number}:DISP", any(each.number == number for each in self._inputs.values()))
        self._settings.word(":TIM:MODE", "MAIN")
        self._settings.number(":TIM:MAIN:SCAL", scale, 1e-3 * scale)
        self._settings.number(":TIM:MAIN:OFFS", (after - before) / 2, scale / 50)
        self._settings.word(":ACQ:TYPE", "NORM")
        self._settings.number(":ACQ:MDEP", depth, 0.0)
        self._window, self._fill_s, self._armed = (before, after), scale * _DIVISIONS, False

    @drives
    def trigger(self, source: str, level: float, slope: str = "rising") -> None:
        """Set an edge trigger: source, level and slope."""
        found = self._input(source)
        if slope not in _SLOPES:
            raise Refused(f"{self._name}: unknown slope '{slope}'", "it is rising or falling")
        self._settings.word(":TRIG:MODE", "EDGE")
        self._settings.word(":TRIG:EDG:SOUR", f"CHAN{found.number}")
        self._settings.word(":TRIG:EDG:SLOP", _SLOPES[slope])
        scale = self._session.query(f":CHAN{found.number}:SCAL?", as_number)
        self._settings.number(":TRIG:EDG:LEV", level, scale / _COUNTS)
        self._trigger = (source, level, cast("Literal['rising', 'falling']", slope))
        self._armed = False

    @begins
    def arm(self) -> None:
        """Arm for a single trigger, and return once the instrument is waiting for it.

        Raises:
            Refused: window or trigger is not set.
            Rejected: the instrument is not waiting: it did not arm, or has already triggered.
        """
        if self._window is None or self._trigger is None:
            raise Refused(
                f"{self._name}: neither window nor trigger may be left unset", "call window and trigger first"
            )
        self._session.setting(":SING")
        end_s = self._clock.now() + self._fill_s + _ARMS_WITHIN_S
        while (state := self.status()) not in {"waiting", "triggered"}:
            if self._clock.now() >= end_s:
                raise Rejected(
                    self._device,
                    f"{self._name} was armed and is {state}, instead of waiting for its trigger",
                    "compare level and slope with the signal before the trigger: it may have triggered at once",
                )
            self._clock.sleep(_LOOK_S)
        self._armed = True

    @drives
    def halt(self) -> None:
        """Stop waiting."""
        self._session.setting(":STOP")
        self._armed = False

    @reads
    def status(self) -> str:
        """Return `armed`, `waiting`, `triggered` or `stopped`."""
        return self._session.query(":TRIG:STAT?", _as_state)

    def complete(self) -> bool:
        """Return whether the scope has triggered and stopped.

        Raises:
            Refused: it has not been armed since it was last configured or read.
        """
        if not self._armed:
            raise Refused(f"{self._name} is not armed", "call arm() before what it is to capture")
        return self.status() == "stopped"

    def frame(self) -> Frame:
        """Read the preamble of every channel, which describes the capture."""
        if self._window is None or self._trigger is None:
            raise Refused(f"{self._name} is not armed", "call window, trigger and arm first")
        self._armed = False
        self._session.setting(":WAV:MODE RAW")
        self._session.setting(":WAV:FORM BYTE")
        self._preambles = tuple(self._preamble(each) for each in self._inputs.values())
        common = self._preambles[0]
        if any((each.points, each.interval, each.first) != (common.points, common.interval, common.first)
               for each in self._preambles):  # fmt: skip
            raise Garbled(self._device, "its channels have different time bases", "switch it off and on")
        before, after = self._window
        self._from = max(0, math.ceil((-before - common.first) / common.interval - 1e-6))
        last = min(common.points - 1, math.floor((after - common.first) / common.interval + 1e-6))
        channel, level, slope = self._trigger
        screens = zip(self._preambles, self._inputs.values(), strict=True)
        return Frame(
            interval=common.interval,
            first=common.first + self._from * common.interval,
            rows=max(0, last - self._from + 1),
            channel=channel,
            level=level,
            slope=slope,
            screens=tuple(preamble.screen(each.probe) for preamble, each in screens),
        )

    def blocks(self, frame: Frame) -> Iterator[NDArray[np.float64]]:
        """Read the memory of every channel, block by block."""
        import numpy as np  # noqa: PLC0415 - slow to import

        for done in range(0, frame.rows, _BLOCK):
            count = min(_BLOCK, frame.rows - done)
            rows = np.empty((count, 1 + len(self._inputs)))
            rows[:, 0] = frame.first + np.arange(done, done + count) * frame.interval
            for place, (found, preamble) in enumerate(zip(self._inputs.values(), self._preambles, strict=True), 1):
                data = np.frombuffer(self._read(found.number, self._from + done, count), np.uint8)
                rows[:, place] = (data - preamble.zero) * preamble.step
            yield rows

    def _read(self, number: int, first: int, count: int) -> bytes:
        self._session.setting(f":WAV:SOUR CHAN{number}")
        self._session.setting(f":WAV:STAR {first + 1}")
        self._session.setting(f":WAV:STOP {first + count}")
        data = self._session.block(":WAV:DATA?")
        if len(data) != count:
            message = f"asked for {count} points of channel {number}, got {len(data)}"
            raise Garbled(self._device, message, "check what else talks to it, and capture again")
        return data

    def _preamble(self, found: _Input) -> _Preamble:
        self._session.setting(f":WAV:SOUR CHAN{found.number}")
        return self._session.query(":WAV:PRE?", _as_preamble)

    def _input(self, channel: str) -> _Input:
        if channel not in self._inputs:
            raise Refused(f"{self._name} has no channel '{channel}'", f"the wiring names {', '.join(self._inputs)}")
        return self._inputs[channel]

    def _depth(self, points: float) -> int:
        """Return the smallest memory depth per channel that holds this many points."""
        shared = {1: 1, 2: 2}.get(len(self._inputs), 4)
        for depth in _DEPTHS:
            if depth // shared >= points:
                return depth // shared
        most = _DEPTHS[-1] // shared
        raise Refused(f"{self._name}: {points:.0f} points do not fit its memory", f"{most} do; ask for fewer")


class RigolDs1000z(ScpiInstrument):
    """Driver `rigol-ds1000z`: role `oscilloscope`, all channels together. The instrument is never reset."""

    roles: ClassVar[frozenset[str]] = frozenset({"oscilloscope"})
    speech: ClassVar[Speech] = Speech(driver="rigol-ds1000z", error_query=":SYST:ERR?", blocks=True)

    _session: BlockSession

    def role(self, wire: Wire) -> RigolScope:
        """Return the oscilloscope with the wire's channels."""
        settings.fits(wire, "rigol-ds1000z", self.roles)
        told = settings.read(wire, ScopeWire)
        parts = ("ch", "probe", "unit")
        of_each = [(number, *(getattr(told, f"{part}{number}") for part in parts)) for number in _CHANNELS]
        inputs = [_Input(*each) for each in of_each if each[1]]
        if len({each.name for each in inputs}) < len(inputs):
            raise settings.wrong(wire, f"ch{inputs[-1].number}", "has the name of another channel")
        if not inputs:
            raise Refused(f"wiring {wire.name}: no channel is named", "name one, such as `ch1: rail`")
        return RigolScope(wire.name, self._session, self._connection, inputs)


def _step(value: float, what: str) -> float:
    """Round up to the next 1-2-5 step."""
    if not (math.isfinite(value) and value > 0):
        raise Refused(f"{what} {value:g} is not above zero", "give a number above zero")
    exponent = math.floor(math.log10(value))
    steps = (float(f"{digit}e{exponent}") for digit in (1, 2, 5, 10))
    return next((step for step in steps if value <= step * (1 + 1e-9)), 10.0 ** (exponent + 1))


def _as_state(reply: str) -> str:
    if reply not in _STATES:
        raise ValueError(", ".join(_STATES))
    return _STATES[reply]


def _as_preamble(reply: str) -> _Preamble:
    fields = reply.split(",")
    if len(fields) != 10 or fields[:2] != ["0", "2"]:  # format BYTE, type RAW
        raise ValueError("the ten fields of a preamble, of bytes from memory")
    points, _, interval, origin, reference, step, zero, middle = (as_number(each) for each in fields[2:])
    if not (points >= 1 and interval > 0 and step > 0):
        raise ValueError("points, interval and step above zero")
    return _Preamble(int(points), interval, origin - reference * interval, step, zero + middle)
