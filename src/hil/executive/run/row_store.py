"""The row files that are open, whoever records."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from hil.evidence.folder import RECORDINGS, RESERVE
from hil.evidence.journal.standing import Voided
from hil.evidence.recordings.rows import Rows

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["OpenRecording", "RecordedChannel", "RecordingFacts", "RowStore"]


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedChannel:
    """One channel of a recording: name, unit, and what measured it how well (standard uncertainty)."""

    name: str
    unit: str
    instrument: str
    calibration: str = ""
    uncertainty: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingFacts:
    """What is known of a recording before its first row."""

    id: str
    name: str
    case: str | None
    step: str | None
    channels: tuple[RecordedChannel, ...]
    rate: float
    duration: float | None
    source: str


class OpenRecording:
    """A recording that grows. Finish it, also after an error: what is there is kept as incomplete."""

    def __init__(
        self,
        facts: RecordingFacts,
        rows: Rows,
        write: Callable[..., None],
        forget: Callable[[OpenRecording], None],
    ) -> None:
        self.facts = facts
        self.rows = rows
        self._write = write
        self._forget = forget

    @property
    def append(self) -> Callable[[Sequence[float]], None]:
        """Takes one row: time in s, then the channels."""
        return self.rows.append

    def finish(self, *, complete: bool) -> str:
        """Write the end down and return the hash of all rows."""
        self._forget(self)
        end = self.rows.finish()
        self._write(
            "recording-end",
            recording=self.facts.id,
            rows=end.rows,
            sha256=end.sha256,
            complete=complete,
            gaps=round(end.largest_gap_s, 9),
        )
        return end.sha256


class RowStore:
    """Opens recordings in a run's folder and keeps those that are open near the disk.

    Args:
        folder: the run's folder.
        write: writes an event.
        again: whether rows that the folder holds already are made again, see `Rows`.
    """

    def __init__(self, folder: Path, write: Callable[..., None], *, again: bool = False) -> None:
        self._folder = folder
        self._write = write
        self._again = again
        self._open: list[OpenRecording] = []

    @property
    def recordings(self) -> Path:
        """Where the row files are."""
        return self._folder / RECORDINGS

    def begin(self, facts: RecordingFacts) -> OpenRecording:
        """Write the beginning down and open the row file."""
        self._write(
            "recording",
            recording=facts.id,
            name=facts.name,
            case=facts.case,
            step=facts.step,
            channels=[
                {
                    "name": channel.name,
                    "unit": channel.unit,
                    "instrument": channel.instrument,
                    "calibration": channel.calibration,
                    "uncertainty": channel.uncertainty,
                }
                for channel in facts.channels
            ],
            rate=facts.rate,
            duration=facts.duration,
            source=facts.source,
        )
        rows = Rows(
            self.recordings / f"{facts.id}.rows",
            recording=facts.id,
            channels=[(channel.name, channel.unit) for channel in facts.channels],
            on_block=lambda count, digest: self._write("rows", recording=facts.id, rows=count, sha256=digest),
            reserve=self._folder / RESERVE,
            again=self._again,
        )
        recording = OpenRecording(facts, rows, self._write, self._open.remove)
        self._open.append(recording)
        return recording

    def holds(self, recording: OpenRecording) -> bool:
        """Return whether a recording is open still."""
        return recording in self._open

    def held(self) -> list[Voided]:
        """Return the rows of every open recording that its file holds and that have not come again."""
        return [Voided(each.facts.id, each.rows.rows, each.rows.held) for each in self._open]

    def skip(self, rows: Iterable[Voided]) -> None:
        """Take over rows that are not made again."""
        ends = {each.recording: each.end for each in rows}
        for each in self._open:
            if each.facts.id in ends:
                each.rows.skip(ends[each.facts.id])

    def add(self, recording: str, rows: NDArray[np.float64]) -> None:
        """Add rows to an open recording, shape (rows, 1 + channels)."""
        for each in self._open:
            if each.facts.id == recording:
                each.rows.append_rows(rows)

    def end_of_case(self, case: str) -> None:
        """Finish what a case left open, as incomplete."""
        for recording in [each for each in self._open if each.facts.case == case]:
            recording.finish(complete=False)

    def tick(self) -> None:
        """Bring waiting rows of every open recording to the disk."""
        for recording in self._open:
            recording.rows.tick()
