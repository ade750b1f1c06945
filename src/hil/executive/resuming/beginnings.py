"""Beginnings of a run: a new one, one that resumes an interrupted run, or one that replays a package."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from hil.bench.bound import BoundBench
from hil.bench.gate import Gate
from hil.clock import wall
from hil.clock.port import NANOSECONDS
from hil.evidence import events
from hil.evidence.attempts import Abandoned, abandoned
from hil.evidence.folder import (
    ATTACHMENTS,
    JOURNAL,
    RECORDINGS,
    TRANSCRIPT,
    create,
    is_sealed,
    renew_reserve,
    require_space,
)
from hil.evidence.journal.past import Past, entries
from hil.evidence.journal.writer import Journal
from hil.evidence.package.contents import Package
from hil.evidence.recordings.hdf5 import revert
from hil.evidence.safed import guardian_hash
from hil.evidence.state import standing
from hil.executive.cases.effects import Recall
from hil.executive.ending.stop import Stopped
from hil.executive.journaling.events import Events
from hil.executive.journaling.record import Record
from hil.executive.resuming.earlier import Boundary, Earlier, not_opened
from hil.executive.setup.configuration import Configuration
from hil.executive.setup.head import PlannedCase, write_head
from hil.executive.watching.keeper import BenchKeeper
from hil.executive.watching.ports import Distress
from hil.model.errors import DeviceFault, HilError, Refused
from hil.wire.transcript import count_operations

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["Entering", "NewRun", "NotArmedAgain", "ReplayedRun", "ResumedRun", "VoidRows"]

VoidRows = Callable[[events.Voided], "NDArray[np.float64]"]
"""Returns rows of a recording, shape (rows, 1 + channels)."""

_LEAST_SPACE = 50_000_000
_FREE_SPACE = "free some space, and resume the run; or seal it as it is with hil seal"

_WITHOUT_GIVEN_UP = 2
"""Last format of results in which an attempt that was given up did not count."""

_ANSWERED = frozenset({"asks"})
"""A person is not asked again; everything else comes from the recorded bytes."""


class NewRun:
    """A new run.

    Args:
        prepare: must succeed before the folder is created, once the run holds its leases.

    Attributes:
        resumes: whether its folder holds the record of an interrupted run.
        earlier: that run, None if there is none.
        entries: its earlier points of entry, each with the bench time in s.
        not_opened: the host gates that ended its armings, see `BenchKeeper`.
        given_up: the attempts that ended without a verdict before it was entered.
        recall: the effects that it must agree with, None if there are none.
        void_rows: returns the void rows of a record, None if the run's own folder holds them.
        attachments: the folder of files that people gave, None if it is the run's own.
    """

    resumes = False
    earlier: Earlier | None = None
    entries: Sequence[tuple[events.Entry, float]] = ()
    not_opened: Mapping[int, Gate] = {}
    given_up: Sequence[Abandoned] = ()
    recall: Recall | None = None
    void_rows: VoidRows | None = None
    attachments: Path | None = None

    def __init__(self, prepare: Callable[[], None] = lambda: None) -> None:
        self._prepare = prepare

    def require_space(self, configuration: Configuration) -> None:
        """Require space for what the run will write."""
        require_space(configuration.reports, _LEAST_SPACE)

    def open_folder(self, configuration: Configuration) -> Path:
        """Create the run's folder, if preparation succeeds: a run that is refused leaves none."""
        self._prepare()
        return create(configuration.reports, bench=configuration.bench.name, dut=configuration.dut.serial)

    def take_over(self, folder: Path) -> None:
        """Do nothing: no other process knows the folder."""

    def past(self, journal: Journal) -> Resumption | None:
        """Return None: there are no events to retrace."""

    def write_head(
        self, configuration: Configuration, planned: Sequence[PlannedCase], folder: Path, journal: Events
    ) -> None:
        """Freeze everything by which the run is judged, and write the first events."""
        write_head(configuration, planned, folder, journal)


class ReplayedRun(NewRun):
    """The replay of a package, in a folder of its own.

    Args:
        package: the record that the run must agree with. A replay does not repeat the void rows.
    """

    def __init__(self, package: Package) -> None:
        super().__init__()
        self._package = package
        self.recall = Recall(package.of(events.Effect), _ANSWERED)
        self.entries = entries(package.of(events.Resumed))
        self.not_opened = not_opened(package.events)
        self.void_rows = self._rows
        self.attachments = package.folder / ATTACHMENTS
        if package.outcome().format > _WITHOUT_GIVEN_UP:
            self.given_up = abandoned(line.event for line in package.lines())

    def _rows(self, part: events.Voided) -> NDArray[np.float64]:
        import numpy as np  # noqa: PLC0415 - slow to import

        found = self._package.recording(part.recording)
        columns = [found.time, *found.arrays.values()]
        return np.column_stack([column[part.first : part.end] for column in columns])


