"""Keysight 34970A and 34972A data acquisition units: timer-paced scans of voltages, thermocouples and digital bytes.

From the 34970A user's guide: CONFigure and ROUTe:SCAN both define the scan list; the timer starts a sweep every 0 to
359,999 s in steps of 1 ms; a scan stores 50,000 readings with the time since its start, and DATA:REMove? removes the
oldest; the fields of a reading are value, time, channel; MEASure and CONFigure switch those fields off; a digital byte
is in the scan list like any channel, `s01` or `s02`. From memory, to be checked on the first article: that a scan list
is sorted, that `*IDN?` can share a line with a query, the relay switching time, that autozero doubles the time of a
reading, and that an open thermocouple and an overload both read 9.9E+37.
"""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, ClassVar

from hil.clock.port import Clock
from hil.instruments import settings
from hil.instruments.marks import reads
from hil.instruments.sampled import Channel, StreamReport
from hil.instruments.scpi_instrument import ReadBack, ScpiInstrument, Speech
from hil.instruments.scpi_session import ScpiSession, as_number, as_register, as_text
from hil.model.bench import Wire
from hil.model.errors import NoReply, Refused, Rejected
from hil.model.figure import Figure, FigureStatus
from hil.model.notation import Seconds, measured

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["DaqSettings", "Keysight34970a"]

_CHANNEL = re.compile(r"[1-3](?:0[1-9]|[1-3]\d|40)")
_INPUT = re.compile(r"([a-z][a-z0-9_]*) (?:(V)(?: (0\.1|1|10|100|300))?|(degC) ([BEJKNRST])|(1))")
_FORM = "must be `NAME V`, `NAME V RANGE` (0.1, 1, 10, 100, 300), `NAME degC TYPE` (B to T), or `NAME 1` for a byte"
_CYCLES = (0.02, 0.2, 1.0, 2.0, 10.0, 20.0, 100.0, 200.0)
_SLOWEST_MAINS_HZ = 50.0
_BYTE = "DIG:BYTE "
_RELAY_S, _BYTE_S, _MARGIN_S = 0.017, 0.005, 0.02
_TIMER_S = 1e-3
_MEMORY = 50_000
_MOST_READINGS = 40  # per request; at 57600 baud and above their 1400 bytes arrive in time
_LONGEST_PAUSE_S = 2.0
_SILENCE_S = 1.0

