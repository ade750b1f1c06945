"""Omron E5CC and E5EC temperature controllers, Modbus RTU.

Addresses and commands: communications manual H175, sections 4-4 and 5-1. The status is read as one four-byte element
(040C), everything else as two-byte elements (2000 and up), integers with as many decimals as the decimal point monitor
(2410) reports. RUN and STOP are operation commands, function 06 to address 0000; writes are refused until
communications writing is switched on. Assumed from public drivers, not yet checked against an instrument: status bit 24
is STOP, 25 communications writing, 26 manual, 6 an input error.

A setpoint is written to non-volatile memory, so it is written only when it changes. The display unit is not read: it
must be degC. Over Modbus the controller reports neither model nor serial number.
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
"""Setting level 1 is open, auto-tuning runs, or the output is in manual mode."""


def _bytes_with(ones: int, zeros: int) -> bytes:
    """Return the regular expression for a byte with the bits `ones` set and the bits `zeros` clear."""
    return b"[%s]" % b"".join(b"\\x%02x" % each for each in range(256) if each & ones == ones and not each & zeros)


_SAYS_STOPPED = rb"%%s\x03\x04%s%s.{4}" % (
    _bytes_with(_STOPPED >> 24, _OTHERWISE_DRIVEN >> 24),
    _bytes_with(0, _OTHERWISE_DRIVEN >> 16 & 0xFF),
)
"""Reply pattern for a status with STOP; the unit is filled in, and the lower half and the checksum follow."""


class OmronE5ccThermal(ModbusThermal):
    """The controller's single loop; fills the role `thermal`."""

    def safe_bytes(self, state: str, proof: Proof | None = None) -> SafeBytes:  # noqa: ARG002 - always an output of 0
        """Return the bytes of STOP; see `hil.instruments.roles.SafeByBytes`.

        Communications writing is switched on first, or STOP would be refused; automatic mode follows, because in manual
        mode the output stays on even while the controller is stopped. The proof is both outputs at exactly 0 %, and a
        status with STOP, read twice: its other half, and with it the checksum, is not known beforehand. Manual mode, an
        open setting level and auto-tuning are not safe.
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

    def _check_display(self) -> None:
        decimals = self._register(_DECIMAL_POINT)
        if decimals != self._decimals:
            raise Rejected(
                self._device,
                f"{self._name}: the display has {decimals} decimals, the wiring says {self._decimals}",
                "set the controller's input type, or `decimals` in the wiring",
            )

    def _regulate(self, setpoint: int) -> None:
        """Enable writing, set the setpoint, then select automatic mode and RUN."""
        self._command(_WRITING_ON, _WRITING, "communications writing", on=True)
        self._set(_SETPOINT, setpoint, "the setpoint")
        self._command(_AUTOMATIC, _MANUAL, "manual operation", on=False)
        self._command(_RUN, _STOPPED, "STOP", on=False)

    def _stop_regulating(self) -> None:
        self._command(_WRITING_ON, _WRITING, "communications writing", on=True)
        self._command(_STOP, _STOPPED, "STOP", on=True)
        self._command(_AUTOMATIC, _MANUAL, "manual operation", on=False)

    def _command(self, command: int, bit: int, what: str, *, on: bool) -> None:
        """Send an operation command unless the status bit is already as wanted, and read it back."""

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
        """Read the status, which shows that a controller of this kind answers; it reports no identity."""
        _status(self._session)
        return Identity()

    def outlets(self) -> Sequence[Outlet]:
        """Return the loop's output; it is on unless the controller is stopped with an output of 0 %."""
        return (Outlet(0, not _status(self._session) & _STOPPED or _power(self._session) != 0),)


def _status(session: ModbusSession) -> int:
    """Read the status as one four-byte element, upper word first."""
    upper, lower = session.read_holding(_STATUS, 2)
    return upper << 16 | lower


def _power(session: ModbusSession) -> int:
    """Read the output in tenths of a percent: heating minus cooling."""
    heating, cooling = (signed(raw) for raw in session.read_holding(_HEATING, 2))
    return heating - cooling
