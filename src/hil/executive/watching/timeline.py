"""Timelines: when things happen that no case asks for, by the bench's own clock or as in a record."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Protocol

from hil.bench.bound import BoundBench
from hil.bench.envelope import Monitor
from hil.bench.gate import Gate
from hil.clock.live import LiveClock
from hil.executive.watching.ports import Distress, Freshness, Machine
from hil.executive.watching.sharing import Bus
from hil.model.errors import HilError
from hil.wire.replay import BUSY, CLOCK, DISTRESS, Playback
from hil.wire.tap import LONGEST_TRANSACTION

__all__ = [
    "Course",
    "OnBench",
    "OnLiveBench",
    "OnRecord",
    "Timeline",
    "timeline_of",
]

_BENCH = "bench"
_LAG_NS = 50_000_000
"""Computation time between a case's calls up to which bench time does not catch up."""


class Course(Protocol):
    """The events of a run."""

    @property
    def course(self) -> int:
        """How many events of the run's own course there are."""
        ...


class Timeline(Protocol):
    """Decides when monitors take turns, time advances by itself, and a hold begins, and which gates a machine has.

    Attributes:
        rows_wait: whether rows of streams wait as long as the limits that they feed allow.
        rows_together: whether waiting rows are fetched when limits take their turns.
        shared: whether recordings share the bus by plan, and a disturbance is not held against the article.
        all_share: whether those beside a case do, too, rows of sampled roles feed limits, and the first arming checks
            whether there is room.
    """

    rows_wait: bool
    rows_together: bool
    shared: bool
    all_share: bool

    @property
    def retraces(self) -> bool:
        """Whether what happens now is already on record."""
        ...

    def come(self) -> None:
        """Catch up with the present, if bench time is behind."""
        ...

    def marks(self) -> Iterator[HilError | None]:
        """Yield, for each point between two calls at which the record caught up, the case's error there, if any."""
        ...

    def look(self) -> Timeline:
        """Return the timeline that applies from this scheduling point on."""
        ...

    def distress(self) -> Distress | None:
        """Return why the bench can no longer be driven, or in a replay could not be then; None while it can."""
        ...

    def busy(self, seconds: float) -> HilError | None:
        """Return the error of a case whose own code ran for this many wall-clock seconds, None if that is allowed."""
        ...

    def due(self, monitors: Sequence[Monitor], until_ns: int, name: str, bus: Bus) -> Iterator[Monitor]:
        """Yield the monitors that take a turn before `until_ns`; each is taken before the next one is requested."""
        ...

    def soonest_ns(self, monitors: Sequence[Monitor]) -> int:
        """Return the instant before which no monitor takes a turn."""
        ...

    def quiet_ns(self, monitors: Sequence[Monitor]) -> int:
        """Return the instant before which none takes a turn where nothing waits and no recording shares the bus."""
        ...

    def look_up_ns(self, when_ns: int, monitors: Sequence[Monitor]) -> int:
        """Return when a wait until `when_ns` must pause for a turn."""
        ...

    def longest_ns(self, when_ns: int) -> int:
        """Return until when a wait until `when_ns` may last before the bench needs attention."""
        ...

    def holds(self, name: str) -> bool:
        """Return whether this mark of a hold is next in the record to retrace."""
        ...

    def mark_hold(self, name: str) -> None:
        """Pass a mark of a hold, and note it."""
        ...

    def host_gates(self, arming: int, freshness: Freshness) -> Iterator[tuple[Gate, bool]]:
        """Yield the gates of people and machine at an arming, each with whether it is new."""
        ...

    def skip(self, operations: int) -> None:
        """Skip the record up to that number of operations: they are void."""
        ...