_Reading = tuple[float, float, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class DaqSettings:
    """Wire settings besides the inputs.

    Attributes:
        nplc: integration time in power-line cycles.
        settling: settling time from closing a channel's relay to its reading.
    """

    nplc: Annotated[float, measured(choices=_CYCLES)] = 1.0
    settling: Seconds = 0.005


@dataclass(frozen=True, slots=True)
class _Input:
    """One input: channel number, name, unit, and the configuration command that precedes the channel list."""

    number: int
    name: str
    unit: str
    configure: str


class DaqInputs:
    """The unit's wired inputs; fills the role `data_acquisition`.

    Args:
        name: the wire's dotted name.
        device: the instrument's name.
        session: its session.
        clock: the bench's clock.
        inputs: in ascending channel order.
        asked: the wire's other settings.
    """

    def __init__(
        self, name: str, device: str, session: ScpiSession, clock: Clock, inputs: Sequence[_Input], asked: DaqSettings
    ) -> None:
        self._name, self._device, self._session, self._clock = name, device, session, clock
        self._settings = ReadBack(name, device, session)
        self._inputs, self._asked = tuple(inputs), asked
        self._rate = 0.0
        self._rows: list[list[float]] = []
        self._sweep: list[_Reading] = []
        self._newest: float | None = None
        self._lost = self._frames = 0
        self._late = self._heard = 0.0

    def channels(self) -> tuple[Channel, ...]:
        """Return every input, and for all but the first its delay after the row's time, `NAME_after`."""
        after = tuple(Channel(f"{each.name}_after", "s") for each in self._inputs[1:])
        return (*(Channel(each.name, each.unit) for each in self._inputs), *after)

    @reads
    def read(self, channel: str) -> Figure:
        """Read one input; not observable where its thermocouple is open, or on overload.

        Raises:
            Refused: there is no such input, or it is being recorded.
            Rejected, NoReply, Garbled: see `ScpiSession.setting`.
        """
        found = next((each for each in self._inputs if each.name == channel), None)
        if found is None:
            known = ", ".join(each.name for each in self._inputs)
            raise Refused(f"{self._name} has no channel '{channel}'", f"the wiring names {known}")
        if found.unit == "1" and not self._rate:
            value = self._session.query(f"SENS:DIG:DATA:BYTE? {_channel_list([found.number])}", _as_first)
        else:
            ((value, _, _),) = self._once((found,))
        status = FigureStatus.NOT_OBSERVABLE if math.isnan(value) else FigureStatus.MEASURED
        return Figure(value=value, unit=found.unit, status=status)

    def sample(self) -> tuple[float, ...]:
        """Scan all inputs once; NaN where one has no reading."""
        return tuple(self._row(self._once(self._inputs))[1:])

    def begin(self, rate: float) -> None:
        """Start a scan at `rate` sweeps per second [Hz], paced by the instrument's timer.

        Raises:
            Refused: a sweep takes longer than its period, or the timer cannot be set to it.
        """
        sweep_s, period_s = self._sweep_s(self._inputs), 1 / rate
        if period_s < sweep_s:
            raise Refused(
                f"{self._name}: {len(self._inputs)} channels take {sweep_s:.3g} s, which is too long for {rate:g} Hz",
                f"record at {math.floor(100 / sweep_s) / 100:g} Hz at most, or with fewer channels, nplc or settling",
            )
        timer_s = round(period_s / _TIMER_S) * _TIMER_S
        if abs(timer_s - period_s) > 5e-4 * period_s:
            raise Refused(f"{self._name}: the timer has steps of 1 ms, and none for {rate:g} Hz",
                          f"record at {1 / timer_s:.6g} Hz")  # fmt: skip
        self._set_up(self._inputs)
        self._settings.word("TRIG:SOUR", "TIM")
        self._settings.number("TRIG:TIM", timer_s, _TIMER_S / 2)
        self._session.setting("TRIG:COUN INF")
        self._rows, self._sweep, self._newest = [], [], None
        self._lost = self._frames = 0
        before = self._clock.now()
        self._session.setting("INIT")
        self._heard = self._clock.now()
        self._late, self._rate = self._heard - before, rate

    def drain(self) -> NDArray[np.float64]:
        """Remove the readings from the instrument's memory; see `hil.instruments.sampled.Streamed`.

        Raises:
            NoReply: the scan has stalled.
        """
        import numpy as np  # noqa: PLC0415 - slow to import

        waiting = self._session.query("DATA:POIN?", as_register)
        while waiting:
            count = min(waiting, _MOST_READINGS)
            for reading in self._session.query(f"DATA:REM? {count}", _as_readings(count)):
                self._add_to_sweep(reading)
            waiting -= count
        rows, self._rows = self._rows, []
        silent_s = self._clock.now() - self._heard
        if rows:
            self._heard += silent_s
        elif silent_s > 1 / self._rate + self._sweep_s(self._inputs) + _SILENCE_S:
            message = f"{self._name}: no sweep has ended for {silent_s:.3g} s"
            raise NoReply(self._device, message, "check whether another wire, program or person has ended its scan")
        return np.array(rows).reshape(len(rows), 1 + len(self.channels()))

    def end(self) -> StreamReport:
        """Stop the scan, and return its report."""
        self._rate = 0.0
        self._session.setting("ABOR")
        return StreamReport(
            frames=self._frames, lost=self._lost, drift=None, drift_uncertainty=None,
            time_uncertainty=self._late / math.sqrt(3),
        )  # fmt: skip

    @property
    def longest_pause(self) -> float:
        """Seconds after which one request no longer fetches everything; nothing is lost then, see `patience`."""
        return max(1 / self._rate, min(_LONGEST_PAUSE_S, _MOST_READINGS / (self._rate * len(self._inputs))))

    @property
    def patience(self) -> float:
        """Seconds until the memory is full, with a margin."""
        return 0.8 * _MEMORY / (self._rate * len(self._inputs))

    def _sweep_s(self, inputs: Sequence[_Input]) -> float:
        """Return the longest duration of a sweep."""
        reading_s = _RELAY_S + self._asked.settling + 2 * self._asked.nplc / _SLOWEST_MAINS_HZ
        return sum(_BYTE_S if each.unit == "1" else reading_s for each in inputs) + _MARGIN_S

    def _once(self, inputs: Sequence[_Input]) -> list[_Reading]:
        if self._rate:
            raise Refused(f"{self._name} is being recorded", "take what you need from the recording's rows")
        self._set_up(inputs)
        self._settings.word("TRIG:SOUR", "IMM")
        self._session.setting("TRIG:COUN 1")
        self._session.setting("INIT")
        self._clock.sleep(self._sweep_s(inputs))
        if (count := self._session.query("DATA:POIN?", as_register)) != len(inputs):
            message = f"{self._name}: a sweep of {len(inputs)} channels gave {count} readings"
            raise NoReply(self._device, message, "check its modules, and whether another program scans")
        found = self._session.query("FETC?", _as_readings(count))
        if [number for _, _, number in found] != [each.number for each in inputs]:
            raise Rejected(self._device, f"{self._name}: other channels were scanned than asked for", "leave it alone")
        return found

    def _add_to_sweep(self, reading: _Reading) -> None:
        """Add a reading to its sweep; an incomplete sweep is lost and leaves a gap in time."""
        number = reading[2]
        if number != self._inputs[len(self._sweep)].number:
            self._sweep = []
            if number != self._inputs[0].number:
                return
        self._sweep.append(reading)
        if len(self._sweep) < len(self._inputs):
            return
        row = self._row(self._sweep)
        since = 0.0 if self._newest is None else self._newest + 0.5 / self._rate
        gone = math.floor((row[0] - since) * self._rate + 1e-6)
        self._lost, self._frames = self._lost + max(0, gone), self._frames + 1
        self._newest, self._sweep = row[0], []
        self._rows.append(row)

    @staticmethod
    def _row(sweep: Sequence[_Reading]) -> list[float]:
        first = sweep[0][1]
        return [first, *(value for value, _, _ in sweep), *(at - first for _, at, _ in sweep[1:])]

    def _set_up(self, inputs: Sequence[_Input]) -> None:
        """Configure the inputs and the scan list; the list is read back."""
        session = self._session
        session.setting("ABOR")
        alike: dict[str, list[int]] = defaultdict(list)
        for each in inputs:
            alike[each.configure].append(each.number)
        for configure, numbers in alike.items():
            where = _channel_list(numbers)
            session.setting(f"CONF:{configure}{where}")
            if configure == _BYTE:
                continue
            function = configure[:4]
            session.setting(f"{function}:NPLC {self._asked.nplc:G},{where}")
            session.setting(f"ROUT:CHAN:DEL {self._asked.settling:G},{where}")
            if function == "TEMP":
                session.setting(f"UNIT:TEMP C,{where}")
                session.setting(f"TEMP:TRAN:TC:CHEC ON,{where}")
        wanted = _channel_list([each.number for each in inputs])
        session.setting(f"ROUT:SCAN {wanted}")
        if (found := session.query("ROUT:SCAN?", as_text)) != f"#{len(str(len(wanted)))}{len(wanted)}{wanted}":
            raise Rejected(
                self._device, f"{self._name}: the scan list {wanted} reads back {found}", "check which modules it has"
            )
        for setting in ("TIME ON", "TIME:TYPE REL", "CHAN ON", "UNIT OFF", "ALAR OFF"):
            session.setting(f"FORM:READ:{setting}")


class Keysight34970a(ScpiInstrument):
    """Driver `keysight-34970a`: role `data_acquisition`, all inputs together. The instrument is never reset."""

    roles: ClassVar[frozenset[str]] = frozenset({"data_acquisition"})
    speech: ClassVar[Speech] = Speech(driver="keysight-34970a", framed=True)

    @staticmethod
    def inputs(wire: Wire) -> Mapping[str, str]:
        """Return the unit of each input; see `hil.instruments.driver.NamesInputs`."""
        named = (_INPUT.fullmatch(text) for key, text in wire.settings.items() if _CHANNEL.fullmatch(key))
        return {match[1]: match[2] or match[4] or match[6] for match in named if match}

    def role(self, wire: Wire) -> DaqInputs:
        """Return the wire's inputs."""
        settings.fits(wire, self.speech.driver, self.roles)
        named = {key: text for key, text in wire.settings.items() if _CHANNEL.fullmatch(key)}
        rest = {key: text for key, text in wire.settings.items() if key not in named}
        asked = settings.read(replace(wire, settings=rest), DaqSettings)
        if not named:
            raise Refused(f"wiring {wire.name}: no channel is named", 'name one, such as `"101": plate degC K`')
        inputs = [_input(wire, key, text) for key, text in sorted(named.items())]
        if len({each.name for each in inputs}) < len(inputs):
            raise settings.wrong(wire, max(named), "has channels of one name")
        return DaqInputs(wire.name, self._connection.device, self._session, self._connection.clock, inputs, asked)


def _input(wire: Wire, key: str, text: str) -> _Input:
    match = _INPUT.fullmatch(text)
    if match is None:
        raise settings.wrong(wire, key, _FORM)
    name, volts, end, celsius, kind, _ = match.groups()
    if volts:
        return _Input(int(key), name, "V", f"VOLT:DC {end or 'AUTO'},")
    return _Input(int(key), name, "degC", f"TEMP TC,{kind},") if celsius else _Input(int(key), name, "1", _BYTE)


def _channel_list(numbers: Sequence[int]) -> str:
    return f"(@{','.join(map(str, numbers))})"


def _as_first(reply: str) -> float:
    """Parse the leading number, whatever fields follow it."""
    return as_number(reply.partition(",")[0])


def _as_readings(count: int) -> Callable[[str], list[_Reading]]:
    """Return the parser for `count` readings: `+2.61950000E+01,0000000000.017,101,...`."""

    def parse(reply: str) -> list[_Reading]:
        fields = [field.strip() for field in reply.split(",")]
        if len(fields) != 3 * count:
            raise ValueError(f"{count} readings of value, time and channel")
        return [
            (as_number(value), as_number(at), as_register(number))
            for value, at, number in zip(*[iter(fields)] * 3, strict=True)
        ]

    return parse
