"""Base of simulated dies that sample autonomously, with the faults of sleep and raw temperature."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from hil.simulation.peers.sensors.chip import Asleep, SensorPeer, TemperatureRaw
from hil.simulation.peers.sensors.sampler import Sampler
from hil.simulation.peers.timing import Alarms
from hil.wire.checkpoint import Kept

__all__ = ["SampledPeer"]


class SampledPeer(SensorPeer):
    """A die with a sampler, which its chip's class makes. That class stores what `_woken` returns.

    Attributes:
        sleep: a register, the bits in there by which it wakes or sleeps, and these bits while it sleeps.
    """

    sleep: ClassVar[tuple[int, int, int]]
    _sampler: Kept[Sampler]
    _naps: Kept[Alarms]
    _warm = (-1, 0)

    def _connected(self) -> None:
        self._sampler.attach(self._clock)
        naps = [(fault.start_ns, self._fall_asleep) for fault in self._faults.of(Asleep)]
        self._naps = Alarms(self._clock, naps)

    def _settle(self) -> None:
        self._sampler.settle()

    def _fall_asleep(self) -> None:
        if self._ready_ns is not None:
            self._reset(0)
            register = self.sleep[0]
            self._store(register, self._registers[register])

    def _woken(self, register: int, value: int) -> int:
        """Return what a register takes: nobody can wake a sensor that fell asleep.

        What it measured last was measured with the old settings, so it is made before they change.
        """
        known, bits, asleep = self.sleep
        if value != self._registers[register] and not self._sleeps_by(register, value):
            _ = self._sampler.newest
        if register == known and self._faults.now(Asleep, self._clock.now_ns()):
            return value & ~bits | asleep
        return value

    def _sleeps_by(self, register: int, value: int) -> bool:
        """Return whether it sleeps after a write, so that nobody reads what it measured last."""
        known, bits, asleep = self.sleep
        return register == known and value & bits == asleep

    def _temperature_alone(self, made: Callable[[NDArray[np.int64]], NDArray[np.float64]]) -> int | None:
        """Return the temperature of the newest sample as `made` makes it, None once its axes were made, too."""
        unmade_ns = self._sampler.unmade_ns
        if unmade_ns is None:
            return None
        if self._warm[0] != unmade_ns:
            self._warm = (unmade_ns, int(made(np.array([unmade_ns]))[0]))
        return self._warm[1]

    def _as_raw(self, counts: NDArray[np.float64], ends_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return counts of the temperature, constant while a fault says so."""
        for fault in self._faults.of(TemperatureRaw):
            counts[(ends_ns >= fault.start_ns) & (ends_ns < fault.end_ns)] = fault.counts
        return counts
