"""What the audit reads of a workspace: catalogue, registers, ledger and packages, as they are now."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec

from hil.audit.cache import Cache
from hil.audit.inputs import Asked, Filed, Package, Register, Remembered, World
from hil.audit.packages import read_packages
from hil.audit.recorded import (
    approvals_of,
    encoded,
    keep,
    policy_of,
    record_subject_of,
    remembered,
    reports_ever,
    verifications_ever,
)
from hil.clock import wall
from hil.documents.findings import Findings, shown
from hil.documents.suggest import did_you_mean
from hil.evidence.durable import sha256_of
from hil.evidence.folder import JOURNAL
from hil.evidence.journal.reader import read_journal
from hil.evidence.ledger.approvals import Subject, keep_signers
from hil.evidence.ledger.book import Ledger, read
from hil.evidence.ledger.entries import Head, Sealed
from hil.evidence.ledger.heads import require_uncut
from hil.evidence.package.verification import verify
from hil.evidence.results.judging_code import judging_digest
from hil.model.errors import EvidenceError, HilError, Refused
from hil.registers.instruments import INSTRUMENTS, load_instruments
from hil.registers.nonconformances import (
    NONCONFORMANCES,
    VERIFICATIONS,
    WAIVERS,
    Nonconformance,
    Records,
    Verification,
    Waiver,
    load_records,
)
from hil.registers.signers import SIGNERS, load_signers
from hil.registers.units import DUTS, load_duts
from hil.requirements.carried import carrying_cases
from hil.requirements.catalogue import Catalogue, load_catalogue
from hil.requirements.lock import LOCK
from hil.requirements.requirement import Document, Requirement
from hil.requirements.schema import REQUIREMENTS

__all__ = [
    "Folders",
    "asked_of",
    "documents_of",
    "keep_present",
    "read_catalogue",
    "read_register",
    "read_world",
    "record_subject",
]

_NOT_THERE = "is not there, as a file below the folder of fixtures"


@dataclass(frozen=True, slots=True, kw_only=True)
class Folders:
    """The folders of a workspace.

    Attributes:
        root: the workspace.
        testplans: its plans.
        fixtures: its registers.
        reports: its packages.
        name: its name.
        ledger: SHA-256 of the first line that its ledger must have; empty where any ledger will do.
    """

    root: Path
    testplans: Path
    fixtures: Path
    reports: Path
    name: str
    ledger: str = ""


def read_world(
    folders: Folders, cache: Cache, *, version: str, locked: bool = True, published_head: str | None = None
) -> World:
    """Return everything that an audit of the workspace as it is now is computed from.

    Args:
        folders: the folders of the workspace.
        cache: what is known of files that did not change.
        version: the version of the product.
        locked: whether the locks of the plans must agree with what they lock.
        published_head: a head that was published earlier; the ledger must contain it.

    Raises:
        ConfigurationError: with all errors in catalogue and registers.
        EvidenceError: if the ledger or the reports cannot be read, or two packages contradict each other.
    """
    ledger, date = read(folders.reports), wall.utc_now()[:10]
    known, forgotten = _remembered(ledger)
    signers = load_signers(folders.fixtures)
    packages = tuple(_compared(folders.reports, ledger, read_packages(folders.reports, cache)))
    asked = cache.requirements(_contents(folders, locked=locked), lambda: read_catalogue(folders, locked=locked))
    register = read_register(folders)
    records = _read_records(folders, asked, register)
    return World(
        asked=asked,
        packages=packages,
        cases=carrying_cases(folders.root, _plans(folders)),
        policy=policy_of(ledger, packages, signers).until(date),
        filed=Filed(
            registers=records,
            earlier=reports_ever(folders.reports, ledger.entries),
            shown=verifications_ever(folders.reports, ledger.entries),
            documents=documents_of(folders.fixtures, records),
            approvals=approvals_of(ledger, packages, signers, records),
            people=signers.people,
        ),
        register=register,
        remembered=known,
        entries=ledger.entries,
        head=ledger.head if ledger.hashes else "",
        problems=(*map(str, (*ledger.findings, *ledger.lacks(published_head))), *forgotten, *_other(ledger, folders)),
        analysis=judging_digest(),
        date=date,
        name=folders.name,
        version=version,
    )


def _other(ledger: Ledger, folders: Folders) -> Iterator[str]:
    """Return a problem if the ledger is not the one that the settings of the workspace name."""
    if folders.ledger and ledger.hashes[:1] != (folders.ledger,):
        there = f"begins with {ledger.hashes[0]}" if ledger.hashes else "is not there"
        yield (
            f"the ledger of {shown(folders.reports, folders.root)} {there}, and the settings of the workspace name"
            f" the one that begins with {folders.ledger}: this is another folder of reports, or a new ledger"
        )


def _remembered(ledger: Ledger) -> tuple[tuple[Remembered, ...], tuple[str, ...]]:
    """Return what the ledger remembers of catalogue and registers, and why it cannot."""
    try:
        return remembered(ledger.reports, ledger.entries), ()
    except EvidenceError as error:
        return (), (error.message,)


def _compared(reports: Path, ledger: Ledger, packages: Iterable[Package]) -> Iterator[Package]:
    """Give packages; of those that the ledger saw running and not sealed, whether their journals are still whole."""
    running = {each.run for each in ledger.of(Head)} - {each.run for each in ledger.of(Sealed)}
    for package in packages:
        if not package.known or package.folder not in running:
            yield package
            continue
        try:
            journal = read_journal(reports / package.folder / JOURNAL)
            require_uncut(reports / package.folder, journal, "count what it says", ledger)
        except HilError as error:
            yield msgspec.structs.replace(package, sealed=False, known=False, problem=error.message)
        else:
            yield package


def _read_records(folders: Folders, asked: Iterable[Asked], register: Register) -> Records:
    findings = Findings()
    kinds = {each.id: each.kind for each in asked}
    found = load_records(folders.fixtures, findings, requirements=kinds, duts=register.duts)
    findings.raise_if_any()
    return found


def record_subject(folders: Folders, number: str) -> Subject:
    """Return what is approved of a report or a waiver of the workspace.

    Raises:
        ConfigurationError: with all errors in catalogue and registers.
        Refused: if there is none of that number, or its approval would close nothing.
    """
    asked = read_catalogue(folders)
    found = _read_records(folders, asked, read_register(folders))
    item = found.find(number)
    if item is None:
        known = tuple(each.id for each in found.every)
        files = f"{NONCONFORMANCES}, {WAIVERS} and {VERIFICATIONS}"
        raise Refused(
            f"there is no report, waiver or verification '{number}'{did_you_mean(number, known)}",
            f"there are: {', '.join(known) or 'none'}, in {folders.fixtures.name}/{files}",
        )
    if not isinstance(item, Nonconformance):
        its = next(each for each in asked if each.id == item.requirement)
        _require_present(item, its)
        if isinstance(item, Verification):
            _require_done(item)
            _require_documents(item, documents_of(folders.fixtures, found))
        subject = record_subject_of(item, {})
        return replace(subject, alone=subject.alone and not its.independent)
    if not item.complete:
        raise Refused(f"{number} is not complete: it cannot be approved", "give its disposition, and what was done")
    folder = folders.reports / item.run
    return record_subject_of(item, {item.run: verify(folder).operator} if item.run and folder.is_dir() else {})


def documents_of(fixtures: Path, records: Records) -> dict[str, str]:
    """Return the SHA-256 of every document that a verification names; empty of what is no file below the folder.

    A link is followed as far as it stays below the folder of fixtures: what lies elsewhere is not kept with it.
    """
    found = {}
    for file in {each.file for item in records.verifications.values() for each in item.documents}:
        try:
            path = (fixtures / file).resolve(strict=True)
            found[file] = sha256_of(path) if path.is_relative_to(fixtures.resolve()) else ""
        except (OSError, RuntimeError):
            found[file] = ""
    return found


def _require_done(item: Verification) -> None:
    if item.date > (today := wall.utc_now()[:10]):
        raise Refused(f"{item.id} is of {item.date}, and today is {today}", "approve it once it is done")


def _require_documents(item: Verification, there: Mapping[str, str]) -> None:
    for each in item.documents:
        if there.get(each.file) != each.sha256:
            now = f"has the SHA-256 {there[each.file]}" if there.get(each.file) else _NOT_THERE
            raise Refused(f"{item.id}: {each.file} {now}", f"put the document back whose SHA-256 is {each.sha256}")


def _require_present(waiver: Waiver | Verification, asked: Asked) -> None:
    if (waiver.rev, waiver.fingerprint) != (asked.rev, asked.fingerprint):
        raise Refused(
            f"{waiver.id} is for rev {waiver.rev} of {asked.id}, which is now rev {asked.rev}, or has another meaning",
            f"if it holds for the present one, give it rev: {asked.rev} and fingerprint: {asked.fingerprint}",
        )


def keep_present(root: Path, testplans: Path, fixtures: Path, reports: Path) -> str:
    """Enter catalogue and registers as they are now into the ledger; return why that is not possible, if it is not."""
    folders = Folders(root=root, testplans=testplans, fixtures=fixtures, reports=reports, name="")
    try:
        if (fixtures / SIGNERS).exists():
            keep_signers(reports, load_signers(fixtures))
        keep(reports, read_catalogue(folders, locked=False), read_register(folders))
    except HilError as error:
        return str(error)
    return ""


def read_catalogue(folders: Folders, *, locked: bool = True) -> tuple[Asked, ...]:
    """Return the requirements of every plan and of the workspace.

    Raises:
        ConfigurationError: with all errors.
    """
    catalogue = load_catalogue(folders.root, _plans(folders), locked=locked)
    return (*_above(catalogue), *_of_plans(catalogue))


def _plans(folders: Folders) -> list[Path]:
    return sorted(file.parent for file in folders.testplans.glob(f"*/{REQUIREMENTS}"))


def read_register(folders: Folders) -> Register:
    """Return the registers of a workspace; one need not have them.

    Raises:
        ConfigurationError: with all errors.
    """
    findings = Findings()
    units, instruments = folders.fixtures / DUTS, folders.fixtures / INSTRUMENTS
    duts = load_duts(units, shown(units, folders.root), findings) if units.exists() else ()
    known = load_instruments(instruments, shown(instruments, folders.root), findings)
    findings.raise_if_any()
    return Register(
        duts={each.serial: each for each in duts},
        instruments=known,
        sha256={
            subject: hashlib.sha256(encoded(subject, content)).hexdigest()
            for subject, content in (("units", duts), ("instruments", tuple(known.values())))
            if content
        },
    )


def _contents(folders: Folders, *, locked: bool) -> tuple[bytes, ...]:
    """Return names and contents of every file that says what is asked, and whether locks must agree."""
    files = sorted((*folders.testplans.glob(f"*/{REQUIREMENTS}"), *folders.testplans.glob(f"*/{LOCK}")))
    named = [file for file in (*files, folders.testplans / REQUIREMENTS) if file.exists()]
    told = (part for file in named for part in (shown(file, folders.root).encode(), _content(file)))
    return (str(locked).encode(), *told)


def _content(file: Path) -> bytes:
    """Return what a file holds; nothing of what cannot be read, such as a pipe: who reads it as a document says so."""
    try:
        return file.read_bytes() if file.is_file() else b""
    except OSError:
        return b""


def _above(catalogue: Catalogue) -> Iterator[Asked]:
    for item in catalogue.above:
        yield asked_of(item, Document(id=""), ())


def _of_plans(catalogue: Catalogue) -> Iterator[Asked]:
    for plan in catalogue.plans:
        document, parts = catalogue.document(plan), catalogue.part_numbers(plan)
        for item in catalogue.of_plan(plan):
            yield asked_of(item, document, parts)


def asked_of(item: Requirement, document: Document, part_numbers: Iterable[str]) -> Asked:
    """Return a requirement as the audit needs it."""
    return Asked(
        id=item.id,
        rev=item.rev,
        fingerprint=item.fingerprint,
        text=item.text,
        kind=item.kind,
        method=item.method,
        source=item.source,
        anomaly=item.anomaly,
        parents=item.parents,
        level=item.level,
        stage=item.stage,
        withdrawn=item.withdrawn,
        max_age_s=item.max_age_s,
        plan=item.plan,
        document=document.id,
        issue=document.issue,
        place=f"{item.place.path}:{item.place.line}",
        part_numbers=tuple(part_numbers),
        witness=item.witness,
        independent=item.independent,
    )
