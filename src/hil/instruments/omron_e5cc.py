"""Omron E5CC and E5EC temperature controllers, Modbus RTU.

Addresses and commands are those of the communications manual H175, sections 4-4 and 5-1: the status is read as one
element of four bytes (040C), everything else as elements of two (2000 and up), whole numbers with as many decimals as
the decimal point monitor (2410) says. RUN and STOP are operation commands, function 06 to address 0000; no write is
taken before communications writing was switched on. Assumed, until it is compared with an instrument: STOP shows in bit
24 of the status, communications writing in 25, manual in 26, an input error in 6, as public drivers have it.

A setpoint that is written goes into a non-volatile memory, so it is written only where it differs. The display's unit
is not asked for: it must be degC. Over Modbus the controller says nothing of model and serial number.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import ClassVar

from hil.instruments.driver import Outlet
from hil.instruments.modbus_line import SILENCE, exchange, exchange_like, question, register, registers_told
from hil.instruments.modbus_session import ModbusSession
from hil.instruments.modbus_thermal import ModbusThermal, ModbusThermalDriver, signed
from hil.instruments.roles import THERMAL
from hil.instruments.safing import must_be_state
from hil.model.bench import Proof
from hil.model.errors import Rejected
from hil.model.identity import Identity
from hil.model.safing import SafeBytes

__all__ = ["OmronE5cc", "OmronE5ccThermal"]

_STATUS = 0x040C
_PROCESS_VALUE, _INTERNAL_SETPOINT, _HEATING, _SETPOINT, _DECIMAL_POINT = 0x2000, 0x2002, 0x2004, 0x2103, 0x2410
_OPERATION = 0x0000
_WRITING_ON, _RUN, _STOP, _AUTOMATIC = 0x0001, 0x0100, 0x0101, 0x0900
_INPUT_ERROR, _CONVERTER_ERROR = 1 << 6, 1 << 2
_STOPPED, _WRITING, _MANUAL = 1 << 24, 1 << 25, 1 << 26
_OTHERWISE_DRIVEN = 1 << 22 | 1 << 23 | _MANUAL
"""Setting level 1 is open, it tunes, or somebody drives the output by hand."""


def _bytes_with(ones: int, zeros: int) -> bytes:
    """Return the regular expression of a byte in which some bits are set and others are not."""
    return b"[%s]" % b"".join(b"\\x%02x" % each for each in range(256) if each & ones == ones and not each & zeros)


_SAYS_STOPPED = rb"%%s\x03\x04%s%s.{4}" % (
    _bytes_with(_STOPPED >> 24, _OTHERWISE_DRIVEN >> 24),
    _bytes_with(0, _OTHERWISE_DRIVEN >> 16 & 0xFF),
)
"""A status with STOP; the unit is filled in, then come the lower half and the checksum."""


class OmronE5ccThermal(ModbusThermal):
    """The one loop of the controller; fills the role `thermal`."""

    def safe_bytes(self, state: str, proof: Proof | None = None) -> SafeBytes:  # noqa: ARG002 - always an output of 0
        """Return the bytes of STOP; see `hil.instruments.roles.SafeByBytes`.

        Communications writing is switched on before it, or STOP would be refused; automatic operation follows, for by
        hand an output is given also while the controller is stopped. It is proven by both outputs of
        exactly 0 %, and by a status in which STOP stands, asked for twice: its other half is not known beforehand, and
        so its checksum is not either. Manual operation, a setting level that is open, and tuning are not safe.
        """
        must_be_state(THERMAL, self._name, state)
        unit, within_s = self._session.unit, self._session.timeout
        commands = [register(_OPERATION, command, unit) for command in (_WRITING_ON, _STOP, _AUTOMATIC)]
        status = exchange_like(question(3, _STATUS, 2, unit), _SAYS_STOPPED % re.escape(bytes((unit,))), within_s)
        outputs = exchange(question(3, _HEATING, 2, unit), registers_told((0, 0), unit), within_s)
        return SafeBytes(
            resync=(SILENCE,),
            off=tuple(exchange(command, command, within_s) for command in commands),
            proof=(status, status, outputs),
            owed_s=within_s,
        )

    def _agree(self) -> None:
        decimals = self._register(_DECIMAL_POINT)
        if decimals != self._decimals:
            raise Rejected(
                self._device,
                f"{self._name}: the display has {decimals} decimals, the wiring says {self._decimals}",
                "set the controller's input type, or `decimals` in the wiring",
            )

    def _regulate(self, setpoint: int) -> None:
        """Let it be written to, set the setpoint, then automatic, run."""
        self._command(_WRITING_ON, _WRITING, "communications writing", on=True)
        self._set(_SETPOINT, setpoint, "the setpoint")
        self._command(_AUTOMATIC, _MANUAL, "manual operation", on=False)
        self._command(_RUN, _STOPPED, "STOP", on=False)

    def _halt(self) -> None:
        self._command(_WRITING_ON, _WRITING, "communications writing", on=True)
        self._command(_STOP, _STOPPED, "STOP", on=True)
        self._command(_AUTOMATIC, _MANUAL, "manual operation", on=False)

    def _command(self, command: int, bit: int, what: str, *, on: bool) -> None:
        """Give an operation command where a bit of the status is not as it is to be, and read it back."""

        def differs() -> str:
            found = bool(_status(self._session) & bit)
            return (
                "" if found == on else f"was set to {'on' if on else 'off'} and reads back {'on' if found else 'off'}"
            )

        self._prove(what, lambda: self._session.write_holding(_OPERATION, command), differs)

    def _process_value(self) -> int:
        return self._register(_PROCESS_VALUE)

    def _working_setpoint(self) -> int:
        return self._register(_INTERNAL_SETPOINT)

    def _sensor_fails(self) -> bool:
        return bool(_status(self._session) & (_INPUT_ERROR | _CONVERTER_ERROR))

    def _power(self) -> int:
        return _power(self._session)


class OmronE5cc(ModbusThermalDriver):
    """Driver `omron-e5cc`: role `thermal`. See `ModbusThermalDriver`."""

    name: ClassVar[str] = "omron-e5cc"
    loop: ClassVar[type[ModbusThermal]] = OmronE5ccThermal

    def identify(self) -> Identity:
        """Read the status, by which a controller of this kind shows that it is there; it says nothing of itself."""
        _status(self._session)
        return Identity()

    def outlets(self) -> Sequence[Outlet]:
        """Return the loop's output; it is on unless it is stopped and gives nothing."""
        return (Outlet(0, not _status(self._session) & _STOPPED or _power(self._session) != 0),)


def _status(session: ModbusSession) -> int:
    """Read the status as one element of four bytes, the upper word first."""
    upper, lower = session.read_holding(_STATUS, 2)
    return upper << 16 | lower


def _power(session: ModbusSession) -> int:
    """Read what is given in tenths of a percent: heating less cooling."""
    heating, cooling = (signed(raw) for raw in session.read_holding(_HEATING, 2))
    return heating - cooling
