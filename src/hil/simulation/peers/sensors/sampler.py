"""Sampling of a simulated sensor: lazy generation of samples, FIFO, status and interrupts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.clock.port import NANOSECONDS
from hil.simulation.faults import Faults, Stuck
from hil.simulation.peers.sensors.fifo import Fifo
from hil.simulation.peers.sensors.grid import Grid
from hil.simulation.peers.sensors.pin import Pin, PinSetting
from hil.simulation.peers.timing import Alarm, Alarms
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import PeerClock

__all__ = ["Bits", "FifoSetting", "Sampler", "Samples"]

_KEEP_NS = NANOSECONDS


class Samples(NamedTuple):
    """Some samples in a row, as counts.

    Attributes:
        ends_ns: when they ended, shape (n,).
        outputs: what data registers show, shape (n, numbers).
        aside: what else goes into packets, shape (n,).
    """

    ends_ns: NDArray[np.int64]
    outputs: NDArray[np.int16]
    aside: NDArray[np.int8]


class Bits(NamedTuple):
    """Bits of the status, and of what asks for an interrupt: a new sample, the watermark, a full FIFO."""

    new: int
    watermark: int
    full: int


class FifoSetting(NamedTuple):
    """FIFO and interrupt configuration from the registers.

    Attributes:
        active: whether samples go into the FIFO.
        newest_go: whether the newest packets are lost where it is full, else the oldest.
        watermark: packets at which the watermark is reached, 0 for never.
        every: whether every sample signals the watermark while it is reached.
        sources: what asks for an interrupt, in `Bits`.
    """

    active: bool
    newest_go: bool
    watermark: int
    every: bool
    sources: int


_NO_FIFO = FifoSetting(active=False, newest_go=False, watermark=0, every=False, sources=0)
_NO_PIN = PinSetting(works=False, high=True, latched=False, pulse_ns=0)


class Sampler(Stateful):
    """Generates samples in batches: on access, after a second at the latest, and when an interrupt is due.

    FIFO and pin are optional. Without a FIFO only the newest sample can be read, and it is generated on access: a
    sensor that runs unread for hours costs nothing.

    Args:
        bits: of the status.
        asleep: what data registers show while nothing is sampled.
        make: makes samples from a number on, which have ended at these instants.
        pack: makes packets of samples.
        look: what the registers say of FIFO and interrupt now.
        fifo: where samples go.
        pin: signals them.
        faults: `stuck` gives the last healthy sample again and again.

    Attributes:
        make_packed: makes samples as `make` does, but only the numbers that go into the FIFO; None where that is no
            quicker.
    """

    _grid: Kept[Grid | None]
    status: Kept[int]
    _newest: Kept[list[int]]
    _unmade: Kept[int]
    _settled: Kept[int]
    _edge: Kept[bool]
    _held: Kept[list[int] | None]
    _next: Kept[Alarm]
    _stucks: Kept[Alarms]

    def __init__(
        self,
        *,
        bits: Bits,
        asleep: Sequence[int],
        make: Callable[[int, NDArray[np.int64]], Samples],
        faults: Faults,
        pack: Callable[[Samples], bytes] = lambda _: b"",
        look: Callable[[], FifoSetting] = lambda: _NO_FIFO,
        fifo: Fifo | None = None,
        pin: Pin | None = None,
    ) -> None:
        self._bits = bits
        self._asleep = asleep
        self._make = make
        self.make_packed: Callable[[int, NDArray[np.int64]], Samples] | None = None
        self._pack = pack
        self._look = look
        self._fifo = Fifo(1, 1) if fifo is None else fifo
        self._pin = Pin(lambda: _NO_PIN) if pin is None else pin
        self._faults = faults
        self._grid = None
        self.status = 0
        self._newest = list(asleep)
        self._unmade = 0
        self._settled = 0
        self._edge = False
        self._held = None
        self._clock: PeerClock

    def attach(self, clock: PeerClock) -> None:
        """Connect the clock."""
        self._clock = clock
        self._next = Alarm(clock, self._due)
        # The last healthy sample is one that ended before the fault began.
        stuck = [(max(0, fault.start_ns - 1), self._hold) for fault in self._faults.of(Stuck)]
        self._stucks = Alarms(clock, stuck)

    def reset(self, status: int) -> None:
        """Be as after power-on: asleep, with nothing sampled."""
        self.status = status
        self.restart(None)
        self.reschedule()

    def restart(self, grid: Grid | None) -> None:
        """Count samples again, on this grid; None is sleep."""
        self._grid, self._settled, self._unmade, self._edge = grid, 0, 0, False
        if grid is None:
            self._newest = list(self._asleep)

    @property
    def newest(self) -> list[int]:
        """What data registers show: the newest sample, which is made now if it was not before."""
        if self._unmade and self._grid:
            self._made(self._grid, self._unmade, self._unmade)
        return self._newest

    @property
    def unmade_ns(self) -> int | None:
        """When the newest sample ended, as long as nobody has read it; None where it is made, or is not the newest."""
        stuck = self._faults.now(Stuck, self._clock.now_ns())
        return self._grid.end_ns(self._unmade) if self._unmade and self._grid and not stuck else None

    def settle(self) -> None:
        """Make the samples that have ended since the last time."""
        grid = self._grid
        count = grid.count(self._clock.now_ns()) if grid else 0
        if grid is None or count == self._settled:
            return
        setting = self._look()
        first, self._settled, self._unmade = self._settled + 1, count, count
        self._note(self._bits.new, setting)
        if setting.active and self.make_packed is not None:
            self._push(self._stuck(self.make_packed(first, grid.ends_ns(first, count - first + 1))), setting)
        elif setting.active:
            self._push(self._made(grid, first, count), setting)
        self.reschedule()

    def take(self, count: int, *, resume: bool) -> bytes:
        """Return bytes that somebody reads from the FIFO; see `Fifo.take`."""
        data = self._fifo.take(count, resume=resume)
        self.reschedule()
        return data

    def take_status(self) -> int:
        """Return the status, which reading clears."""
        status, self.status = self.status, 0
        return status

    def flush(self, packet: int) -> None:
        """Empty the FIFO; packets have this size from now on."""
        self._fifo.flush(packet)
        self._edge = False
        self.reschedule()

    def reschedule(self) -> None:
        """Let the next sample that somebody waits for be made when it ends, and none be older than a second."""
        when_ns = self._due_ns()
        if when_ns is None:
            self._next.clear()
        else:
            self._next.set(when_ns)

    def _made(self, grid: Grid, first: int, last: int) -> Samples:
        """Make samples up to the newest one, counted from 1."""
        samples = self._stuck(self._make(first, grid.ends_ns(first, last - first + 1)))
        self._unmade, self._newest = 0, samples.outputs[-1].tolist()
        return samples

    def _push(self, samples: Samples, setting: FifoSetting) -> None:
        fifo, level = self._fifo, setting.watermark
        before = fifo.packets
        fifo.push(self._pack(samples), newest_go=setting.newest_go)
        if level and fifo.packets >= level and (setting.every or before < level):
            self._note(self._bits.watermark, setting)
        if fifo.packets == fifo.capacity and before < fifo.capacity:
            self._note(self._bits.full, setting)

    def _note(self, what: int, setting: FifoSetting) -> None:
        self.status |= what
        self._edge = self._edge or bool(what & setting.sources)

    def _stuck(self, samples: Samples) -> Samples:
        for fault in self._faults.of(Stuck):
            hit = (samples.ends_ns >= fault.start_ns) & (samples.ends_ns < fault.end_ns)
            if self._held is not None and hit.any():
                samples.outputs[hit] = self._held
        return samples

    def _hold(self) -> None:
        self.settle()
        self._held = list(self.newest)

    def _due_ns(self) -> int | None:
        if self._edge:
            return self._clock.now_ns()
        grid, setting = self._grid, self._look()
        if grid is None:
            return None
        ahead = self._awaited(setting)
        end_ns = grid.end_ns(self._settled + ahead) if ahead else None
        if not setting.active:
            return end_ns
        keep_ns = max(grid.end_ns(self._settled), grid.start_ns) + _KEEP_NS
        return keep_ns if end_ns is None else min(end_ns, keep_ns)

    def _awaited(self, setting: FifoSetting) -> int:
        """Return how many samples ahead the next interrupt is, 0 for none."""
        bits, sources, fifo = self._bits, setting.sources, self._fifo
        if sources & bits.new:
            return 1
        if not setting.active:
            return 0
        missing = []
        if sources & bits.watermark and setting.watermark:
            missing.append(max(setting.watermark - fifo.packets, 1 if setting.every else 0))
        if sources & bits.full:
            missing.append(fifo.capacity - fifo.packets)
        return min((number for number in missing if number > 0), default=0)

    def _due(self) -> None:
        self.settle()
        if self._edge:
            self._edge = False
            self._pin.trigger()
        self.reschedule()
