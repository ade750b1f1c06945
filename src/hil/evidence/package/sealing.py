"""Sealing: rows become HDF5, results are derived, and the package is sealed; an interrupted run is sealed as it is."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from pathlib import Path

from hil.evidence import events
from hil.evidence.durable import DISK_FULL, PART, read_plain, sync_folder, write_whole
from hil.evidence.folder import CHECKPOINT, INBOX, JOURNAL, RECORDINGS, RESERVE, RESULTS, free_reserve, hold, is_sealed
from hil.evidence.inbox import Message, poll
from hil.evidence.journal.reader import JournalReading, cut_torn_tail, read_journal, require_known_format
from hil.evidence.journal.writer import Journal
from hil.evidence.ledger.book import head
from hil.evidence.ledger.entries import Sealed
from hil.evidence.ledger.heads import require_uncut
from hil.evidence.ledger.packages import enter
from hil.evidence.package.bag import (
    MANIFEST,
    digest_of_manifest,
    info_text,
    inventory,
    make_read_only,
    put_seal,
    write_manifests,
)
from hil.evidence.package.contents import Package
from hil.evidence.package.introduced import lost_files, set_aside, strangers
from hil.evidence.package.listing import list_folder, shown
from hil.evidence.recordings.hdf5 import convert
from hil.evidence.recordings.rows import Rows
from hil.evidence.results.derived import results_of
from hil.evidence.results.facts import DamagedFile
from hil.evidence.results.outcome import write_outcome
from hil.evidence.safed import guardian_hash
from hil.evidence.state import RunState, fold
from hil.model.errors import EvidenceError, Refused

__all__ = [
    "EXIT_CODE",
    "SEAL_ERRORS",
    "ReportWriter",
    "end_recordings",
    "event_of",
    "finish",
    "info_of",
    "not_sealed",
    "recover",
    "seal",
    "write_end",
]

ReportWriter = Callable[[Package], None]
"""Writes `data/report/*` into the run's folder; everything else in `data` is final by then."""

SEAL_ERRORS = (OSError, MemoryError, ImportError)
"""Errors of a seal on a machine without space or memory; a library that finds no memory cannot be imported."""

_ASIDE = "put it back from a copy, or move it out of the run's folder, and seal again"
_BOTH = "resume it with hil resume, or seal it as it is with hil seal"
_SEAL_AGAIN = "seal it with hil seal"
_MOST_FILES = 64
_MOST_BYTES = 50_000_000
"""How many row files, of what total size, may be kept beside their HDF5 before the folder is synced for them."""


def seal(folder: Path, journal: Journal, *, exit_code: int, write_reports: ReportWriter, then: str = _BOTH) -> str:
    """Seal a run and return its evidence digest; the journal gets its end and is closed.

    The process may be killed after any step: `recover` then continues from there.

    Args:
        folder: the run's folder, held by this process.
        journal: its journal.
        exit_code: the exit code of the run.
        write_reports: writes the reports; if it fails, the package is sealed before the error is raised.
        then: what to do after an error before the results are written.

    Raises:
        EvidenceError: if the disk is full or fails, or memory runs out; the folder stays and can be recovered.
    """
    try:
        _write_results(folder, journal)
        then = _SEAL_AGAIN
        write_end(folder, journal, exit_code=exit_code)
        return finish(folder, write_reports)
    except SEAL_ERRORS as error:
        raise not_sealed(folder, error, then) from error


def not_sealed(folder: Path, error: BaseException, then: str) -> EvidenceError:
    """Return the error for a seal that failed, or for a package that was sealed without all its reports.

    Args:
        folder: the run's folder.
        error: one of `SEAL_ERRORS`.
        then: what to do once its cause is fixed, if the package is not sealed.
    """
    full = isinstance(error, OSError) and error.errno in DISK_FULL
    short = isinstance(error, MemoryError)
    what = "disk full" if full else "out of memory" if short else str(error)
    first = "free some space" if full else "give it more memory" if short else "fix that"
    if is_sealed(folder):
        return EvidenceError(
            f"{folder.name}: it is sealed, but not every report could be written: {what}",
            f"{first}, and write them elsewhere with hil report {folder.name} --output FOLDER",
        )
    return EvidenceError(f"{folder.name}: cannot be sealed: {what}", f"nothing is lost; {first} and {then}")


def _write_results(folder: Path, journal: Journal) -> None:
    """Empty the inbox, convert the recordings, and derive the results."""
    for message in poll(folder):
        journal.write(event_of(message), journal.last_t, beside=message.beside)
    reading = read_journal(folder / JOURNAL)
    journal.sync()  # rows are removed below, and their hashes are in the ends of the recordings
    wrong = _convert_all(folder, fold(reading.events))
    if wrong := [*wrong, *set_aside(folder, reading)]:
        for text in wrong:
            journal.write(events.Anomaly(text=text), journal.last_t)
        reading = read_journal(folder / JOURNAL)
    results = results_of(folder, reading)
    data = write_outcome(results)
    write_whole(folder / RESULTS, data)
    found = events.Results(
        sha256=hashlib.sha256(data).hexdigest(), verdict=results.verdict, guardian=guardian_hash(folder)
    )
    journal.write(found, journal.last_t)


