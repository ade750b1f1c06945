"""Role `thermal` over Modbus: what temperature controllers share, whatever their registers."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, ClassVar

from hil.clock.port import Clock
from hil.instruments import settings
from hil.instruments.driver import ANY_BYTE, Clamps, Connection
from hil.instruments.marks import drives, reads
from hil.instruments.modbus_session import ModbusSession
from hil.instruments.roles import Thermal
from hil.model.bench import Wire
from hil.model.errors import DeviceFault, Garbled, NoReply, Refused, Rejected
from hil.model.figure import Figure
from hil.model.notation import whole

__all__ = ["ModbusThermal", "ModbusThermalDriver", "ThermalSettings", "signed"]

_MOST_DECIMALS = 2  # of a display; more would leave too little range in a register
_FACTORY_UNIT = 1
_QUIET_S = 0.02
_OUTPUT_GONE_S = 2.0
"""Time until the output reflects a change of mode."""
_PAUSE_S = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class ThermalSettings:
    """Wire settings: decimals of the display."""

    decimals: Annotated[int, whole(0, _MOST_DECIMALS)] = 1


class ModbusThermal(ABC):
    """One control loop on Modbus; fills the role `thermal`. Base class of each make of controller.

    Args:
        name: the wire's dotted name.
        device: the instrument's name, for messages.
        session: its session.
        clock: the bench's clock.
        clamps: clamps on its setpoint, quantity `temperature`.
        channel: channel of the wire, for looking up clamps.
        decimals: decimals of the display; a wrong number scales every temperature by powers of ten.
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
        self._display_checked = False

    @drives
    def hold(self, temperature: float) -> None:
        """Regulate to a setpoint [degC]: write the setpoint, then enable regulation; all are read back.

        Raises:
            ClampExceeded: the setpoint exceeds a clamp; nothing was sent.
            Rejected: the display differs from the wiring, or a setting reads back differently.
        """
        self._clamps.permit(self._channel, "temperature", temperature)
        scaled = temperature * 10**self._decimals
        if not -0x8000 <= scaled < 0x7FFF:
            raise Refused(
                f"{self._name}: {temperature:g} degC does not fit in a register", "ask for another temperature"
            )
        self._display_checked = False
        self._check_display_once()
        self._regulate(round(scaled) & 0xFFFF)

    @drives
    def standby(self) -> None:
        """Stop regulating, which turns the control outputs off, and wait until the output reads 0 %.

        Raises:
            Rejected: the controller keeps regulating, or reports its output as still on.
        """
        self._stop_regulating()
        deadline = self._clock.now() + _OUTPUT_GONE_S
        while self._power():
            if self._clock.now() >= deadline:
                raise Rejected(
                    self._device, f"{self._name} is in standby and its output is on", "cut the power of the cooler"
                )
            self._clock.sleep(_PAUSE_S)

    @reads
    def temperature(self) -> Figure:
        """Return the process value in degC; NaN where the controller reports a sensor break or over-range."""
        self._check_display_once()
        raw = self._process_value()
        return Figure(value=math.nan if self._sensor_fails() else self._scaled(raw), unit="degC")

    @reads
    def setpoint(self) -> Figure:
        """Return the working setpoint in degC."""
        self._check_display_once()
        return Figure(value=self._scaled(self._working_setpoint()), unit="degC")

    @reads
    def output(self) -> Figure:
        """Return the working output in %, negative while cooling."""
        return Figure(value=self._power() / 10, unit="%")

    @abstractmethod
    def _check_display(self) -> None:
        """Compare the display with the wiring; Rejected if temperatures would be scaled wrongly."""

    @abstractmethod
    def _regulate(self, setpoint: int) -> None:
        """Write the setpoint's register value, and enable regulation."""

    @abstractmethod
    def _stop_regulating(self) -> None:
        """Stop regulating."""

    @abstractmethod
    def _process_value(self) -> int:
        """Read the process value's register."""

    @abstractmethod
    def _working_setpoint(self) -> int:
        """Read the working setpoint's register."""

    @abstractmethod
    def _sensor_fails(self) -> bool:
        """Read whether the controller reports a sensor break or over-range."""

    @abstractmethod
    def _power(self) -> int:
        """Read the working output in tenths of a percent, negative while cooling."""

    def _check_display_once(self) -> None:
        """Compare the display with the wiring, unless that has been done."""
        if not self._display_checked:
            self._check_display()
            self._display_checked = True

    def _set(self, register: int, value: int, what: str) -> None:
        """Write a register if it differs, and read it back. See `_prove`."""

        def differs(found: int) -> str:
            return "" if found == value else f"was set to {signed(value)} and reads back {signed(found)}"

        self._prove(
            what, lambda: self._session.write_holding(register, value), lambda: differs(self._register(register))
        )

    def _prove(self, what: str, write: Callable[[], None], differs: Callable[[], str]) -> None:
        """Write if something differs, and read back, followed by silence as proof that no stale frame was read.

        Args:
            what: what is set, for the message.
            write: writes it.
            differs: reads it and describes what differs; empty if it is as wanted.

        Raises:
            NoReply: no reply, or the echo was lost and the value is not as wanted.
            Garbled: the same for a malformed reply, or unsolicited bytes came.
            Rejected: the instrument refused, or reads back differently.
        """
        stray = self._stray()
        fault: DeviceFault | None = None
        if self._write_is_due(differs):
            try:
                write()
            except (NoReply, Garbled) as error:
                fault = error
        wrong = differs()
        self._session.must_be_quiet(_QUIET_S)
        if stray:
            raise stray
        if wrong:
            raise fault or Rejected(
                self._device, f"{self._name}: {what} {wrong}", "check its setpoint limits and its access level"
            )

    def _write_is_due(self, differs: Callable[[], str]) -> bool:
        """Return whether a write is due; if unknown, it is, because the write may be what makes the bench safe."""
        try:
            return bool(differs())
        except (NoReply, Garbled):
            return True

    def _stray(self) -> DeviceFault | None:
        """Return the fault found before a write, which is sent all the same."""
        try:
            self._session.must_be_quiet()
        except DeviceFault as fault:
            return fault
        return None

    def _register(self, address: int) -> int:
        return self._session.read_holding(address, 1)[0]

    def _scaled(self, raw: int) -> float:
        return signed(raw) / float(10**self._decimals)


