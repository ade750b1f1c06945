"""Whether everything in a package follows from its journal, its recordings and what was frozen."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path

from hil.documents.canonical import JsonError, parse_strict
from hil.evidence.durable import read_plain
from hil.evidence.events import Check, End, Results, Run
from hil.evidence.folder import ATTACHMENTS, CALIBRATION, CATALOGUE, JOURNAL, PARAMETERS, RECORDINGS, RESULTS
from hil.evidence.journal.reader import JournalReading
from hil.evidence.package.bag import INFO
from hil.evidence.package.inventory import file_findings, hashes_at_end
from hil.evidence.package.judged import judge_again
from hil.evidence.package.listing import shown
from hil.evidence.package.sealing import info_of
from hil.evidence.recordings.hdf5 import hashes_of
from hil.evidence.results.derived import results_of
from hil.evidence.results.facts import facts_of
from hil.evidence.results.outcome import FORMAT, write_outcome
from hil.evidence.state import fold
from hil.model.errors import Finding, HilError

__all__ = ["content_findings", "guarded"]

Hashes = Mapping[str, str]
"""Path and SHA-256 of every file below `data`, as they are now."""


def content_findings(folder: Path, reading: JournalReading, hashes: Hashes) -> Iterator[Finding]:
    """Derive again whatever the package claims, and give every difference.

    Args:
        folder: the run's folder.
        reading: its journal.
        hashes: path and SHA-256 of every file below `data`, as they are now.
    """
    for look in (
        _journal_findings,
        _info_findings,
        _file_findings,
        _begun_findings,
        _results_findings,
        _recording_findings,
        _attachment_findings,
        _check_findings,
    ):
        yield from guarded(partial(look, folder, reading, hashes))


def guarded(look: Callable[[], Iterator[Finding]]) -> Iterator[Finding]:
    """Turn whatever hostile content makes of a look into a finding."""
    try:
        yield from look()
    except Exception as error:  # noqa: BLE001 - whoever made the content chooses what goes wrong in reading it
        what = error.message if isinstance(error, HilError) else f"{type(error).__name__}: {error}"
        yield Finding("data", 0, 0, f"verification cannot go on here: {what}")


def _journal_findings(_: Path, reading: JournalReading, __: Hashes) -> Iterator[Finding]:
    yield from reading.findings
    if reading.torn:
        yield Finding(JOURNAL, 0, 0, f"{len(reading.torn)} bytes at the end are half a line")
    kinds = [type(event) for event in reading.events]
    if kinds[:1] != [Run] or kinds[-2:] != [Results, End] or kinds.count(Results) != 1:
        yield Finding(JOURNAL, 0, 0, "a sealed journal begins with run, and ends with results and end, each once")
    for line in reading.lines:
        if not line.canonical:
            yield Finding(JOURNAL, line.number, 1, "this is not canonical JSON")


def _info_findings(folder: Path, reading: JournalReading, _: Hashes) -> Iterator[Finding]:
    text = read_plain(folder / INFO)
    names = [line.removeprefix(b"External-Identifier: ") for line in text.split(b"\n") if line.startswith(b"Ext")]
    if len(names) != 1 or not reading.lines or text != info_of(folder, names[0].decode(), reading):
        yield Finding(INFO, 0, 0, "it does not say what the journal and the files say")


def _file_findings(_: Path, reading: JournalReading, hashes: Hashes) -> Iterator[Finding]:
    yield from file_findings(reading, hashes)


def _begun_findings(_: Path, reading: JournalReading, hashes: Hashes) -> Iterator[Finding]:
    run = fold(reading.events).run
    for field, path in (("catalogue", CATALOGUE), ("parameters", PARAMETERS), ("calibration", CALIBRATION)):
        if getattr(run, field, None) != hashes.get(path):
            yield Finding(path, 0, 0, f"this is not the {field} that the run was begun with")


def _results_findings(folder: Path, reading: JournalReading, hashes: Hashes) -> Iterator[Finding]:
    named = fold(reading.events).results
    if named is None or named.sha256 != hashes.get(RESULTS):
        yield Finding(RESULTS, 0, 0, "the journal names other results")
    sealed = read_plain(folder / RESULTS)
    derived = results_of(folder, reading, _format(sealed))
    if named is None or named.verdict is not derived.verdict:
        yield Finding(JOURNAL, 0, 0, f"the run's verdict is {derived.verdict}, and not what the journal says")
    if write_outcome(derived) != sealed:
        yield Finding(RESULTS, 0, 0, "journal and frozen catalogue give other results")


def _format(results: bytes) -> int:
    """Return the format that results are said to be in; the newest for what is none."""
    try:
        found = parse_strict(results)
    except JsonError:
        return FORMAT
    form = found.get("format") if isinstance(found, dict) else None
    return 1 if form == 1 else FORMAT


def _recording_findings(folder: Path, reading: JournalReading, hashes: Hashes) -> Iterator[Finding]:
    """Compare rows with the journal's hashes; a file that is not the one the run wrote is not even opened."""
    written = hashes_at_end(reading)
    state = fold(reading.events)
    for identifier, claim in state.rows.items():
        path = f"{RECORDINGS}/{identifier}.h5"
        ended = state.ended.get(identifier)
        if ended is None:
            yield Finding(shown(path), 0, 0, "the journal has no end of this recording")
        elif path not in hashes:
            yield Finding(shown(path), 0, 0, "the recording is missing")
        elif hashes[path] == written.get(path):
            yield from guarded(partial(_row_findings, folder, path, claim, ended.rows))


def _row_findings(folder: Path, path: str, claim: Mapping[int, str], rows: int) -> Iterator[Finding]:
    """Compare the rows with every hash that the journal has; one row more is asked for, and must not be there."""
    *found, (there, _) = hashes_of(folder / path, [*claim, max(claim) + 1])
    if there != rows:
        yield Finding(path, 0, 0, f"it has {there} rows, and the journal {rows}")
    for due, (count, digest) in zip(sorted(claim), found, strict=True):
        if count != due or digest != claim[due]:
            yield Finding(path, 0, 0, f"its first {due} rows are not those that the journal names")


def _attachment_findings(_: Path, reading: JournalReading, hashes: Hashes) -> Iterator[Finding]:
    for event in fold(reading.events).attachments:
        path = f"{ATTACHMENTS}/{event.file}"
        if hashes.get(path) != event.sha256:
            yield Finding(shown(path), 0, 0, "this is not the attachment that the journal names")


def _check_findings(folder: Path, reading: JournalReading, _: Hashes) -> Iterator[Finding]:
    catalogue = facts_of(folder, reading).catalogue
    for line in reading.lines:
        if isinstance(line.event, Check):
            for message in judge_again(line.event, catalogue):
                yield Finding(JOURNAL, line.number, 1, message)
