"""Signatures and approvals of packages and of records beside them: entering them, and deciding which count."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec

from hil.clock import wall
from hil.documents.canonical import JsonError
from hil.evidence.durable import read_plain, write_whole
from hil.evidence.ledger.book import LEDGER, Ledger, append, append_once, object_file, put_object, read, read_object
from hil.evidence.ledger.entries import Approved, Baseline, Entry, Sealed, Signed
from hil.evidence.ledger.signing import APPROVAL, PACKAGE, Statement, problem_of, read_statement, sign
from hil.model.errors import EvidenceError, HilError, Refused
from hil.registers.signers import ALLOWED, REVOKED, SIGNERS, Signers, load_signers

__all__ = ["Said", "Subject", "approve", "keep_signers", "said_of", "sign_package", "signers_then", "stray_files"]

_FOLDER = "signatures"
_FILES = (SIGNERS, ALLOWED, REVOKED)
_LONGEST = 500


class _Kept(msgspec.Struct, frozen=True, kw_only=True):
    """The files of signers and keys, with their bytes in base64."""

    format: int
    files: dict[str, bytes]


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """What is signed: a package as its verification found it, or a record such as a waiver.

    Attributes:
        run: the name of the run, or the number of the record.
        evidence: the package's evidence digest, or the SHA-256 of the record's content.
        operator: who ran it, as the run recorded it, or who wrote the record.
        content: the content of a record, which has no seal; empty for a package.
        others: who else may not approve a record: the operators of the runs that it is about.
        alone: whether its author may approve a record; the approval is then the author's signature.
    """

    run: str
    evidence: str
    operator: str
    content: bytes = b""
    others: tuple[str, ...] = ()
    alone: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Said:
    """A signature or an approval, and whether it counts.

    Attributes:
        entry: its entry in the ledger.
        problem: why it does not count, in a sentence; empty if it does.
    """

    entry: Signed | Approved
    problem: str = ""

    @property
    def kind(self) -> str:
        """Return `signed` or `approved`."""
        return self.entry.kind()

    def __str__(self) -> str:
        entry = self.entry
        what = (
            f'{entry.role} by {entry.principal}: "{entry.meaning}"' if isinstance(entry, Approved) else entry.principal
        )
        return f"{what}, {entry.utc[:10]}, ledger line {entry.seq + 1}"


def sign_package(reports: Path, subject: Subject, signers: Signers, *, principal: str, key: Path) -> Said:
    """Sign a package and enter the signature.

    Raises:
        Refused: if the signature would not count, with the reason; nothing is entered.
        EvidenceError: if the ledger cannot be read or written.
    """
    return _enter(reports, subject, signers, principal=principal, key=key)


def approve(
    reports: Path, subject: Subject, signers: Signers, *, principal: str, key: Path, role: str, meaning: str
) -> Said:
    """Approve a package in a role and enter the approval.

    Raises:
        Refused: if the approval would not count, with the reason; nothing is entered.
        EvidenceError: if the ledger cannot be read or written.
    """
    meaning = meaning.strip()
    if not meaning or len(meaning) > _LONGEST or not meaning.isprintable():
        raise Refused(
            f"--meaning must be one line of 1 to {_LONGEST} characters",
            'say what you approve: --meaning "results reviewed"',
        )
    return _enter(reports, subject, signers, principal=principal, key=key, role=role, meaning=meaning)


def said_of(ledger: Ledger, subject: Subject, signers: Signers) -> tuple[Said, ...]:
    """Return every signature and approval of a package in the ledger, and why some do not count.

    Raises:
        Refused: if there are some, and no ssh-keygen to verify them with.
    """
    entries = [each for each in ledger.entries if isinstance(each, Signed | Approved) and each.run == subject.run]
    authors = {each.principal for each in entries if isinstance(each, Signed)}
    return tuple(Said(entry=each, problem=_problem(ledger, each, subject, signers, authors)) for each in entries)


def stray_files(ledger: Ledger, run: str) -> Iterator[str]:
    """Yield a sentence for every file in a run's folder of signatures that is not as the ledger has it."""
    place = ledger.reports / LEDGER / _FOLDER / run
    due: dict[str, str] = {}
    for entry in ledger.entries:
        if isinstance(entry, Signed | Approved) and entry.run == run:
            name = _file_name(entry)
            due |= {name: entry.statement, f"{name}.sig": entry.signature}
    there = {path.name for path in place.iterdir()} if place.is_dir() else set()
    for name in sorted(there - due.keys()):
        yield f"{LEDGER}/{_FOLDER}/{run}/{name}: no entry of the ledger names this file"
    for name, digest in due.items():
        try:
            same = read_plain(place / name) == read_object(ledger.reports, digest)
        except (OSError, EvidenceError):
            same = False
        if not same:
            yield f"{LEDGER}/{_FOLDER}/{run}/{name}: missing, or not the bytes that the ledger names"