class ResumedRun(NewRun):
    """The resumption of an interrupted run, in its folder.

    Args:
        earlier: the run as it was found.
    """

    resumes = True

    def __init__(self, earlier: Earlier) -> None:
        self.earlier: Earlier = earlier
        self.entries = earlier.entries
        self.not_opened = earlier.not_opened
        self.given_up = abandoned(line.event for line in earlier.lines)

    def require_space(self, configuration: Configuration) -> None:
        """Require space for what the run will write."""
        require_space(configuration.reports, _LEAST_SPACE, _FREE_SPACE)

    def open_folder(self, _: Configuration) -> Path:
        """Return the folder that it was interrupted in."""
        return self.earlier.folder

    def take_over(self, folder: Path) -> None:
        """Revert recordings to rows, and renew the reserve.

        Raises:
            Refused: if the run was continued, or sealed, since it was found; its folder is now held.
        """
        if is_sealed(folder) or (folder / JOURNAL).stat().st_size != self.earlier.size:
            raise Refused(f"{folder.name}: another process has resumed it in the meantime", "see it with hil status")
        renew_reserve(folder)
        revert(folder / RECORDINGS, self.earlier.state.recordings.values())

    def past(self, journal: Journal) -> Resumption:
        """Return the events to retrace."""
        return Resumption(self.earlier, journal)

    def write_head(
        self, _configuration: Configuration, _planned: Sequence[PlannedCase], _folder: Path, journal: Events
    ) -> None:
        """Show the first events, which exist already."""
        for line in self.earlier.head:
            journal.show(line.event)


class Resumption(Past):
    """The events of an interrupted run after its head, and what is recorded before its first new one.

    Args:
        earlier: the interrupted run.
        journal: its journal.
    """

    def __init__(self, earlier: Earlier, journal: Journal) -> None:
        super().__init__(earlier.lines)
        self._earlier = earlier
        self._journal = journal

    @property
    def course(self) -> int:
        """How many events of the run's own course its head has."""
        return self._earlier.own_course

    def resume(self, t: float, entry: events.Entry | None) -> None:
        """Record that the run was resumed, and before that, whether the machine was restarted in between.

        Args:
            t: bench time in s.
            entry: its point of entry, None if it continues where it was.
        """
        earlier, last = self._earlier, self._earlier.last_wall
        beside, seconds = {"interrupted": last}, round(wall.seconds_since(str(last["utc"])), 1)
        if last["boot_id"] != wall.stamp().boot_id:
            rebooted = events.Reboot(text="the machine was restarted in the meantime", seconds=seconds)
            self._journal.write(rebooted, t, beside=beside)
        resumed = events.Resumed(
            number=earlier.resumes + 1,
            checkpoint=earlier.checkpoint.at_ns / NANOSECONDS if earlier.checkpoint else 0.0,
            torn_bytes=earlier.torn,
            deviation=earlier.deviation,
            seconds=seconds,
            text="the run was interrupted, and resumed here" if entry is None else _entered(earlier),
            entry=entry,
            guardian=guardian_hash(earlier.folder),
        )
        self._journal.write(resumed, t, beside=beside)


def _entered(earlier: Earlier) -> str:
    stands = standing([line.event for line in earlier.lines])
    stop = next((event for event in stands if isinstance(event, events.Stop)), None)
    how = f"stopped by {stop.reason}" if stop else "interrupted"
    if earlier.boundary and earlier.boundary.over:
        return f"{how} after its last case; only the safe-off is driven, and the end is repeated"
    where = "recording" if earlier.boundary and earlier.boundary.kept else "turn or case"
    return f"{how}, and resumed where the last {where} began; everything after that is void"


class NotArmedAgain(HilError):
    """A bench in this process could not be armed when a run was re-entered."""


