"""The controller: its turn every period, its output on the cooler, and its registers on the line.

What the map (HA028651, section 15.5) does not say is assumed: while the sensor is broken the process value stands at
the top of its range and the safe output power is given; standby sets output and integral term to 0; the remote setpoint
counts for five seconds after it was written. There is no timer, no autotune, and no setpoint ramp.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from hil.clock.port import NANOSECONDS
from hil.model.notation import matching, number, one_of
from hil.simulation.faults import Fault
from hil.simulation.peers.eurotherm import memory as at
from hil.simulation.peers.eurotherm.memory import Memory
from hil.simulation.peers.thermal.controller import LoopEnds, LoopTruth, ThermalController, model_of
from hil.simulation.peers.thermal.loop import Tuning
from hil.simulation.peers.thermal.requests import Requests
from hil.wire.checkpoint import Kept

__all__ = ["MODEL", "ControllerTruth", "Eurotherm3216", "OtherType"]

_REMOTE_NS = 5 * NANOSECONDS
_ALL = 100.0
_BROKEN, _BY_HAND, _REMOTE_FAILED = 1 << 5, 1 << 4, 1 << 14
_UNITS = {"degC": (0, 1.0, 0.0), "degF": (1, 1.8, 32.0), "K": (2, 1.0, 273.15)}
_SIMULATED = 0x5349
"""The version of a simulated controller, the letters SI; no real one can have it."""
_CODE_WORDS = "the four digits of a type code, such as '3216'"
_MODES = {"operating": at.OPERATING, "standby": at.STANDBY}


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherType(Fault):
    """A controller of another type answers: `value` is its type code."""

    name = "identity"

    value: Annotated[str, matching("(0x)?[0-9A-Fa-f]{1,4}", "a hexadecimal number such as 0x3C")]


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerTruth(LoopTruth):
    """One controller, and how somebody left it.

    Attributes:
        unit: of the display.
        output_high, output_low: limits of the output [%].
        model: type code, in hexadecimal.
    """

    unit: Annotated[str, one_of(*_UNITS)] = "degC"
    output_high: Annotated[float, number(0, 100)] = 100.0
    output_low: Annotated[float, number(-100, 0)] = -100.0
    model: Annotated[str, matching("(0[xX])?[0-9A-Fa-f]{1,4}", _CODE_WORDS)] = "3216"

    def shown(self, celsius: float) -> float:
        """Return a temperature in the unit of the display."""
        _, factor, offset = _UNITS[self.unit]
        return celsius * factor + offset

    def memory(self, address: int) -> Memory:
        """Return the parameters as somebody left them, of a unit with that address."""
        return Memory(
            {
                **dict.fromkeys(
                    (at.PROCESS_VALUE, at.WORKING_OUTPUT, at.WORKING_SETPOINT, at.STATUS, at.SENSOR_BREAK), 0
                ),
                **dict.fromkeys((at.TIMER_STATUS, at.SETPOINT_SELECT, at.SETPOINT_SOURCE, at.COMMS_SETPOINT), 0),
                **dict.fromkeys((at.MANUAL_OUTPUT, at.SAFE_OUTPUT, at.LOOP_MODE, at.INVERTED_STATUS), 0),
                **dict.fromkeys(at.SETPOINTS, self.word(self.setpoint)),
                at.PROPORTIONAL_BAND: round(10 * self.proportional_band),
                at.INTEGRAL_TIME: self.integral_time,
                at.DERIVATIVE_TIME: self.derivative_time,
                at.COOL_GAIN: round(10 * self.cool_gain),
                at.OUTPUT_HIGH: round(10 * self.output_high),
                at.OUTPUT_LOW: round(10 * self.output_low),
                at.SETPOINT_HIGH: self.word(self.setpoint_high),
                at.SETPOINT_LOW: self.word(self.setpoint_low),
                at.INSTRUMENT_MODE: _MODES[self.mode],
                at.TYPE_CODE: int(self.model, 16),
                at.VERSION: _SIMULATED,
                at.UNIT_ADDRESS: address,
                at.UNITS: _UNITS[self.unit][0],
                at.DECIMALS: self.decimals,
            }
        )


class Eurotherm3216(ThermalController):
    """The controller; `identity` changes its type code. See `ThermalController`.

    Args:
        truth: what it is.
        ends: what it is connected to.
    """

    _memory: Kept[Memory]
    _remote_ns: Kept[int]

    def __init__(self, truth: ControllerTruth, ends: LoopEnds) -> None:
        super().__init__(ends, truth.period_ns)
        self._truth = truth
        self._memory = truth.memory(ends.address)
        self._tuned: Tuning | None = None  # until a parameter is written
        self._requests = Requests(self._read, self._write)
        self._remote_ns = -_REMOTE_NS - 1

    @property
    def writes(self) -> Mapping[int, int]:
        """How often each address of the non-volatile memory was written."""
        return self._memory.writes

    def restored(self) -> None:
        """Read the tuning from what was restored."""
        self._tuned = None

    def _answer(self, function: int, data: bytes) -> bytes:
        return self._requests.answer(function, data)

    def _turn(self, now_ns: int, reading: float | None) -> float:
        """Regulate, and show all of it."""
        truth = self._truth
        value = truth.range_high if reading is None else truth.shown(reading)
        remote_failed, setpoint = self._setpoint(now_ns)
        output = round(self._output(setpoint / 10**truth.decimals, None if reading is None else value), 1)
        status = _BROKEN * (reading is None) | _BY_HAND * (self._memory[at.LOOP_MODE] != at.AUTOMATIC)
        self._memory.show(
            {
                at.PROCESS_VALUE: truth.word(value),
                at.WORKING_SETPOINT: setpoint,
                at.WORKING_OUTPUT: round(10 * output),
                at.SENSOR_BREAK: int(reading is None),
                at.STATUS: status | _REMOTE_FAILED * remote_failed,
            }
        )
        return output

    def _setpoint(self, now_ns: int) -> tuple[bool, int]:
        """Return whether the remote setpoint is asked for and stale, and the setpoint that counts."""
        asked = self._memory[at.SETPOINT_SOURCE] != 0
        fresh = now_ns - self._remote_ns <= _REMOTE_NS
        source = at.COMMS_SETPOINT if asked and fresh else at.TARGET_SETPOINT
        return asked and not fresh, self._memory[source]

    def _output(self, setpoint: float, value: float | None) -> float:
        tuning = self._tuned
        if tuning is None:
            tuning = self._tuned = self._tuning()
        if self._memory[at.INSTRUMENT_MODE] != at.OPERATING:
            self._regulation.clear()
            return 0.0
        by_hand = self._memory[at.LOOP_MODE] != at.AUTOMATIC
        if value is not None and not by_hand:
            return self._regulation.output(setpoint, value, tuning, self._period_ns / NANOSECONDS)
        output = tuning.limited(self._memory[at.MANUAL_OUTPUT if by_hand else at.SAFE_OUTPUT] / 10)
        error = 0.0 if value is None else setpoint - value
        self._regulation.hold(output, min(max(error, -tuning.band), tuning.band), tuning)
        return output

    def _tuning(self) -> Tuning:
        return Tuning(
            band=max(self._memory[at.PROPORTIONAL_BAND], 1) / 10,
            integral=self._memory[at.INTEGRAL_TIME],
            derivative=self._memory[at.DERIVATIVE_TIME],
            cool_gain=max(self._memory[at.COOL_GAIN], 1) / 10,
            low=max(self._memory[at.OUTPUT_LOW] / 10, -_ALL),
            high=min(self._memory[at.OUTPUT_HIGH] / 10, _ALL),
        )

    def _read(self, address: int) -> int:
        other = self._faults.now(OtherType, self._clock.now_ns())
        if address == at.TYPE_CODE and other:
            return int(other.value, 16)
        if address == at.INVERTED_STATUS:
            return ~self._memory[at.STATUS]
        return self._memory[address]

    def _write(self, address: int, value: int) -> None:
        self._memory.write(address, value)
        self._tuned = None
        if address == at.COMMS_SETPOINT:
            self._remote_ns = self._clock.now_ns()
        if address == at.INSTRUMENT_MODE and self._memory[address] != at.OPERATING:
            # However rarely it takes its turns, nothing goes to the cooler from here on.
            self._regulation.clear()
            self._memory.show({at.WORKING_OUTPUT: 0})
            self._drive_at(0.0, self._clock.now_ns())


MODEL = model_of(ControllerTruth, Eurotherm3216, OtherType)
"""The model for the driver `eurotherm-3216`."""
