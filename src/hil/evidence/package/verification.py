"""Verification: whether a package is what was sealed, and whether every verdict in it follows from its data."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from pathlib import Path

from hil.evidence.folder import JOURNAL, SEAL, is_held, is_sealed
from hil.evidence.journal.reader import read_journal
from hil.evidence.package.bag import digest_of_manifest, hash_payload, manifest_text
from hil.evidence.package.consistent import content_findings, guarded, results_event
from hil.evidence.package.intact import bag_findings
from hil.model.errors import EvidenceError, Finding

__all__ = ["State", "Verification", "verify"]


class State(StrEnum):
    """What became of a run's folder."""

    RUNNING = "RUNNING"
    INTERRUPTED = "INTERRUPTED"
    SEALED = "SEALED"
    DAMAGED = "DAMAGED"


@dataclass(frozen=True, slots=True, kw_only=True)
class Verification:
    """What verification found.

    Attributes:
        folder: the run's folder.
        state: SEALED where nothing is wrong with the seal and what is below it.
        findings: everything that is wrong.
        evidence_digest: the digest of what is there now, empty without a seal.
        content_digest: the digest over the journal's bodies, empty without a journal.
        verdict: the run's verdict, empty without results.
        complete: whether the run went to its own end; one that was interrupted never counts as verified.
    """

    folder: Path
    state: State
    findings: tuple[Finding, ...]
    evidence_digest: str = ""
    content_digest: str = ""
    verdict: str = ""
    complete: bool = False

    @property
    def ok(self) -> bool:
        """Whether this is a whole package of a complete run."""
        return self.state is State.SEALED and self.complete


def verify(folder: Path) -> Verification:
    """Verify a run's folder, offline and from its own bytes only.

    Raises:
        EvidenceError: where this is no run's folder at all, or its files cannot be opened.
    """
    if not (folder / "data").is_dir() and not is_sealed(folder):
        raise EvidenceError(f"{folder}: this is no run's folder", "name a folder of reports/, see hil runs")
    if not is_sealed(folder):
        return _verify_unsealed(folder)
    try:
        hashes = hash_payload(folder)
    except OSError as error:
        raise EvidenceError(f"{folder}: cannot be read: {error}", "check who may read the package") from error
    findings = list(guarded(partial(bag_findings, folder, hashes)))
    try:
        reading = read_journal(folder / JOURNAL)
    except EvidenceError as error:
        findings.append(Finding(JOURNAL, 0, 0, error.message))
        return Verification(folder=folder, state=State.DAMAGED, findings=tuple(findings))
    findings += content_findings(folder, reading)
    return Verification(
        folder=folder,
        state=State.DAMAGED if findings else State.SEALED,
        findings=tuple(findings),
        evidence_digest=digest_of_manifest(manifest_text(hashes)),
        content_digest=reading.content_digest,
        verdict=str(results_event(reading).get("verdict", "")),
        complete=not {"recovered", "stop"} & {event["kind"] for event in reading.events},
    )


def _verify_unsealed(folder: Path) -> Verification:
    held = is_held(folder)
    why = "the run goes on" if held else "the run was interrupted, the package is incomplete"
    findings = [Finding(SEAL, 0, 0, why)]
    try:
        reading = read_journal(folder / JOURNAL)
    except EvidenceError as error:
        findings.append(Finding(JOURNAL, 0, 0, error.message))
        return Verification(folder=folder, state=State.INTERRUPTED, findings=tuple(findings))
    findings += reading.findings
    if reading.torn and not held:
        findings.append(Finding(JOURNAL, 0, 0, f"{len(reading.torn)} bytes at the end are half a line"))
    state = State.RUNNING if held else State.INTERRUPTED
    return Verification(folder=folder, state=state, findings=tuple(findings), content_digest=reading.content_digest)
