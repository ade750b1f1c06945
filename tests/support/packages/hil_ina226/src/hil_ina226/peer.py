"""An INA226 at register level, as its data sheet (SBOS547) describes it.

Registers have 16 bits, high byte first. Configuration 00h is 4127h after power-on: continuous, no averaging, 1.1 ms for
each of the two conversions. Shunt Voltage 01h counts 2.5 uV, Bus Voltage 02h 1.25 mV; bit 3 of Mask/Enable 06h says
that conversions have ended, and is taken away by reading it. Die ID FFh is 2260h.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from hil.analysis.noise.numbers import RandomStream
from hil.model.notation import NotNegative, Positive
from hil.simulation.faults import Fault
from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.peers.sensors.chip import Datasheet, Fitted, OtherIdentity, SensorPeer
from hil.simulation.plants.terminal import SignalPoint
from hil.wire.checkpoint import Kept

__all__ = ["MODEL", "Ina226", "MonitorTruth", "Overflow", "build"]

_CONFIG, _SHUNT, _BUS, _MASK, _IDENTITY = 0x00, 0x01, 0x02, 0x06, 0xFF
_CONVERSIONS = (1, 4, 16, 64, 128, 256, 512, 1024)
_PAIR_NS = 2_200_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Overflow(Fault):
    """The flag of a math overflow is set."""

    name = "overflow"


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitorTruth:
    """The shunt that is fitted [ohm], and the noise of one bus conversion [V rms]."""

    shunt: Positive = 0.1
    noise: NotNegative = 1e-3


class Ina226(SensorPeer):
    """The chip on its bus; conversions are made when somebody reads them.

    Args:
        fitted: where it is, and how it is fed.
        points: the rail's voltage and current, None for 0.
        truth: shunt and noise.
        stream: its random numbers.
    """

    sheet: ClassVar[Datasheet] = Datasheet(
        model="INA226",
        addresses=(0x40, 0x41, 0x44, 0x45),
        identity=(_IDENTITY, 0x2260),
        least_volts=2.7,
        boot_s=1e-3,
        reset={_CONFIG: 0x4127},
        read_only=frozenset((_SHUNT, _BUS, 0x03, 0x04)),
        follows={register: register for register in range(0x100)},
        width=2,
    )
    _start_ns: Kept[int]
    _told: Kept[int]

    def __init__(
        self,
        fitted: Fitted,
        points: tuple[SignalPoint | None, SignalPoint | None],
        truth: MonitorTruth,
        stream: RandomStream,
    ) -> None:
        super().__init__(fitted)
        self._points = points
        self._truth = truth
        self._stream = stream
        self._start_ns = self._told = 0
        self._readers = {_SHUNT: self._shunt, _BUS: self._bus, _MASK: self._mask}

    def _register(self) -> int:
        return self._pointer  # this chip uses all 256 numbers

    def _was_reset(self) -> None:
        self._start_ns, self._told = self._clock.now_ns(), 0

    def _store(self, register: int, value: int) -> None:
        super()._store(register, value)
        if register == _CONFIG:
            self._was_reset()

    def _cycle_ns(self) -> int:
        config = self._registers[_CONFIG]
        return _CONVERSIONS[config >> 9 & 7] * _PAIR_NS if config & 7 == 7 else 0

    def _ended_ns(self) -> int:
        """Return when the last cycle ended, 0 for none."""
        cycle_ns = self._cycle_ns()
        count = (self._clock.now_ns() - self._start_ns) // cycle_ns if cycle_ns else 0
        return self._start_ns + count * cycle_ns if count else 0

    def _mask(self) -> int:
        ended_ns = self._ended_ns()
        ready, self._told = ended_ns > self._told, ended_ns
        overflow = self._faults.now(Overflow, self._clock.now_ns())
        return (8 if ready else 0) | (4 if overflow else 0)

    def _bus(self) -> int:
        at_ns, point = self._ended_ns(), self._points[0]
        volts = point.observe_at(at_ns) if at_ns and point else 0.0
        noise = self._truth.noise * self._stream.normal(at_ns // 1_000_000) if at_ns else 0.0
        return max(0, min(0x7FFF, round((volts + noise) / 1.25e-3)))

    def _shunt(self) -> int:
        at_ns, point = self._ended_ns(), self._points[1]
        amperes = point.observe_at(at_ns) if at_ns and point else 0.0
        return max(-32768, min(32767, round(amperes * self._truth.shunt / 2.5e-6))) & 0xFFFF


def build(setup: PeerSetup) -> Ina226:
    """Build the chip; terminals `voltage`, `current` and `power` (V) go to plant signals."""
    fitted = Fitted.read(setup, Ina226.sheet)
    truth = setup.truth.part(MonitorTruth)
    points = setup.connections.signal("voltage"), setup.connections.signal("current")
    setup.finish()
    return Ina226(fitted, points, truth, setup.stream("noise"))


MODEL = PeerModel(link="bus", fault_kinds=(OtherIdentity, Overflow), build=build)
