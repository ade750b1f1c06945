"""Record of a run in progress: its folder, journal, row files and transcript, and their upkeep."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack, suppress
from io import FileIO
from pathlib import Path
from typing import Protocol

from hil.bench.bound import BoundBench
from hil.bench.lease import Lease, refuse_latched
from hil.clock import wall
from hil.evidence import events
from hil.evidence.events import Event, EventSink, HoldEnd
from hil.evidence.folder import ATTACHMENTS, JOURNAL, RESERVE, TRANSCRIPT, free_reserve, hold
from hil.evidence.inbox import Message, asks_for_end, poll, waiting
from hil.evidence.journal.writer import Journal
from hil.evidence.package.sealing import ReportWriter, end_recordings, event_of, seal
from hil.executive.ending.stop import StopFlags
from hil.executive.journaling.checkpoints import Checkpoints
from hil.executive.journaling.events import DISK_FULL, Caller, Events, Listener, Retraced
from hil.executive.journaling.heads import Heads
from hil.executive.journaling.row_store import RowStore
from hil.executive.people.questions import Elsewhere
from hil.executive.setup.configuration import Configuration
from hil.executive.setup.head import PlannedCase
from hil.model.errors import EvidenceError
from hil.wire.transcript import Transcript, past_lines

__all__ = ["Beginning", "Record", "Timekeeping", "Upkeep"]

_NOTICED_S = 1.0


class Timekeeping:
    """Compares three clocks: one that stops while the machine is suspended, one that does not, and the time of day.

    Args:
        journal: where events are written.
        clocks: reads them.
    """

    def __init__(self, journal: EventSink, clocks: Callable[[], wall.Clocks] = wall.clocks) -> None:
        self._journal = journal
        self._clocks = clocks
        self._before = clocks()

    def tick(self) -> None:
        """Read the clocks and record any divergence since the last reading."""
        before, now = self._before, self._clocks()
        self._before = now
        boot = now.boot - before.boot
        suspended = boot - (now.awake - before.awake)
        jumped = (now.day - before.day) - boot
        if suspended > _NOTICED_S:
            self._journal.write(events.Suspended(text="the machine was suspended", seconds=round(suspended, 1)))
        if abs(jumped) > _NOTICED_S:
            self._journal.write(events.ClockJump(text="the machine's time of day was set", seconds=round(jumped, 1)))


class RunProgress(Protocol):
    """Progress of a run."""

    def note(self) -> None:
        """Write a checkpoint of the bench, if it is due."""
        ...

    def retraces(self) -> bool:
        """Return whether the run is still retracing its past; nothing from outside can be taken then."""
        ...


class KnowsCode(Protocol):
    """The recipient of a code."""

    def knows(self, code: str) -> bool:
        """Return whether this is the latest code sent."""
        ...


class Upkeep:
    """Syncs pending data to disk and polls the inbox.

    Args:
        folder: the run's folder.
        journal: where messages are written, and shown to all listeners.
        store: the open recordings.
        transcript: what went over the wire.
        flags: requested to end the run when a message asks for it, or the disk is full.
        progress: the progress of the run.

    Attributes:
        elsewhere: takes answers to the pending question.
    """

    def __init__(
        self,
        folder: Path,
        journal: Events,
        store: RowStore,
        transcript: Transcript,
        flags: StopFlags,
        progress: RunProgress,
    ) -> None:
        self.elsewhere = Elsewhere()
        self._progress = progress
        self._on_call: KnowsCode | None = None
        self._left = waiting(folder)
        self._timekeeping = Timekeeping(journal)
        self._folder = folder
        self._events = journal
        self._store = store
        self._transcript = transcript
        self._flags = flags

    def expect(self, on_call: KnowsCode) -> None:
        """Compare incoming codes with the one sent to this person."""
        self._on_call = on_call

    def tick(self) -> None:
        """Do all of it."""
        self.keep_time()
        self._flush(self._progress.note)
        if not (self._folder / RESERVE).exists():
            self._disk_is_full()
        if not self._progress.retraces():
            for message in poll(self._folder, self._left):
                self._take(message)
        elif asks_for_end(self._folder, self._left):
            self._flags.request("another terminal")

    def keep_time(self) -> None:
        """Record what the machine's clocks did, before anything stamped by them."""
        self._timekeeping.tick()

    def _take(self, message: Message) -> None:
        if message.kind in {"interrupt", "stop"}:
            may_stay_open = self._flags.leave_open or not self._flags.reason
            self._flags.leave_open = message.kind == "interrupt" and may_stay_open
            self._flags.request(f"{message.by or 'another terminal'}: {message.text}".rstrip(": "))
        elif message.kind == "reached":
            known = self._on_call is not None and self._on_call.knows(message.text)
            self._events.write(events.Reached(by=message.by, ok=known))
        elif message.kind == "answer":
            path = self._folder / ATTACHMENTS / message.file if message.file else None
            if problem := self.elsewhere.take(message.name, message.text, message.by, path, message.witness):
                if path is not None:  # the sender still has it
                    path.unlink(missing_ok=True)
                text = f"inbox, answer by {message.by or 'nobody'}: {problem}"
                self._events.write(events.Anomaly(text=text))
        else:
            self._events.write(event_of(message), beside=message.beside)

    def flush(self) -> None:
        """Sync pending data to disk."""
        self._flush(lambda: None)

    def _flush(self, then: Callable[[], None]) -> None:
        try:
            self._events.tick()
            self._transcript.flush()
            self._store.tick()
            then()
        except (OSError, EvidenceError):
            self._disk_is_full()
            if free_reserve(self._folder / RESERVE):
                self.flush()

    def _disk_is_full(self) -> None:
        """Request an end from which the run can be resumed once there is space again."""
        self._flags.leave_off(DISK_FULL)