class OnBench:
    """The timeline of a bench in this process: its clock decides the turns.

    Args:
        bench: the bench.
        machine: the machine that drives it.
    """

    rows_wait = rows_together = shared = all_share = True

    def __init__(self, bench: BoundBench, machine: Machine) -> None:
        self._bench = bench
        self._clock = bench.clock
        self._machine = machine

    @property
    def retraces(self) -> bool:
        """Whether a resumed run that is re-executed from its first step has operations left to retrace."""
        return self._bench.transcript.comes_again

    def come(self) -> None:
        """Do nothing: this bench is always at its present."""

    def marks(self) -> Iterator[HilError | None]:
        """Return none."""
        return iter(())

    def look(self) -> Timeline:
        """Return this one: an existing bench continues by itself."""
        return self

    def distress(self) -> Distress | None:
        """Return None: what drives this bench ends with it."""
        return None

    def busy(self, seconds: float) -> HilError | None:
        """Return None: this bench stands still while a case computes."""
        del seconds
        return None

    def due(self, monitors: Sequence[Monitor], until_ns: int, name: str, bus: Bus) -> Iterator[Monitor]:
        """Yield the monitors with room before `until_ns`, and overdue ones, as far as recordings admit them."""
        del name
        now_ns = self._clock.now_ns()
        for monitor in monitors:
            waits = now_ns < monitor.due_ns and not (bus.shares or bus.looks_ahead)  # like most
            if not waits and bus.room(monitor, now_ns, until_ns):
                yield monitor
                now_ns = self._clock.now_ns()  # its reading took time

    def soonest_ns(self, monitors: Sequence[Monitor]) -> int:
        """Return when the next one is due."""
        return min([monitor.due_ns for monitor in monitors], default=0)

    def quiet_ns(self, monitors: Sequence[Monitor]) -> int:
        """Return when the next one is overdue, or due if its reading takes no time."""
        return min([each.overdue_ns if each.room_ns else each.due_ns for each in monitors], default=0)

    def look_up_ns(self, when_ns: int, monitors: Sequence[Monitor]) -> int:
        """Return when the next one with room before `when_ns` is due: now, if that passed during a reading."""
        now_ns = self._clock.now_ns()
        near = [monitor for monitor in monitors if monitor.due_ns <= when_ns]
        turns = [(max(now_ns, monitor.due_ns), monitor.room_ns) for monitor in near]
        return min([due_ns for due_ns, room_ns in turns if due_ns <= when_ns - room_ns], default=when_ns)

    def longest_ns(self, when_ns: int) -> int:
        """Return `when_ns`."""
        return when_ns

    def holds(self, name: str) -> bool:
        """Return whether the transcript of a resumed run has this mark next."""
        return self._bench.transcript.next_is(_BENCH, name)

    def mark_hold(self, name: str) -> None:
        """Note that a hold began or ended now."""
        _note(self._bench, name)

    def host_gates(self, arming: int, freshness: Freshness) -> Iterator[tuple[Gate, bool]]:
        """Yield the gates of the machine."""
        del arming
        yield from ((gate, True) for gate in self._machine.gates(freshness))

    def skip(self, operations: int) -> None:
        """Do nothing: there is no record."""


class OnLiveBench(OnBench):
    """The timeline of a bench outside this process, whose clock stands still between operations.

    While a person is asked, or a case computes, bench time must catch up, for monitors and turns. The transcript
    marks that with the number of events before it, so that a replay does so between the same two events.

    Args:
        bench: the bench.
        clock: its clock.
        machine: the machine that drives it.
        events: know their number.
    """

    def __init__(self, bench: BoundBench, clock: LiveClock, machine: Machine, events: Course) -> None:
        super().__init__(bench, machine)
        self._live = clock
        self._events = events

    def come(self) -> None:
        """Catch up with the present, if bench time is behind by more than a moment."""
        live = self._live
        if live.lag_ns() > _LAG_NS:
            began_ns, sent = live.now_ns(), str(self._events.course).encode()
            self._bench.transcript.note(_BENCH, CLOCK, began_ns, live.look(), sent=sent)

    def distress(self) -> Distress | None:
        """Return why the machine can no longer drive the bench, None while it can.

        What trips the bench for good does so in a replay, too. A loss that leaves the run resumable is not replayed.
        """
        if (found := self._machine.distress()) and not found.what:
            _note(self._bench, DISTRESS, f"{self._events.course} {found.text}".encode())
        return found

    def busy(self, seconds: float) -> HilError | None:
        """Note how long a case's own code left the bench unattended, and return that error; see `Timeline`.

        It is an error of the case in a replay, too, even if that computes faster.
        """
        if seconds <= LONGEST_TRANSACTION:
            return None
        told = f"{seconds:.2f}"
        _note(self._bench, BUSY, f"{self._events.course} {told}".encode())
        return _held_up(told)

    def longest_ns(self, when_ns: int) -> int:
        """Return the end of the present time slice of the clock."""
        return min(when_ns, self._live.soon_ns()) if self._live.began else when_ns


