"""The controller: its turn every period, its output on the cooler, and its registers on the line.

What the map (HA028651, section 15.5) does not say is assumed: while the sensor is broken the process value stands at
the top of its range and the safe output power is given; standby sets output and integral term to 0; the remote setpoint
counts for five seconds after it was written. There is no timer, no autotune, and no setpoint ramp.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from hil.clock.port import NANOSECONDS
from hil.model.notation import SomeNanoseconds, matching, number, one_of, whole
from hil.simulation.faults import Fault, Faults, Stuck
from hil.simulation.peers.eurotherm import memory as at
from hil.simulation.peers.eurotherm.loop import Regulation, SensorDetached, SensorInput, SensorOpen, SensorTruth, Tuning
from hil.simulation.peers.eurotherm.memory import Memory, Requests
from hil.simulation.peers.modbus_rtu import FrameReader, checked, seal
from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.peers.timing import Alarm
from hil.simulation.plants.terminal import InputPoint, Power
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import Line, PeerClock

__all__ = ["MODEL", "ControllerTruth", "Eurotherm3216", "Make", "OtherType", "Runaway", "build"]

_REPLY_NS = 5_000_000
_REMOTE_NS = 5 * NANOSECONDS
_ALL = 100.0
_BROKEN, _BY_HAND, _REMOTE_FAILED = 1 << 5, 1 << 4, 1 << 14
_UNITS = {"degC": (0, 1.0, 0.0), "degF": (1, 1.8, 32.0), "K": (2, 1.0, 273.15)}
_CODE_WORDS = "the four digits of a type code, such as '3216'"
_Setpoint = Annotated[float, number(-200, 1000)]


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherType(Fault):
    """A controller of another type answers: `value` is its type code."""

    name = "identity"

    value: Annotated[str, matching("(0x)?[0-9A-Fa-f]{1,4}", "a hexadecimal number such as 0x3C")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Runaway(Fault):
    """All that there is reaches the cooler, in the direction that was asked for last."""

    name = "runaway"


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerTruth:
    """One controller, and how somebody left it.

    Attributes:
        address: of the unit, None for the one that the bench file has.
        period_ns: of its control loop.
        decimals, unit: of the display.
        range_high: what the process value shows while the sensor is broken, in that unit, as all its setpoints are.
        proportional_band, integral_time, derivative_time, cool_gain: of the loop [1, s, s, 1].
        output_high, output_low: limits of the output [%].
        mode: `operating` or `standby`.
        model, firmware: type code and version, in hexadecimal.
    """

    address: Annotated[int | None, whole(1, 254)] = None
    period_ns: SomeNanoseconds = field(default=NANOSECONDS, metadata={"alias": "period"})
    decimals: Annotated[int, whole(0, 2)] = 1
    unit: Annotated[str, one_of(*_UNITS)] = "degC"
    range_high: Annotated[float, number(0, 3000)] = 300.0
    setpoint: _Setpoint = 22.0
    setpoint_high: _Setpoint = 60.0
    setpoint_low: _Setpoint = -30.0
    proportional_band: Annotated[float, number(0.1, 3000)] = 10.0
    integral_time: Annotated[int, whole(0, 9999)] = 60
    derivative_time: Annotated[int, whole(0, 9999)] = 0
    cool_gain: Annotated[float, number(0.1, 10)] = 2.0
    output_high: Annotated[float, number(0, 100)] = 100.0
    output_low: Annotated[float, number(-100, 0)] = -100.0
    mode: Annotated[str, one_of("operating", "standby")] = "standby"
    model: Annotated[str, matching("(0[xX])?[0-9A-Fa-f]{1,4}", _CODE_WORDS)] = "3216"
    firmware: Annotated[str, matching(r"[0-9A-Fa-f]{1,2}\.[0-9A-Fa-f]{1,2}", "a version such as '1.11'")] = "1.11"


@dataclass(frozen=True, slots=True, kw_only=True)
class Make:
    """What this article is.

    Attributes:
        address: unit address.
        baud: of its line.
        period_ns: of its control loop.
        decimals: of the display.
        unit: of the display: `degC`, `degF` or `K`.
        top: what the process value shows while the sensor is broken, in that unit.
    """

    address: int
    baud: int
    period_ns: int
    decimals: int
    unit: str
    top: float

    def shown(self, celsius: float) -> float:
        """Return a temperature in the unit of the display."""
        _, factor, offset = _UNITS[self.unit]
        return celsius * factor + offset

    def word(self, value: float) -> int:
        """Return a temperature in that unit as the registers have it."""
        return int(min(max(round(value * 10**self.decimals), -0x8000), 0x7FFF))

    @property
    def unit_code(self) -> int:
        """The unit as register 516 has it."""
        return _UNITS[self.unit][0]


class Eurotherm3216(Stateful):
    """One loop that takes its turns on the bench's time, from the first one on.

    The fault `stuck` lets nothing of the output reach the cooler, `runaway` all that there is, in the direction that
    heats; both whatever the controller shows. `identity` changes the type code.

    Args:
        make: what it is.
        memory: its parameters.
        sensor: its input.
        drive: the plant's input at its output, -1 to 1.
        power: of the amplifier between output and cooler; without it nothing drives the cooler.
        faults: what goes wrong.
    """

    _memory: Kept[Memory]
    _regulation: Kept[Regulation]
    _reader: Kept[FrameReader]
    _remote_ns: Kept[int]
    _next_turn: Kept[Alarm]
    _asked: Kept[float]

    def __init__(
        self,
        *,
        make: Make,
        memory: Memory,
        sensor: SensorInput,
        drive: InputPoint | None,
        power: Power,
        faults: Faults,
    ) -> None:
        self._make = make
        self._memory = memory
        self._sensor = sensor
        self._drive = drive
        self._power = power
        self._asked = 0.0  # of the amplifier, in %
        self._faults = faults
        self._regulation = Regulation()
        self._tuned: Tuning | None = None  # until a parameter is written
        self._requests = Requests(self._read, self._write)
        self._reader = FrameReader(make.baud, self._frame)
        self._remote_ns = -_REMOTE_NS - 1
        self._line: Line
        self._clock: PeerClock

    @property
    def writes(self) -> Mapping[int, int]:
        """How often each address of the non-volatile memory was written."""
        return self._memory.writes

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

    def restored(self) -> None:
        """Read the tuning from what was restored."""
        self._tuned = None

    def _turn(self) -> None:
        """Convert, regulate, drive the output, and show all of it."""
        now_ns = self._clock.now_ns()
        number = now_ns // self._make.period_ns
        reading = self._sensor.convert(now_ns, number)
        value = self._make.top if reading is None else self._make.shown(reading)
        remote_failed, setpoint = self._setpoint(now_ns)
        output = round(self._output(setpoint / 10**self._make.decimals, None if reading is None else value), 1)
        status = _BROKEN * (reading is None) | _BY_HAND * (self._memory[at.LOOP_MODE] != at.AUTOMATIC)
        self._memory.show(
            {
                at.PROCESS_VALUE: self._make.word(value),
                at.WORKING_SETPOINT: setpoint,
                at.WORKING_OUTPUT: round(10 * output),
                at.SENSOR_BREAK: int(reading is None),
                at.STATUS: status | _REMOTE_FAILED * remote_failed,
            }
        )
        self._drive_at(output, now_ns)
        self._next_turn.set((number + 1) * self._make.period_ns)

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
            return self._regulation.output(setpoint, value, tuning, self._make.period_ns / NANOSECONDS)
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

    def _drive_at(self, output: float, now_ns: int) -> None:
        if self._faults.faults:
            if self._faults.now(Stuck, now_ns):
                output = 0.0
            elif self._faults.now(Runaway, now_ns):
                output = _ALL
        self._asked = output
        self._amplify()

    def _amplify(self) -> None:
        if self._drive is not None:
            self._drive.command(self._asked / _ALL if self._power.there else 0.0)

    def _frame(self, frame: bytes) -> None:
        body = checked(frame)
        if body is None or body[0] not in {0, self._make.address}:
            return
        reply = self._requests.answer(body[1], body[2:])
        if body[0]:
            self._line.send(seal(body[:1] + reply), _REPLY_NS)

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


_USUAL_BAUD = 9600
_MODES = {"operating": at.OPERATING, "standby": at.STANDBY}


def build(setup: PeerSetup) -> Eurotherm3216:
    """Build the controller; terminals are `sensor`, `ambient` and `power`, signals, and `drive`, an input.

    Raises:
        TruthError: with everything that is wrong in its truth or terminals.
    """
    truth = setup.truth
    own = truth.part(ControllerTruth)
    sensor = SensorInput(
        truth=truth.part(SensorTruth),
        place=setup.connections.signal("sensor"),
        room=setup.connections.signal("ambient"),
        faults=setup.faults,
        noise=setup.stream("sensor"),
    )
    drive, power = setup.connections.input("drive"), Power(setup.connections.signal("power"))
    setup.finish()
    make = Make(
        address=own.address or setup.instrument.address or 1,
        baud=setup.instrument.baud or _USUAL_BAUD,
        period_ns=own.period_ns,
        decimals=own.decimals,
        unit=own.unit,
        top=own.range_high,
    )
    memory = _memory(make, own)
    return Eurotherm3216(make=make, memory=memory, sensor=sensor, drive=drive, power=power, faults=setup.faults)


def _memory(make: Make, own: ControllerTruth) -> Memory:
    """Return the parameters as somebody left them."""
    major, minor = (int(each, 16) for each in own.firmware.split("."))
    return Memory(
        {
            **dict.fromkeys((at.PROCESS_VALUE, at.WORKING_OUTPUT, at.WORKING_SETPOINT, at.STATUS, at.SENSOR_BREAK), 0),
            **dict.fromkeys((at.TIMER_STATUS, at.SETPOINT_SELECT, at.SETPOINT_SOURCE, at.COMMS_SETPOINT), 0),
            **dict.fromkeys((at.MANUAL_OUTPUT, at.SAFE_OUTPUT, at.LOOP_MODE, at.INVERTED_STATUS), 0),
            **dict.fromkeys(at.SETPOINTS, make.word(own.setpoint)),
            at.PROPORTIONAL_BAND: round(10 * own.proportional_band),
            at.INTEGRAL_TIME: own.integral_time,
            at.DERIVATIVE_TIME: own.derivative_time,
            at.COOL_GAIN: round(10 * own.cool_gain),
            at.OUTPUT_HIGH: round(10 * own.output_high),
            at.OUTPUT_LOW: round(10 * own.output_low),
            at.SETPOINT_HIGH: make.word(own.setpoint_high),
            at.SETPOINT_LOW: make.word(own.setpoint_low),
            at.INSTRUMENT_MODE: _MODES[own.mode],
            at.TYPE_CODE: int(own.model, 16),
            at.VERSION: major << 8 | minor,
            at.UNIT_ADDRESS: make.address,
            at.UNITS: make.unit_code,
            at.DECIMALS: make.decimals,
        }
    )


MODEL = PeerModel(
    link="serial",
    fault_kinds=(OtherType, Runaway, SensorDetached, SensorOpen, Stuck),
    build=build,
)
"""The model for the driver `eurotherm-3216`."""
