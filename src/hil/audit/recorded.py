"""What is entered into the ledger of catalogue, registers and status, and the state of a past day from that."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import takewhile
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Generic, TypeVar

import msgspec

from hil.audit.document import Document, Row
from hil.audit.inputs import Approval, Asked, Filed, Package, Policy, Register, Remembered, World
from hil.audit.remembered import CATALOGUE, INSTRUMENTS, UNITS, remember, removed_from
from hil.evidence.ledger.approvals import Subject, said_of, signers_then
from hil.evidence.ledger.book import Ledger, append_all, put_object, read, read_object
from hil.evidence.ledger.entries import (
    ZERO,
    Approved,
    Baseline,
    Entry,
    Explained,
    Reason,
    Sealed,
    Signed,
    Status,
    set_back,
)
from hil.model.errors import EvidenceError, Refused
from hil.model.identity import Dut
from hil.registers.instruments import RegisteredInstrument
from hil.registers.nonconformances import Filing, Nonconformance, Record, Records, Verification, Waiver
from hil.registers.signers import Signers

__all__ = [
    "ANALYSIS",
    "REPORTS",
    "VERIFICATIONS",
    "WAIVERS",
    "approvals_of",
    "baseline",
    "encoded",
    "explain",
    "keep",
    "past",
    "policy_of",
    "record",
    "record_subject_of",
    "remembered",
    "reports_ever",
    "verifications_ever",
]

ANALYSIS = "analysis"
"""The subject of the baselines that name the analysis."""
REPORTS, WAIVERS, VERIFICATIONS = "nonconformances", "waivers", "verifications"
"""The subjects of the baselines of reports, waivers and verifications."""

_Item = TypeVar("_Item")


class _Recorded(msgspec.Struct, Generic[_Item], frozen=True, kw_only=True):
    """The object of a baseline."""

    format: int
    subject: str
    entries: tuple[_Item, ...]


def encoded(subject: str, items: Sequence[object]) -> bytes:
    """Return the object of a baseline: the same bytes for the same entries."""
    return msgspec.json.encode(_Recorded(format=1, subject=subject, entries=tuple(items)), order="sorted")


def explain(reports: Path, world: World, *, by: str, text: str) -> World:
    """Enter into the ledger why everything that is gone from catalogue and registers is gone.

    Args:
        reports: the folder of reports.
        world: as it is now.
        by: who says so.
        text: why.

    Returns:
        The world in which what is gone counts no longer.

    Raises:
        EvidenceError: if the ledger cannot be written.
    """
    gone = removed_from(world.asked, world.register, world.remembered).told
    append_all(reports, [Explained(entry=each.mark, name=each.name, by=by, text=text) for each in gone])
    ledger = read(reports)
    left = tuple(each for each in world.remembered if each not in gone)
    return replace(world, remembered=left, entries=ledger.entries, head=ledger.head)


def record(reports: Path, world: World, document: Document) -> tuple[int, int]:
    """Enter into the ledger what changed since it last heard: catalogue, registers, and the status of requirements.

    What is gone from them counts on: only `explain` ends that.

    Args:
        reports: the folder of reports.
        world: what the document was computed from; nothing of it known from a cache.
        document: the document.

    Returns:
        How many baselines and how many changes of status were entered.

    Raises:
        EvidenceError: if the ledger cannot be written, or was continued since `world` was read.
    """
    subjects = {**_subjects(world.asked, world.register), ANALYSIS: (world.analysis,)}
    entered = {each.subject for each in world.entries if isinstance(each, Baseline)}
    filed = world.filed.registers
    by_subject: Mapping[str, Mapping[str, object]] = {
        REPORTS: filed.nonconformances,
        WAIVERS: filed.waivers,
        VERIFICATIONS: filed.verifications,
    }
    for subject, items in by_subject.items():
        if items or subject in entered:
            subjects[subject] = tuple(items.values())
    baselines = _changed(reports, world.entries, subjects)
    changes = list(_changes(world, document))
    if entries := [*baselines, *changes]:
        append_all(reports, entries, after=world.head or ZERO)
    return len(baselines), len(changes)


def keep(reports: Path, asked: Sequence[Asked], register: Register) -> None:
    """Enter the catalogue and the registers into the ledger, unless they stand there as they are.

    Raises:
        EvidenceError: if the ledger cannot be read or written.
    """
    if baselines := _changed(reports, read(reports).entries, _subjects(asked, register)):
        append_all(reports, baselines)


def _subjects(asked: Sequence[Asked], register: Register) -> Mapping[str, Sequence[object]]:
    in_order: list[Asked] = sorted(asked, key=lambda each: each.id)
    return {
        CATALOGUE: in_order,
        UNITS: list(register.duts.values()),
        INSTRUMENTS: list(register.instruments.values()),
    }


def _changed(reports: Path, entries: Sequence[Entry], subjects: Mapping[str, Sequence[object]]) -> list[Entry]:
    """Return baselines of what is not as it was entered last."""
    entered = {each.subject: each.object for each in entries if isinstance(each, Baseline)}
    kept = {subject: put_object(reports, encoded(subject, items)) for subject, items in subjects.items()}
    return [Baseline(subject=subject, object=name) for subject, name in kept.items() if entered.get(subject) != name]


def remembered(reports: Path, entries: Sequence[Entry]) -> tuple[Remembered, ...]:
    """Return what catalogue and registers ever had by the ledger's baselines, but for what was explained.

    Raises:
        EvidenceError: if the object of a baseline is missing, was changed, or cannot be read.
    """
    return remember(entries, lambda entry, kind: _decoded(reports, entry.object, entry.subject, kind))


def _changes(world: World, document: Document) -> Iterator[Entry]:
    known = {each.requirement: _told(each) for each in world.entries if isinstance(each, Status)}
    for row in document.rows:
        status = _status(row)
        if known.get(row.id) != _told(status):
            yield status


def _told(status: Status) -> Status:
    return msgspec.structs.replace(status, seq=-1, prev="", utc="", own="")


def _status(row: Row) -> Status:
    return Status(
        requirement=row.id,
        status=row.close_out,
        compliance=row.compliance,
        reasons=tuple(Reason(code=each.code, text=each.text) for each in row.reasons),
        fingerprint=row.fingerprint,
        evidence=tuple(each.digest for each in row.evidence if each.digest),
    )


def past(world: World, reports: Path, day: str) -> World:
    """Return what an audit at the end of a day of UTC was computed from.

    It takes the entries before the first one of a later day, the packages that were sealed by then, and the catalogue
    and registers that were entered last by then. Where an entry follows one of a later day, a clock was set back, or
    had been ahead: nobody knows which, and that is a problem.

    Args:
        world: as it is now.
        reports: the folder of reports, for the objects of the ledger.
        day: ISO 8601.

    Raises:
        Refused: where nothing was entered by then.
        EvidenceError: if an object of the ledger is missing or was changed.
    """
    entries = tuple(takewhile(lambda each: each.utc[:10] <= day, world.entries))
    back = [each for each in world.entries[len(entries) :] if each.utc[:10] <= day]
    sealed = {each.evidence for each in entries if isinstance(each, Sealed)}
    duts = baseline(reports, entries, UNITS, Dut)
    instruments = baseline(reports, entries, INSTRUMENTS, RegisteredInstrument)
    asked = baseline(reports, entries, CATALOGUE, Asked)
    analysis = baseline(reports, entries, ANALYSIS, str)
    if asked is None:
        first = next((each.utc[:10] for each in world.entries if isinstance(each, Baseline)), "")
        known = f"the first one is of {first}" if first else "there is none yet"
        raise Refused(
            f"no catalogue was recorded up to {day}: {known}",
            "hil audit --record enters the present one into the ledger; past ones cannot be reconstructed",
        )
    register = Register(
        duts={each.serial: each for each in duts or ()},
        instruments={each.id: each for each in instruments or ()},
        sha256={each.subject: each.object for each in entries if isinstance(each, Baseline)},
    )
    return replace(
        world,
        asked=asked,
        packages=tuple(each for each in world.packages if each.digest in sealed or each.named in sealed),
        cases=None,
        register=register,
        remembered=remembered(reports, entries),
        problems=(*world.problems, *map(_set_back, back[:1])),
        entries=entries,
        **_signed_then(world, reports, entries, day),
        analysis=analysis[-1] if analysis else world.analysis,
        head=_head(entries, world),
        as_of=day,
        date=day,
    )


def _signed_then(world: World, reports: Path, entries: tuple[Entry, ...], day: str) -> dict[str, Any]:
    """Return what was asked for and signed by the signers of that day; by those of now where none were kept."""
    found = baseline(reports, entries, REPORTS, Nonconformance) or ()
    waivers = baseline(reports, entries, WAIVERS, Waiver) or ()
    shown = baseline(reports, entries, VERIFICATIONS, Verification) or ()
    records = Records(
        nonconformances={each.id: each for each in found},
        waivers={each.id: each for each in waivers},
        verifications={each.id: each for each in shown},
    )
    with TemporaryDirectory() as place:
        ledger, signers = Ledger(reports=reports, entries=entries), signers_then(reports, entries, Path(place))
        if signers is None:
            policy, approvals, people = world.policy.until(day), world.filed.approvals, world.filed.people
        else:
            policy = policy_of(ledger, world.packages, signers).until(day)
            approvals, people = approvals_of(ledger, world.packages, signers, records), signers.people
    counted = tuple(each for each in approvals if each.utc[:10] <= day)
    filed = Filed(
        registers=records,
        earlier=reports_ever(reports, entries),
        shown=verifications_ever(reports, entries),
        documents={each.file: each.sha256 for item in shown for each in item.documents},  # as they were approved
        approvals=counted,
        people=people,
    )
    return {"policy": policy, "filed": filed}


def reports_ever(reports: Path, entries: Sequence[Entry]) -> tuple[Nonconformance, ...]:
    """Return every nonconformance report that was ever entered or approved, once for each content.

    Raises:
        EvidenceError: if an object of the ledger is missing or was changed.
    """
    return _ever(reports, entries, REPORTS, "NCR-", Nonconformance)


def verifications_ever(reports: Path, entries: Sequence[Entry]) -> tuple[Verification, ...]:
    """Return every verification that was ever entered or approved, as `reports_ever` does."""
    return _ever(reports, entries, VERIFICATIONS, "V-", Verification)


def _ever(reports: Path, entries: Sequence[Entry], subject: str, number: str, kind: type[_Item]) -> tuple[_Item, ...]:
    names = dict.fromkeys(each.object for each in entries if isinstance(each, Baseline) and each.subject == subject)
    found = [each for name in names for each in _decoded(reports, name, subject, kind)]
    found += [
        msgspec.json.decode(read_object(reports, each.evidence), type=kind)
        for each in entries
        if isinstance(each, Approved) and each.run.startswith(number)
    ]
    return tuple(dict.fromkeys(found))


def record_subject_of(item: Filing, operators: Mapping[str, str]) -> Subject:
    """Return what is approved of a record; the operator of the run that it speaks of cannot approve it.

    The author of a verification may, unless its requirement asks for somebody else.

    Args:
        item: the report, the waiver or the verification.
        operators: who ran what, by the names of runs.
    """
    record = Record(of=item)
    run = item.run if isinstance(item, Nonconformance) else ""
    others = (operators[run],) if operators.get(run) else ()
    return Subject(
        run=item.id,
        evidence=record.sha256,
        operator=item.by,
        content=record.content,
        others=others,
        alone=isinstance(item, Verification),
    )


def approvals_of(
    ledger: Ledger, packages: Iterable[Package], signers: Signers, records: Records
) -> tuple[Approval, ...]:
    """Return every approval of a record as it is now that counts, and whose time can be believed."""
    operators = {name: package.operator for package in packages for name in (package.run, package.folder)}
    found: list[Approval] = []
    doubted = set_back(ledger.entries)
    for item in records.every:
        author = signers.called(item.by)
        for each in said_of(ledger, record_subject_of(item, operators), signers):
            it = each.entry
            if isinstance(it, Approved) and not each.problem and it.seq not in doubted:
                found.append(
                    Approval(
                        record=it.run,
                        sha256=it.evidence,
                        role=it.role,
                        principal=it.principal,
                        utc=it.utc,
                        seq=it.seq,
                        own=author is None or author.principal == it.principal,
                    )
                )
    return tuple(found)


def policy_of(ledger: Ledger, packages: Iterable[Package], signers: Signers) -> Policy:
    """Return what the register of signers asks for, and every signature that counts and whose time can be believed."""
    of_run: dict[str, list[Entry]] = {}
    for entry in ledger.entries:
        if isinstance(entry, Approved | Signed):
            of_run.setdefault(entry.run, []).append(entry)
    kept = [entry for entry in ledger.entries if isinstance(entry, Baseline) and entry.subject == "signers"]
    found: list[tuple[str, str, str]] = []
    doubted = set_back(ledger.entries)
    for package in packages:
        if package.digest and package.run in of_run:
            subject = Subject(run=package.run, evidence=package.digest, operator=package.operator)
            its = replace(ledger, entries=tuple(sorted((*kept, *of_run[package.run]), key=lambda each: each.seq)))
            for each in said_of(its, subject, signers):
                role = each.entry.role if isinstance(each.entry, Approved) else ""
                found += [] if each.problem or each.entry.seq in doubted else [(each.entry.utc, package.digest, role)]
    return Policy(signatures=signers.required.signature, approvals=signers.required.approvals, said=tuple(found))


def _set_back(entry: Entry) -> str:
    text = "follows one of a later day: a clock was wrong, so what was recorded by then is unknown"
    return f"line {entry.seq + 1} of the ledger, of {entry.utc}, {text}"


def _head(entries: Sequence[Entry], world: World) -> str:
    """Return the head that the ledger had after these entries: what the next one names."""
    later = world.entries[len(entries) :]
    return later[0].prev if later else world.head


def baseline(reports: Path, entries: Sequence[Entry], subject: str, kind: type[_Item]) -> tuple[_Item, ...] | None:
    """Return the entries of the newest baseline of a subject; None if there is none.

    Raises:
        EvidenceError: if its object is missing, was changed, or cannot be read.
    """
    names = [each.object for each in entries if isinstance(each, Baseline) and each.subject == subject]
    return _decoded(reports, names[-1], subject, kind) if names else None


def _decoded(reports: Path, name: str, subject: str, kind: type[_Item]) -> tuple[_Item, ...]:
    try:
        found = msgspec.json.decode(read_object(reports, name), type=_Recorded[kind])  # type: ignore[valid-type]
    except msgspec.MsgspecError as error:
        raise EvidenceError(
            f"the {subject} that the ledger names cannot be read: {error}",
            "it was written by another version of hil",
        ) from error
    items: tuple[_Item, ...] = found.entries
    return items
