"""An interrupted run, sealed as it is: nothing is added but the word that it was interrupted."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from hil.evidence import events
from hil.evidence.durable import read_plain
from hil.evidence.folder import JOURNAL, RECORDINGS, RESERVE, hold, is_sealed
from hil.evidence.journal.reader import cut_torn_tail, read_journal, require_known_format
from hil.evidence.journal.writer import Journal
from hil.evidence.package.bag import MANIFEST, digest_of_manifest, make_read_only
from hil.evidence.package.sealing import SEAL_ERRORS, ReportWriter, finish, not_sealed, seal, write_end
from hil.evidence.recordings.rows import Rows
from hil.evidence.state import RunState, fold
from hil.model.errors import EvidenceError, Refused

__all__ = ["EXIT_CODE", "recover"]

EXIT_CODE = 2
"""The exit code of a run that was interrupted, as pytest has it."""


def recover(folder: Path, *, write_reports: ReportWriter) -> str:
    """Seal an interrupted run as it is and return its evidence digest.

    A torn tail of the journal is cut and kept, recordings end incomplete with the rows that are there, and the
    verdict is not better than ABORTED. A seal that was interrupted is finished; one that is whole is left alone.

    Raises:
        Refused: while the run's process is alive, and where nothing was recorded at all.
        EvidenceError: where the journal is damaged beyond a torn tail or is of another format, a file cannot be
            read or written, or there is not enough memory.
    """
    with hold(folder):
        try:
            if not is_sealed(folder):
                return _seal_as_it_is(folder, write_reports)
            make_read_only(folder)
            return digest_of_manifest(read_plain(folder / MANIFEST))
        except SEAL_ERRORS as error:
            raise not_sealed(
                folder, error, "seal it once more with hil seal; hil verify tells what is there"
            ) from error


def _seal_as_it_is(folder: Path, write_reports: ReportWriter) -> str:
    require_known_format(read_journal(folder / JOURNAL))
    torn = cut_torn_tail(folder)
    reading = read_journal(folder / JOURNAL)
    if reading.findings:
        raise EvidenceError(f"{folder.name}: {reading.findings[0]}", "a damaged journal is not sealed; keep the folder")
    if not reading.lines:
        raise Refused(f"{folder.name}: nothing was recorded", "the folder can be deleted")
    state = fold(reading.events)
    if state.end:
        return finish(folder, write_reports)
    with Journal(folder / JOURNAL, reserve=folder / RESERVE) as journal:
        if state.results:
            write_end(folder, journal, exit_code=0 if state.results.verdict.good else 1)
            return finish(folder, write_reports)
        if torn or not state.recovered:
            text = "the run was interrupted and is sealed as it is"
            journal.write(events.Recovered(torn_bytes=torn, text=text), journal.last_t)
        _end_recordings(folder, journal, state)
        return seal(folder, journal, exit_code=EXIT_CODE, write_reports=write_reports)


def _end_recordings(folder: Path, journal: Journal, state: RunState) -> None:
    for recording, begun in state.recordings.items():
        if recording not in state.ended:
            _end_recording(folder, journal, begun)


def _end_recording(folder: Path, journal: Journal, begun: events.Recording) -> None:
    identifier = begun.recording
    rows = Rows(
        folder / RECORDINGS / f"{identifier}.rows",
        recording=identifier,
        channels=[(channel.name, channel.unit) for channel in begun.channels],
        on_block=partial(_write_rows, journal, identifier),
    )
    end = rows.finish()
    ended = events.RecordingEnd(
        recording=identifier, rows=end.rows, sha256=end.sha256, complete=False, gaps=end.largest_gap_s
    )
    journal.write(ended, journal.last_t)


def _write_rows(journal: Journal, identifier: str, rows: int, sha256: str) -> None:
    journal.write(events.Rows(recording=identifier, rows=rows, sha256=sha256), journal.last_t)
