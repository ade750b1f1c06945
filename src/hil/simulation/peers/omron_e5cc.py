"""An Omron E5CC temperature controller, for heating and cooling, as its Modbus line sees it.

Facts, from the communications manual H175: an address below 2000 is of four bytes, upper word first, and read in pairs
from an even address; from 2000 on elements have two. Function 06 to address 0000 is an operation command: 00 lets the
line write or not, 01 is RUN or STOP, 04 the write mode, 09 automatic or manual. What the line may not do is refused
with exception 4. Setpoints that are written in backup mode go into a non-volatile memory.

Assumed: bits of the status as in the driver's public examples; a setpoint beyond its limits is refused with exception
3; while the input fails the process value stands at the top of its range and nothing is given, as while it is stopped;
by hand it gives what it gave, also while it is stopped. There is no tuning, no setting level 1, and no alarm.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from hil.clock.port import NANOSECONDS
from hil.model.notation import Flag, SomeNanoseconds, whole
from hil.simulation.peers.thermal.controller import LoopEnds, LoopTruth, ThermalController, model_of
from hil.simulation.peers.thermal.loop import Tuning
from hil.simulation.peers.thermal.requests import NoSuchParameter, Requests
from hil.wire.checkpoint import Kept

__all__ = ["MODEL", "OmronE5cc", "OmronTruth"]

_ALL = 100.0
_WRITES, _REFUSED, _EXCEPTION = {0x06, 0x10}, 4, 0x80
_PV, _STATUS, _INTERNAL_SP, _HEATING, _COOLING = 0x2000, 0x2001, 0x2002, 0x2004, 0x2005
_SP, _ALARM_UPPER, _ALARM_LOWER, _STATUS_AGAIN, _STATUS_UPPER, _DECIMALS = (
    0x2103,
    0x2105,
    0x2106,
    0x2406,
    0x2407,
    0x2410,
)
_IN_FOUR_BYTES = {0x0000: _PV, 0x0004: _INTERNAL_SP, 0x0008: _HEATING, 0x000A: _COOLING, 0x0106: _SP}
_LONG_STATUS = {0x0002, 0x040C}
_INPUT_ERROR, _RAM, _STOPPED, _WRITING, _BY_HAND = 1 << 6, 1 << 20, 1 << 24, 1 << 25, 1 << 26
_COMMANDS = {0x00: _WRITING, 0x01: _STOPPED, 0x04: _RAM, 0x09: _BY_HAND}


@dataclass(frozen=True, slots=True, kw_only=True)
class OmronTruth(LoopTruth):
    """One controller, and how somebody left it: whether the line may write besides."""

    address: Annotated[int | None, whole(1, 99)] = None
    period_ns: SomeNanoseconds = field(default=NANOSECONDS // 20, metadata={"alias": "period"})
    communications_writing: Flag = False


class OmronE5cc(ThermalController):
    """The controller. See `ThermalController`.

    Args:
        truth: what it is.
        ends: what it is connected to.

    Attributes:
        memory_writes: how often the non-volatile memory was written.
    """

    memory_writes: Kept[int]
    _values: Kept[dict[int, int]]
    _bits: Kept[int]

    def __init__(self, truth: OmronTruth, ends: LoopEnds) -> None:
        super().__init__(ends, truth.period_ns)
        self._truth = truth
        self._tuning = Tuning(
            band=truth.proportional_band,
            integral=truth.integral_time,
            derivative=truth.derivative_time,
            cool_gain=truth.cool_gain,
            low=-_ALL,
            high=_ALL,
        )
        self.memory_writes = 0
        self._values = dict.fromkeys((_PV, _HEATING, _COOLING, _ALARM_UPPER, _ALARM_LOWER), 0)
        self._values |= {_SP: truth.word(truth.setpoint), _DECIMALS: truth.decimals}
        self._bits = _STOPPED * (truth.mode == "standby") | _WRITING * truth.communications_writing
        self._requests = Requests(self._read, self._write)

    def _turn(self, now_ns: int, reading: float | None) -> float:
        """Regulate, and show all of it; by hand the output stays as it is."""
        del now_ns
        truth = self._truth
        self._values[_PV] = truth.word(truth.range_high if reading is None else reading)
        self._bits = self._bits & ~_INPUT_ERROR | _INPUT_ERROR * (reading is None)
        if self._bits & _BY_HAND:
            return (self._values[_HEATING] - self._values[_COOLING]) / 10
        if reading is None or self._bits & _STOPPED:
            return self._nothing()
        setpoint, seconds = self._values[_SP] / 10**truth.decimals, self._period_ns / NANOSECONDS
        return self._shown(round(self._regulation.output(setpoint, reading, self._tuning, seconds), 1))

    def _nothing(self) -> float:
        self._regulation.clear()
        return self._shown(0.0)

    def _shown(self, output: float) -> float:
        self._values |= {_HEATING: round(10 * max(output, 0.0)), _COOLING: round(10 * max(-output, 0.0))}
        return output

    def _answer(self, function: int, data: bytes) -> bytes:
        permitted = data[:3] == bytes(3) or self._bits & _WRITING
        if function in _WRITES and not permitted:
            return bytes((function | _EXCEPTION, _REFUSED))
        return self._requests.answer(function, data)

    def _read(self, address: int) -> int:
        """Return one word; of an element of four bytes the upper one is at the even address."""
        if address < _PV:
            element, upper = address & ~1, not address & 1
            value = self._bits if element in _LONG_STATUS else self._read(_IN_FOUR_BYTES.get(element, address))
            return value >> 16 if upper else value & 0xFFFF
        if address in {_STATUS, _STATUS_AGAIN}:
            return self._bits & 0xFFFF
        if address == _STATUS_UPPER:
            return self._bits >> 16
        if address not in {*self._values, _INTERNAL_SP}:
            raise NoSuchParameter
        return self._values[_SP if address == _INTERNAL_SP else address]

    def _write(self, address: int, value: int) -> None:
        if address == 0:
            self._operate(value >> 8, value & 0xFF)
        elif address == _SP:
            if not self._truth.word(self._truth.setpoint_low) <= value <= self._truth.word(self._truth.setpoint_high):
                raise ValueError(value)
            self._keep(address, value)
        elif address in {_ALARM_UPPER, _ALARM_LOWER}:
            self._keep(address, value)
        else:
            raise NoSuchParameter

    def _keep(self, address: int, value: int) -> None:
        self._values[address] = value
        self.memory_writes += not self._bits & _RAM

    def _operate(self, command: int, information: int) -> None:
        """Carry out an operation command."""
        if command not in _COMMANDS or information not in {0, 1}:
            raise ValueError(command)
        bit = _COMMANDS[command]
        self._bits = self._bits & ~bit | bit * information
        if self._bits & _STOPPED and not self._bits & _BY_HAND:
            self._drive_at(self._nothing(), self._clock.now_ns())


MODEL = model_of(OmronTruth, OmronE5cc)
"""The model for the driver `omron-e5cc`."""
