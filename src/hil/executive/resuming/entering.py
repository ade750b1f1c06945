"""Entering a run again that was stopped to be resumed: behind the last event from which its case can go on."""

from __future__ import annotations

from hil.bench.bound import BoundBench
from hil.clock.port import NANOSECONDS
from hil.evidence.folder import TRANSCRIPT
from hil.evidence.journal.past import Entry
from hil.executive.journaling.record import Record
from hil.executive.resuming.beginnings import NewRun
from hil.executive.resuming.earlier import Boundary, Earlier
from hil.executive.watching.keeper import BenchKeeper
from hil.model.errors import HilError
from hil.wire.transcript import count_operations

__all__ = ["Entering", "NotArmedAgain"]


class NotArmedAgain(HilError):
    """The bench could not be armed when a run was entered again."""


class Entering:
    """Lets a run go on behind the event at which it is entered, on a bench that stood safe in the meantime.

    What came behind that event before is void, and is kept: events, operations, rows. The bench is armed anew, every
    output driven again as it was at that event, and every stream begun again. Behind the last case none of that is
    done: the safe state, the watch behind it, and the seal are all that is left. A run that was entered before is
    entered again on its record in the same way, and so is the replay of one.

    Args:
        record: what the run writes down.
        bench: its bench.
        keeper: arms the bench.
        beginning: what the run begins from.
    """

    def __init__(self, record: Record, bench: BoundBench, keeper: BenchKeeper, beginning: NewRun) -> None:
        self._record = record
        self._bench = bench
        self._keeper = keeper
        self._places: dict[int, list[Entry]] = {}
        for entry in beginning.entries:
            self._places.setdefault(entry.place, []).append(entry)
        self._void_rows = beginning.void_rows
        self._earlier = beginning.earlier
        self._boundary = beginning.earlier.boundary if beginning.earlier else None

    def after(self, place: int) -> None:
        """Enter the run if this is the place; called after every event of its own course.

        Raises:
            NotArmedAgain: if the bench cannot be armed.
            DeviceFault: if an output or a stream does not go on.
        """
        entries, anew = self._places.pop(place, []), self._boundary is not None and place == self._boundary.place
        if not entries and not anew:
            return
        with self._keeper.scheduler.flags.undisturbed():  # nothing looks after a bench that is being armed
            self._enter(place, entries, anew=anew)

    def _enter(self, place: int, entries: list[Entry], *, anew: bool) -> None:
        for entry in entries if anew else entries[:-1]:  # entered here once more: what came behind it is void, too
            self._record.store.note_void(entry)
        entry = self._anew(place) if anew else self._as_recorded(entries[-1])
        if self._bench.outside:
            self._bench.opened_anew()
        self._keeper.over = entry.over
        if entry.over:
            return
        if problem := self._keeper.arm_again(entry.void_to):
            self._keeper.safe()
            raise NotArmedAgain(f"the bench was not armed again: {problem}", "see hil bench check")
        self._keeper.holding.drive_again()
        self._keeper.scheduler.begin_again()

    def _as_recorded(self, entry: Entry) -> Entry:
        """Enter the run where it was entered."""
        self._pass_over(entry)
        self._keeper.scheduler.retrace_to(round(entry.at * NANOSECONDS))
        return entry

    def _anew(self, place: int) -> Entry:
        """Enter the run here now."""
        if self._earlier is None or self._boundary is None:
            raise RuntimeError("nothing is entered again")
        entry, clock = self._entry(place, self._earlier, self._boundary), self._bench.clock
        self._pass_over(entry)
        if not self._earlier.live:
            self._keeper.scheduler.go_on()
        clock.wait_until(self._earlier.last_ns)  # what is recorded now comes after what is void
        clock.sleep(self._earlier.stood_s)
        if self._earlier.live:  # a clock that follows boot time would let everybody wait for that
            self._keeper.scheduler.go_on()
        self._record.events.end_of_past(entry)
        return entry

    def _entry(self, place: int, earlier: Earlier, boundary: Boundary) -> Entry:
        """Return what is void if the run is entered here now."""
        return Entry(
            place=place,
            boundary=boundary.sequence,
            void_to=earlier.lines[-1].body["seq"],
            operations=count_operations(earlier.folder / TRANSCRIPT),
            at=0.0,
            number=earlier.next_recording,
            rows=tuple(self._record.store.held(boundary.kept, earlier.begun_behind)),
            kept=boundary.kept,
            over=boundary.over,
        )

    def _pass_over(self, entry: Entry) -> None:
        self._record.events.skip(entry.void_to)
        self._record.transcript.skip(entry.operations)
        self._keeper.scheduler.timeline.skip(entry.operations)
        for recording, void_rows in self._record.store.pass_over(entry, self._void_rows):
            self._keeper.scheduler.feeds.pass_over(recording, void_rows)
