"""Timelines: when things happen that no case asks for, here by the bench's own clock."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol

from hil.bench.bound import BoundBench
from hil.bench.envelope import Monitor
from hil.bench.gate import Gate
from hil.clock.live import LiveClock
from hil.executive.watching.ports import Distress, Freshness, Machine
from hil.executive.watching.sharing import Bus
from hil.model.errors import HilError
from hil.wire.replay import BUSY, CLOCK, DISTRESS, Place
from hil.wire.tap import LONGEST_TRANSACTION

__all__ = [
    "BENCH",
    "Course",
    "OnBench",
    "OnLiveBench",
    "Places",
    "Timeline",
    "held_up",
    "note",
]

BENCH = "bench"
"""The device of marks that belong to no device."""
_LAG_NS = 50_000_000
"""Computation time between a case's calls up to which bench time does not catch up."""


class Course(Protocol):
    """The events of a run."""

    @property
    def course(self) -> int:
        """How many events of the run's own course there are."""
        ...


class Places:
    """Numbers the places of a run's course, live as in a replay.

    A case passes points, and waits, in a replay as it did live. After each of them time may go on by itself.

    Args:
        events: know their number.
    """

    def __init__(self, events: Course) -> None:
        self._events = events
        self._course = self._entered = 0

    def here(self) -> Place:
        """Return the present place."""
        if self._course != self._events.course:
            self._course, self._entered = self._events.course, 0
        return Place(self._course, self._entered)

    def enter(self) -> None:
        """Come to the next point or wait of the case."""
        self.here()
        self._entered += 1


class Timeline(Protocol):
    """Decides when monitors take turns, time advances by itself, and a hold begins, and which gates a machine has.

    Attributes:
        rows_wait: whether rows of streams wait as long as the limits that they feed allow.
        rows_together: whether waiting rows are fetched when limits take their turns.
        shared: whether recordings share the bus by plan, and a disturbance is not held against the article.
        places: number where the run is.
        all_share: whether those beside a case do, too, rows of sampled roles feed limits, and the first arming checks
            whether there is room.
    """

    rows_wait: bool
    rows_together: bool
    shared: bool
    all_share: bool
    places: Places

    @property
    def retraces(self) -> bool:
        """Whether what happens now is already on record."""
        ...

    def come(self) -> bool:
        """Catch up with the present, if bench time is behind; return whether it was."""
        ...

    def marks(self, *, to_event: bool) -> Iterator[HilError | None]:
        """Yield, for each point between two calls at which the record caught up, the case's error there, if any.

        Args:
            to_event: up to the next event; otherwise only up to the next point or wait of the case.
        """
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
        places: number where the run is.
    """

    rows_wait = rows_together = shared = all_share = True

    def __init__(self, bench: BoundBench, machine: Machine, places: Places) -> None:
        self._bench = bench
        self._clock = bench.clock
        self._machine = machine
        self.places = places

    @property
    def retraces(self) -> bool:
        """Whether a resumed run that is re-executed from its first step has operations left to retrace."""
        return self._bench.transcript.comes_again

    def come(self) -> bool:
        """Return False: this bench is always at its present."""
        return False

    def marks(self, *, to_event: bool) -> Iterator[HilError | None]:
        """Return none."""
        del to_event
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
        """Return whether the transcript of a resumed run has this mark next, and here."""
        sent = self._bench.transcript.sent_next(BENCH, name)
        return sent is not None and Place.of(sent) <= self.places.here()

    def mark_hold(self, name: str) -> None:
        """Note that a hold began or ended now."""
        note(self._bench, name, self.places.here().sent)

    def host_gates(self, arming: int, freshness: Freshness) -> Iterator[tuple[Gate, bool]]:
        """Yield the gates of the machine."""
        del arming
        yield from ((gate, True) for gate in self._machine.gates(freshness))

    def skip(self, operations: int) -> None:
        """Do nothing: there is no record."""


class OnLiveBench(OnBench):
    """The timeline of a bench outside this process, whose clock stands still between operations.

    While a person is asked, or a case computes, bench time must catch up, for monitors and turns. The transcript
    marks that with its place, so that a replay does so at the same one.

    Args:
        bench: the bench.
        clock: its clock.
        machine: the machine that drives it.
        places: number where the run is.
    """

    def __init__(self, bench: BoundBench, clock: LiveClock, machine: Machine, places: Places) -> None:
        super().__init__(bench, machine, places)
        self._live = clock

    def come(self) -> bool:
        """Catch up with the present, if bench time is behind by more than a moment; return whether it was."""
        live = self._live
        if live.lag_ns() <= _LAG_NS:
            return False
        began_ns = live.now_ns()
        self._bench.transcript.note(BENCH, CLOCK, began_ns, live.look(), sent=self.places.here().sent)
        return True

    def distress(self) -> Distress | None:
        """Return why the machine can no longer drive the bench, None while it can.

        What trips the bench for good does so in a replay, too. A loss that leaves the run resumable is not replayed.
        """
        if (found := self._machine.distress()) and not found.what:
            note(self._bench, DISTRESS, f"{self.places.here().course} {found.text}".encode())
        return found

    def busy(self, seconds: float) -> HilError | None:
        """Note how long a case's own code left the bench unattended, and return that error; see `Timeline`.

        It is an error of the case in a replay, too, even if that computes faster.
        """
        if seconds <= LONGEST_TRANSACTION:
            return None
        told = f"{seconds:.2f}"
        note(self._bench, BUSY, f"{self.places.here().course} {told}".encode())
        return held_up(told)

    def longest_ns(self, when_ns: int) -> int:
        """Return the end of the present time slice of the clock."""
        return min(when_ns, self._live.soon_ns()) if self._live.began else when_ns


def note(bench: BoundBench, name: str, sent: bytes = b"") -> None:
    """Note a mark of the bench in the transcript."""
    now_ns = bench.clock.now_ns()
    bench.transcript.note(BENCH, name, now_ns, now_ns, sent=sent)


def held_up(seconds: str) -> HilError:
    """Return the error of a case whose own code ran for this long, with outputs on."""
    return HilError(
        f"its own code ran for {seconds} s without letting anybody look after the bench, with outputs on;"
        f" {LONGEST_TRANSACTION:g} s are allowed",
        "compute after the last use of the outputs, or in smaller pieces",
    )