def write_end(folder: Path, journal: Journal, *, exit_code: int) -> None:
    """Write the journal's last event, which names every file, and close the journal; the results are written."""
    _remove_partial_files(folder)
    wall = {"files": inventory(folder), "ledger": _head_before(folder)}
    journal.write(events.End(state="SEALED", exit_code=exit_code), journal.last_t, beside=wall)
    journal.close()


def finish(folder: Path, write_reports: ReportWriter) -> str:
    """Write the reports, remove what does not belong in a package, enter the seal in the ledger, and seal.

    The journal has its `end`. An entry without a seal, left by a killed process, counts for the seal that follows.
    """
    _tidy(folder)
    reading = read_journal(folder / JOURNAL)
    try:
        write_reports(Package(folder, reading))
    finally:  # the evidence does not wait for a report, which can be rewritten
        _tidy(folder)
        write_manifests(folder, info_of(folder, folder.name, reading))
        not_entered = _enter(folder, reading, "it is sealed, but not entered in the ledger")
        put_seal(folder)
        make_read_only(folder)
        sync_folder(folder.parent)
    if not_entered:
        raise not_entered
    return digest_of_manifest((folder / MANIFEST).read_bytes())


def _enter(folder: Path, reading: JournalReading, otherwise: str) -> EvidenceError | None:
    """Enter a seal in the ledger; if that fails, return `otherwise` with the reason: evidence does not wait."""
    state = fold(reading.events)
    run = state.run
    sealed = Sealed(
        run=folder.name,
        evidence=digest_of_manifest(read_plain(folder / MANIFEST)),
        content=reading.content_digest,
        verdict=str(state.results.verdict) if state.results else "",
        source=run.source if run else "",
        bench=run.bench if run else "",
        dut=run.dut.serial if run else "",
    )
    try:
        enter(folder.parent, sealed)
    except EvidenceError as error:
        return EvidenceError(
            f"{folder.name}: {otherwise}: {error.message}",
            f"{error.hint}; hil seal {folder.name} enters it",
        )
    return None


def _head_before(folder: Path) -> str:
    """Return the head of the ledger, which the package then names; empty if it cannot be read."""
    try:
        return head(folder.parent)
    except EvidenceError:
        return ""


def info_of(folder: Path, identifier: str, reading: JournalReading) -> bytes:
    """Return the `bag-info.txt` that belongs to a journal with its `end`."""
    return info_text(
        folder,
        identifier=identifier,
        date=str(reading.lines[-1].wall.get("utc", ""))[:10],
        content=reading.content_digest,
        version=run.version if (run := fold(reading.events[:1]).run) else "",
    )


def event_of(message: Message) -> events.Event:
    """Return the event that records a message from the inbox."""
    by, text = message.by, message.text
    match message.kind:
        case "attachment":
            return events.Attachment(file=message.file, sha256=message.sha256, by=by, text=text)
        case "note":
            return events.Note(by=by, text=text)
        case "ack":
            return events.Acknowledged(by=by, text=text, guardian=message.sha256)
        case "reached":
            return events.Reached(by=by, ok=False)
        case "hold" | "release":
            return events.HoldAsked(release=message.kind == "release", by=by, text=text)
        case _:
            return events.Anomaly(text=f"inbox, {message.kind} by {by or 'nobody'}: {text}")


def _convert_all(folder: Path, state: RunState) -> list[str]:
    """Convert every recording; return what is wrong with any, a sentence each."""
    waiting: list[Path] = []
    wrong = []
    for name, begun in state.recordings.items():
        wrong.append(_convert_one(folder / RECORDINGS, begun, state.ended.get(name), waiting))
        if len(waiting) >= _MOST_FILES or sum(rows.stat().st_size for rows in waiting) >= _MOST_BYTES:
            _remove_converted(waiting)
    _remove_converted(waiting)
    sync_folder(folder / RECORDINGS)
    return [text for text in wrong if text]


def _remove_converted(waiting: list[Path]) -> None:
    """Remove row files whose HDF5 is complete, once the names of these are on disk, too."""
    if waiting:
        sync_folder(waiting[0].parent)
    while waiting:
        waiting.pop().unlink()


