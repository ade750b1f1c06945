"""An IIM-42652 gyroscope at register level.

TDK InvenSense DS-000440, as far as public sources tell it: the vendor's header Ixm42xxxDefs.h (registers, bits,
ranges, rates, filter orders), Linux inv_icm42600 (60 ms to start, 150 ms to stop, -32768 for invalid, packets, 2048
bytes), and for the filter's bandwidths, reset values and INT_ASYNC_RESET drivers of its family (ICM-42688,
ICM-40609).

WHO_AM_I 75h is 6Fh; registers stand in banks behind REG_BANK_SEL 76h; after power-on both sensors are off and data
are -32768 (8000h), big-endian. PWR_MGMT0 4Eh with gyroscope mode 3 (low noise) starts it: 60 ms until data are valid,
150 ms from off to on. Ranges are 2000 deg/s halved down to 15.625 deg/s (16.4 to 2097.2 LSB/(deg/s)), rates 8 kHz to
12.5 Hz. The filter's -3 dB bandwidth is rate/2, or the larger of 400 Hz and the rate over 4, 5, 8, 10, 16, 20, 40.
Temperature is 25 degC + counts/132.48, in the FIFO 25 degC + counts/2.07. The FIFO holds 2048 bytes. FIFO_COUNT is
big-endian, in bytes or packets (INTF_CONFIG0). A burst goes on at the next register, and stays at FIFO_DATA once it
is there.

Assumed, for these sources leave it open: samples come at the gyroscope's rate where both sensors are on; the filter's
noise bandwidth is that of a Butterworth filter of GYRO_UI_FILT_ORD, and it does not delay or smooth the rate itself;
any change of rate, filter or power starts the samples, and their noise, anew; the watermark interrupt comes when the
level is reached from below, with FIFO_WM_GT_TH at every sample while it is; a change of what goes into the FIFO
empties it; without FIFO_TEMP_EN the temperature byte is 80h; lost packets are counted until the FIFO is flushed;
nothing is acknowledged within 1 ms after a reset; the accelerometer sees a constant without noise. Not modelled:
filters of the codes 8 to 15 (they count as rate/2), packets of 20 bits, low-power mode of the gyroscope, TEMP_DIS,
FSYNC, INT2, APEX, self-test, clock input, and the user offsets of bank 4, which are stored and do nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import cast

from hil.simulation.faults import Fault
from hil.simulation.peers.alarm import Alarms
from hil.simulation.peers.iim42652.article import Article
from hil.simulation.peers.iim42652.fifo import Fifo
from hil.simulation.peers.iim42652.pin import Pin
from hil.simulation.peers.iim42652.registers import FIFO_FULL, FIFO_WATERMARK, Register, RegisterFile
from hil.simulation.peers.iim42652.sampler import Sampler
from hil.simulation.plants.terminal import SignalPoint
from hil.wire.peer import Nack, PeerClock

__all__ = ["Iim42652"]

_IDENTITY = 0x6F
_RESET_NS = 1_000_000
_LEAST_VOLTS = 1.71
_RESET_DONE = 0x10
_SOFT_RESET, _FLUSH, _RESTART, _STROBE = 0x01, 0x02, 0x08, 0x04
_BIG_COUNT, _BIG_DATA = 0x20, 0x10
_MODES = 0x0F
_BY_READING = 0x08
_DATA = range(Register.TEMP_DATA, Register.TMST_FSYNC)
_COUNT = range(Register.FIFO_COUNT, Register.FIFO_DATA)
_LOST = range(Register.FIFO_LOST_PKT, Register.FIFO_LOST_PKT + 2)
_TMSTVAL = range(Register.TMSTVAL, Register.TMSTVAL + 3)
_CONTENTS = 0x0F
_ACCELERATION = range(1, 4)


class Iim42652:
    """The sensor on its bus: registers in banks, and a pointer.

    Args:
        address: 7-bit address.
        article: what it senses.
        power: where its supply voltage is seen, or None for a sensor that always has power.
        boot_ns: from power-on to the first acknowledge.
    """

    def __init__(self, address: int, article: Article, power: SignalPoint | None, boot_ns: int) -> None:
        self._address = address
        self._faults = article.faults
        self._power = power
        self._boot_ns = boot_ns
        self._registers = RegisterFile()
        self._fifo = Fifo(self._registers)
        self._pin = Pin(self._registers)
        self._sampler = Sampler(self._registers, article, self._fifo, self._pin)
        self._ready_ns: int | None = None
        self._pointer = 0
        self._stamp = 0
        self._readers = self._computed()
        self._clock: PeerClock
        self._naps: Alarms

    @property
    def addresses(self) -> tuple[int, ...]:
        """The address, set by the pin AP_AD0."""
        return (self._address,)

    def on_interrupt(self, callback: Callable[[], None]) -> None:
        """Call back at every rising edge of INT1."""
        self._pin.listen(callback)

    def attach(self, clock: PeerClock) -> None:
        """Connect the clock, and watch the supply voltage."""
        self._clock = clock
        self._pin.attach(clock)
        self._sampler.attach(clock)
        if self._power is not None:
            self._power.plant.listen(self._power_changed)
        self._power_changed()
        naps = self._faults.of("asleep")
        self._naps = Alarms(clock, [(fault.start_ns, self._fall_asleep) for fault in naps])

    def write(self, address: int, data: bytes) -> None:
        """Take the register's number and what is written from there on."""
        del address
        self._acknowledge()
        if not data:
            return
        self._pointer = data[0]
        for value in data[1:]:
            self._store(self._registers.in_bank(self._pointer), value)
            self._step()

    def read(self, address: int, count: int) -> bytes:
        """Give registers from the pointer on."""
        del address
        self._acknowledge()
        data = bytearray()
        while len(data) < count:
            register = self._registers.in_bank(self._pointer)
            if register == Register.FIFO_DATA:
                data += self._take(count - len(data))
            else:
                data.append(self._load(register))
                self._step()
        return bytes(data)

    def state(self) -> Mapping[str, object]:
        """Return registers, samples, FIFO and pin."""
        return {
            "ready_ns": self._ready_ns,
            "pointer": self._pointer,
            "stamp": self._stamp,
            "registers": self._registers.state(),
            "fifo": self._fifo.state(),
            "sampler": self._sampler.state(),
            "pin": self._pin.state(),
            "naps": self._naps.state(),
        }

    def restore(self, state: Mapping[str, object]) -> None:
        """Go on from what `state` returned."""
        self._ready_ns = cast("int | None", state["ready_ns"])
        self._pointer = cast("int", state["pointer"])
        self._stamp = cast("int", state["stamp"])
        registers = cast("dict[str, object]", state["registers"])
        self._registers.restore(cast("int", registers["bank"]), cast("dict[str, int]", registers["values"]))
        self._fifo.restore(cast("dict[str, object]", state["fifo"]))
        self._sampler.restore(cast("dict[str, object]", state["sampler"]))
        self._pin.restore(cast("dict[str, object]", state["pin"]))
        self._naps.restore(state["naps"])

    def _acknowledge(self) -> None:
        if self._ready_ns is None or self._clock.now_ns() < self._ready_ns:
            raise Nack
        self._sampler.settle()

    def _power_changed(self) -> None:
        powered = self._power is None or self._power.observe() >= _LEAST_VOLTS
        if powered and self._ready_ns is None:
            # A sensor without a power terminal has had power since long before the epoch.
            self._reset(self._boot_ns if self._power is not None else 0)
        elif not powered and self._ready_ns is not None:
            self._reset(0)
            self._ready_ns = None

    def _fall_asleep(self) -> None:
        if self._ready_ns is not None:
            self._reset(0)

    def _reset(self, busy_ns: int) -> None:
        self._registers.reset()
        self._fifo.flush()
        self._pin.reset()
        self._sampler.reset()
        self._sampler.status = _RESET_DONE
        self._stamp = 0
        self._ready_ns = self._clock.now_ns() + busy_ns

    def _step(self) -> None:
        self._pointer = (self._pointer + 1) % 0x80

    def _store(self, register: int, value: int) -> None:
        before = self._registers[register]
        if register == Register.REG_BANK_SEL:
            self._registers.select(value)
        elif register == Register.DEVICE_CONFIG and value & _SOFT_RESET:
            self._reset(_RESET_NS)
        elif register == Register.SIGNAL_PATH_RESET:
            self._signal_path(value)
        else:
            self._registers[register] = value & self._allowed(register)
            self._follow(register, before ^ value)

    def _allowed(self, register: int) -> int:
        """Return the bits that can be set: a sensor that fell asleep cannot be woken."""
        asleep: Fault | None = self._faults.now("asleep", self._clock.now_ns())
        return 0xFF & ~_MODES if asleep and register == Register.PWR_MGMT0 else 0xFF

    def _follow(self, register: int, changed: int) -> None:
        bypassed = register == Register.FIFO_CONFIG and not self._registers[register] >> 6
        if bypassed or (register == Register.FIFO_CONFIG1 and changed & _CONTENTS):
            self._sampler.flush()
        self._sampler.configure()

    def _signal_path(self, value: int) -> None:
        """Act once; these bits clear themselves."""
        if value & _STROBE:
            self._stamp = self._sampler.stamp(self._clock.now_ns())
        if value & (_FLUSH | _RESTART):
            self._sampler.flush()

    def _computed(self) -> Mapping[int, Callable[[], int]]:
        """Return the registers whose bytes are made when they are read."""
        readers: dict[int, Callable[[], int]] = {
            Register.WHO_AM_I: self._identity,
            Register.INT_STATUS: self._status,
            Register.REG_BANK_SEL: lambda: self._registers.bank,
        }
        readers.update({register: partial(self._data, register - _DATA.start) for register in _DATA})
        readers.update({register: partial(self._count, register - _COUNT.start) for register in _COUNT})
        readers.update({register: partial(self._lost, register - _LOST.start) for register in _LOST})
        readers.update({register: partial(self._stamped, register - _TMSTVAL.start) for register in _TMSTVAL})
        return readers

    def _load(self, register: int) -> int:
        reader = self._readers.get(register)
        return reader() if reader else self._registers[register]

    def _identity(self) -> int:
        fault = self._faults.now("identity", self._clock.now_ns())
        return int(fault.text, 16) if fault else _IDENTITY

    def _data(self, place: int) -> int:
        """Return one byte of temperature, accelerometer and gyroscope, in this order."""
        number, byte = divmod(place, 2)
        if number in _ACCELERATION:
            counts = int(self._sampler.acceleration()[number - _ACCELERATION.start])
        else:
            counts = self._sampler.newest[max(0, number - len(_ACCELERATION))]
        return _byte(counts & 0xFFFF, byte, big=bool(self._registers[Register.INTF_CONFIG0] & _BIG_DATA))

    def _count(self, place: int) -> int:
        return _byte(self._fifo.count, place, big=bool(self._registers[Register.INTF_CONFIG0] & _BIG_COUNT))

    def _lost(self, place: int) -> int:
        return _byte(self._fifo.lost, place, big=False)

    def _stamped(self, place: int) -> int:
        return self._stamp >> 8 * place & 0xFF

    def _status(self) -> int:
        status, self._sampler.status = self._sampler.status, 0
        self._pin.clear()
        return status

    def _take(self, count: int) -> bytes:
        if self._registers[Register.INT_CONFIG0] & _BY_READING and self._sampler.status & (FIFO_WATERMARK | FIFO_FULL):
            self._pin.clear()
        data = self._fifo.take(count)
        self._sampler.rescheduled()
        return data


def _byte(number: int, place: int, *, big: bool) -> int:
    """Return one byte of a 16-bit number in the order of the bus."""
    return number >> 8 * (1 - place if big else place) & 0xFF