class Beginning(Protocol):
    """Beginning of a run, as its record sees it: a folder of its own, or that of an interrupted run.

    Attributes:
        resumes: whether the folder holds rows and operations that are retraced before anything new is written.
    """

    resumes: bool

    def require_space(self, configuration: Configuration) -> None:
        """Require space for what the run will write.

        Raises:
            Refused: if there is too little.
        """
        ...

    def open_folder(self, configuration: Configuration) -> Path:
        """Return the run's folder."""
        ...

    def take_over(self, folder: Path) -> None:
        """Prepare a folder that is now held.

        Raises:
            Refused: if another process has continued it.
        """
        ...

    def past(self, journal: Journal) -> Retraced | None:
        """Return the events to retrace, None if there are none."""
        ...

    def write_head(
        self, configuration: Configuration, planned: Sequence[PlannedCase], folder: Path, events: Events
    ) -> None:
        """Write the first events, or show those that exist already."""
        ...


class _Sink(FileIO):
    """The file of a transcript; it counts as full while `frozen`."""

    def __init__(self, path: Path, mode: str, frozen: Callable[[], bool]) -> None:
        super().__init__(path, mode)
        self._frozen = frozen

    def write(self, data: bytes | bytearray | memoryview, /) -> int:  # type: ignore[override]
        """Write as much as fits."""
        if self._frozen():
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return super().write(data)


