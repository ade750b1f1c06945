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
from hil.model.notation import Flag, SomeNanoseconds, number, one_of, whole
from hil.simulation.faults import Faults, Stuck
from hil.simulation.peers.eurotherm.controller import Runaway
from hil.simulation.peers.eurotherm.loop import Regulation, SensorDetached, SensorInput, SensorOpen, SensorTruth, Tuning
from hil.simulation.peers.eurotherm.memory import NoSuchParameter, Requests
from hil.simulation.peers.modbus_rtu import FrameReader, checked, seal
from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.peers.timing import Alarm
from hil.simulation.plants.terminal import InputPoint, Power
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import Line, PeerClock

__all__ = ["MODEL", "OmronE5cc", "OmronTruth", "build"]

_REPLY_NS = 8_000_000
_USUAL_BAUD = 9600
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
class OmronTruth:
    """One controller, and how somebody left it. See `hil.simulation.peers.eurotherm.controller.ControllerTruth`.

    Attributes:
        communications_writing: whether the line may write.
    """

    address: Annotated[int | None, whole(1, 99)] = None
    period_ns: SomeNanoseconds = field(default=NANOSECONDS // 20, metadata={"alias": "period"})
    decimals: Annotated[int, whole(0, 2)] = 1
    range_high: Annotated[float, number(0, 3000)] = 300.0
    setpoint: Annotated[float, number(-200, 1000)] = 22.0
    setpoint_high: Annotated[float, number(-200, 1000)] = 60.0
    setpoint_low: Annotated[float, number(-200, 1000)] = -30.0
    proportional_band: Annotated[float, number(0.1, 3000)] = 10.0
    integral_time: Annotated[int, whole(0, 9999)] = 60
    derivative_time: Annotated[int, whole(0, 9999)] = 0
    cool_gain: Annotated[float, number(0.1, 10)] = 2.0
    mode: Annotated[str, one_of("operating", "standby")] = "standby"
    communications_writing: Flag = False


class OmronE5cc(Stateful):
    """One loop that takes its turns on the bench's time.

    Faults are those of the Eurotherm: `stuck` lets nothing reach the cooler, `runaway` all that there is.

    Args:
        truth: what it is.
        address: of the unit.
        baud: of its line.
        sensor: its input.
        drive: the plant's input at its output, -1 to 1.
        power: of the amplifier between output and cooler.
        faults: what goes wrong.

    Attributes:
        memory_writes: how often the non-volatile memory was written.
    """

    memory_writes: Kept[int]
    _values: Kept[dict[int, int]]
    _bits: Kept[int]
    _regulation: Kept[Regulation]
    _reader: Kept[FrameReader]
    _next_turn: Kept[Alarm]
    _asked: Kept[float]

    def __init__(
        self,
        truth: OmronTruth,
        *,
        address: int,
        baud: int,
        sensor: SensorInput,
        drive: InputPoint | None,
        power: Power,
        faults: Faults,
    ) -> None:
        self._truth = truth
        self._address = address
        self._sensor = sensor
        self._drive = drive
        self._power = power
        self._faults = faults
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
        self._values |= {_SP: self._word(truth.setpoint), _DECIMALS: truth.decimals}
        self._bits = _STOPPED * (truth.mode == "standby") | _WRITING * truth.communications_writing
        self._regulation = Regulation()
        self._asked = 0.0
        self._requests = Requests(self._read, self._write)
        self._reader = FrameReader(baud, self._frame)
        self._line: Line
        self._clock: PeerClock

    def attach(self, line: Line, clock: PeerClock) -> None:
        """Connect the line; the first turn is taken at once."""
        self._line = line
        self._clock = clock
        self._reader.attach(clock)
        self._next_turn = Alarm(clock, self._turn)
        self._next_turn.set(clock.now_ns())
        self._power.listen(self._amplify)

    def receive(self, data: bytes) -> None:
        """Take bytes of the line."""
        self._reader.receive(data)

    def _word(self, value: float) -> int:
        return int(min(max(round(value * 10**self._truth.decimals), -0x8000), 0x7FFF))

    def _turn(self) -> None:
        """Convert, regulate, drive the output, and show all of it."""
        now_ns, period_ns = self._clock.now_ns(), self._truth.period_ns
        place = now_ns // period_ns
        reading = self._sensor.convert(now_ns, place)
        self._values[_PV] = self._word(self._truth.range_high if reading is None else reading)
        self._bits = self._bits & ~_INPUT_ERROR | _INPUT_ERROR * (reading is None)
        if self._bits & _BY_HAND:
            self._give((self._values[_HEATING] - self._values[_COOLING]) / 10)
        elif reading is None or self._bits & _STOPPED:
            self._give_nothing()
        else:
            setpoint = self._values[_SP] / 10**self._truth.decimals
            self._give(round(self._regulation.output(setpoint, reading, self._tuning, period_ns / NANOSECONDS), 1))
        self._next_turn.set((place + 1) * period_ns)

    def _give_nothing(self) -> None:
        self._regulation.clear()
        self._give(0.0)

    def _give(self, output: float) -> None:
        self._values |= {_HEATING: round(10 * max(output, 0.0)), _COOLING: round(10 * max(-output, 0.0))}
        if self._faults.now(Stuck, self._clock.now_ns()):
            output = 0.0
        elif self._faults.now(Runaway, self._clock.now_ns()):
            output = _ALL
        self._asked = output
        self._amplify()

    def _amplify(self) -> None:
        if self._drive is not None:
            self._drive.command(self._asked / _ALL if self._power.there else 0.0)

    def _frame(self, frame: bytes) -> None:
        body = checked(frame)
        if body is None or body[0] not in {0, self._address}:
            return
        permits = body[1:5] == b"\x06\x00\x00\x00" or self._bits & _WRITING
        if body[1] in _WRITES and not permits:
            reply = bytes((body[1] | _EXCEPTION, _REFUSED))
        else:
            reply = self._requests.answer(body[1], body[2:])
        if body[0]:
            self._line.send(seal(body[:1] + reply), _REPLY_NS)

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
            if not self._word(self._truth.setpoint_low) <= value <= self._word(self._truth.setpoint_high):
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
            self._give_nothing()


def build(setup: PeerSetup) -> OmronE5cc:
    """Build the controller; terminals are `sensor`, `ambient` and `power`, signals, and `drive`, an input.

    Raises:
        TruthError: with everything that is wrong in its truth or terminals.
    """
    truth, connections = setup.truth, setup.connections
    own = truth.part(OmronTruth)
    sensor = SensorInput(
        truth=truth.part(SensorTruth),
        place=connections.signal("sensor"),
        room=connections.signal("ambient"),
        faults=setup.faults,
        noise=setup.stream("sensor"),
    )
    drive, power = connections.input("drive"), Power(connections.signal("power"))
    setup.finish()
    return OmronE5cc(
        own,
        address=own.address or setup.instrument.address or 1,
        baud=setup.instrument.baud or _USUAL_BAUD,
        sensor=sensor,
        drive=drive,
        power=power,
        faults=setup.faults,
    )


MODEL = PeerModel(link="serial", fault_kinds=(Runaway, SensorDetached, SensorOpen, Stuck), build=build)
"""The model for the driver `omron-e5cc`."""
