"""Verification: whether a package is as it was sealed, and whether every verdict in it follows from its data."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial
from pathlib import Path

from hil.evidence.durable import read_plain, sha256_of
from hil.evidence.events import End
from hil.evidence.folder import JOURNAL, SEAL, is_held, is_run, is_sealed
from hil.evidence.journal.reader import UnknownFormat, read_ends, read_journal, require_known_format
from hil.evidence.ledger.book import Ledger, read
from hil.evidence.ledger.heads import cut_or_rewritten
from hil.evidence.ledger.packages import known
from hil.evidence.package.bag import (
    DECLARATION,
    INFO,
    MANIFEST,
    TAG_MANIFEST,
    digest_of_manifest,
    identifier_of,
    manifest_text,
    payload_of,
    read_manifest,
    tag_manifest_text,
)
from hil.evidence.package.listing import Listing, list_folder, shown
from hil.evidence.safed import was_safed
from hil.evidence.state import fold, standing
from hil.model.errors import EvidenceError, Finding

__all__ = ["NO_SEAL", "State", "Verification", "bag_findings", "hash_file", "in_short", "unread_journal", "verify"]


class State(StrEnum):
    """The state of a run's folder."""

    RUNNING = "RUNNING"
    INTERRUPTED = "INTERRUPTED"
    SAFED = "SAFED"
    """The guardian made its bench safe and ended it."""
    SEALED = "SEALED"
    DAMAGED = "DAMAGED"
    UNKNOWN = "UNKNOWN"
    """Sealed in a format that this version does not read."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Verification:
    """Result of a verification.

    Attributes:
        folder: the run's folder.
        state: SEALED if nothing is wrong with the seal and what it covers.
        findings: everything that is wrong.
        evidence_digest: the package's digest; empty unless it is SEALED: a computed one would name the damage.
        content_digest: the digest over the journal's bodies; empty unless it is SEALED.
        verdict: the run's verdict; empty unless it is SEALED.
        run: the name that the folder had at its seal; empty unless it is SEALED.
        source: where the run's bytes came from; empty unless it is SEALED.
        operator: who ran it, as the run recorded it; empty unless it is SEALED.
        deviates: whether the run differs from its plan.
        exceptions: what counts as hardware by the word of the bench file alone, a sentence each.
        ledger: what the ledger of its folder of reports says of it; empty without a ledger, and unless it is SEALED.
        sure: False if the ledger is damaged, and so does not confirm what the package says of itself.
        complete: whether the run came to its own end; an interrupted one never counts as verified.
    """

    folder: Path
    state: State
    findings: tuple[Finding, ...]
    evidence_digest: str = ""
    content_digest: str = ""
    verdict: str = ""
    run: str = ""
    source: str = ""
    operator: str = ""
    deviates: bool = False
    exceptions: tuple[str, ...] = ()
    ledger: str = ""
    sure: bool = True
    complete: bool = False

    @property
    def problem(self) -> str:
        """Everything that is wrong, in one line; empty if nothing is."""
        return in_short(self.findings)

    @property
    def ok(self) -> bool:
        """Whether this is an intact package of a complete run, and the ledger that should have it is not damaged."""
        return self.state is State.SEALED and self.complete and self.sure


def in_short(findings: Sequence[Finding]) -> str:
    """Return the first finding and the number of others, in one line that can be printed anywhere."""
    others = len(findings) - 1
    more = f" (and {others} more problem{'s' * (others > 1)})" if others > 0 else ""
    return f"{shown(str(findings[0]))}{more}" if findings else ""


def verify(folder: Path, ledger: Ledger | None = None) -> Verification:
    """Verify a run's folder, offline; whatever is in it, the result is findings, not exceptions.

    A package that is consistent in itself is compared with the ledger: whoever rewrites all of it can make it
    consistent again.

    Args:
        folder: the run's folder.
        ledger: the ledger to compare it with; by default that of the folder of reports it is in.

    Raises:
        EvidenceError: if this is not a run's folder at all, or the ledger cannot be read.
    """
    held = is_held(folder)  # checked first: a run that ends in between is then sealed
    if is_sealed(folder):
        found = _verify_sealed(folder)
        return found if found.findings else _compared(found, ledger)
    if not is_run(folder):
        raise EvidenceError(f"{shown(str(folder))}: not a run's folder", "name a folder of reports/, see hil runs")
    return _verify_unsealed(folder, State.RUNNING if held else State.INTERRUPTED, ledger)


def _verify_sealed(folder: Path) -> Verification:
    from hil.evidence.package.consistent import content_findings, guarded  # noqa: PLC0415 - heavy, and lists need `State`

    listing = list_folder(folder)
    if listing.odd:  # if a folder may be a link, nothing below it is opened
        return Verification(folder=folder, state=State.DAMAGED, findings=tuple(listing.findings()))
    findings = list(listing.findings())
    hashes: dict[str, str] = {}
    for path in payload_of(listing.files):
        findings += hash_file(folder, path, hashes)
    findings += guarded(partial(bag_findings, folder, listing, hashes))
    try:
        reading = read_journal(folder / JOURNAL)
        require_known_format(reading)
    except UnknownFormat as error:
        state = State.DAMAGED if findings else State.UNKNOWN
        return Verification(folder=folder, state=state, findings=(*findings, Finding(JOURNAL, 1, 1, str(error))))
    except EvidenceError as error:
        return Verification(folder=folder, state=State.DAMAGED, findings=(*findings, unread_journal(folder, error)))
    for finding in content_findings(folder, reading, hashes):
        findings.append(replace(finding, message=finding.message.replace(f"{folder}/", "")))
    if findings:
        return Verification(folder=folder, state=State.DAMAGED, findings=tuple(dict.fromkeys(findings)))
    final = fold(reading.events)
    stands = standing(reading.events)
    return Verification(
        folder=folder,
        state=State.SEALED,
        findings=(),
        evidence_digest=digest_of_manifest(manifest_text(hashes)),
        content_digest=reading.content_digest,
        verdict=str(final.results.verdict) if final.results else "",
        run=identifier_of(read_plain(folder / INFO).decode()),
        source=final.run.source if final.run else "",
        operator=final.run.operator if final.run else "",
        deviates=bool(final.deviations),
        exceptions=final.exceptions,
        complete=not (final if len(stands) == len(reading.events) else fold(stands)).interrupted,
    )


def _compared(found: Verification, ledger: Ledger | None) -> Verification:
    """Return the verification of a package that is consistent in itself, with what the ledger says of it."""
    before = str(read_ends(found.folder / JOURNAL).lines[-1].wall.get("ledger", ""))
    place = found.folder.resolve()
    ledger = read(place.parent) if ledger is None else ledger
    said = known(ledger, run=found.run, folder=shown(place.name), evidence=found.evidence_digest, before=before)
    if said.findings:
        return Verification(folder=found.folder, state=State.DAMAGED, findings=said.findings)
    return replace(found, ledger=said.told, sure=said.sure)


def unread_journal(folder: Path, error: EvidenceError) -> Finding:
    """Return the finding for a journal that cannot be read, without a path of this machine."""
    return Finding(JOURNAL, 0, 0, error.message.removeprefix(f"{folder / JOURNAL}: "))


def hash_file(folder: Path, path: str, hashes: dict[str, str]) -> Iterator[Finding]:
    """Add the SHA-256 of a file to the known ones, or yield a finding if it cannot be read."""
    try:
        hashes[path] = sha256_of(folder / path)
    except OSError as error:
        yield Finding(shown(path), 0, 0, f"it cannot be read: {error.strerror}")


def _verify_unsealed(folder: Path, state: State, ledger: Ledger | None) -> Verification:
    from hil.evidence.package.consistent import guarded  # noqa: PLC0415 - as above
    from hil.evidence.package.introduced import lost_files  # noqa: PLC0415 - as above

    running = state is State.RUNNING
    findings = list(list_folder(folder).odd)
    try:
        reading = read_journal(folder / JOURNAL)
    except EvidenceError as error:
        return Verification(
            folder=folder, state=State.DAMAGED, findings=(_unsealed(state), *findings, unread_journal(folder, error))
        )
    if not running and was_safed(folder, reading.events):
        state = State.SAFED
    ended = not running and bool(reading.events) and isinstance(reading.events[-1], End)
    findings.insert(0, Finding(SEAL, 0, 0, NO_SEAL) if ended else _unsealed(state))
    lost = list(guarded(partial(lost_files, folder, reading))) if ended else []
    if not running and not reading.findings and (problem := cut_or_rewritten(folder, reading, ledger)):
        lost.append(Finding(JOURNAL, 0, 0, problem))
    findings += (*reading.findings, *lost)
    if (reading.findings or lost) and not running:
        state = State.DAMAGED
    if reading.torn and not running:
        findings.append(Finding(JOURNAL, 0, 0, f"{len(reading.torn)} bytes at the end are an incomplete line"))
    return Verification(folder=folder, state=state, findings=tuple(findings))


NO_SEAL = "the run has ended, and its seal is missing: hil seal seals it; if this is a copy, copy the package again"


def _unsealed(state: State) -> Finding:
    return Finding(SEAL, 0, 0, _WHY[state])


_WHY = {
    State.RUNNING: "the run is still running",
    State.INTERRUPTED: "the run was interrupted, the package is incomplete",
    State.SAFED: "the guardian ended the run, the package is incomplete",
}


_TAG_FILES = frozenset({SEAL, INFO, MANIFEST, TAG_MANIFEST})


def bag_findings(folder: Path, listing: Listing, hashes: Mapping[str, str]) -> Iterator[Finding]:
    """Compare a folder with its manifests and with what sealing writes.

    Args:
        folder: the run's folder.
        listing: what is in it.
        hashes: path and SHA-256 of every file below `data`, as they are now.
    """
    for name in listing.files:
        if name not in hashes and name not in _TAG_FILES:
            yield Finding(shown(name), 0, 0, "no manifest names this file")
    missing = sorted(_TAG_FILES - {*listing.files})
    for name in missing:
        yield Finding(name, 0, 0, "this file is missing: every package has it")
    if SEAL not in missing and read_plain(folder / SEAL) != DECLARATION:
        yield Finding(SEAL, 0, 0, "expected the BagIt declaration of a sealed package, found something else")
    if MANIFEST not in missing:
        yield from _compare(folder, MANIFEST, hashes, manifest_text(hashes))
    if not missing:
        tags = {name: sha256_of(folder / name) for name in (SEAL, INFO, MANIFEST)}
        yield from _compare(folder, TAG_MANIFEST, tags, tag_manifest_text(folder))


def _compare(folder: Path, manifest: str, hashes: Mapping[str, str], due: bytes) -> Iterator[Finding]:
    named, findings = read_manifest(folder, manifest)
    for path in sorted(named.keys() - hashes.keys()):
        findings.append(Finding(shown(path), 0, 0, f"{manifest} names it, and it is missing"))
    for path, digest in hashes.items():
        if path not in named:
            findings.append(Finding(shown(path), 0, 0, f"{manifest} does not name it"))
        elif named[path] != digest:
            what = f"changed after the seal: {manifest} has another hash"
            findings.append(Finding(shown(path), 0, 0, what))
    yield from findings
    if not findings and read_plain(folder / manifest) != due:
        yield Finding(manifest, 0, 0, "the entries are right, but order or spacing is not as a seal writes them")
