"""Base of simulated Modbus temperature controllers: a periodic control loop and its connections.

With the fault `stuck` none of the output reaches the cooler, with `runaway` full power in the heating direction; the
controller's display is unaffected.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, TypeVar

from hil.clock.port import NANOSECONDS
from hil.model.notation import SomeNanoseconds, number, one_of, whole
from hil.simulation.faults import Fault, Faults, Stuck
from hil.simulation.peers.modbus_rtu import FrameReader, checked, seal
from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.peers.thermal.loop import Regulation, SensorDetached, SensorInput, SensorOpen, SensorTruth
from hil.simulation.peers.timing import Alarm
from hil.simulation.plants.terminal import InputPoint, Power
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import Line, PeerClock

__all__ = ["LoopEnds", "LoopTruth", "Runaway", "ThermalController", "model_of"]

_USUAL_BAUD = 9600
_ALL = 100.0
_REPLY_NS = 5_000_000
_Setpoint = Annotated[float, number(-200, 1000)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Runaway(Fault):
    """All that there is reaches the cooler, in the direction that was asked for last."""

    name = "runaway"


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopTruth:
    """One controller, and how somebody left it.

    Attributes:
        address: of the unit, None for the one that the bench file has.
        period_ns: of its control loop.
        decimals: of the display.
        range_high: what the process value shows while the sensor is broken, in its unit, as all its setpoints are.
        proportional_band, integral_time, derivative_time, cool_gain: of the loop [1, s, s, 1].
        mode: `operating` or `standby`.
    """

    address: Annotated[int | None, whole(1, 254)] = None
    period_ns: SomeNanoseconds = field(default=NANOSECONDS, metadata={"alias": "period"})
    decimals: Annotated[int, whole(0, 2)] = 1
    range_high: Annotated[float, number(0, 3000)] = 300.0
    setpoint: _Setpoint = 22.0
    setpoint_high: _Setpoint = 60.0
    setpoint_low: _Setpoint = -30.0
    proportional_band: Annotated[float, number(0.1, 3000)] = 10.0
    integral_time: Annotated[int, whole(0, 9999)] = 60
    derivative_time: Annotated[int, whole(0, 9999)] = 0
    cool_gain: Annotated[float, number(0.1, 10)] = 2.0
    mode: Annotated[str, one_of("operating", "standby")] = "standby"

    def word(self, value: float) -> int:
        """Return a temperature in the unit of the display as the registers have it."""
        return int(min(max(round(value * 10**self.decimals), -0x8000), 0x7FFF))


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopEnds:
    """What a controller is connected to.

    Attributes:
        address: of the unit.
        baud: of its line.
        sensor: its input.
        drive: the plant's input at its output, -1 to 1.
        power: of the amplifier between output and cooler; without it nothing drives the cooler.
        faults: what goes wrong.
    """

    address: int
    baud: int
    sensor: SensorInput
    drive: InputPoint | None
    power: Power
    faults: Faults


_Truth = TypeVar("_Truth", bound=LoopTruth)


class ThermalController(Stateful, ABC):
    """One periodic control loop in bench time.

    Args:
        ends: what it is connected to.
        period_ns: of its turns.
    """

    _regulation: Kept[Regulation]
    _reader: Kept[FrameReader]
    _next_turn: Kept[Alarm]
    _asked: Kept[float]

    def __init__(self, ends: LoopEnds, period_ns: int) -> None:
        self._ends = ends
        self._faults = ends.faults
        self._period_ns = period_ns
        self._asked = 0.0  # of the amplifier, in %
        self._regulation = Regulation()
        self._reader = FrameReader(ends.baud, self._frame)
        self._line: Line
        self._clock: PeerClock

    @abstractmethod
    def _turn(self, now_ns: int, reading: float | None) -> float:
        """Take a turn with a reading in degC, None of a broken sensor; show all of it, and return the output in %."""

    @abstractmethod
    def _answer(self, function: int, data: bytes) -> bytes:
        """Return function and data of the reply to a request."""

    def attach(self, line: Line, clock: PeerClock) -> None:
        """Connect the line; the first turn is taken at once."""
        self._line = line
        self._clock = clock
        self._reader.attach(clock)
        self._next_turn = Alarm(clock, self._take_turn)
        self._next_turn.set(clock.now_ns())
        self._ends.power.listen(self._amplify)

    def receive(self, data: bytes) -> None:
        """Take bytes of the line."""
        self._reader.receive(data)

    def _take_turn(self) -> None:
        now_ns = self._clock.now_ns()
        place = now_ns // self._period_ns
        self._drive_at(self._turn(now_ns, self._ends.sensor.convert(now_ns, place)), now_ns)
        self._next_turn.set((place + 1) * self._period_ns)

    def _drive_at(self, output: float, now_ns: int) -> None:
        """Let an output in % reach the amplifier, but for what goes wrong."""
        if self._faults.faults:
            if self._faults.now(Stuck, now_ns):
                output = 0.0
            elif self._faults.now(Runaway, now_ns):
                output = _ALL
        self._asked = output
        self._amplify()

    def _amplify(self) -> None:
        if self._ends.drive is not None:
            self._ends.drive.command(self._asked / _ALL if self._ends.power.there else 0.0)

    def _frame(self, frame: bytes) -> None:
        body = checked(frame)
        if body is None or body[0] not in {0, self._ends.address}:
            return
        reply = self._answer(body[1], body[2:])
        if body[0]:
            self._line.send(seal(body[:1] + reply), _REPLY_NS)


def model_of(
    truth: type[_Truth], make: Callable[[_Truth, LoopEnds], ThermalController], *faults: type[Fault]
) -> PeerModel:
    """Return the model of a controller; terminals are `sensor`, `ambient` and `power`, signals, and `drive`, an input.

    Args:
        truth: what a bench file says of it.
        make: makes one of that and what it is connected to.
        faults: kinds of its own.
    """

    def build(setup: PeerSetup) -> ThermalController:
        own, sensor_truth = setup.truth.part(truth), setup.truth.part(SensorTruth)
        connections = setup.connections
        ends = LoopEnds(
            address=own.address or setup.instrument.address or 1,
            baud=setup.instrument.baud or _USUAL_BAUD,
            sensor=SensorInput(
                truth=sensor_truth,
                place=connections.signal("sensor"),
                room=connections.signal("ambient"),
                faults=setup.faults,
                noise=setup.stream("sensor"),
            ),
            drive=connections.input("drive"),
            power=Power(connections.signal("power")),
            faults=setup.faults,
        )
        setup.finish()
        return make(own, ends)

    kinds: tuple[type[Fault], ...] = (Runaway, SensorDetached, SensorOpen, Stuck, *faults)
    return PeerModel(link="serial", fault_kinds=kinds, build=build)