class OnRecord:
    """The timeline of a record: everything happens as in the transcript.

    Args:
        bench: the bench.
        playback: the record that answers for it.
        after: the timeline of the bench, once it continues by itself.
        events: know their number.
        not_opened: the host gate that ended an arming, by arming: people and machine are not asked again.
    """

    def __init__(
        self,
        bench: BoundBench,
        playback: Playback,
        after: Timeline,
        events: Course,
        not_opened: Mapping[int, Gate],
    ) -> None:
        self._bench = bench
        self._playback = playback
        self._after = after
        self._events = events
        self._not_opened = not_opened
        self.rows_wait = playback.rows_wait
        self.rows_together = not playback.in_parts
        self.shared = playback.shared
        self.all_share = playback.all_share

    @property
    def retraces(self) -> bool:
        """Return True: a record is retraced."""
        return True

    def come(self) -> None:
        """Do nothing: the marks of the record show where it caught up with its present."""

    def marks(self) -> Iterator[HilError | None]:
        """Yield what the record has between the last event and the next one; see `Timeline`."""
        while True:
            while told := self._mark(BUSY):
                yield _held_up(told.decode())
            if not self._mark(CLOCK):
                return
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
        while limit := self._playback.take_monitor(max(until_ns - 1, clock.now_ns()), name):
            yield next(monitor for monitor in monitors if monitor.limit.id == limit)

    def soonest_ns(self, monitors: Sequence[Monitor]) -> int:
        """Return 0: only the record knows."""
        del monitors
        return 0

    quiet_ns = soonest_ns

    def look_up_ns(self, when_ns: int, monitors: Sequence[Monitor]) -> int:
        """Return where the wait ends, or pauses, in the record."""
        del monitors
        return self._playback.look_up_ns(when_ns)

    def longest_ns(self, when_ns: int) -> int:
        """Return `when_ns`: a record needs no attention."""
        return when_ns

    def holds(self, name: str) -> bool:
        """Return whether this mark is next in the record."""
        return self._playback.comes(name, self._bench.clock.now_ns())

    def mark_hold(self, name: str) -> None:
        """Take a mark of a hold from the record."""
        self._playback.take(_BENCH, name)
        _note(self._bench, name)

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
        if int(number) > self._events.course:
            return b""
        began_ns = self._bench.clock.now_ns()
        self._playback.take(_BENCH, name, found.sent)
        self._bench.transcript.note(_BENCH, name, began_ns, self._bench.clock.now_ns(), sent=found.sent)
        return told or number


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
    own = OnBench(bench, machine) if bench.live is None else OnLiveBench(bench, bench.live, machine, events)
    return own if bench.playback is None else OnRecord(bench, bench.playback, own, events, not_opened)


def _note(bench: BoundBench, name: str, sent: bytes = b"") -> None:
    now_ns = bench.clock.now_ns()
    bench.transcript.note(_BENCH, name, now_ns, now_ns, sent=sent)


def _held_up(seconds: str) -> HilError:
    return HilError(
        f"its own code ran for {seconds} s without letting anybody look after the bench, with outputs on;"
        f" {LONGEST_TRANSACTION:g} s are allowed",
        "compute after the last use of the outputs, or in smaller pieces",
    )
