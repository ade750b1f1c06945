"""What a run begins from: nothing before it, an interrupted run that it resumes, or a package that it replays."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from hil.bench.gate import Gate
from hil.clock import wall
from hil.clock.port import NANOSECONDS
from hil.evidence import events
from hil.evidence.folder import JOURNAL, RECORDINGS, create, is_sealed, renew_reserve, require_space
from hil.evidence.journal.past import Entry, Past, entries
from hil.evidence.journal.writer import Journal
from hil.evidence.package.contents import Package
from hil.evidence.recordings.hdf5 import revert
from hil.evidence.state import standing
from hil.executive.cases.effects import Recall
from hil.executive.journaling.events import Events
from hil.executive.resuming.earlier import Earlier, not_opened
from hil.executive.setup.configuration import Configuration
from hil.executive.setup.head import PlannedCase, write_head
from hil.model.errors import Refused

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["NewRun", "ReplayedRun", "ResumedRun", "VoidRows"]

VoidRows = Callable[[events.Voided], "NDArray[np.float64]"]
"""Returns rows of a recording, shape (rows, 1 + channels)."""

_LEAST_SPACE = 50_000_000
_FREE_SPACE = "free some space, and resume the run; or seal it as it is with hil seal"

_ANSWERED = frozenset({"asks"})
"""A person is not asked again; everything else comes from the recorded bytes."""


class NewRun:
    """A run that nothing came before.

    Attributes:
        resumes: whether its folder holds what an interrupted run wrote down.
        earlier: that run, None where there is none.
        entries: where the run was entered before.
        not_opened: the gates of the host that ended its armings, see `BenchKeeper`.
        recall: the effects that it has to agree with, None where there are none.
        void_rows: returns the void rows of a record, None where the run's own folder holds them.
    """

    resumes = False
    earlier: Earlier | None = None
    entries: Sequence[Entry] = ()
    not_opened: Mapping[int, Gate] = {}
    recall: Recall | None = None
    void_rows: VoidRows | None = None

    def require_space(self, configuration: Configuration) -> None:
        """Require space for what the run will write."""
        require_space(configuration.reports, _LEAST_SPACE)

    def open_folder(self, configuration: Configuration) -> Path:
        """Make the run's folder."""
        return create(configuration.reports, bench=configuration.bench.name, dut=configuration.dut.serial)

    def take_over(self, folder: Path) -> None:
        """Do nothing: nobody else knows the folder."""

    def past(self, journal: Journal) -> Resumption | None:
        """Return that no event comes again."""

    def write_head(
        self, configuration: Configuration, planned: Sequence[PlannedCase], folder: Path, journal: Events
    ) -> None:
        """Freeze what the run is judged by, and write the first events."""
        write_head(configuration, planned, folder, journal)


class ReplayedRun(NewRun):
    """The replay of a package, in a folder of its own.

    Args:
        package: what the run has to agree with. A replay does not make the void rows again.
    """

    def __init__(self, package: Package) -> None:
        self._package = package
        self.recall = Recall(package.of(events.Effect), _ANSWERED)
        self.entries = entries(package.of(events.Resumed))
        self.not_opened = not_opened(package.standing)
        self.void_rows = self._rows

    def _rows(self, part: events.Voided) -> NDArray[np.float64]:
        import numpy as np  # noqa: PLC0415 - slow to import

        found = self._package.recording(part.recording)
        columns = [found.time, *found.arrays.values()]
        return np.column_stack([column[part.first : part.end] for column in columns])


class ResumedRun(NewRun):
    """An interrupted run that goes on in its folder.

    Args:
        earlier: the run as it was found.
    """

    resumes = True

    def __init__(self, earlier: Earlier) -> None:
        self.earlier: Earlier = earlier
        self.entries = earlier.entries
        self.not_opened = earlier.not_opened

    def require_space(self, configuration: Configuration) -> None:
        """Require space for what the run will write."""
        require_space(configuration.reports, _LEAST_SPACE, _FREE_SPACE)

    def open_folder(self, _: Configuration) -> Path:
        """Return the folder that it was interrupted in."""
        return self.earlier.folder

    def take_over(self, folder: Path) -> None:
        """Take back what the run wrote of rows and reserve.

        Raises:
            Refused: if somebody went on with the run, or sealed it, since it was found; its folder is held by now.
        """
        if is_sealed(folder) or (folder / JOURNAL).stat().st_size != self.earlier.size:
            raise Refused(f"{folder.name}: another process went on with it meanwhile", "see it with hil status")
        renew_reserve(folder)
        revert(folder / RECORDINGS, self.earlier.state.recordings.values())

    def past(self, journal: Journal) -> Resumption:
        """Return the events that come again."""
        return Resumption(self.earlier, journal)

    def write_head(
        self, _configuration: Configuration, _planned: Sequence[PlannedCase], _folder: Path, journal: Events
    ) -> None:
        """Show the first events, which stand there already."""
        for line in self.earlier.head:
            journal.show(line.event)


class Resumption(Past):
    """The events of an interrupted run behind its head, and what is written down before its first new one.

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

    def resume(self, t: float, entry: Entry | None) -> None:
        """Write down that the run was resumed, and before that if the machine was started anew in between.

        Args:
            t: bench time in s.
            entry: where it is entered again, None where it goes on where it was.
        """
        earlier, last = self._earlier, self._earlier.last_wall
        beside, seconds = {"interrupted": last}, round(wall.seconds_since(str(last["utc"])), 1)
        if last["boot_id"] != wall.stamp().boot_id:
            rebooted = events.Reboot(text="the machine was started anew meanwhile", seconds=seconds)
            self._journal.write(rebooted, t, beside=beside)
        resumed = events.Resumed(
            number=earlier.resumes + 1,
            checkpoint=earlier.checkpoint.at_ns / NANOSECONDS if earlier.checkpoint else 0.0,
            torn_bytes=earlier.torn,
            deviation=earlier.deviation,
            seconds=seconds,
            text="the run was interrupted, and went on here" if entry is None else _entered(earlier),
            entry=_told(entry) if entry else None,
        )
        self._journal.write(resumed, t, beside=beside)


def _entered(earlier: Earlier) -> str:
    told = standing([line.event for line in earlier.lines])
    stop = next((event for event in told if isinstance(event, events.Stop)), None)
    how = f"stopped by {stop.reason}" if stop else "interrupted"
    if earlier.boundary and earlier.boundary.over:
        return f"{how} behind its last case; nothing but the way to the safe state is driven, and the end made anew"
    where = "recording" if earlier.boundary and earlier.boundary.kept else "turn or case"
    return f"{how}, and entered again where the last {where} began; what came behind that is void"


def _told(entry: Entry) -> events.Entry:
    return events.Entry(
        place=entry.place,
        boundary=entry.boundary,
        void_to=entry.void_to,
        operations=entry.operations,
        number=entry.number,
        rows=entry.rows,
        kept=entry.kept,
        over=entry.over,
    )
