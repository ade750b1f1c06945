"""The timeline of a record: when things happened that no case asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

from hil.bench.bound import BoundBench
from hil.bench.envelope import Monitor
from hil.bench.gate import Gate
from hil.executive.watching.ports import Distress, Freshness, Machine
from hil.executive.watching.sharing import Bus
from hil.executive.watching.timeline import BENCH, Course, OnBench, OnLiveBench, Places, Timeline, held_up
from hil.model.errors import HilError
from hil.wire.replay import BUSY, CLOCK, DISTRESS, HOLD, Place, Playback
from hil.wire.transcript import Operation

__all__ = ["OnRecord", "timeline_of"]


class OnRecord:
    """The timeline of a record: everything happens as in the transcript.

    Args:
        bench: the bench.
        playback: the record that answers for it.
        after: the timeline of the bench, once it continues by itself.
        places: number where the run is.
        not_opened: the host gate that ended an arming, by arming: people and machine are not asked again.
    """

    def __init__(
        self,
        bench: BoundBench,
        playback: Playback,
        after: Timeline,
        places: Places,
        not_opened: Mapping[int, Gate],
    ) -> None:
        self._bench = bench
        self._playback = playback
        self._after = after
        self.places = places
        self._not_opened = not_opened
        self.rows_wait = playback.rows_wait
        self.rows_together = not playback.in_parts
        self.shared = playback.shared
        self.all_share = playback.all_share

    @property
    def retraces(self) -> bool:
        """Return True: a record is retraced."""
        return True

    def come(self) -> bool:
        """Catch up if the record did so at this very place; return whether it did."""
        found = self._playback.next_if(CLOCK)
        if found is None or Place.of(found.sent) != self.places.here():
            return False
        self._pass(found)
        return True

    def marks(self, *, to_event: bool) -> Iterator[HilError | None]:
        """Yield what the record has between the last event and the next one; see `Timeline`.

        Up to format 9 nothing tells what was at a point of the case.
        """
        while True:
            while told := self._mark(BUSY):
                yield held_up(told.decode())
            found = self._playback.next_if(CLOCK)
            if found is None:
                return
            place, here = Place.of(found.sent), self.places.here()
            if place.course > here.course or (place > here and not to_event):
                return
            self._pass(found)
            yield None

    def look(self) -> Timeline:
        """Let the bench continue from here if the record ends here; return the timeline that then applies."""
        self._playback.hand_over_if_due()
        return self._after if self._bench.playback is None else self

    def distress(self) -> Distress | None:
        """Return why the bench could no longer be driven then."""
        text = self._mark(DISTRESS).decode()
        return Distress(text) if text else None

    def busy(self, seconds: float) -> HilError | None:
        """Return None: the marks of the record show how long the case took then."""
        del seconds
        return None

    def due(self, monitors: Sequence[Monitor], until_ns: int, name: str, bus: Bus) -> Iterator[Monitor]:
        """Yield the monitors that the record has here; those of a later wait are left for that one."""
        del bus
        clock = self._bench.clock
        while limit := self._playback.take_monitor(max(until_ns - 1, clock.now_ns()), name, self.places.here()):
            yield next(monitor for monitor in monitors if monitor.limit.id == limit)

    def soonest_ns(self, monitors: Sequence[Monitor]) -> int:
        """Return 0: only the record knows."""
        del monitors
        return 0

    quiet_ns = soonest_ns

    def look_up_ns(self, when_ns: int, monitors: Sequence[Monitor]) -> int:
        """Return where the wait ends, or pauses, in the record."""
        del monitors
        return self._bench.clock.now_ns() if self.holds(HOLD) else self._playback.look_up_ns(when_ns)

    def longest_ns(self, when_ns: int) -> int:
        """Return `when_ns`: a record needs no attention."""
        return when_ns

    def holds(self, name: str) -> bool:
        """Return whether this mark is next in the record."""
        return self._playback.comes(name, self._bench.clock.now_ns(), self.places.here())

    def mark_hold(self, name: str) -> None:
        """Take a mark of a hold from the record."""
        self._pass(self._playback.next_if(name) or self._playback.take(BENCH, name))  # diverges if it is not next

    def host_gates(self, arming: int, freshness: Freshness) -> Iterator[tuple[Gate, bool]]:
        """Yield the gate that ended this arming in the record, if one did; it is on record already."""
        del freshness
        if gate := self._not_opened.get(arming):
            yield gate, False

    def skip(self, operations: int) -> None:
        """Skip the record up to that number of operations."""
        self._playback.skip(operations)

    def _mark(self, name: str) -> bytes:
        """Take a mark that the record has between the last event and the next one; return its content."""
        found = self._playback.next_if(name)
        if found is None:
            return b""
        number, _, told = found.sent.partition(b" ")
        if int(number) > self.places.here().course:
            return b""
        self._pass(found)
        return told

    def _pass(self, found: Operation) -> None:
        """Pass a mark of the bench."""
        began_ns = self._bench.clock.now_ns()
        self._playback.take(BENCH, found.name, found.sent)
        self._bench.transcript.note(BENCH, found.name, began_ns, self._bench.clock.now_ns(), sent=found.sent)


def timeline_of(
    bench: BoundBench, machine: Machine, events: Course, not_opened: Mapping[int, Gate] = MappingProxyType({})
) -> Timeline:
    """Return the timeline of a bench: of its record, if one answers for it, otherwise of its own clock.

    Args:
        bench: the bench.
        machine: the machine that drives it.
        events: know their number.
        not_opened: see `OnRecord`.
    """
    places = Places(events)
    own = OnBench(bench, machine, places) if bench.live is None else OnLiveBench(bench, bench.live, machine, places)
    return own if bench.playback is None else OnRecord(bench, bench.playback, own, places, not_opened)
