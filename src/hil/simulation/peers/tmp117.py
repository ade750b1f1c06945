"""A TMP117 at register level, as its data sheet (SNOSD82) describes it.

Registers have 16 bits, high byte first, and a transfer stays at its register. Temp_Result 00h is 8000h until a
conversion has ended, then 1/128 degC each; Configuration 01h is 0220h after power-on: continuous conversion, eight
averages, a cycle of 1 s. Data_Ready is taken away by reading either of them. Device_ID 0Fh is 0117h.
Assumed: the noise of one conversion is white, and averaging divides it by the root of its number.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import ClassVar

from hil.analysis.noise.numbers import RandomStream
from hil.clock.port import NANOSECONDS
from hil.model.notation import NotNegative
from hil.simulation.faults import Fault
from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.peers.sensors.chip import Datasheet, Fitted, OtherIdentity, SensorPeer
from hil.simulation.plants.terminal import SignalPoint
from hil.wire.checkpoint import Kept

__all__ = ["MODEL", "EepromBusy", "NoiseTruth", "Tmp117", "build"]

_RESULT, _CONFIG, _IDENTITY = 0x00, 0x01, 0x0F
_READY, _BUSY, _SOFT_RESET = 0x2000, 0x1000, 0x0002
_WRITABLE = 0x0FFC
_NONE_YET = 0x8000
_MS = 1_000_000
_RESET_NS = 2 * _MS
# By AVG: conversions, and what they take [ms]; by CONV: the least cycle [ms].
_CONVERSIONS = ((1, 15.5), (8, 125.0), (32, 500.0), (64, 1000.0))
_CYCLES = (0.0, 125.0, 250.0, 500.0, 1000.0, 4000.0, 8000.0, 16000.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class EepromBusy(Fault):
    """The flag EEPROM_Busy is set: the board's supply dips while its power-on values are written."""

    name = "eeprom-busy"


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseTruth:
    """The noise of one conversion [K rms]."""

    noise: NotNegative = 0.02


class Tmp117(SensorPeer):
    """The sensor on its bus; conversions are made when somebody reads them.

    Args:
        fitted: where it is, and how it is fed.
        temperature: what it feels, or None for 25 degC.
        noise: of one conversion [K rms].
        stream: its random numbers.
    """

    sheet: ClassVar[Datasheet] = Datasheet(
        model="TMP117",
        addresses=(0x48, 0x49, 0x4A, 0x4B),
        identity=(_IDENTITY, 0x0117),
        least_volts=1.7,
        boot_s=1.5e-3,
        reset={_CONFIG: 0x0220, 0x02: 0x6000, 0x03: 0x8000},
        read_only=frozenset((_RESULT, *range(0x09, 0x80))),
        follows={register: register for register in range(0x80)},
        width=2,
    )
    _start_ns: Kept[int]
    _told: Kept[int]

    def __init__(self, fitted: Fitted, temperature: SignalPoint | None, noise: float, stream: RandomStream) -> None:
        super().__init__(fitted)
        self._temperature = temperature
        self._noise = noise
        self._stream = stream
        self._start_ns = 0
        self._told = 0
        self._readers = {_RESULT: self._result, _CONFIG: self._config}

    def _was_reset(self) -> None:
        self._start_ns, self._told = self._clock.now_ns(), 0

    def _store(self, register: int, value: int) -> None:
        if register != _CONFIG:
            super()._store(register, value)
        elif value & _SOFT_RESET:
            self._reset(_RESET_NS)
        else:
            self._registers[_CONFIG] = value & _WRITABLE
            self._start_ns, self._told = self._clock.now_ns(), 0

    def _mode(self) -> tuple[int, int]:
        """Return averaged conversions and the cycle [ns], which is 0 in shutdown."""
        config = self._registers[_CONFIG]
        averages, least_ms = _CONVERSIONS[config >> 5 & 3]
        cycle_ms = max(least_ms, _CYCLES[config >> 7 & 7])
        return averages, 0 if config >> 10 & 3 == 1 else round(cycle_ms * _MS)

    def _ended(self) -> int:
        """Return how many cycles have ended since the settings were written."""
        cycle_ns = self._mode()[1]
        return (self._clock.now_ns() - self._start_ns) // cycle_ns if cycle_ns else 0

    def _config(self) -> int:
        ended = self._ended()
        ready, self._told = ended > self._told, ended
        busy = self._faults.now(EepromBusy, self._clock.now_ns())
        return self._registers[_CONFIG] | (_READY if ready else 0) | (_BUSY if busy else 0)

    def _result(self) -> int:
        number = self._told = self._ended()
        if not number:
            return _NONE_YET
        averages, cycle_ns = self._mode()
        at_ns = max(self._start_ns + number * cycle_ns, self._clock.now_ns() - NANOSECONDS)
        celsius = self._temperature.observe_at(at_ns) if self._temperature else 25.0
        celsius += self._noise / sqrt(averages) * self._stream.normal(at_ns // _MS)
        return max(-32768, min(32767, round(celsius * 128.0))) & 0xFFFF


def build(setup: PeerSetup) -> Tmp117:
    """Build the sensor; terminals `temperature` (degC) and `power` (V) go to plant signals."""
    fitted = Fitted.read(setup, Tmp117.sheet)
    noise = setup.truth.part(NoiseTruth).noise
    temperature = setup.connections.signal("temperature")
    setup.finish()
    return Tmp117(fitted, temperature, noise, setup.stream("noise"))


MODEL = PeerModel(link="bus", fault_kinds=(EepromBusy, OtherIdentity), build=build)
