"""Keysight 34461A multimeter, and the others of its family with the same commands (34460A, 34465A, 34470A).

Commands: Truevolt Series Operating and Service Guide. A reading that takes longer than one transaction may is started,
waited for, and fetched. Every reading is requested together with its function, so that a change at the front panel
cannot turn amperes into volts. From memory, to be checked on the first article: the integration times of a 34461A, and
that autozero doubles them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

from hil.instruments import settings
from hil.instruments.marks import reads
from hil.instruments.power_roles import MULTIMETER
from hil.instruments.sampled import Channel
from hil.instruments.scpi_instrument import ScpiInstrument, Speech
from hil.instruments.scpi_session import as_number, as_switch
from hil.model.bench import Wire
from hil.model.errors import Refused, Rejected
from hil.model.figure import Figure, FigureStatus
from hil.model.notation import AnyText, measured, one_of

__all__ = ["Keysight34461a", "Keysight34461aInput", "MeterSettings"]

_FUNCTIONS = {"voltage": "VOLT", "current": "CURR", "resistance": "RES"}
_RANGES = {
    "voltage": (0.1, 1.0, 10.0, 100.0, 1000.0),
    "current": (1e-4, 1e-3, 1e-2, 1e-1, 1.0, 3.0),
    "resistance": (1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8),
}
_CYCLES = (0.02, 0.2, 1.0, 10.0, 100.0)
_SLOWEST_MAINS_HZ = 50.0
_QUICK_S = 0.25
_MARGIN_S = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class MeterSettings:
    """Wire settings.

    Attributes:
        measures: the measured quantity.
        range: upper end of the range in V, A or ohm; autorange if absent.
        nplc: integration time in power-line cycles.
    """

    measures: Annotated[str, one_of(*_FUNCTIONS)] = "voltage"
    range: AnyText = ""
    nplc: Annotated[float, measured(choices=_CYCLES)] = 10.0


class Keysight34461aInput:
    """One measured quantity; fills the role `multimeter`.

    Args:
        meter: the driver, which caches the instrument's present configuration.
        wire: the quantity and its settings.
    """

    def __init__(self, meter: Keysight34461a, wire: Wire) -> None:
        asked = settings.read(wire, MeterSettings)
        self._meter = meter
        self._name = wire.name
        self._measures = asked.measures
        self._range = _end_of_range(wire, asked)
        self._nplc = asked.nplc
        self._unit = MULTIMETER.quantities[asked.measures]

    @reads
    def voltage(self) -> Figure:
        """Measure the DC voltage in V."""
        return self._figure("voltage")

    @reads
    def current(self) -> Figure:
        """Measure the DC current in A."""
        return self._figure("current")

    @reads
    def resistance(self) -> Figure:
        """Measure the resistance in ohm."""
        return self._figure("resistance")

    def channels(self) -> tuple[Channel, ...]:
        """Return the one channel, the measured quantity."""
        return (Channel(self._measures, self._unit),)

    @reads
    def sample(self) -> tuple[float, ...]:
        """Take one reading; NaN on overload."""
        return (self._meter.read(self._measures, self._range, self._nplc),)

    def _figure(self, quantity: str) -> Figure:
        if quantity != self._measures:
            raise Refused(
                f"{self._name} measures {self._measures}, and its leads are not connected for {quantity}",
                f"wire another multimeter with the setting `measures: {quantity}`",
            )
        (value,) = self.sample()
        status = FigureStatus.NOT_OBSERVABLE if math.isnan(value) else FigureStatus.MEASURED
        return Figure(value=value, unit=self._unit, status=status)


class Keysight34461a(ScpiInstrument):
    """Driver `keysight-34461a`: role `multimeter`; a wire may set `measures`, `range` and `nplc`."""

    roles: ClassVar[frozenset[str]] = frozenset({"multimeter"})
    speech: ClassVar[Speech] = Speech(driver="keysight-34461a", framed=True)

    _set_to: tuple[str, float, float] | None = None

    def role(self, wire: Wire) -> Keysight34461aInput:
        """Return the multimeter as the wire configures it."""
        settings.fits(wire, self.speech.driver, self.roles)
        return Keysight34461aInput(self, wire)

    def reopened(self) -> None:
        """Discard the cached configuration."""
        self._set_to = None

    def read(self, quantity: str, end: float, nplc: float) -> float:
        """Take one reading and return its value, NaN on overload.

        Args:
            quantity: `voltage`, `current` or `resistance`.
            end: upper end of the range, 0 for autorange.
            nplc: integration time in power-line cycles.

        Raises:
            Rejected: the instrument was reconfigured at its front panel, or refuses the setting.
            NoReply, Garbled: see `ScpiSession.query`.
        """
        if self._set_to != (quantity, end, nplc):
            self._set_up(quantity, end, nplc)
        function = _FUNCTIONS[quantity]
        lasts = 2 * nplc / _SLOWEST_MAINS_HZ + _MARGIN_S
        if lasts <= _QUICK_S:
            value, found = self._session.query("READ?;:FUNC?", _as_reading)
        else:
            self._session.setting("INIT")
            self._connection.clock.sleep(lasts)
            value, found = self._session.query("FETC?;:FUNC?", _as_reading)
        if found != function:
            self._set_to = None
            raise Rejected(
                self._connection.device, f"it was set to measure {function}, and measures {found}", "leave it alone"
            )
        return value

    def _set_up(self, quantity: str, end: float, nplc: float) -> None:
        self._set_to = None
        function, session = _FUNCTIONS[quantity], self._session
        session.setting(f"CONF:{function} {end:G}" if end else f"CONF:{function} AUTO")
        session.setting(f"{function}:NPLC {nplc:G}")
        taken = session.query(f"{function}:NPLC?", as_number)
        automatic = session.query(f"{function}:RANG:AUTO?", as_switch)
        found = session.query(f"{function}:RANG?", as_number)
        if not math.isclose(taken, nplc, rel_tol=1e-3) or automatic == bool(end) or (end and not _near(found, end)):
            raise Rejected(
                self._connection.device,
                f"was set to {function} {end or 'AUTO'} at {nplc:g} NPLC and reads back {found:g} at {taken:g} NPLC",
                "check whether its front panel or another program changes it",
            )
        self._set_to = (quantity, end, nplc)


def _near(found: float, wanted: float) -> bool:
    return math.isclose(found, wanted, rel_tol=1e-3)


def _as_reading(reply: str) -> tuple[float, str]:
    """Parse a reading and its function: `+1.234E+00;"VOLT"`."""
    number, separator, function = reply.partition(";")
    if not separator:
        raise ValueError('a number and a function like +1.2E+00;"VOLT"')
    return as_number(number.strip()), function.strip().strip('"').partition(":")[0]


def _end_of_range(wire: Wire, asked: MeterSettings) -> float:
    """Return the upper end of the wire's range, 0 for autorange."""
    if not asked.range or asked.range == "auto":
        return 0.0
    unit = MULTIMETER.quantities[asked.measures]
    ends = {f"{end:g} {unit}": end for end in _RANGES[asked.measures]}
    try:
        end = float(asked.range.removesuffix(unit).strip())
    except ValueError:
        end = math.nan
    if end not in ends.values():
        raise settings.wrong(wire, "range", f"must be auto, {', '.join(ends)}")
    return end
