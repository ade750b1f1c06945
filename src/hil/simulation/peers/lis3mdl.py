"""An LIS3MDL magnetometer at register level, as its datasheet describes it.

DocID024204: WHO_AM_I 0Fh is 3Dh; after power-on CTRL_REG1..5 are 10h, 00h, 03h (power-down), 00h, 00h. Bit 7 of the
register address asks for auto-increment, and a burst goes from 2Dh back to 28h. Sensitivity is 6842, 3421, 2281, 1711
LSB/gauss. The temperature has 8 LSB/degC and is 0 at 25 degC (AN4602). Assumed: any change of rate, range or mode
starts the conversions anew; noise falls with the root of the conversion time of the performance mode; readings stop
at the ends of 16 bits.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import cast

from hil.clock.port import NANOSECONDS
from hil.simulation.peers.alarm import Alarm, Alarms
from hil.simulation.peers.lis3mdl_conversion import AXES, Conversion, Outputs, Sensor, SensorTruth
from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.plants.terminal import SignalPoint
from hil.simulation.truth import TruthError
from hil.wire.peer import Nack, PeerClock

__all__ = ["MODEL", "Lis3mdl", "build"]

_ADDRESSES = (0x1C, 0x1E)
_OFFSETS = range(0x05, 0x0B)
_WHO_AM_I, _IDENTITY = 0x0F, 0x3D
_CTRL1, _CTRL2, _CTRL3, _CTRL4, _CTRL5 = range(0x20, 0x25)
_STATUS = 0x27
_DATA = range(0x28, 0x2E)
_TEMPERATURE = range(0x2E, 0x30)
_DEFAULTS = {_CTRL1: 0x10, _CTRL3: 0x03, 0x30: 0xE8}
_WRITABLE = frozenset((*_OFFSETS, *range(_CTRL1, _CTRL5 + 1), 0x30, 0x32, 0x33))
_REBOOT, _SOFT_RESET = 0x08, 0x04
_BLOCK_DATA_UPDATE = 0x40
_INCREMENT = 0x80
_LEAST_VOLTS = 1.9
_ALL_AXES = 0x08


class Lis3mdl:
    """The sensor: registers, a pointer, and conversions on its own grid.

    Args:
        address: 7-bit address.
        sensor: what it senses.
        power: where its supply voltage is seen, or None for a sensor that always has power.
        boot_ns: from power-on to the first acknowledge.
    """

    def __init__(self, address: int, sensor: Sensor, power: SignalPoint | None, boot_ns: int) -> None:
        self._address = address
        self._sensor = sensor
        self._power = power
        self._boot_ns = boot_ns
        self._powered_ns: int | None = None
        self._pointer = 0
        self._registers = dict.fromkeys(_WRITABLE, 0)
        self._conversion = Conversion()
        self._held = Outputs()
        self._frozen: Outputs | None = None
        self._read = [0, 0, 0]
        self._latched: dict[int, tuple[int, int, int]] = {}
        self._clock: PeerClock
        self._single: Alarm
        self._changes: Alarms

    @property
    def addresses(self) -> tuple[int, ...]:
        """The address, set by the pin SDO/SA1."""
        return (self._address,)

    def attach(self, clock: PeerClock) -> None:
        """Connect the clock, and watch the supply voltage."""
        self._clock = clock
        if self._power is not None:
            self._power.plant.listen(self._power_changed)
        self._single = Alarm(clock, self._take_single)
        stuck = self._sensor.faults.of("stuck")
        changes = [((fault.start_ns, self._freeze), (fault.end_ns, self._thaw)) for fault in stuck]
        self._changes = Alarms(clock, [change for pair in changes for change in pair])
        self._power_changed()

    def write(self, address: int, data: bytes) -> None:
        """Take the register's address and what is written from there on."""
        del address
        self._awake()
        if not data:
            return
        self._pointer = data[0]
        for value in data[1:]:
            self._store(self._pointer & ~_INCREMENT, value)
            self._step()

    def read(self, address: int, count: int) -> bytes:
        """Give registers from the pointer on."""
        del address
        self._awake()
        data = bytearray()
        for _ in range(count):
            data.append(self._load(self._pointer & ~_INCREMENT))
            self._step()
        return bytes(data)

    def state(self) -> Mapping[str, object]:
        """Return registers, conversions and what was read of them."""
        return {
            "powered_ns": self._powered_ns,
            "pointer": self._pointer,
            "registers": {str(register): value for register, value in sorted(self._registers.items())},
            "conversion": self._conversion.state(),
            "held": self._held.state(),
            "frozen": None if self._frozen is None else self._frozen.state(),
            "read": list(self._read),
            "latched": {str(axis): list(latch) for axis, latch in self._latched.items()},
            "single": self._single.state(),
            "changes": self._changes.state(),
        }

    def restore(self, state: Mapping[str, object]) -> None:
        """Go on from what `state` returned."""
        self._powered_ns = cast("int | None", state["powered_ns"])
        self._pointer = cast("int", state["pointer"])
        self._registers = {int(key): value for key, value in cast("dict[str, int]", state["registers"]).items()}
        self._conversion = Conversion.restored(cast("dict[str, int]", state["conversion"]))
        self._held = Outputs.restored(cast("list[int]", state["held"]))
        frozen = cast("list[int] | None", state["frozen"])
        self._frozen = None if frozen is None else Outputs.restored(frozen)
        self._read = list(cast("list[int]", state["read"]))
        latched = cast("dict[str, tuple[int, int, int]]", state["latched"])
        self._latched = {int(axis): (value, count, halves) for axis, (value, count, halves) in latched.items()}
        self._single.restore(state["single"])
        self._changes.restore(state["changes"])

    def _awake(self) -> None:
        if self._powered_ns is None or self._clock.now_ns() < self._powered_ns + self._boot_ns:
            raise Nack

    def _power_changed(self) -> None:
        powered = self._power is None or self._power.observe() >= _LEAST_VOLTS
        if powered and self._powered_ns is None:
            # A sensor without a power terminal has had power since long before the epoch.
            self._powered_ns = self._clock.now_ns() if self._power is not None else -self._boot_ns
            self._reset()
        elif not powered:
            self._powered_ns = None

    def _reset(self) -> None:
        self._registers = {**dict.fromkeys(_WRITABLE, 0), **_DEFAULTS}
        self._conversion, self._held = Conversion(), Outputs()
        self._read, self._latched = [0, 0, 0], {}

    def _step(self) -> None:
        """Move the pointer on, if the address asked for it; the data registers are a ring of six."""
        if self._pointer & _INCREMENT:
            register = self._pointer & ~_INCREMENT
            following = _DATA.start if register == _DATA.stop - 1 else (register + 1) % _INCREMENT
            self._pointer = _INCREMENT | following

    def _store(self, register: int, value: int) -> None:
        if register not in _WRITABLE:
            return
        if register == _CTRL2 and value & _SOFT_RESET:
            self._reset()
        elif register == _CTRL2 and value & _REBOOT:
            # Reboot loads the trimming values again; registers and conversions stay.
            self._registers[register] = value & ~_REBOOT
        else:
            self._registers[register] = value
            self._configure(again=register == _CTRL3)

    def _configure(self, *, again: bool) -> None:
        registers = self._registers
        wanted = Conversion.from_registers(*(registers[item] for item in (_CTRL1, _CTRL2, _CTRL3, _CTRL4)))
        if wanted.setting != self._conversion.setting or (again and wanted.single):
            self._held = self._newest()
            self._conversion = wanted.started(self._clock.now_ns())
            self._read, self._latched = [0, 0, 0], {}
            self._await_single()

    def _await_single(self) -> None:
        if self._conversion.single and not self._count():
            self._single.set(self._conversion.end_ns(1))

    def _take_single(self) -> None:
        # After a reset, or in continuous mode by now, nothing is awaited any more.
        if self._conversion.single:
            self._held = self._sensor.outputs(self._conversion, 1)

    def _load(self, register: int) -> int:
        if register == _WHO_AM_I:
            fault = self._sensor.faults.now("identity", self._clock.now_ns())
            return int(fault.text, 16) if fault else _IDENTITY
        if register == _STATUS:
            return self._status()
        if register in _DATA:
            return self._data(register - _DATA.start)
        if register in _TEMPERATURE:
            return self._newest().temperature >> 8 * (register - _TEMPERATURE.start) & 0xFF
        if register == _CTRL3 and self._conversion.single and self._count():
            return self._registers[register] | 0x03
        return self._registers.get(register, 0)

    def _data(self, place: int) -> int:
        """Return one byte of an axis; with block data update an axis keeps still until both were read."""
        axis, high = divmod(place, 2)
        latched = self._latched.get(axis)
        value, count, halves = latched or (self._reading(axis), self._count(), 0)
        halves |= 1 << high
        if halves == 0b11 or not self._registers[_CTRL5] & _BLOCK_DATA_UPDATE:
            self._latched.pop(axis, None)
        else:
            self._latched[axis] = (value, count, halves)
        if high:
            self._read[axis] = count
        return value >> 8 * high & 0xFF

    def _reading(self, axis: int) -> int:
        return max(-32768, min(32767, self._newest().axes[axis] - self._hard_iron(axis)))

    def _count(self) -> int:
        return self._conversion.count(self._clock.now_ns())

    def _hard_iron(self, axis: int) -> int:
        low = _OFFSETS.start + 2 * axis
        offset = self._registers[low] | self._registers[low + 1] << 8
        return offset - 0x10000 if offset & 0x8000 else offset

    def _status(self) -> int:
        """Return data available (low half) and overrun (high half) per axis, and for all three."""
        count = self._count()
        fresh = sum(1 << axis for axis in range(len(AXES)) if count > self._read[axis])
        lost = sum(1 << axis for axis in range(len(AXES)) if count > self._read[axis] + 1)
        status = fresh | (_ALL_AXES if fresh == _ALL_AXES - 1 else 0)
        return status | (lost | (_ALL_AXES if lost else 0)) << 4

    def _newest(self) -> Outputs:
        if self._frozen is not None:
            return self._frozen
        count = self._count()
        # A single conversion was taken over when it ended; nobody knows how late it is read.
        return self._sensor.outputs(self._conversion, count) if count and not self._conversion.single else self._held

    def _freeze(self) -> None:
        self._frozen = self._newest()

    def _thaw(self) -> None:
        self._frozen = None