def _enter(
    reports: Path, subject: Subject, signers: Signers, *, principal: str, key: Path, role: str = "", meaning: str = ""
) -> Said:
    signers.find(principal)
    ledger = read(reports)
    statement = _statement(ledger, subject, principal, role, meaning)
    authors = {each.principal for each in ledger.of(Signed, subject.run)}
    if role and (problem := _not_entitled(subject, signers, principal, role, statement.utc, authors)):
        raise _would_not_count(subject, problem)
    data = statement.line()
    signature = sign(data, key=key, namespace=statement.namespace)
    said, signed = put_object(reports, data), put_object(reports, signature)
    file = object_file(reports, signed)
    if problem := problem_of(statement, file, utc=statement.utc, fixtures=signers.folder):
        raise _would_not_count(subject, problem)
    keep_signers(reports, signers)
    if subject.content:
        put_object(reports, subject.content)
    run, evidence = subject.run, subject.evidence
    entry: Signed | Approved = Signed(run=run, evidence=evidence, principal=principal, statement=said, signature=signed)
    if role:
        entry = Approved(
            run=run,
            evidence=evidence,
            principal=principal,
            statement=said,
            signature=signed,
            role=role,
            meaning=meaning,
        )
    entry = append(reports, entry)
    place = reports / LEDGER / _FOLDER / run
    place.mkdir(parents=True, exist_ok=True)
    write_whole(place / _file_name(entry), data)
    write_whole(place / f"{_file_name(entry)}.sig", signature)
    return Said(entry=entry)


def _statement(ledger: Ledger, subject: Subject, principal: str, role: str, meaning: str) -> Statement:
    """Return the statement to sign, about a package whose seal is in the ledger, or about a record."""
    if subject.content:
        return Statement(
            format=1,
            namespace=APPROVAL,
            run=subject.run,
            evidence=subject.evidence,
            content=subject.evidence,
            verdict="",
            source="",
            principal=principal,
            role=role,
            meaning=meaning,
            utc=wall.utc_now(),
        )
    sealed = next((each for each in ledger.of(Sealed, subject.run) if each.evidence == subject.evidence), None)
    if sealed is None:
        raise Refused(f"{subject.run}: the ledger has no seal of it", f"enter it first: hil seal {subject.run}")
    return Statement(
        format=1,
        namespace=APPROVAL if role else PACKAGE,
        run=subject.run,
        evidence=subject.evidence,
        content=sealed.content,
        verdict=sealed.verdict,
        source=sealed.source,
        principal=principal,
        role=role,
        meaning=meaning,
        utc=wall.utc_now(),
    )


def _would_not_count(subject: Subject, problem: str) -> Refused:
    return Refused(f"{subject.run}: this would not count: {problem}", f"see fixtures/{SIGNERS} and fixtures/{ALLOWED}")


def keep_signers(reports: Path, signers: Signers) -> None:
    """Keep the present signers in the ledger, unless they are there already.

    Raises:
        EvidenceError: if the ledger cannot be written.
    """
    kept = put_object(reports, msgspec.json.encode(_Kept(format=1, files=_files_of(signers)), order="sorted"))

    def stands(ledger: Ledger) -> bool:
        return [each.object for each in ledger.of(Baseline) if each.subject == "signers"][-1:] == [kept]

    append_once(reports, Baseline(subject="signers", object=kept), stands)


def _files_of(signers: Signers) -> dict[str, bytes]:
    paths = (signers.folder / name for name in _FILES)
    return {path.name: read_plain(path) for path in paths if path.exists()}


def signers_then(reports: Path, entries: Iterable[Entry], place: Path) -> Signers | None:
    """Return who could sign when the last of these entries was written; None if no entry records it.

    Args:
        reports: the folder of reports.
        entries: entries of its ledger, in order.
        place: an empty folder for the files of keys, which ssh-keygen reads.

    Raises:
        EvidenceError: if the kept files are missing or were changed.
        ConfigurationError: if this version cannot read the kept register.
    """
    kept = [each.object for each in entries if isinstance(each, Baseline) and each.subject == "signers"]
    if not kept:
        return None
    for name, content in _files_in(read_object(reports, kept[-1])).items():
        write_whole(place / name, content)
    return load_signers(place)


