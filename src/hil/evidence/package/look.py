"""Quick look at a sealed package: every check that does not read its recordings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from hil.documents.canonical import JsonError
from hil.evidence.durable import read_plain
from hil.evidence.folder import ATTACHMENTS, JOURNAL, RECORDINGS, REPORT, RESULTS, TRANSCRIPT
from hil.evidence.journal.reader import JournalLine, UnknownFormat, read_ends, require_known_format
from hil.evidence.ledger.book import Ledger
from hil.evidence.ledger.packages import known
from hil.evidence.package.bag import (
    INFO,
    MANIFEST,
    digest_of_manifest,
    identifier_of,
    payload_of,
    payload_oxum,
    read_manifest,
)
from hil.evidence.package.consistent import frozen_findings, guarded, named_results
from hil.evidence.package.listing import Listing, list_folder, shown
from hil.evidence.package.verification import State, bag_findings, hash_file, unread_journal
from hil.evidence.results.outcome import Outcome, read_outcome
from hil.model.errors import EvidenceError, Finding

__all__ = ["LOOKED_AT", "Look", "look"]

LOOKED_AT = "seal, list of files, journal, results and frozen files"
"""What a quick look reads; for everything else it believes the manifest."""

_BELIEVED = (f"{RECORDINGS}/", f"{ATTACHMENTS}/", f"{REPORT}/", TRANSCRIPT)


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """Result of a quick look.

    Attributes:
        state: SEALED if nothing wrong was found, DAMAGED if something was, UNKNOWN for a future format.
        findings: everything wrong that was found.
        outcome: the sealed results; None unless it is SEALED.
        last: the journal's last line; None unless it is SEALED.
        size: bytes below `data`; 0 unless it is SEALED.
    """

    state: State
    findings: tuple[Finding, ...] = ()
    outcome: Outcome | None = None
    last: JournalLine | None = None
    size: int = 0


def look(folder: Path, ledger: Ledger | None = None) -> Look:
    """Take a quick look at a sealed package: at `LOOKED_AT`, so that the time does not grow with its recordings.

    It checks that every file exists under its name, and no other, and that together they have the recorded size; and
    that seal, tag files, journal, results and frozen files have the hashes in the manifests and the journal.
    Recordings, attachments, transcript and report are not read, and nothing is rederived: `verify` does both.

    Args:
        folder: the package.
        ledger: the ledger to compare it with, as `verify` does; None to skip that.
    """
    listing = list_folder(folder)
    if listing.odd:
        return Look(state=State.DAMAGED, findings=tuple(listing.findings()))
    findings = [*listing.findings()]
    hashes: dict[str, str] = {}
    named, _ = read_manifest(folder, MANIFEST)
    for path in payload_of(listing.files):
        if path.startswith(_BELIEVED):
            hashes[path] = named.get(path, "")
        else:
            findings += hash_file(folder, path, hashes)
    findings += guarded(partial(bag_findings, folder, listing, hashes))
    findings += guarded(partial(_size_findings, folder, listing), INFO)
    try:
        ends = read_ends(folder / JOURNAL)
        require_known_format(ends)
    except UnknownFormat as error:
        state = State.DAMAGED if findings else State.UNKNOWN
        return Look(state=state, findings=(*findings, Finding(JOURNAL, 1, 1, error.message)))
    except EvidenceError as error:
        return Look(state=State.DAMAGED, findings=(*findings, unread_journal(folder, error)))
    findings += frozen_findings(folder, ends, hashes)
    findings += named_results(ends, hashes)
    outcome, wrong = _outcome(folder, hashes)
    findings += wrong
    if findings:
        return Look(state=State.DAMAGED, findings=tuple(dict.fromkeys(findings)))
    if ledger is not None and (rewritten := _by_ledger(folder, ends.lines[-1], ledger)):
        return Look(state=State.DAMAGED, findings=rewritten)
    size = sum((folder / path).lstat().st_size for path in hashes)
    return Look(state=State.SEALED, outcome=outcome, last=ends.lines[-1], size=size)


def _by_ledger(folder: Path, last: JournalLine, ledger: Ledger) -> tuple[Finding, ...]:
    """Return what in the ledger contradicts a package, whose manifest is believed."""
    return known(
        ledger,
        run=identifier_of(read_plain(folder / INFO).decode()),
        folder=shown(folder.name),
        evidence=digest_of_manifest(read_plain(folder / MANIFEST)),
        before=str(last.wall.get("ledger", "")),
    ).findings


def _size_findings(folder: Path, listing: Listing) -> Iterator[Finding]:
    due = f"Payload-Oxum: {payload_oxum(folder, listing.files)}"
    if INFO in listing.files and due not in read_plain(folder / INFO).decode("utf-8", errors="replace").split("\n"):
        text = "field 'Payload-Oxum' is not the size and number of the files: some are cut off, or missing"
        yield Finding(INFO, 0, 0, text)


def _outcome(folder: Path, hashes: Mapping[str, str]) -> tuple[Outcome | None, list[Finding]]:
    if RESULTS not in hashes:
        return None, []
    try:
        return read_outcome(read_plain(folder / RESULTS)), []
    except JsonError as error:
        return None, [Finding(RESULTS, error.line, error.column, error.bare)]
    except OSError as error:
        return None, [Finding(RESULTS, 0, 0, f"it cannot be read: {error.strerror}")]