def build(setup: PeerSetup) -> Lis3mdl:
    """Build the sensor; terminals `field` (three axes, uT), `temperature` (degC) and `power` (V) go to plant signals.

    Raises:
        TruthError: with everything that is wrong in its truth or terminals.
    """
    truth, connections = setup.truth, setup.connections
    address = setup.instrument.address or _ADDRESSES[0]
    if address not in _ADDRESSES:
        raise TruthError(truth.path[:-1], f"an LIS3MDL answers at 0x1C or 0x1E, not at 0x{address:02X}")
    article = SensorTruth.read(truth)
    boot = truth.number("boot_time", 1e-2, minimum=0)
    field, temperature = connections.axes("field"), connections.signal("temperature")
    power = connections.signal("power")
    for fault in setup.faults.of("identity"):
        if not re.fullmatch(r"0x[0-9A-Fa-f]{1,2}", fault.text):
            raise TruthError(
                (*truth.path[:-1], "faults"), f"expected a register value such as '0x3C', not '{fault.text}'"
            )
    setup.finish()
    sensor = Sensor(
        article,
        field=field,
        temperature=temperature,
        faults=setup.faults,
        seeds=setup.seeds,
        name=setup.instrument.name,
    )
    return Lis3mdl(address, sensor, power, round(boot * NANOSECONDS))


MODEL = PeerModel(link="bus", fault_kinds=("identity", "saturated", "stuck"), build=build)
"""The model behind the driver `lis3mdl`."""
