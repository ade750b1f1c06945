"""Verification: whether a package is what was sealed, and whether every verdict in it follows from its data."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from pathlib import Path

from hil.documents.canonical import canonical
from hil.evidence.bag import (
    DECLARATION,
    INFO,
    MANIFEST,
    TAG_MANIFEST,
    digest_of_manifest,
    hash_payload,
    manifest_text,
    odd_entries,
    read_manifest,
    tag_manifest_text,
    top_entries,
)
from hil.evidence.durable import sha256_of
from hil.evidence.facts import digest_of, facts_of
from hil.evidence.folder import (
    ATTACHMENTS,
    CATALOGUE,
    JOURNAL,
    RECORDINGS,
    RESULTS,
    SEAL,
    is_held,
    is_sealed,
)
from hil.evidence.judged import judge_again
from hil.evidence.quick_json import quick_canonical
from hil.evidence.reading import Body, JournalReading, read_journal
from hil.evidence.recordings import hashes_of
from hil.evidence.results import results_of
from hil.evidence.seal import info_of
from hil.model.errors import EvidenceError, Finding, HilError

__all__ = ["State", "Verification", "verify"]

_TAG_FILES = frozenset({SEAL, INFO, MANIFEST, TAG_MANIFEST})
_HOSTILE = (HilError, OSError, KeyError, TypeError, ValueError, AttributeError, IndexError, RecursionError)


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
        EvidenceError: where this is no run's folder at all.
    """
    if not (folder / "data").is_dir() and not is_sealed(folder):
        raise EvidenceError(f"{folder}: this is no run's folder", "name a folder of reports/, see hil runs")
    if not is_sealed(folder):
        return _verify_unsealed(folder)
    findings = list(_guarded(partial(_bag_findings, folder)))
    try:
        reading = read_journal(folder / JOURNAL)
        findings += _guarded(partial(_journal_findings, reading))
        findings += _content_findings(folder, reading)
        results = _results(reading)
        return Verification(
            folder=folder,
            state=State.DAMAGED if findings else State.SEALED,
            findings=tuple(findings),
            evidence_digest=digest_of_manifest(manifest_text(hash_payload(folder))),
            content_digest=reading.content_digest,
            verdict=str(results.get("verdict", "")),
            complete=not {"recovered", "stop"} & {event["kind"] for event in reading.events},
        )
    except EvidenceError as error:
        return Verification(
            folder=folder, state=State.DAMAGED, findings=(*findings, Finding(JOURNAL, 0, 0, error.message))
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


def _guarded(look: Callable[[], Iterator[Finding]]) -> Iterator[Finding]:
    """Turn whatever hostile content makes of a look into a finding."""
    try:
        yield from look()
    except _HOSTILE as error:
        what = error.message if isinstance(error, HilError) else f"{type(error).__name__}: {error}"
        yield Finding("data", 0, 0, f"verification cannot go on here: {what}")


def _bag_findings(folder: Path) -> Iterator[Finding]:
    yield from odd_entries(folder)
    for name in top_entries(folder):
        if name not in _TAG_FILES:
            yield Finding(name, 0, 0, "no manifest names this file")
    if (folder / SEAL).read_bytes() != DECLARATION:
        yield Finding(SEAL, 0, 0, "this is not the declaration of a sealed package")
    hashes = hash_payload(folder)
    yield from _compare(folder, MANIFEST, hashes, manifest_text(hashes))
    tags = {name: sha256_of(folder / name) for name in (SEAL, INFO, MANIFEST) if (folder / name).is_file()}
    if len(tags) == len(_TAG_FILES) - 1:
        yield from _compare(folder, TAG_MANIFEST, tags, tag_manifest_text(folder))
    else:
        yield Finding(TAG_MANIFEST, 0, 0, "tag files are missing")


def _compare(folder: Path, manifest: str, hashes: Mapping[str, str], due: bytes) -> Iterator[Finding]:
    named, findings = read_manifest(folder, manifest)
    for path in named.keys() - hashes.keys():
        findings.append(Finding(path, 0, 0, f"{manifest} names it, and it is missing"))
    for path, digest in hashes.items():
        if path not in named:
            findings.append(Finding(path, 0, 0, f"{manifest} does not name it"))
        elif named[path] != digest:
            findings.append(Finding(path, 0, 0, f"it is not the file that was sealed: {manifest} has another hash"))
    yield from findings
    if not findings and (folder / manifest).read_bytes() != due:
        yield Finding(manifest, 0, 0, "its text is not the one that is written at a seal")


def _journal_findings(reading: JournalReading) -> Iterator[Finding]:
    yield from reading.findings
    if reading.torn:
        yield Finding(JOURNAL, 0, 0, f"{len(reading.torn)} bytes at the end are half a line")
    kinds = [event["kind"] for event in reading.events]
    if kinds[:1] != ["run"] or kinds[-2:] != ["results", "end"] or kinds.count("results") != 1:
        yield Finding(JOURNAL, 0, 0, "a sealed journal begins with run, and ends with results and end, each once")
    for line in reading.lines:
        if quick_canonical(line.body) != line.raw:
            yield Finding(JOURNAL, line.number, 1, "this is not canonical JSON")


def _content_findings(folder: Path, reading: JournalReading) -> Iterator[Finding]:
    for look in (_info_findings, _results_findings, _recording_findings, _attachment_findings, _check_findings):
        yield from _guarded(partial(look, folder, reading))


def _info_findings(folder: Path, reading: JournalReading) -> Iterator[Finding]:
    text = (folder / INFO).read_bytes()
    names = [line.removeprefix(b"External-Identifier: ") for line in text.split(b"\n") if line.startswith(b"Ext")]
    if len(names) != 1 or text != info_of(folder, names[0].decode(), reading):
        yield Finding(INFO, 0, 0, "it does not say what the journal and the files say")


def _results_findings(folder: Path, reading: JournalReading) -> Iterator[Finding]:
    run = reading.events[0] if reading.events else {}
    if run.get("catalogue") != digest_of(facts_of(folder, reading).catalogue):
        yield Finding(CATALOGUE, 0, 0, "this is not the catalogue that the run was begun with")
    data = (folder / RESULTS).read_bytes()
    if _results(reading).get("sha256") != sha256_of(folder / RESULTS):
        yield Finding(RESULTS, 0, 0, "the journal names other results")
    derived = results_of(folder, reading)
    if canonical(derived) != data:
        yield Finding(RESULTS, 0, 0, "journal and frozen catalogue give other results")
    if _results(reading).get("verdict") != derived["verdict"]:
        yield Finding(JOURNAL, 0, 0, f"the run's verdict is {derived['verdict']}, and not what the journal says")


def _recording_findings(folder: Path, reading: JournalReading) -> Iterator[Finding]:
    claims: dict[str, dict[int, str]] = {}
    ended: dict[str, int] = {}
    for event in reading.events:
        if event["kind"] == "recording":
            claims.setdefault(event["recording"], {})
        elif event["kind"] in {"rows", "recording-end"}:
            claims.setdefault(event["recording"], {})[event["rows"]] = event["sha256"]
        if event["kind"] == "recording-end":
            ended[event["recording"]] = event["rows"]
    for identifier, claim in claims.items():
        path = f"{RECORDINGS}/{identifier}.h5"
        if identifier not in ended:
            yield Finding(path, 0, 0, "the journal has no end of this recording")
        elif not (folder / path).is_file():
            yield Finding(path, 0, 0, "the recording is missing")
        else:
            yield from _guarded(partial(_row_findings, folder, path, claim, ended[identifier]))


def _row_findings(folder: Path, path: str, claim: Mapping[int, str], rows: int) -> Iterator[Finding]:
    """Compare the rows with every hash that the journal has; one row more is asked for, and must not be there."""
    *found, (there, _) = hashes_of(folder / path, [*claim, max(claim) + 1])
    if there != rows:
        yield Finding(path, 0, 0, f"it has {there} rows, and the journal {rows}")
    for due, (count, digest) in zip(sorted(claim), found, strict=True):
        if count != due or digest != claim[due]:
            yield Finding(path, 0, 0, f"its first {due} rows are not those that the journal names")


def _attachment_findings(folder: Path, reading: JournalReading) -> Iterator[Finding]:
    for event in reading.events:
        if event["kind"] == "attachment":
            path = f"{ATTACHMENTS}/{Path(event['file']).name}"
            if not (folder / path).is_file() or sha256_of(folder / path) != event["sha256"]:
                yield Finding(path, 0, 0, "this is not the attachment that the journal names")


def _check_findings(folder: Path, reading: JournalReading) -> Iterator[Finding]:
    catalogue = facts_of(folder, reading).catalogue
    for line in reading.lines:
        if line.body["kind"] == "check":
            for message in judge_again(line.body, catalogue):
                yield Finding(JOURNAL, line.number, 1, message)


def _results(reading: JournalReading) -> Body:
    return next((event for event in reading.events if event["kind"] == "results"), {})
