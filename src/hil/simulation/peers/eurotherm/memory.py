"""Parameters of the controller by Modbus address.

HA028651 issue 7, section 15.5: values are whole numbers; temperatures have the decimals of the display, powers and the
proportional band one. A setpoint beyond its limits is clipped, an address that is not listed is refused (assumed).
"""

from __future__ import annotations

from collections.abc import Mapping

from hil.simulation.peers.thermal.requests import NoSuchParameter
from hil.wire.checkpoint import Kept, Stateful

__all__ = [
    "AUTOMATIC",
    "COMMS_SETPOINT",
    "COOL_GAIN",
    "DECIMALS",
    "DERIVATIVE_TIME",
    "INSTRUMENT_MODE",
    "INTEGRAL_TIME",
    "INVERTED_STATUS",
    "LOOP_MODE",
    "MANUAL_OUTPUT",
    "OPERATING",
    "OUTPUT_HIGH",
    "OUTPUT_LOW",
    "PROCESS_VALUE",
    "PROPORTIONAL_BAND",
    "SAFE_OUTPUT",
    "SENSOR_BREAK",
    "SETPOINTS",
    "SETPOINT_HIGH",
    "SETPOINT_LOW",
    "SETPOINT_SELECT",
    "SETPOINT_SOURCE",
    "STANDBY",
    "STATUS",
    "TARGET_SETPOINT",
    "TIMER_STATUS",
    "TYPE_CODE",
    "UNITS",
    "UNIT_ADDRESS",
    "VERSION",
    "WORKING_OUTPUT",
    "WORKING_SETPOINT",
    "Memory",
]

PROCESS_VALUE, TARGET_SETPOINT, MANUAL_OUTPUT, WORKING_OUTPUT, WORKING_SETPOINT = range(1, 6)
PROPORTIONAL_BAND, INTEGRAL_TIME, DERIVATIVE_TIME = 6, 8, 9
SETPOINT_SELECT, COOL_GAIN, TIMER_STATUS = 15, 19, 23
SETPOINTS = (24, 25)
COMMS_SETPOINT = 26
OUTPUT_HIGH, OUTPUT_LOW, SAFE_OUTPUT = 30, 31, 34
STATUS, INVERTED_STATUS = 75, 76
VERSION, SETPOINT_HIGH, SETPOINT_LOW, TYPE_CODE, UNIT_ADDRESS = 107, 111, 112, 122, 131
INSTRUMENT_MODE, SENSOR_BREAK, LOOP_MODE, SETPOINT_SOURCE = 199, 258, 273, 276
UNITS, DECIMALS = 516, 525

OPERATING, STANDBY = 0, 1
AUTOMATIC = 0

_CHOICES = {SETPOINT_SELECT: (0, 1), INSTRUMENT_MODE: (0, 1, 2), LOOP_MODE: (0, 1), SETPOINT_SOURCE: (0, 1)}
_SETPOINTS = {TARGET_SETPOINT, *SETPOINTS, COMMS_SETPOINT}
_LOST_WITHOUT_POWER = {COMMS_SETPOINT}
_WRITABLE = {
    *_SETPOINTS,
    *_CHOICES,
    MANUAL_OUTPUT,
    PROPORTIONAL_BAND,
    INTEGRAL_TIME,
    DERIVATIVE_TIME,
    COOL_GAIN,
    OUTPUT_HIGH,
    OUTPUT_LOW,
    SAFE_OUTPUT,
}


class Memory(Stateful):
    """Values by address, as signed 16-bit numbers.

    Args:
        values: every parameter that there is, but the target setpoint, which is one of the two setpoints.

    Attributes:
        writes: how often each address of the non-volatile memory was written, whatever the value: it is specified for
            100,000 times.
    """

    _values: Kept[dict[int, int]]
    writes: Kept[dict[int, int]]

    def __init__(self, values: Mapping[int, int]) -> None:
        self._values = dict(values)
        self.writes = {}

    def __getitem__(self, address: int) -> int:
        if address == TARGET_SETPOINT:
            address = self._real(address)
        try:
            return self._values[address]
        except KeyError:
            raise NoSuchParameter from None

    def show(self, values: Mapping[int, int]) -> None:
        """Let the instrument itself set what it shows."""
        self._values.update(values)

    def write(self, address: int, value: int) -> None:
        """Write from the line.

        Raises:
            NoSuchParameter: nobody can write there.
            ValueError: the parameter cannot have this value.
        """
        if address not in _WRITABLE:
            raise NoSuchParameter
        if value not in _CHOICES.get(address, (value,)):
            raise ValueError(value)
        if address in _SETPOINTS:
            value = min(max(value, self[SETPOINT_LOW]), self[SETPOINT_HIGH])
        self._values[self._real(address)] = value
        if address not in _LOST_WITHOUT_POWER:
            address = self._real(address)
            self.writes[address] = self.writes.get(address, 0) + 1

    def _real(self, address: int) -> int:
        return SETPOINTS[self._values[SETPOINT_SELECT]] if address == TARGET_SETPOINT else address