def _files_in(data: bytes) -> dict[str, bytes]:
    """Return the kept files; earlier versions of hil concatenated them."""
    if data.startswith(b"{"):
        files = msgspec.json.decode(data, type=_Kept).files
        return {name: files[name] for name in _FILES if name in files}
    names = b"|".join(re.escape(name.encode()) for name in _FILES)
    _, *parts = re.split(b"^# (%b)\n" % names, data, flags=re.MULTILINE)
    return {name.decode(): content for name, content in zip(parts[::2], parts[1::2], strict=True)}


def _problem(ledger: Ledger, entry: Signed | Approved, subject: Subject, signers: Signers, authors: set[str]) -> str:
    """Return why a signature or an approval does not count; empty if it does."""
    try:
        read_object(ledger.reports, entry.signature)
        statement = read_statement(read_object(ledger.reports, entry.statement))
    except (EvidenceError, JsonError) as error:
        return f"its statement or signature was changed: {error}"
    role, meaning = (entry.role, entry.meaning) if isinstance(entry, Approved) else ("", "")
    namespace = APPROVAL if isinstance(entry, Approved) else PACKAGE
    if (statement.run, statement.evidence) != (subject.run, subject.evidence):
        what, digest = ("content", "SHA-256") if subject.content else ("package", "evidence digest")
        return f"it signs another {what}: {statement.run}, {digest} {statement.evidence}"
    said = (statement.format, statement.namespace, statement.principal, statement.role, statement.meaning)
    if said != (1, namespace, entry.principal, role, meaning) or entry.evidence != subject.evidence:
        return "its statement says something else than the ledger's entry"
    if statement.utc > entry.utc:
        return f"it was signed {statement.utc}, after it was entered {entry.utc}"

    def by(who: Signers) -> str:
        file = object_file(ledger.reports, entry.signature)
        if problem := problem_of(statement, file, utc=entry.utc, fixtures=who.folder):
            return problem
        return _not_entitled(subject, who, entry.principal, role, entry.utc, authors) if role else ""

    return by(signers) or _problem_then(ledger, entry, signers, by)


def _problem_then(ledger: Ledger, entry: Signed | Approved, signers: Signers, by: Callable[[Signers], str]) -> str:
    """Return why a signature did not count by the signers of the time when it was entered; empty if it did."""
    before = [each for each in ledger.entries if each.seq < entry.seq]
    kept = [each.object for each in before if isinstance(each, Baseline) and each.subject == "signers"]
    if not kept:
        return ""  # earlier versions of hil kept none
    try:
        if _files_in(read_object(ledger.reports, kept[-1])) == _files_of(signers):
            return ""
        with TemporaryDirectory() as place:
            then = signers_then(ledger.reports, before, Path(place))
            problem = by(then) if then else ""
    except HilError as error:
        return f"it is not known who could sign when it was entered: {error}"
    return f"by the signers of {entry.utc[:10]}, when it was entered: {problem}" if problem else ""


def _not_entitled(subject: Subject, signers: Signers, principal: str, role: str, utc: str, authors: set[str]) -> str:
    """Return why a person may not approve a package in a role; empty if allowed."""
    try:
        person = signers.find(principal)
    except Refused as error:
        return error.message
    if not person.holds(role, utc[:10]):
        held = ", ".join(f"{each.role} {each.since} to {each.until or 'now'}" for each in person.roles)
        return f"{principal} does not hold the role {role} on {utc[:10]}, but {held or 'none'}"
    who, what = ("author", subject.run) if subject.content else ("operator", "the package")
    for name in () if subject.alone else (subject.operator, *subject.others):
        author = signers.called(name)
        if author is None:
            return (
                f"nobody can tell whether {principal} is somebody else than the {who}: "
                f"fixtures/{SIGNERS} has nobody called '{name}'"
            )
        if author is person or principal in authors:
            return f"{principal} is the author of {what}: somebody else must approve it"
        who = "operator"
    return ""


def _file_name(entry: Signed | Approved) -> str:
    what = f"approval-{entry.role}" if isinstance(entry, Approved) else "package"
    return f"{what}-{re.sub(r'[^A-Za-z0-9._-]+', '_', entry.principal)}-{entry.statement[:8]}.json"