class Entering:
    """Continues a run after its point of entry, on a bench that was safe in the meantime.

    What came after that event before is void, but kept: events, operations, rows. The bench is rearmed, every output
    driven as it was at that event, and every stream restarted. After the last case none of that is done: only the
    safe state, the watch after it, and the seal are left. On the record of a run that was entered before, it is
    re-entered in the same way, and so it is in a replay.

    Args:
        record: the record of the run.
        bench: its bench.
        keeper: arms the bench.
        beginning: what the run begins from.
    """

    def __init__(self, record: Record, bench: BoundBench, keeper: BenchKeeper, beginning: NewRun) -> None:
        self._record = record
        self._bench = bench
        self._keeper = keeper
        self._places: dict[int, list[tuple[events.Entry, float]]] = {}
        for entry, t in beginning.entries:
            self._places.setdefault(entry.place, []).append((entry, t))
        self._void_rows = beginning.void_rows
        self._failed: list[events.Failed] = []
        self._left: list[Abandoned] = []
        self._given_up = tuple(beginning.given_up)
        self._earlier = beginning.earlier
        self._boundary = beginning.earlier.boundary if beginning.earlier else None

    def after(self, place: int) -> None:
        """Enter the run if this is its point of entry; called after every event of its own course.

        Raises:
            NotArmedAgain: if the bench of this process cannot be armed. A run on any other bench stays open instead.
            DeviceFault: if an output or a stream does not continue.
        """
        entries, reentered = self._places.pop(place, []), self._boundary is not None and place == self._boundary.place
        if not entries and not reentered:
            return
        scheduler, before_ns = self._keeper.scheduler, self._bench.clock.now_ns()
        try:
            with scheduler.flags.undisturbed():  # a bench being armed is not attended to
                self._enter(place, entries, reentered=reentered)
        finally:
            scheduler.put_off(self._bench.clock.now_ns() - before_ns)

    def take_failed(self, case: str) -> list[events.Failed]:
        """Return, once, the checks of a case that had failed before the run was interrupted."""
        found = [failed for failed in self._failed if failed.case == case]
        self._failed = [failed for failed in self._failed if failed.case != case]
        return found

    def take_given_up(self, case: str) -> list[Abandoned]:
        """Return, once, the attempts of a case that were given up before the run was entered."""
        found = [each for each in self._left if each.case == case]
        self._left = [each for each in self._left if each.case != case]
        return found

    def _enter(self, place: int, entries: list[tuple[events.Entry, float]], *, reentered: bool) -> None:
        for entry, _ in entries if reentered else entries[:-1]:  # re-entered here: what came after it is void, too
            self._record.store.note_void(entry)
        self._failed += [failed for entry, _ in entries for failed in entry.failed]
        entry = self._reentry(place) if reentered else self._as_recorded(*entries[-1])
        self._failed += entry.failed if reentered else ()
        given_up = self._given_up
        if reentered and self._earlier is not None:
            given_up = abandoned((line.event for line in self._earlier.lines), entry)
        self._left += [each for each in given_up if entry.boundary < each.void_to <= entry.void_to]
        if self._bench.outside:
            self._bench.reopened()
        self._keeper.over = bool(entry.over)
        if entry.over:
            return
        try:
            self._rearm(entry)
        except (DeviceFault, NotArmedAgain) as error:
            flags = self._keeper.scheduler.flags
            if self._earlier is None:
                flags.request(error.message)  # the replay of a run that was stopped here
            elif not reentered or self._bench.live is None:
                raise
            elif not flags.reason:
                self._keeper.scheduler.lose(Distress(error.message, "arming"))

    def _rearm(self, entry: events.Entry) -> None:
        """Rearm the bench and restore its outputs; if a stop is requested meanwhile, it is left safe.

        The stop is not raised here, where a case may be only about to begin: the next scheduling point raises it.
        """
        keeper = self._keeper
        problem = keeper.arm_again(entry.void_to)
        if problem or not self._restore_outputs():
            keeper.safe()
        if problem and not keeper.scheduler.flags.reason:
            raise NotArmedAgain(f"the bench was not armed again: {problem}", "see hil bench check")

    def _restore_outputs(self) -> bool:
        """Restore all outputs and streams; return False if a stop was requested before that was done."""
        try:
            self._keeper.holding.drive_again()
        except Stopped:
            return False
        self._keeper.scheduler.begin_again()
        return True

    def _as_recorded(self, entry: events.Entry, t: float) -> events.Entry:
        """Enter the run as recorded, at bench time `t` in s."""
        self._skip_void(entry)
        self._keeper.scheduler.retrace_to(round(t * NANOSECONDS))
        return entry

    def _reentry(self, place: int) -> events.Entry:
        """Enter the run here now."""
        if self._earlier is None or self._boundary is None:
            raise RuntimeError("nothing is entered again")
        entry, clock = self._entry(place, self._earlier, self._boundary), self._bench.clock
        self._skip_void(entry)
        if not self._earlier.live:
            self._keeper.scheduler.go_on()
        clock.wait_until(self._earlier.last_ns)  # new events come after the void ones
        clock.sleep(self._earlier.stood_s)
        if self._earlier.live:  # a clock that follows boot time would have to wait for that
            self._keeper.scheduler.go_on()
        self._record.events.end_of_past(entry)
        return entry

    def _entry(self, place: int, earlier: Earlier, boundary: Boundary) -> events.Entry:
        """Return the entry, with what is void, for entering the run here; wholly void recordings are ended first."""
        last = earlier.lines[-1].event.seq
        if earlier.broken_off:
            last = self._record.end_recordings(earlier.broken_off)
        return events.Entry(
            place=place,
            boundary=boundary.sequence,
            void_to=last,
            operations=count_operations(earlier.folder / TRANSCRIPT),
            number=earlier.next_recording,
            rows=tuple(self._record.store.held(boundary.kept, earlier.begun_after)),
            kept=boundary.kept,
            over=boundary.over,
            failed=earlier.failed,
        )

    def _skip_void(self, entry: events.Entry) -> None:
        self._record.events.skip(entry.void_to)
        self._record.transcript.skip(entry.operations)
        self._keeper.scheduler.timeline.skip(entry.operations)
        for recording, void_rows in self._record.store.pass_over(entry, self._void_rows):
            self._keeper.scheduler.feeds.pass_over(recording, void_rows)