class ModbusThermalDriver:
    """Base driver for controllers of one make: role `thermal` on their single loop.

    The instrument's `address` is its unit address; 0 stands for the factory setting, 1.

    Attributes:
        name: the driver's name in bench files.
        loop: the class that fills the role.
    """

    roles: ClassVar[frozenset[str]] = frozenset({"thermal"})
    capabilities: ClassVar[frozenset[str]] = frozenset({ANY_BYTE})
    name: ClassVar[str]
    loop: ClassVar[type[ModbusThermal]]

    def __init__(self, connection: Connection) -> None:
        if connection.port is None:
            raise Refused(f"{connection.device}: the driver {self.name} needs a port", "give it `port:`")
        self._connection = connection
        unit = connection.address or _FACTORY_UNIT
        self._session = ModbusSession(
            connection.device, connection.port, connection.clock, unit, timeout=connection.timeout
        )

    def role(self, wire: Wire) -> Thermal:
        """Return the loop with the wire's number of decimals, 1 by default."""
        if wire.role not in self.roles:
            raise Refused(
                f"wiring {wire.name}: the driver {self.name} does not fill the role {wire.role}",
                "it fills the role thermal",
            )
        return self.loop(
            name=wire.name,
            device=self._connection.device,
            session=self._session,
            clock=self._connection.clock,
            clamps=self._connection.clamps,
            channel=wire.channel,
            decimals=settings.read(wire, ThermalSettings).decimals,
        )


def signed(raw: int) -> int:
    """Return a 16-bit register as a signed number."""
    return raw - 0x10000 if raw & 0x8000 else raw
