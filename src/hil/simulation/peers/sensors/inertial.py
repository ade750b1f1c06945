"""Simulated die with jointly sampled gyroscope and accelerometer, and a thermometer."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from hil.clock.port import NANOSECONDS
from hil.model.notation import number
from hil.simulation.peers.model import PeerSetup
from hil.simulation.peers.sensors.chip import Fitted
from hil.simulation.peers.sensors.elements import AccelerationTruth, AxesElement, Die, RateTruth, limited
from hil.simulation.peers.sensors.fifo import Fifo
from hil.simulation.peers.sensors.grid import Grid
from hil.simulation.peers.sensors.sampled import SampledPeer
from hil.simulation.peers.sensors.sampler import Bits, FifoSetting, Sampler, Samples
from hil.wire.checkpoint import Kept

__all__ = ["InertialDie", "InertialTruth", "Senses", "Setting"]

_ACCELERATIONS, _RATES, _TEMPERATURE = slice(0, 3), slice(3, 6), 6
_LEAST, _MOST = -32768, 32767


@dataclass(frozen=True, slots=True, kw_only=True)
class InertialTruth:
    """One device: its accelerometer, and the relative error of its sample rates."""

    accelerometer: AccelerationTruth = field(default_factory=AccelerationTruth)
    odr_error: Annotated[float, number(-0.1, 0.1)] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Senses:
    """What one device senses, and how fast its oscillator is.

    Attributes:
        gyroscope, accelerometer: its axes [deg/s, m/s2].
        die: its temperature.
        odr: its sample rates over the nominal ones.
    """

    gyroscope: AxesElement
    accelerometer: AxesElement
    die: Die
    odr: float

    @classmethod
    def read(cls, setup: PeerSetup, gyroscope: RateTruth | None = None) -> Self:
        """Read the truth, and the terminals `rate`, `acceleration` and `temperature`.

        Args:
            setup: of the peer.
            gyroscope: what it is, where that is not what `RateTruth` says.
        """
        own = setup.truth.part(InertialTruth)
        return cls(
            gyroscope=AxesElement(setup, "rate", gyroscope),
            accelerometer=AxesElement(setup, "acceleration", own.accelerometer, own.accelerometer.acceleration),
            die=Die(setup, most=85),
            odr=1 + own.odr_error,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """What the registers ask for; any change starts the samples, and their noise, again.

    Attributes:
        gyro, accel: which of them is on; none of them is sleep.
        rate: nominal samples per second of both.
        gyro_bandwidth, accel_bandwidth: noise bandwidths of their filters [Hz].
        more: registers whose changes count beside these.
    """

    gyro: bool
    accel: bool
    rate: float
    gyro_bandwidth: float
    accel_bandwidth: float
    more: tuple[int, ...] = ()


class InertialDie(SampledPeer):
    """The die. A sample is three accelerations, three rates and the temperature, 0 of a sensor that is off.

    Its class reads the registers, in `_wanted`, `_counts_per_unit`, `_look` and `_packed`, and calls `_configure` when
    they have changed.

    Attributes:
        bits: of the status.
        heat: counts of the temperature per kelvin, and how far below 25 degC they are 0 [K].
        start_up_ns: how long the axes are 0 after a sensor was switched on.

    Args:
        fitted: where it is, and how it is fed.
        senses: what it senses.
        fifo: where samples go.
    """

    bits: ClassVar[Bits]
    heat: ClassVar[tuple[float, float]]
    start_up_ns: ClassVar[int] = 0
    _valid_ns: Kept[int]
    _lost: Kept[int]
    _gyroscope: Kept[AxesElement]
    _accelerometer: Kept[AxesElement]
    _fifo: Kept[Fifo]

    def __init__(self, fitted: Fitted, senses: Senses, fifo: Fifo) -> None:
        super().__init__(fitted)
        self._gyroscope, self._accelerometer = senses.gyroscope, senses.accelerometer
        self._die, self._odr, self._fifo = senses.die, senses.odr, fifo
        self._sampler = Sampler(
            bits=self.bits,
            asleep=[0] * 7,
            make=self._samples,
            pack=self._packed,
            look=self._look,
            fifo=fifo,
            faults=fitted.faults,
        )
        self._setting = self._wanted()
        self._valid_ns = self._lost = 0

    def restored(self) -> None:
        """Read what the registers ask for."""
        self._setting = self._wanted()

    @abstractmethod
    def _wanted(self) -> Setting:
        """Return what the registers ask for."""

    @abstractmethod
    def _counts_per_unit(self) -> tuple[float, float]:
        """Return counts per m/s2 and per deg/s, at the ranges that are set."""

    @abstractmethod
    def _look(self) -> FifoSetting:
        """Return what the registers say of the FIFO."""

    @abstractmethod
    def _packed(self, samples: Samples) -> bytes:
        """Return packets as they go into the FIFO."""

    def _packet_bytes(self) -> int:
        """Return the bytes of a packet, as the registers want it."""
        return self._fifo.packet

    def _was_reset(self) -> None:
        self._setting = self._wanted()
        self._gyroscope.stop()
        self._accelerometer.stop()
        self._empty()
        self._sampler.reset(0)

    def _empty(self) -> None:
        """Forget what is in the FIFO, and what it lost."""
        self._lost = 0
        self._sampler.flush(self._packet_bytes())

    def _configure(self) -> None:
        """Follow the registers."""
        before, wanted = self._setting, self._wanted()
        if wanted != before:
            now_ns, rate = self._clock.now_ns(), wanted.rate * self._odr
            if (wanted.gyro and not before.gyro) or (wanted.accel and not before.accel):
                self._valid_ns = now_ns + self.start_up_ns
            self._setting = wanted
            for element, on, bandwidth in (
                (self._gyroscope, wanted.gyro, wanted.gyro_bandwidth),
                (self._accelerometer, wanted.accel, wanted.accel_bandwidth),
            ):
                if on and rate:
                    element.begin(now_ns, rate=rate, bandwidth=bandwidth)
                else:
                    element.stop()
            running = rate and (wanted.gyro or wanted.accel)
            self._sampler.restart(Grid(now_ns, NANOSECONDS / rate) if running else None)
        self._sampler.reschedule()

    def _samples(self, first: int, ends_ns: NDArray[np.int64], *, accel: bool = True, gyro: bool = True) -> Samples:
        """Make samples; one whose axes nobody wants leaves them 0."""
        degrees = self._die.many(ends_ns)
        outputs = np.zeros((ends_ns.size, 7), dtype=np.int16)
        per_acceleration, per_rate = self._counts_per_unit()
        for place, element, on, per_unit in (
            (_ACCELERATIONS, self._accelerometer, accel and self._setting.accel, per_acceleration),
            (_RATES, self._gyroscope, gyro and self._setting.gyro, per_rate),
        ):
            if on:
                measured = element.measured(first, ends_ns, degrees) * per_unit
                outputs[:, place] = limited(measured, _LEAST, _MOST).T
        outputs[ends_ns < self._valid_ns] = 0
        outputs[:, _TEMPERATURE] = self._temperatures(ends_ns, degrees)
        return Samples(ends_ns, outputs, np.zeros(ends_ns.size, dtype=np.int8))

    def _temperatures(self, ends_ns: NDArray[np.int64], degrees: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return counts of temperatures [degC]."""
        per_kelvin, colder = self.heat
        return limited(self._as_raw(self._die.counts(degrees + colder, per_kelvin), ends_ns), _LEAST, _MOST)

    def _output(self, place: int) -> int:
        """Return one number; the temperature alone does not have the axes made, which a magnetometer leaves unread."""
        if place == _TEMPERATURE:
            alone = self._temperature_alone(lambda ends_ns: self._temperatures(ends_ns, self._die.many(ends_ns)))
            if alone is not None:
                return alone
        return self._sampler.newest[place]