def _convert_one(place: Path, begun: events.Recording, ended: events.RecordingEnd | None, waiting: list[Path]) -> str:
    """Convert a recording, add its rows to those awaiting removal, and return what is wrong with it."""
    identifier = begun.recording
    rows, hdf5 = place / f"{identifier}.rows", place / f"{identifier}.h5"
    if ended is None:
        raise EvidenceError(f"recording {identifier} has not ended", "recordings end before the run is sealed")
    if rows.exists():
        try:
            try:
                convert(rows, hdf5, begun=begun, ended=ended)
            except OSError:  # a full disk may have space once earlier rows are gone
                if not waiting:
                    raise
                _remove_converted(waiting)
                convert(rows, hdf5, begun=begun, ended=ended)
        except EvidenceError:
            return f"recording {identifier}: its rows are not those that the journal names; the row file is kept"
        waiting.append(rows)
    elif not hdf5.exists():
        return f"recording {identifier}: its rows are gone"
    return ""


def _tidy(folder: Path) -> None:
    """Remove reserve, checkpoint, inbox, empty folders, and partial files of a killed process."""
    free_reserve(folder / RESERVE)
    (folder / CHECKPOINT).unlink(missing_ok=True)
    if (folder / INBOX).exists():
        shutil.rmtree(folder / INBOX)
    _remove_partial_files(folder)
    for empty in reversed(list_folder(folder).empty):  # the innermost come last
        (folder / empty).rmdir()


def _remove_partial_files(folder: Path) -> None:
    """Remove partial files of a killed process."""
    for place in (folder, *(folder / "data" / name for name in (".", "attachments", "recordings"))):
        for half in place.glob(f"*{PART}"):
            half.unlink()


EXIT_CODE = 2
"""The exit code of an interrupted run, as in pytest."""


def recover(folder: Path, *, write_reports: ReportWriter) -> str:
    """Seal an interrupted run as it is and return its evidence digest.

    A torn tail of the journal is cut off and kept, recordings end as incomplete with the rows that exist, and the
    verdict is no better than ABORTED. An interrupted seal is finished; a complete one is left alone.

    Raises:
        Refused: while the run's process is alive, and if nothing was recorded at all.
        EvidenceError: if the journal is damaged beyond a torn tail or has another format, a file cannot be
            read or written, or memory runs out.
    """
    with hold(folder):
        try:
            if not is_sealed(folder):
                return _seal_as_it_is(folder, write_reports)
            with suppress(OSError):  # it is somebody else's, or the file system is read-only
                make_read_only(folder)
            missing = "it is sealed already, and only the line of its seal is missing from the ledger"
            if not_entered := _enter(folder, read_journal(folder / JOURNAL), missing):
                raise not_entered
            return digest_of_manifest(read_plain(folder / MANIFEST))
        except DamagedFile as error:
            raise EvidenceError(f"{folder.name}: cannot seal: {error.finding}", _ASIDE) from error
        except SEAL_ERRORS as error:
            raise not_sealed(folder, error, "seal it again with hil seal; hil verify shows what is there") from error


def _seal_as_it_is(folder: Path, write_reports: ReportWriter) -> str:
    require_known_format(read_journal(folder / JOURNAL))
    torn = cut_torn_tail(folder)
    reading = read_journal(folder / JOURNAL)
    if reading.findings:
        raise EvidenceError(
            f"{folder.name}: cannot seal: the journal is damaged: {reading.findings[0]}",
            "keep the folder; hil verify shows what is wrong",
        )
    with suppress(EvidenceError):  # evidence does not wait for a ledger that cannot be read
        require_uncut(folder, reading, "seal")
    if not reading.lines:
        raise Refused(f"{folder.name}: nothing was recorded", "the folder can be deleted")
    state = fold(reading.events)
    if state.results:
        _require_known(folder, reading)
    if state.end:
        if lost := list(lost_files(folder, reading)):
            more = f", and {len(lost) - 1} more" if len(lost) > 1 else ""
            raise EvidenceError(
                f"{folder.name}: cannot seal: {lost[0]}{more}", "if this is a copy, copy the package again"
            )
        return finish(folder, write_reports)
    with Journal(folder / JOURNAL, reserve=folder / RESERVE) as journal:
        if state.results:
            write_end(folder, journal, exit_code=0 if state.results.verdict.good else 1)
            return finish(folder, write_reports)
        if torn or not state.recovered:
            text = "the run was interrupted and is sealed as it is"
            journal.write(events.Recovered(torn_bytes=torn, text=text), journal.last_t)
        end_recordings(folder, journal, state.left_open)
        return seal(folder, journal, exit_code=EXIT_CODE, write_reports=write_reports, then=_SEAL_AGAIN)


def _require_known(folder: Path, reading: JournalReading) -> None:
    """Refuse files that came after the last event that could have recorded them.

    Raises:
        EvidenceError: with the first of them.
    """
    here = (path for path in list_folder(folder).files if not path.endswith(PART))
    if path := next(strangers(reading, here), ""):
        raise EvidenceError(
            f"{folder.name}: cannot seal: {shown(path)}: no event of the journal introduced this file",
            "move it out of the run's folder, and seal again",
        )


def end_recordings(folder: Path, journal: Journal, recordings: Iterable[events.Recording]) -> None:
    """End recordings of a killed process as incomplete, with the rows that reached the disk."""
    for begun in recordings:
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
