"""Eurotherm 3216 temperature controller, Modbus RTU.

Registers are those of the 3200 series engineering handbook HA028651 (issue 7, section 15.5): whole numbers,
temperatures with as many decimals as the display shows. Assumed, from public drivers and the 2000 series, until they
are compared with an instrument: powers in tenths of a percent, units at 516, decimals at 525, and a type code (122)
that reads 3216 in hexadecimal.

The target setpoint (2) is in a memory for 100,000 writes, so it is written only where it differs. The remote setpoint
(26) could be written for ever, but the instrument gives it up when nothing came for some seconds; a bench that waits
for a person, or computes, would let the temperature go. So the local one it is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

from hil.clock.port import Clock
from hil.instruments import settings
from hil.instruments.driver import ANY_BYTE, Clamps, Connection, Outlet
from hil.instruments.marks import drives, reads
from hil.instruments.modbus_line import SILENCE, exchange, question, register, register_told
from hil.instruments.modbus_session import ModbusSession
from hil.instruments.roles import THERMAL, Thermal
from hil.instruments.safing import must_be_state
from hil.model.bench import Proof, Wire
from hil.model.errors import DeviceFault, Garbled, NoReply, Refused, Rejected
from hil.model.figure import Figure
from hil.model.identity import Identity
from hil.model.notation import whole
from hil.model.safing import SafeBytes

__all__ = ["Eurotherm3216", "Eurotherm3216Thermal", "EurothermSettings"]

_PROCESS_VALUE, _TARGET_SETPOINT, _WORKING_OUTPUT, _WORKING_SETPOINT = 1, 2, 4, 5
_STATUS, _VERSION, _TYPE_CODE = 75, 107, 122
_INSTRUMENT_MODE, _LOOP_MODE, _SETPOINT_SOURCE = 199, 273, 276
_UNITS, _DECIMALS = 516, 525

_SENSOR_BREAK, _OVER_RANGE = 1 << 5, 1 << 10
_OPERATING, _STANDBY = 0, 1
_AUTOMATIC, _LOCAL, _CELSIUS = 0, 0, 0
_FACTORY_UNIT = 1
_MOST_DECIMALS = 2
_SERIES = 0x3200
_QUIET_S = 0.02
_OUTPUT_GONE_S = 2.0
"""The control loop needs a turn before its output shows the mode."""
_PAUSE_S = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class EurothermSettings:
    """What a wire may set: decimals of the display."""

    decimals: Annotated[int, whole(0, _MOST_DECIMALS)] = 1


class Eurotherm3216Thermal:
    """The one loop of the controller; fills the role `thermal`.

    Args:
        name: the wire's dotted name.
        device: the instrument's name, for messages.
        session: its session.
        clock: the bench's clock.
        clamps: how far its setpoint may be set; the quantity is `temperature`.
        channel: of the wire, by which clamps are found.
        decimals: how many the display shows; everything about temperature is wrong by powers of ten otherwise.
    """

    def __init__(
        self,
        *,
        name: str,
        device: str,
        session: ModbusSession,
        clock: Clock,
        clamps: Clamps,
        channel: int,
        decimals: int,
    ) -> None:
        self._name = name
        self._device = device
        self._session = session
        self._clock = clock
        self._clamps = clamps
        self._channel = channel
        self._decimals = decimals
        self._agreed = False

    @drives
    def hold(self, temperature: float) -> None:
        """Regulate to a setpoint [degC]: setpoint first, then automatic, then operating; all are read back.

        Raises:
            ClampExceeded: the setpoint is not permitted; nothing was sent.
            Rejected: decimals or units are not those of the wiring, or something reads back otherwise.
        """
        self._clamps.permit(self._channel, "temperature", temperature)
        scaled = temperature * 10**self._decimals
        if not -0x8000 <= scaled < 0x7FFF:
            raise Refused(
                f"{self._name}: {temperature:g} degC does not fit in a register", "ask for another temperature"
            )
        wanted = round(scaled)
        self._agreed = False
        self._agree()
        self._set(_TARGET_SETPOINT, wanted & 0xFFFF, "the setpoint")
        self._set(_SETPOINT_SOURCE, _LOCAL, "the setpoint's source")
        self._set(_LOOP_MODE, _AUTOMATIC, "the loop's mode")
        self._set(_INSTRUMENT_MODE, _OPERATING, "the instrument's mode")

    @drives
    def standby(self) -> None:
        """Put the instrument into standby, in which control outputs are off, and wait until its output reads 0 %.

        Raises:
            Rejected: it stays in operation, or says that its output is still on.
        """
        self._set(_INSTRUMENT_MODE, _STANDBY, "the instrument's mode")
        deadline = self._clock.now() + _OUTPUT_GONE_S
        while self._register(_WORKING_OUTPUT):
            if self._clock.now() >= deadline:
                raise Rejected(
                    self._device, f"{self._name} is in standby and its output is on", "cut the power of the cooler"
                )
            self._clock.sleep(_PAUSE_S)

    @reads
    def temperature(self) -> Figure:
        """Return the process value in degC; NaN where the controller says that its sensor is broken or over range."""
        self._agree()
        raw = self._register(_PROCESS_VALUE)
        broken = self._register(_STATUS) & (_SENSOR_BREAK | _OVER_RANGE)
        return Figure(value=math.nan if broken else self._scaled(raw), unit="degC")

    @reads
    def setpoint(self) -> Figure:
        """Return the working setpoint in degC."""
        self._agree()
        return Figure(value=self._scaled(self._register(_WORKING_SETPOINT)), unit="degC")

    @reads
    def output(self) -> Figure:
        """Return the working output in %, negative while it cools."""
        return Figure(value=_signed(self._register(_WORKING_OUTPUT)) / 10, unit="%")

    def safe_bytes(self, state: str, proof: Proof | None = None) -> SafeBytes:  # noqa: ARG002 - always an output of 0
        """Return the bytes of standby; see `hil.instruments.roles.SafeByBytes`.

        The mode is written whether or not it differs, which is rare enough for the memory. It is proven by the mode
        and by a working output of exactly 0 %; a temperature cannot be held to bounds by bytes.
        """
        must_be_state(THERMAL, self._name, state)
        unit, within_s = self._session.unit, self._session.timeout
        mode = register(_INSTRUMENT_MODE, _STANDBY, unit)
        told = ((_INSTRUMENT_MODE, _STANDBY), (_WORKING_OUTPUT, 0))
        return SafeBytes(
            resync=(SILENCE,),
            off=(exchange(mode, mode, within_s),),
            proof=tuple(exchange(question(3, at, 1, unit), register_told(value, unit), within_s) for at, value in told),
            owed_s=within_s,
        )

    def _agree(self) -> None:
        """Compare decimals and units of the instrument with those of the wiring, once and before every setpoint.

        Raises:
            Rejected: they differ, and every temperature would be another one.
        """
        if self._agreed:
            return
        decimals, units = self._register(_DECIMALS), self._register(_UNITS)
        if decimals != self._decimals or units != _CELSIUS:
            raise Rejected(
                self._device,
                f"{self._name}: the display has {decimals} decimals and unit {units},"
                f" the wiring says {self._decimals} decimals, and 0 is degC",
                "set the instrument's decimal point and unit, or `decimals` in the wiring",
            )
        self._agreed = True

    def _set(self, register: int, value: int, what: str) -> None:
        """Write a register where it differs, and read it back, with silence after that: no stale frame was read.

        Raises:
            NoReply: nothing came, or the echo was lost and the register is otherwise.
            Garbled: the same with nonsense, or something came that nobody had asked for.
            Rejected: the instrument refused, or reads back otherwise.
        """
        stray = self._stray()
        fault: DeviceFault | None = None
        if self._may_differ(register, value):
            try:
                self._session.write_holding(register, value)
            except (NoReply, Garbled) as error:
                fault = error
        found = self._register(register)
        self._session.must_be_quiet(_QUIET_S)
        if stray:
            raise stray
        if found != value:
            raise fault or Rejected(
                self._device,
                f"{self._name}: {what} was set to {_signed(value)} and reads back {_signed(found)}",
                "check its setpoint limits and its access level",
            )

    def _may_differ(self, register: int, value: int) -> bool:
        """Return whether a write is due; where nobody can tell, it is, because it may be what makes the bench safe."""
        try:
            return self._register(register) != value
        except (NoReply, Garbled):
            return True

    def _stray(self) -> DeviceFault | None:
        """Return what is wrong before a write; it leaves all the same."""
        try:
            self._session.must_be_quiet()
        except DeviceFault as fault:
            return fault
        return None

    def _register(self, address: int) -> int:
        return self._session.read_holding(address, 1)[0]

    def _scaled(self, raw: int) -> float:
        return _signed(raw) / float(10**self._decimals)


class Eurotherm3216:
    """Driver `eurotherm-3216`: role `thermal`.

    The instrument's `address` is its unit address; 0 stands for the factory's 1.
    """

    roles: ClassVar[frozenset[str]] = frozenset({"thermal"})
    capabilities: ClassVar[frozenset[str]] = frozenset({ANY_BYTE})

    def __init__(self, connection: Connection) -> None:
        if connection.port is None:
            raise Refused(f"{connection.device}: a eurotherm-3216 is reached by a port", "give it `port:`")
        self._connection = connection
        unit = connection.address or _FACTORY_UNIT
        self._session = ModbusSession(
            connection.device, connection.port, connection.clock, unit, timeout=connection.timeout
        )

    def identify(self) -> Identity:
        """Read type code and version, hexadecimal numbers that read like the model and V1.11; it reports no more."""
        try:
            code, version = (self._session.read_holding(address, 1)[0] for address in (_TYPE_CODE, _VERSION))
        except Rejected:
            return Identity()
        model = f"{code:04X}" if code & 0xFF00 == _SERIES else f"type code {code:#06x}"
        return Identity(model=model, firmware=f"{version >> 8:X}.{version & 0xFF:02X}")

    def outlets(self) -> Sequence[Outlet]:
        """Return the loop's output; it is on while the controller regulates, or gives power by hand."""
        mode, loop, output = (
            self._session.read_holding(address, 1)[0] for address in (_INSTRUMENT_MODE, _LOOP_MODE, _WORKING_OUTPUT)
        )
        return (Outlet(0, (mode == _OPERATING and loop == _AUTOMATIC) or output != 0),)

    def role(self, wire: Wire) -> Thermal:
        """Return the loop with the decimals that the wire names, 1 by default."""
        if wire.role not in self.roles:
            raise Refused(
                f"wiring {wire.name}: a eurotherm-3216 does not fill the role {wire.role}", "it fills the role thermal"
            )
        own = settings.read(wire, EurothermSettings)
        return Eurotherm3216Thermal(
            name=wire.name,
            device=self._connection.device,
            session=self._session,
            clock=self._connection.clock,
            clamps=self._connection.clamps,
            channel=wire.channel,
            decimals=own.decimals,
        )


def _signed(raw: int) -> int:
    return raw - 0x10000 if raw & 0x8000 else raw
