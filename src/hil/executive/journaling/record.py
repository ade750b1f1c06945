"""The record of one run while it goes on: its folder, journal, row files and transcript."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from functools import partial
from io import FileIO
from pathlib import Path

from hil.bench.bound import BoundBench
from hil.bench.lease import Lease, refuse_latched
from hil.evidence.folder import JOURNAL, RECORDINGS, RESERVE, TRANSCRIPT, create, hold, renew_reserve, require_space
from hil.evidence.journal.past import Past
from hil.evidence.journal.standing import Entry
from hil.evidence.journal.writer import Journal
from hil.evidence.package.sealing import ReportWriter, seal
from hil.evidence.recordings.reverting import revert
from hil.executive.ending.stop import StopFlags
from hil.executive.journaling.events import Events, Listener
from hil.executive.journaling.row_store import RowStore
from hil.executive.journaling.upkeep import Upkeep
from hil.executive.resuming.checkpoints import Checkpoints
from hil.executive.resuming.earlier import Earlier, go_on_with, require_untouched
from hil.executive.setup.configuration import Configuration
from hil.executive.setup.head import PlannedCase, write_head
from hil.model.errors import Diverged, EvidenceError
from hil.wire.transcript import Transcript, count_operations, past_lines

__all__ = ["Record"]

_LEAST_SPACE = 50_000_000
_AGAIN = "free some space, and resume the run; or seal it as it is with hil seal"


class Record:
    """What a run writes down, and what of an interrupted run comes again before anything new is written.

    Args:
        configuration: what the run is made of.
        flags: stop requests.
        leases: what the run must hold alone.
        listeners: are shown every event.
        earlier: the interrupted run that goes on, None for a new one.
        closing: lets go of folder and leases when the run is over.
    """

    def __init__(
        self,
        configuration: Configuration,
        flags: StopFlags,
        leases: Sequence[str],
        listeners: Sequence[Listener],
        earlier: Earlier | None,
        closing: ExitStack,
    ) -> None:
        self._configuration = configuration
        self._earlier = earlier
        self._checkpoints: Checkpoints | None = None
        self._bench: BoundBench | None = None
        self._retraces = earlier is not None
        self._go_on: Callable[..., None] = lambda *_: None
        self.folder = self._open_folder(leases, closing)
        closing.enter_context(hold(self.folder))
        if earlier:
            require_untouched(earlier)
            renew_reserve(self.folder)
            revert(self.folder / RECORDINGS, (line.body for line in earlier.lines if line.body["kind"] == "recording"))
        self._journal = Journal(self.folder / JOURNAL, reserve=self.folder / RESERVE)
        past_events = Past(earlier.lines) if earlier else None
        self.events = Events(self._journal, flags, past_events, earlier.own_course if earlier else 0)
        for listener in listeners:
            self.events.listen(listener)
        self.store = RowStore(self.folder, self.events, again=earlier is not None)
        past = past_lines(self.folder / TRANSCRIPT) if earlier else None
        self._sink = FileIO(self.folder / TRANSCRIPT, "a" if past else "w")
        self.transcript = Transcript(self._sink, past)
        self.upkeep = Upkeep(self.folder, self.events, self.store, self.transcript, flags)
        self.upkeep.retraces = self.retraces

    def begin(self, planned: Sequence[PlannedCase]) -> None:
        """Write the head of a new run; that of an interrupted one stands there already, and is only shown."""
        if self._earlier is None:
            write_head(self._configuration, planned, self.folder, self.events)
        else:
            for line in self._earlier.head:
                self.events.show(line.body)

    def follow(self, bench: BoundBench, *, checkpoints: bool) -> None:
        """Stamp events with the bench's time, and write down where it is if `checkpoints`."""
        self._bench = bench
        self.events.follow(bench.clock)
        if bench.live is not None:  # it is not made again from a checkpoint: each event needs the operations before it
            self.events.ahead = self._ahead
        if self._earlier is not None:
            self._go_on = partial(go_on_with, self._earlier, self._journal, bench.clock.now)
            self.events.at_new = self._go_on
        if checkpoints:
            self._checkpoints = Checkpoints(self.folder, bench)
            self.events.listen(self._released)
            self.upkeep.checkpoint = self._note_progress

    @property
    def entered_at(self) -> int | None:
        """The place in the run's own course at which it is entered again, None where it is not."""
        return self._earlier.boundary.place if self._earlier and self._earlier.boundary else None

    @property
    def last_ns(self) -> int:
        """The latest instant that an interrupted run wrote down."""
        return self._earlier.last_ns if self._earlier else 0

    @property
    def stood_s(self) -> float:
        """How long the bench stood safe before that, in bench time."""
        return self._earlier.stood_s if self._earlier else 0.0

    def entry(self, place: int) -> Entry:
        """Return what is void if the run is entered here now."""
        if self._earlier is None or self._earlier.boundary is None:
            raise RuntimeError("nothing is entered again")
        return Entry(
            place=place,
            boundary=self._earlier.boundary.sequence,
            void_to=self._earlier.lines[-1].body["seq"],
            operations=count_operations(self.folder / TRANSCRIPT),
            at=0.0,
            number=self._earlier.next_recording,
            rows=tuple(self.store.held(self._earlier.boundary.kept, self._earlier.begun_behind)),
            kept=self._earlier.boundary.kept,
            over=self._earlier.boundary.over,
        )

    def resumed(self, entry: Entry) -> None:
        """Write down that the run is entered again."""
        self.events.at_new = lambda: self._go_on(entry)
        self.events.end_of_past()

    def leave_open(self) -> None:
        """Write down where the bench is, and close everything without a seal, so that the run can be resumed."""
        self.upkeep.flush()
        if self._checkpoints is not None:
            with suppress(OSError, EvidenceError):  # on a full disk the one before will do
                self._checkpoints.write()
        self.abandon()

    def if_diverged(self, tell: Callable[[Diverged], object]) -> None:
        """Let `tell` hear why a resumed run does not come to its past again."""
        self.events.at_divergence = self.transcript.at_divergence = self.store.at_divergence = tell
        if self._bench is not None and self._bench.playback is not None:
            self._bench.playback.at_divergence = tell

    def if_stopped(self, tell: Callable[[], object]) -> None:
        """Let `tell` hear that a resumed run is to stop before it came to its past again: it cannot."""

        def leave() -> None:
            if self.retraces():
                tell()

        self.events.at_stop = leave

    def retraces(self) -> bool:
        """Return whether this is a resumed run that has not yet come to all that is written down."""
        if self._retraces:
            answered = self._bench is None or self._bench.playback is not None
            parts = (self.events, self.transcript, self.store)
            self._retraces = answered or any(part.comes_again for part in parts)
        return self._retraces

    def seal(self, exit_code: int, write_reports: ReportWriter) -> str:
        """Seal the package and return its evidence digest."""
        self.events.end_of_past()
        self._flush()
        return seal(self.folder, self._journal, exit_code=exit_code, write_reports=write_reports)

    def abandon(self) -> None:
        """Close everything without a seal."""
        self._flush()
        self._journal.close()

    def _ahead(self) -> None:
        """Come before an event; behind a wake nobody knows whether there is another one."""
        self.upkeep.keep_time()
        self.transcript.flush()

    def _released(self, event: Mapping[str, object]) -> None:
        """Do not let a run that is killed now begin amid a hold that is over."""
        if event["kind"] == "hold-end" and self._checkpoints is not None:
            self._checkpoints.soon()

    def _note_progress(self) -> None:
        """Write down where the bench is; of a resumed run first that it was resumed."""
        self.events.end_of_past()
        if self._checkpoints is not None:
            self._checkpoints.tick()

    def _flush(self) -> None:
        self.upkeep.flush()
        self._sink.close()

    def _open_folder(self, leases: Sequence[str], closing: ExitStack) -> Path:
        configuration = self._configuration
        require_space(configuration.reports, _LEAST_SPACE, *([_AGAIN] if self._earlier else []))
        self.leases = leases
        self.lease = lease = Lease(leases, f"a run of {', '.join(plan.name for plan in configuration.plans)}")
        closing.callback(lease.release)
        refuse_latched(leases)
        if self._earlier is not None:
            folder = self._earlier.folder
        else:
            folder = create(configuration.reports, bench=configuration.bench.name, dut=configuration.dut.serial)
        lease.name(folder.name)
        return folder
