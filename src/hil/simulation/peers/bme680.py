"""A BME680 at register level, its thermometer alone, as its data sheet (BST-BME680-DS001) describes it.

As public drivers have it (Bosch, Pimoroni): chip_id D0h is 61h. It sleeps after power-on. Mode 1 in the lower two bits
of ctrl_meas 74h measures once and goes back to sleep; osrs_t above, bits 7:5, is 0 for none, or 1, 2, 4, 8, 16
conversions by 1 to 5. meas_status_0 1Dh has new data in bit 7, and a measurement that runs in bit 5. The temperature
has 20 bits from 22h on, the high byte first, 80000h where none was measured; without a filter the lowest bits are 0, so
that one conversion has 16 bits, and each doubling one more. filter, bits 4:2 of config 75h, has coefficients 0, 1, 3, 7
to 127: new = (old * coefficient + measured) / (coefficient + 1). par_t1 E9h, par_t2 8Ah and par_t3 8Ch, low byte first,
are the article's: degC * 5120 = 8 * t2 * x + 16 * t3 * x^2, with x = counts / 2^17 - t1 / 2^13. A soft reset is B6h in
E0h.

Assumed: a measurement takes 1.963 ms a conversion and 4.8 ms beside; the noise of one conversion is white; the filter
starts with the first sample after a reset. Not modelled: humidity, pressure, gas, and the heater, which warms it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import sqrt
from typing import Annotated, ClassVar

from hil.analysis.noise.numbers import RandomStream
from hil.model.notation import NotNegative, vector
from hil.simulation.faults import Stuck
from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.peers.sensors.chip import Asleep, Datasheet, Fitted, OtherIdentity, SensorPeer, TemperatureRaw
from hil.simulation.peers.sensors.elements import Die
from hil.simulation.peers.timing import Alarm
from hil.simulation.truth import TruthError
from hil.wire.checkpoint import Kept

__all__ = ["MODEL", "Bme680", "Bme680Truth", "build"]

_STATUS, _TEMP = 0x1D, 0x22
_CTRL_MEAS, _CONFIG, _RESET, _IDENTITY = 0x74, 0x75, 0xE0, 0xD0
_T2, _T1 = 0x8A, 0xE9
_WRITABLE = frozenset((*range(0x50, 0x6E), *range(0x70, 0x76)))
_SOFT_RESET, _FORCED, _NEW, _MEASURING = 0xB6, 0x01, 0x80, 0x20
_NONE, _MOST = 0x80000, 0xFFFFF
_AVERAGES = (0, 1, 2, 4, 8, 16, 16, 16)
_COEFFICIENTS = (0, 1, 3, 7, 15, 31, 63, 127)
_RESET_NS, _CONVERSION_NS, _OVERHEAD_NS = 2_000_000, 1_963_000, 4_800_000
_REFERENCE = 25.0
_MS = 1_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Bme680Truth:
    """One article: its coefficients par_t1 to par_t3, and the noise of one conversion [K rms]."""

    coefficients: Annotated[tuple[float, ...], vector(3)] = (26203.0, 26519.0, 3.0)
    noise: NotNegative = 0.02


class Bme680(SensorPeer):
    """The sensor on its bus.

    Args:
        fitted: where it is, and how it is fed.
        article: what it is.
        die: its temperature.
        stream: its random numbers.
    """

    sheet: ClassVar[Datasheet] = Datasheet(
        model="BME680",
        addresses=(0x76, 0x77),
        identity=(_IDENTITY, 0x61),
        least_volts=1.71,
        boot_s=2e-3,
        read_only=frozenset(range(0x100)) - _WRITABLE,
        size=0x100,
    )
    _counts: Kept[int]
    _filtered: Kept[float | None]
    _fresh: Kept[bool]
    _done: Kept[Alarm]

    def __init__(self, fitted: Fitted, article: Bme680Truth, die: Die, stream: RandomStream) -> None:
        super().__init__(fitted)
        self._t1, self._t2, self._t3 = (round(number) for number in article.coefficients)
        self._noise, self._die, self._stream = article.noise, die, stream
        self._counts, self._filtered, self._fresh = _NONE, None, False
        factory = {
            _T1: self._t1 & 0xFF, _T1 + 1: self._t1 >> 8,
            _T2: self._t2 & 0xFF, _T2 + 1: self._t2 >> 8 & 0xFF, _T2 + 2: self._t3 & 0xFF,
        }  # fmt: skip
        self._readers = {register: partial(int, value) for register, value in factory.items()}
        self._readers[_STATUS] = self._status
        for place in range(3):
            self._readers[_TEMP + place] = partial(self._byte, 12 - 8 * place)

    def _connected(self) -> None:
        self._done = Alarm(self._clock, self._measured)

    def _was_reset(self) -> None:
        self._counts, self._filtered, self._fresh = _NONE, None, False
        self._done.clear()

    def _store(self, register: int, value: int) -> None:
        if register == _RESET:
            if value == _SOFT_RESET:
                self._reset(_RESET_NS)
            return
        super()._store(register, value)
        asleep = self._faults.now(Asleep, self._clock.now_ns())
        if register == _CTRL_MEAS and value & 3 == _FORCED and not asleep:
            self._fresh = False
            self._done.set(self._clock.now_ns() + _OVERHEAD_NS + self._averages * _CONVERSION_NS)

    @property
    def _averages(self) -> int:
        return _AVERAGES[self._registers[_CTRL_MEAS] >> 5]

    def _measured(self) -> None:
        """A measurement has ended: it is what the die felt then."""
        now_ns, code = self._clock.now_ns(), self._registers[_CTRL_MEAS] >> 5
        self._registers[_CTRL_MEAS] = self._registers[_CTRL_MEAS] & ~3
        self._fresh = True
        raw = self._faults.now(TemperatureRaw, now_ns)
        if not self._averages:
            self._counts = _NONE
        elif raw:
            self._counts = raw.counts & _MOST
        elif not self._faults.now(Stuck, now_ns):
            noise = self._noise / sqrt(self._averages) * self._stream.normal(now_ns // _MS)
            counts = self._counts_of(self._die.counts_at(now_ns, 1.0) + _REFERENCE + noise)
            keep = _COEFFICIENTS[self._registers[_CONFIG] >> 2 & 7]
            before = counts if self._filtered is None else self._filtered
            self._filtered = (before * keep + counts) / (keep + 1)
            unseen = 0 if keep else max(0, 5 - code)
            self._counts = max(0, min(_MOST, round(self._filtered))) >> unseen << unseen

    def _counts_of(self, celsius: float) -> float:
        """Return the counts, not yet rounded, from which the article's coefficients make this temperature."""
        square, linear, wanted = 16 * self._t3, 8 * self._t2, 5120 * celsius
        x = 2 * wanted / (linear + sqrt(linear * linear + 4 * square * wanted))
        return (x + self._t1 / 2**13) * 2**17

    def _status(self) -> int:
        running = self._registers[_CTRL_MEAS] & 3 == _FORCED
        return (_NEW if self._fresh else 0) | (_MEASURING if running else 0)

    def _byte(self, shift: int) -> int:
        self._fresh = False
        return (self._counts >> shift if shift >= 0 else self._counts << -shift) & 0xFF


def build(setup: PeerSetup) -> Bme680:
    """Build the sensor; terminals `temperature` (degC) and `power` (V) go to plant signals.

    Raises:
        TruthError: with everything that is wrong in its truth or terminals.
    """
    fitted, die, article = Fitted.read(setup, Bme680.sheet), Die(setup, most=85), setup.truth.part(Bme680Truth)
    t1, t2, t3 = (round(number) for number in article.coefficients)
    if not (0 <= t1 < 2**16 and -(2**15) <= t2 < 2**15 and -(2**7) <= t3 < 2**7):
        raise TruthError((*setup.truth.path, "coefficients"), "'coefficients' must have 16, 16 and 8 bits")
    setup.finish()
    return Bme680(fitted, article, die, setup.stream("noise"))


MODEL = PeerModel(link="bus", fault_kinds=(Asleep, OtherIdentity, Stuck, TemperatureRaw), build=build)
"""The model for the driver `bme680`."""
