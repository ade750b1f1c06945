"""Eurotherm 3216 temperature controller, Modbus RTU.

Registers are those of the 3200 series engineering handbook HA028651 (issue 7, section 15.5): whole numbers,
temperatures with as many decimals as the display shows. Assumed, from public drivers and the 2000 series, and not yet
checked against an instrument: powers in tenths of a percent, units at 516, decimals at 525, and a type code (122)
that reads 3216 in hexadecimal.

The target setpoint (2) is stored in memory rated for 100,000 writes, so it is written only when it changes. The remote
setpoint (26) has no such limit, but it times out after some seconds without a write: a bench that waits for a person,
or computes, would lose control of the temperature. So the local setpoint is used.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from hil.instruments.driver import Outlet
from hil.instruments.modbus_line import SILENCE, exchange, one_register, question, register, registers_told
from hil.instruments.modbus_thermal import ModbusThermal, ModbusThermalDriver, signed
from hil.instruments.roles import THERMAL
from hil.instruments.safing import must_be_state
from hil.model.bench import Proof
from hil.model.errors import Rejected
from hil.model.identity import Identity
from hil.model.safing import SafeBytes

__all__ = ["Eurotherm3216", "Eurotherm3216Thermal"]

_PROCESS_VALUE, _TARGET_SETPOINT, _WORKING_OUTPUT, _WORKING_SETPOINT = 1, 2, 4, 5
_STATUS, _VERSION, _TYPE_CODE = 75, 107, 122
_SIMULATED = 0x5349
"""The version of a simulated controller, the letters SI."""
_INSTRUMENT_MODE, _LOOP_MODE, _SETPOINT_SOURCE = 199, 273, 276
_UNITS, _DECIMALS = 516, 525

_SENSOR_BREAK, _OVER_RANGE = 1 << 5, 1 << 10
_OPERATING, _STANDBY = 0, 1
_AUTOMATIC, _LOCAL, _CELSIUS = 0, 0, 0
_SERIES = 0x3200


class Eurotherm3216Thermal(ModbusThermal):
    """The controller's single loop; fills the role `thermal`."""

    def safe_bytes(self, state: str, proof: Proof | None = None) -> SafeBytes:  # noqa: ARG002 - always an output of 0
        """Return the bytes of standby; see `hil.instruments.roles.SafeByBytes`.

        The mode is always written, which is rare enough for the memory. The proof is the mode and a working output of
        exactly 0 %; bytes alone cannot check a temperature against bounds.
        """
        must_be_state(THERMAL, self._name, state)
        unit, within_s = self._session.unit, self._session.timeout
        mode = register(_INSTRUMENT_MODE, _STANDBY, unit)
        told = ((_INSTRUMENT_MODE, _STANDBY), (_WORKING_OUTPUT, 0))
        return SafeBytes(
            resync=(SILENCE,),
            off=(exchange(mode, mode, within_s),),
            proof=tuple(
                exchange(question(3, at, 1, unit), registers_told((value,), unit), within_s) for at, value in told
            ),
            owed_s=within_s,
            who=one_register(_TYPE_CODE, unit, within_s),
        )

    def _check_display(self) -> None:
        """Compare the instrument's decimals and units with the wiring's."""
        decimals, units = self._register(_DECIMALS), self._register(_UNITS)
        if decimals != self._decimals or units != _CELSIUS:
            raise Rejected(
                self._device,
                f"{self._name}: the display has {decimals} decimals and unit {units},"
                f" the wiring says {self._decimals} decimals, and 0 is degC",
                "set the instrument's decimal point and unit, or `decimals` in the wiring",
            )

    def _regulate(self, setpoint: int) -> None:
        """Write the setpoint, then select local setpoint, automatic mode and operating."""
        self._set(_TARGET_SETPOINT, setpoint, "the setpoint")
        self._set(_SETPOINT_SOURCE, _LOCAL, "the setpoint's source")
        self._set(_LOOP_MODE, _AUTOMATIC, "the loop's mode")
        self._set(_INSTRUMENT_MODE, _OPERATING, "the instrument's mode")

    def _stop_regulating(self) -> None:
        self._set(_INSTRUMENT_MODE, _STANDBY, "the instrument's mode")

    def _process_value(self) -> int:
        return self._register(_PROCESS_VALUE)

    def _working_setpoint(self) -> int:
        return self._register(_WORKING_SETPOINT)

    def _sensor_fails(self) -> bool:
        return bool(self._register(_STATUS) & (_SENSOR_BREAK | _OVER_RANGE))

    def _power(self) -> int:
        return signed(self._register(_WORKING_OUTPUT))


class Eurotherm3216(ModbusThermalDriver):
    """Driver `eurotherm-3216`: role `thermal`. See `ModbusThermalDriver`."""

    name: ClassVar[str] = "eurotherm-3216"
    loop: ClassVar[type[ModbusThermal]] = Eurotherm3216Thermal

    def identify(self) -> Identity:
        """Read type code and version, whose hexadecimal digits read as the model and V1.11; it reports nothing else."""
        try:
            code, version = (self._session.read_holding(address, 1)[0] for address in (_TYPE_CODE, _VERSION))
        except Rejected:
            return Identity()
        model = f"{code:04X}" if code & 0xFF00 == _SERIES else f"type code {code:#06x}"
        if version == _SIMULATED:
            return Identity(model=model, firmware="SIMULATED")
        return Identity(model=model, firmware=f"{version >> 8:X}.{version & 0xFF:02X}")

    def outlets(self) -> Sequence[Outlet]:
        """Return the loop's output; it is on while the controller regulates, or outputs power in manual mode."""
        mode, loop, output = (
            self._session.read_holding(address, 1)[0] for address in (_INSTRUMENT_MODE, _LOOP_MODE, _WORKING_OUTPUT)
        )
        return (Outlet(0, (mode == _OPERATING and loop == _AUTOMATIC) or output != 0),)
