"""The measuring half of the simulated IIM-42652: what was sampled up to now, and what that brings about."""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

import numpy as np
from numpy.typing import NDArray

from hil.clock.port import NANOSECONDS
from hil.simulation.peers.alarm import Alarm, Alarms
from hil.simulation.peers.iim42652.article import INVALID, Article, Samples
from hil.simulation.peers.iim42652.fifo import Fifo
from hil.simulation.peers.iim42652.pin import Pin
from hil.simulation.peers.iim42652.registers import FIFO_FULL, FIFO_WATERMARK, NEW_DATA, Register, RegisterFile
from hil.simulation.peers.iim42652.sampling import Sampling
from hil.wire.peer import PeerClock

__all__ = ["Sampler"]

_START_UP_NS, _STOP_NS = 60_000_000, 150_000_000
_KEEP_NS = NANOSECONDS
_EVERY_SAMPLE = 0x20
_LSB_PER_G = (2048, 4096, 8192, 16384)
_STAMP_RESOLUTION = 0x08
_NS_PER_STAMP, _NS_PER_LONG_STAMP = 1000, 16000
_ASLEEP = [INVALID, INVALID, INVALID, INVALID]


class Sampler:
    """Samples are made in rows, when somebody looks, at the latest after a second, and when an interrupt is due.

    Args:
        registers: the sensor's registers.
        article: its sensing elements.
        fifo: where samples go.
        pin: tells of them.
    """

    def __init__(self, registers: RegisterFile, article: Article, fifo: Fifo, pin: Pin) -> None:
        self._registers = registers
        self._article = article
        self._fifo = fifo
        self._pin = pin
        self.sampling = Sampling()
        self.status = 0
        self.newest = list(_ASLEEP)
        self._settled = 0
        self._edge = False
        self._off_ns: int | None = None
        self._reset_ns = 0
        self._held: list[int] | None = None
        self._clock: PeerClock
        self._next: Alarm
        self._stucks: Alarms

    def attach(self, clock: PeerClock) -> None:
        """Connect the clock."""
        self._clock = clock
        self._next = Alarm(clock, self._due)
        # The last healthy sample is one that ended before the fault began.
        stuck = [(max(0, fault.start_ns - 1), self._hold) for fault in self._article.faults.of("stuck")]
        self._stucks = Alarms(clock, stuck)

    def reset(self) -> None:
        """Be as after power-on: asleep, with nothing sampled."""
        self.sampling = Sampling()
        self.status, self.newest, self._settled, self._edge = 0, list(_ASLEEP), 0, False
        self._off_ns, self._reset_ns = None, self._clock.now_ns()
        self._article.begin(self.sampling)
        self._schedule()

    def configure(self) -> None:
        """Follow the registers; what changes rate, filter or power starts the samples anew."""
        now_ns = self._clock.now_ns()
        wanted = Sampling.from_registers(self._registers, self._article.truth.odr_error)
        if not wanted.alike(self.sampling):
            self.sampling = Sampling.restored(
                {**wanted.state(), "start_ns": now_ns, "valid_ns": self._valid_ns(wanted, now_ns)}
            )
            self._settled, self._edge = 0, False
            if not self.sampling.running:
                self.newest = list(_ASLEEP)
            self._article.begin(self.sampling)
        self._schedule()

    def settle(self) -> None:
        """Make the samples that have ended since the last time."""
        count = self.sampling.count(self._clock.now_ns())
        if count == self._settled:
            return
        first = self._settled + 1 if self._fifo.active else count
        scale = self._registers[Register.GYRO_CONFIG0] >> 5
        samples = self._stuck(self._article.samples(self.sampling, first, count - first + 1, scale))
        self._settled = count
        self.newest = [int(samples.temperature[-1]), *samples.gyro[-1].tolist()]
        self._note(NEW_DATA)
        if self._fifo.active:
            self._push(samples)
        self._schedule()

    def acceleration(self) -> NDArray[np.int16]:
        """Return the accelerometer's three counts."""
        if not self.sampling.accel:
            return np.full(3, INVALID, dtype=np.int16)
        scale = _LSB_PER_G[self._registers[Register.ACCEL_CONFIG0] >> 5 & 3]
        counts = np.rint(np.array(self._article.truth.acceleration) * scale)
        return np.asarray(np.clip(counts, -32767, 32767), dtype=np.int16)

    def stamp(self, now_ns: int) -> int:
        """Return the time-stamp counter, 20 bits of 1 us or 16 us by the sensor's own oscillator."""
        return int(self._stamps(np.array([now_ns]))[0]) % (1 << 20)

    def flush(self) -> None:
        """Empty the FIFO."""
        self._fifo.flush()
        self._edge = False
        self._schedule()

    def rescheduled(self) -> None:
        """Look again at what is due next, after somebody took from the FIFO."""
        self._schedule()

    def state(self) -> Mapping[str, object]:
        """Return it as JSON values."""
        return {
            "sampling": self.sampling.state(),
            "noise": self._article.state(),
            "status": self.status,
            "newest": list(self.newest),
            "settled": self._settled,
            "edge": self._edge,
            "off_ns": self._off_ns,
            "reset_ns": self._reset_ns,
            "held": self._held,
            "next": self._next.state(),
            "stucks": self._stucks.state(),
        }

    def restore(self, state: Mapping[str, object]) -> None:
        """Go on from what `state` returned."""
        self.sampling = Sampling.restored(cast("dict[str, object]", state["sampling"]))
        self._article.restore(self.sampling, cast("list[object]", state["noise"]))
        self.status = cast("int", state["status"])
        self.newest = list(cast("list[int]", state["newest"]))
        self._settled = cast("int", state["settled"])
        self._edge = bool(state["edge"])
        self._off_ns = cast("int | None", state["off_ns"])
        self._reset_ns = cast("int", state["reset_ns"])
        self._held = cast("list[int] | None", state["held"])
        self._next.restore(state["next"])
        self._stucks.restore(state["stucks"])

    def _valid_ns(self, wanted: Sampling, now_ns: int) -> int:
        """Return when the gyroscope gives valid numbers: it takes time to start, and to stop before that."""
        if wanted.gyro and self.sampling.gyro:
            return self.sampling.valid_ns
        if self.sampling.gyro:
            self._off_ns = now_ns
        stopped_ns = now_ns if self._off_ns is None else max(now_ns, self._off_ns + _STOP_NS)
        return stopped_ns + _START_UP_NS

    def _push(self, samples: Samples) -> None:
        fifo = self._fifo
        before, level = fifo.packets, fifo.watermark
        fifo.push(samples, self.acceleration(), self._stamps(samples.ends_ns).astype(np.uint16))
        every = bool(self._registers[Register.FIFO_CONFIG1] & _EVERY_SAMPLE)
        if level and fifo.packets >= level and (every or before < level):
            self._note(FIFO_WATERMARK)
        if fifo.packets == fifo.capacity and before < fifo.capacity:
            self._note(FIFO_FULL)

    def _note(self, what: int) -> None:
        self.status |= what
        self._edge = self._edge or bool(what & self._registers[Register.INT_SOURCE0])

    def _stamps(self, times_ns: NDArray[np.int64]) -> NDArray[np.int64]:
        long = self._registers[Register.TMST_CONFIG] & _STAMP_RESOLUTION
        passed = (times_ns - self._reset_ns) * (1 + self._article.truth.odr_error)
        return np.asarray(passed // (_NS_PER_LONG_STAMP if long else _NS_PER_STAMP), dtype=np.int64)

    def _stuck(self, samples: Samples) -> Samples:
        for fault in self._article.faults.of("stuck"):
            hit = (samples.ends_ns >= fault.start_ns) & (samples.ends_ns < fault.end_ns)
            if self._held is not None and hit.any():
                samples.temperature[hit] = self._held[0]
                samples.gyro[hit] = self._held[1:]
        return samples

    def _hold(self) -> None:
        self.settle()
        self._held = list(self.newest)

    def _schedule(self) -> None:
        """Let the next sample that somebody waits for be made when it ends, and none be older than a second."""
        when_ns = self._due_ns()
        if when_ns is None:
            self._next.clear()
        else:
            self._next.set(when_ns)

    def _due_ns(self) -> int | None:
        if self._edge:
            return self._clock.now_ns()
        if not self.sampling.running:
            return None
        ahead = self._awaited()
        end_ns = self.sampling.end_ns(self._settled + ahead) if ahead else None
        if not self._fifo.active:
            return end_ns
        keep_ns = max(self.sampling.end_ns(self._settled), self.sampling.start_ns) + _KEEP_NS
        return keep_ns if end_ns is None else min(end_ns, keep_ns)

    def _awaited(self) -> int:
        """Return how many samples ahead the next interrupt is, 0 for none."""
        sources, fifo = self._registers[Register.INT_SOURCE0], self._fifo
        if sources & NEW_DATA:
            return 1
        if not fifo.active:
            return 0
        missing = []
        if sources & FIFO_WATERMARK and fifo.watermark:
            every = bool(self._registers[Register.FIFO_CONFIG1] & _EVERY_SAMPLE)
            missing.append(max(fifo.watermark - fifo.packets, 1 if every else 0))
        if sources & FIFO_FULL:
            missing.append(fifo.capacity - fifo.packets)
        return min((number for number in missing if number > 0), default=0)

    def _due(self) -> None:
        self.settle()
        if self._edge:
            self._edge = False
            self._pin.trigger()
        self._schedule()
