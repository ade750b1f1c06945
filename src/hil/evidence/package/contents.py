"""Reader of a run's folder: events, results, catalogue, recordings; for reports, replay and audit."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

from hil.documents.canonical import JsonError
from hil.evidence.durable import read_plain
from hil.evidence.events import Event
from hil.evidence.folder import JOURNAL, RECORDINGS, RESULTS, TRANSCRIPT, is_sealed
from hil.evidence.journal.reader import JournalLine, JournalReading, read_journal, require_known_format
from hil.evidence.package.bag import MANIFEST, digest_of_manifest, evidence_digest
from hil.evidence.recordings.hdf5 import Recorded, read_recording
from hil.evidence.results.derived import results_of
from hil.evidence.results.facts import Calibration, facts_of, read_json
from hil.evidence.results.outcome import Outcome, read_outcome
from hil.evidence.state import RunState, fold, standing
from hil.model.errors import EvidenceError

__all__ = ["Package"]

_Event = TypeVar("_Event", bound=Event)


class Package:
    """The content of a run's folder, sealed or not; read lazily, and believed: call `verify` first.

    Args:
        folder: the run's folder.
        reading: its journal, if that has been read already.
    """

    def __init__(self, folder: Path, reading: JournalReading | None = None) -> None:
        self.folder = folder
        self._read = reading

    @property
    def name(self) -> str:
        """The run's name."""
        return self.folder.name

    @property
    def sealed(self) -> bool:
        """Whether the package carries its seal."""
        return is_sealed(self.folder)

    @property
    def transcript_path(self) -> Path:
        """Where the transcript of ports and buses is."""
        return self.folder / TRANSCRIPT

    @property
    def evidence_digest(self) -> str:
        """The sealed evidence digest; before the seal, that of the folder's present content."""
        if self.sealed:
            return digest_of_manifest(self._bytes(MANIFEST))
        return evidence_digest(self.folder)

    @property
    def content_digest(self) -> str:
        """SHA-256 over the bodies before the results; equal runs have equal ones."""
        return self._reading.content_digest

    @cached_property
    def _reading(self) -> JournalReading:
        reading = self._read or read_journal(self.folder / JOURNAL)
        require_known_format(reading)
        return reading

    @cached_property
    def events(self) -> tuple[Event, ...]:
        """The events that stand, in order."""
        return standing(self._reading.events)

    @cached_property
    def state(self) -> RunState:
        """The state of the run after the events that stand."""
        return fold(self.events)

    @property
    def cut_short(self) -> bool:
        """Whether the run did not come to its own end: it was interrupted, or has no results yet."""
        return self.state.interrupted or self.state.results is None

    def lines(self) -> tuple[JournalLine, ...]:
        """Return the journal's lines, with wall stamps."""
        return self._reading.lines

    def of(self, kind: type[_Event]) -> tuple[_Event, ...]:
        """Return the events of one kind that stand, in order."""
        return tuple(event for event in self.events if type(event) is kind)

    def outcome(self) -> Outcome:
        """Return the results: as sealed, or derived from the journal so far.

        Raises:
            EvidenceError: if `data/results.json` cannot be read.
        """
        path, reading = self.folder / RESULTS, self._reading
        if not path.exists():
            return results_of(self.folder, reading)
        try:
            return read_outcome(self._bytes(RESULTS))
        except JsonError as error:
            raise EvidenceError(f"{path}: not a results file: {error.message}", "see hil verify") from error

    def calibration(self) -> Calibration:
        """Return the frozen calibration records, by instrument."""
        return facts_of(self.folder, self._reading).calibration

    def recording(self, identifier: str) -> Recorded:
        """Return one recording, from its rows while the run is running.

        Raises:
            EvidenceError: if the run has no such recording, or it cannot be read.
        """
        begun = self.state.recordings
        if identifier not in begun:
            known = ", ".join(begun) or "none"
            raise EvidenceError(f"{self.name}: there is no recording {identifier!r}", f"it has {known}")
        return read_recording(self.folder / RECORDINGS, begun[identifier], self.state.ended.get(identifier))

    def json(self, relative: str) -> Any:  # noqa: ANN401 - JSON holds what it holds
        """Return the content of a JSON file of the package; the path is relative to the folder."""
        return read_json(self._inside(relative))

    def text(self, relative: str) -> str:
        """Return the text of a file of the package; the path is relative to the folder.

        Raises:
            EvidenceError: if there is no such text inside the package.
        """
        try:
            return self._bytes(relative).decode("utf-8")
        except UnicodeDecodeError as error:
            raise EvidenceError(f"{self.name}/{relative}: not a text file: {error}", "see hil verify") from error

    def _bytes(self, relative: str) -> bytes:
        try:
            return read_plain(self._inside(relative))
        except OSError as error:
            raise EvidenceError(f"{self.name}/{relative}: cannot be read: {error}", "see hil verify") from error

    def _inside(self, relative: str) -> Path:
        try:
            path = (self.folder / relative).resolve()
            inside = path.is_relative_to(self.folder.resolve())
        except (OSError, RuntimeError, ValueError):  # loops of links, names that no file can have
            inside = False
        if not inside:
            raise EvidenceError(f"{self.name}: {relative} is outside of the package", "name a file of the package")
        return path