class Record:
    """What a run records, and what it retraces of an interrupted run before anything new is written.

    Args:
        configuration: what the run is made of.
        flags: stop requests.
        leases: what the run must hold exclusively.
        listeners: are shown every event.
        beginning: what the run begins from.
        caller: is notified why a resumed run does not retrace its past.
        closing: releases folder and leases when the run is over.
    """

    def __init__(
        self,
        configuration: Configuration,
        flags: StopFlags,
        leases: Sequence[str],
        listeners: Sequence[Listener],
        beginning: Beginning,
        caller: Caller,
        closing: ExitStack,
    ) -> None:
        self._configuration = configuration
        self._beginning = beginning
        self._caller = caller
        self._checkpoints: Checkpoints | None = None
        self._bench: BoundBench | None = None
        self._retraces = beginning.resumes
        self.folder = self._open_folder(leases, closing)
        self.attachments = self.folder / ATTACHMENTS
        self._hold = closing.enter_context(hold(self.folder))
        beginning.take_over(self.folder)
        self._journal = Journal(self.folder / JOURNAL, reserve=self.folder / RESERVE)
        self.events = Events(self._journal, flags, beginning.past(self._journal), caller)
        for listener in listeners:
            self.events.listen(listener)
        if leases:  # a rehearsal is not resumed
            self.events.listen(self._heads(configuration))
        self.store = RowStore(
            self.folder,
            self.events,
            again=beginning.resumes,
            caller=caller,
            full=lambda: flags.leave_off(DISK_FULL),
            frozen=self._frozen,
        )
        past = past_lines(self.folder / TRANSCRIPT) if beginning.resumes else None
        self._sink = _Sink(self.folder / TRANSCRIPT, "a" if past else "w", self._frozen)
        self.transcript = Transcript(self._sink, past)
        self.transcript.at_divergence = caller.diverged
        self.upkeep = Upkeep(self.folder, self.events, self.store, self.transcript, flags, self)

    @property
    def descriptors(self) -> list[int]:
        """The descriptors that hold the run's folder and its leases, as long as any process has them open."""
        return [self._hold, *self.lease.descriptors]

    def begin(self, planned: Sequence[PlannedCase]) -> None:
        """Write the head of a new run; that of an interrupted one exists already, and is only shown."""
        self._beginning.write_head(self._configuration, planned, self.folder, self.events)

    def follow(self, bench: BoundBench, *, checkpoints: bool) -> None:
        """Stamp events with the bench's time, and write checkpoints of it if `checkpoints`."""
        self._bench = bench
        self.events.follow(bench.clock)
        if bench.playback is not None:
            bench.playback.at_divergence = self._caller.diverged
        if checkpoints:
            self._checkpoints = Checkpoints(self.folder, bench)
            self.events.listen(self._released, HoldEnd)

    def _heads(self, configuration: Configuration) -> Heads:
        return Heads(
            self.folder,
            self._journal,
            lambda text: self.events.write(events.Anomaly(text=text)),
            source=configuration.request.source,
            all_of_them=configuration.outside,
        )

    def leave_open(self) -> None:
        """Write a checkpoint of the bench, and close everything without a seal, so that the run can be resumed."""
        self.upkeep.flush()
        if self._checkpoints is not None:
            with suppress(OSError, EvidenceError):  # on a full disk the previous one will do
                self._checkpoints.write()
        self.abandon()

    def retraces(self) -> bool:
        """Return whether this is a resumed run that has not yet retraced everything on record."""
        if self._retraces:
            answered = self._bench is None or self._bench.playback is not None
            parts = (self.events, self.transcript, self.store)
            self._retraces = answered or any(part.comes_again for part in parts)
        return self._retraces

    def end_recordings(self, recordings: Iterable[events.Recording]) -> int:
        """End recordings of a void past, and return the sequence number of the last event."""
        end_recordings(self.folder, self._journal, recordings)
        return self._journal.count - 1

    def seal(self, exit_code: int, write_reports: ReportWriter) -> str:
        """Seal the package and return its evidence digest."""
        self.events.end_of_past()
        self._flush()
        return seal(self.folder, self._journal, exit_code=exit_code, write_reports=write_reports)

    def abandon(self) -> None:
        """Close everything without a seal."""
        self._flush()
        self._journal.close()

    def before_line(self) -> None:
        """Called before an event of a live bench: record what the clocks did, and write out the operations before it.

        Such a bench is not restored from a checkpoint: each event needs the operations before it. After a wake it is
        unknown whether another event will follow.

        Raises:
            OSError: if the disk has no space for them, nor a reserve to release.
        """
        self.upkeep.keep_time()
        try:
            self.transcript.flush()
        except OSError:
            if not free_reserve(self.folder / RESERVE):
                raise
            self.transcript.flush()

    def _frozen(self) -> bool:
        """Return whether rows and transcript wait for the journal, which has no space for an event.

        A resumed bench in this process retraces what they hold, so they must hold nothing from after a stop that the
        journal does not know of.
        """
        return not self._configuration.outside and self.events.lost > 0

    def _released(self, _: Event) -> None:
        """Write a checkpoint soon, so that a run killed now does not resume in the middle of a hold that is over."""
        if self._checkpoints is not None:
            self._checkpoints.soon()

    def note(self) -> None:
        """Write a checkpoint if due; in a resumed run, first record that it was resumed."""
        self.events.end_of_past()
        if self._checkpoints is not None:
            self._checkpoints.tick()

    def _flush(self) -> None:
        self.upkeep.flush()
        self._sink.close()

    def _open_folder(self, leases: Sequence[str], closing: ExitStack) -> Path:
        configuration = self._configuration
        self._beginning.require_space(configuration)
        self.leases = leases
        self.lease = lease = Lease(leases, f"a run of {', '.join(plan.name for plan in configuration.plans)}")
        closing.callback(lease.release)
        refuse_latched(leases)
        folder = self._beginning.open_folder(configuration)
        lease.name(folder.name)
        return folder
