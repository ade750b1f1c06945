"""Reports, waivers and verifications in an audit: which of them count, what they close, and what they keep open."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from hil.audit.document import Stated
from hil.audit.inputs import Approval, Asked, Package, World
from hil.audit.reasons import Code, Reason
from hil.clock.wall import days_between
from hil.evidence.ledger.entries import Sealed
from hil.model.verdict import Verdict
from hil.registers.history import events_after
from hil.registers.nonconformances import (
    Disposition,
    Filing,
    Nonconformance,
    Record,
    UnitName,
    Verification,
    Waiver,
)

__all__ = ["DISPOSES", "VERIFIES", "WAIVES", "Accepted", "accepted"]

DISPOSES, WAIVES, VERIFIES = "nonconformance", "waiver", "verification"
"""The roles in which a report, a waiver and a verification are approved."""

_DAY_S = 86_400.0


@dataclass(frozen=True, slots=True, kw_only=True)
class _Report:
    """A report with every scope that it ever had, and who approved its present content."""

    now: Nonconformance | None
    versions: tuple[Nonconformance, ...]
    approval: Approval | None

    @property
    def number(self) -> str:
        return self.versions[-1].id

    @property
    def closed(self) -> bool:
        return self.now is not None and self.now.complete and self.approval is not None

    def names(self, requirement: str) -> bool:
        """Return whether any version named a requirement: an edit does not remove what was once named."""
        return any(requirement in each.requirements for each in self.versions)

    def why_open(self) -> str:
        told = f'{self.number} "{self.versions[-1].title}"'
        if self.now is None:
            return f"{told} is no longer in the register, and was never closed there"
        if self.now.disposition is None:
            return f"{told} is open: the disposition of {_units(self.now.units)} is undecided"
        if not self.now.complete:
            return f"{told} is open: {self.now.disposition} is decided but not done"
        return f"{told} is open: {self.now.disposition} is not approved in its present form by anyone but its author"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Waived:
    """A waiver and who approved its present content."""

    waiver: Waiver
    approval: Approval | None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Shown:
    """A verification and the approvals of its present content."""

    item: Verification
    approvals: tuple[Approval, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Accepted:
    """Every report, waiver and verification, as an audit needs them.

    Attributes:
        reports: every report that there is or was, in the order of their numbers.
        waivers: the waivers by requirement.
        shown: the verifications by requirement, the oldest first.
        undone: verifications that said FAIL once and no longer do, by requirement.
        date: the day of the audit, ISO 8601.
        sha256: SHA-256 over their contents, empty if there are none.
    """

    reports: tuple[_Report, ...] = ()
    waivers: Mapping[str, tuple[_Waived, ...]] = field(default_factory=dict)
    shown: Mapping[str, tuple[_Shown, ...]] = field(default_factory=dict)
    undone: Mapping[str, tuple[Verification, ...]] = field(default_factory=dict)
    date: str = ""
    sha256: str = ""

    def open_reports(self, requirement: str) -> Iterator[Reason]:
        """Give a reason for every report on a requirement that is not closed."""
        for report in self.reports:
            if report.names(requirement) and not report.closed:
                yield Reason(code=Code.OPEN_NCR, text=report.why_open())

    def disposed(self, requirement: str, package: Package, seal: Sealed | None) -> bool:
        """Return whether a closed report covers a FAIL in a package, and the unit has conformed since or is gone.

        Args:
            requirement: what failed.
            package: the run that failed.
            seal: its seal in the ledger; what was approved before it cannot cover it.
        """
        return any(
            report.now.disposition is not Disposition.USE_AS_IS
            and report.now.run in {package.run, package.folder}
            and _comes_after(report.approval, seal)
            for report in self._closed(requirement, package)
            if report.now and report.now.run
        )

    def stale(self, requirement: str, package: Package) -> Iterator[tuple[Code, str]]:
        """Yield why evidence of a unit no longer counts after the disposition of one of its nonconformances."""
        for report in self._closed(requirement, package):
            now = report.now
            if now is None or now.action is None or now.disposition is Disposition.USE_AS_IS:
                continue
            if now.disposition is Disposition.SCRAP:
                yield Code.STALE_DUT, f"{package.serial} was scrapped by {now.id}"
            elif package.began[:10] <= now.action.date:
                told = f"{package.serial}: {now.disposition} by {now.id}, complete on {now.action.date}"
                yield Code.STALE_DUT, f"{told}: earlier evidence has to be repeated"

    def _closed(self, requirement: str, package: Package) -> Iterator[_Report]:
        unit = UnitName(part=package.part, serial=package.serial)
        for report in self.reports:
            if report.closed and report.now and requirement in report.now.requirements and unit in report.now.units:
                yield report

    def waiver_of(self, asked: Asked, world: World) -> tuple[Waiver, Approval] | None:
        """Return the waiver that closes a requirement, and its approval; None if there is none that counts."""
        for each in self.waivers.get(asked.id, ()):
            if each.approval is not None and not self._void(each, asked, world):
                return each.waiver, each.approval
        return None

    @staticmethod
    def covers(found: tuple[Waiver, Approval] | None, package: Package, seal: Sealed | None) -> bool:
        """Return whether a waiver covers a package: of one of its units, and sealed before the approval."""
        if found is None:
            return False
        waiver, approval = found
        return UnitName(part=package.part, serial=package.serial) in waiver.units and _comes_after(approval, seal)

    def stated(self, asked: Asked, world: World) -> tuple[Stated, ...]:
        """Return what was stated of a requirement without a run, and why it does not close it, if it does not."""
        return tuple(self._stated(each, asked, world) for each in self.shown.get(asked.id, ()))

    def _stated(self, each: _Shown, asked: Asked, world: World) -> Stated:
        item, approval = each.item, _counting(each, asked)
        found = _not_shown(each, asked, world)
        reasons = tuple(Reason(code=code, text=f"{item.id}: {text}") for code, text in found)
        return Stated(
            number=item.id,
            method=item.method,
            date=item.date,
            verdict=item.verdict,
            by=item.by,
            role=item.role,
            statement=item.statement,
            documents=tuple((document.file, document.sha256) for document in item.documents),
            units=tuple(f"{unit.part} {unit.serial}" for unit in item.units),
            witness=item.witness,
            approved=_by(approval) if approval else "",
            closes=not reasons,
            reasons=reasons,
        )

    def failed(self, asked: Asked) -> Iterator[Reason]:
        """Give a reason for every verification that said FAIL, until a closed report names it as what found it.

        A later one does not take it back, and neither does taking it out of the register.
        """
        said = [each.item for each in self.shown.get(asked.id, ()) if each.item.verdict == Verdict.FAIL]
        for item in (*said, *self.undone.get(asked.id, ())):
            disposed = any(
                report.now.run == item.id and report.now.disposition is not Disposition.USE_AS_IS
                for report in self.reports
                if report.closed and report.now and asked.id in report.now.requirements
            )
            if not disposed:
                gone = "" if item in said else ", and is no longer in the register as it was"
                yield Reason(code=Code.FAILED, text=f"{item.id} said FAIL on {item.date}{gone}")

    def told(self, asked: Asked, world: World) -> Iterator[str]:
        """Give a sentence for every closed report and every waiver of a requirement."""
        for report in self.reports:
            if report.closed and report.now and report.approval and asked.id in report.now.requirements:
                yield f"{report.number}, {report.now.disposition}, {_by(report.approval)}"
        for each in self.waivers.get(asked.id, ()):
            if problem := self._void(each, asked, world):
                yield f"{each.waiver.id} closes nothing: {problem}"
            elif each.approval:
                units, until = _units(each.waiver.units), each.waiver.until
                yield f"waiver {each.waiver.id} for {units} until {until}, {_by(each.approval)}"

    def _void(self, each: _Waived, asked: Asked, world: World) -> str:
        """Return why a waiver closes nothing, empty if it counts."""
        waiver = each.waiver
        if each.approval is None:
            return "it is not approved in its present form by anyone but its author"
        if (waiver.rev, waiver.fingerprint) != (asked.rev, asked.fingerprint):
            of = f"rev {waiver.rev} ({waiver.fingerprint[:8]})"
            return f"it is for {of} of the requirement, which is now rev {asked.rev} ({asked.fingerprint[:8]})"
        if self.date > waiver.until:
            return f"it counted until {waiver.until}"
        return next(_unfit(waiver.units, asked, world), "")


def accepted(world: World) -> Accepted:
    """Return the reports and waivers of a world with the approvals of their present content."""
    filed = world.filed
    ever: dict[str, list[Nonconformance]] = {}
    for each in (*filed.earlier, *filed.registers.nonconformances.values()):
        ever.setdefault(each.id, []).append(each)
    reports = tuple(
        _Report(
            now=(now := filed.registers.nonconformances.get(number)),
            versions=tuple(versions),
            approval=_approval(now, DISPOSES, filed.approvals) if now else None,
        )
        for number, versions in sorted(ever.items())
    )
    waivers: dict[str, tuple[_Waived, ...]] = {}
    for waiver in sorted(filed.registers.waivers.values(), key=lambda each: each.id):
        its = _Waived(waiver=waiver, approval=_approval(waiver, WAIVES, filed.approvals))
        waivers[waiver.requirement] = (*waivers.get(waiver.requirement, ()), its)
    shown: dict[str, tuple[_Shown, ...]] = {}
    for item in sorted(filed.registers.verifications.values(), key=lambda each: (each.date, each.id)):
        stands = _Shown(item=item, approvals=tuple(_approvals(item, VERIFIES, filed.approvals)))
        shown[item.requirement] = (*shown.get(item.requirement, ()), stands)
    undone: dict[str, tuple[Verification, ...]] = {}
    for was in filed.shown:
        now_is = filed.registers.verifications.get(was.id)
        same = now_is is not None and (now_is.verdict, now_is.requirement) == (was.verdict, was.requirement)
        if was.verdict == Verdict.FAIL and not same:
            undone[was.requirement] = (*undone.get(was.requirement, ()), was)
    contents = [Record(of=each).sha256 for each in filed.registers.every]
    digest = hashlib.sha256("".join(contents).encode()).hexdigest() if contents else ""
    return Accepted(reports=reports, waivers=waivers, shown=shown, undone=undone, date=world.date, sha256=digest)


def _approval(item: Filing, role: str, approvals: Iterable[Approval]) -> Approval | None:
    """Return the first approval of the present content of a record."""
    return next(_approvals(item, role, approvals), None)


def _approvals(item: Filing, role: str, approvals: Iterable[Approval]) -> Iterator[Approval]:
    wanted = (item.id, Record(of=item).sha256, role)
    yield from (each for each in approvals if (each.record, each.sha256, each.role) == wanted)


def _counting(each: _Shown, asked: Asked) -> Approval | None:
    """Return the approval by which a verification counts; it may have to come from someone other than its author."""
    return next((it for it in _afterwards(each) if not (asked.independent and it.own)), None)


def _afterwards(each: _Shown) -> tuple[Approval, ...]:
    """Return the approvals since the day of a verification: what is not done yet cannot be approved."""
    return tuple(it for it in each.approvals if it.utc[:10] >= each.item.date)


def _not_shown(each: _Shown, asked: Asked, world: World) -> Iterator[tuple[Code, str]]:
    """Yield why a verification does not close its requirement."""
    item = each.item
    if item.verdict != Verdict.PASS:
        yield Code.NO_VERDICT, f"its verdict is {item.verdict}"
    if item.method != asked.method:
        yield Code.NOT_ELIGIBLE, f"it was made by {item.method}, and the requirement is verified by {asked.method}"
    yield from ((Code.NOT_ELIGIBLE, problem) for problem in _of_witness(item, asked, world))
    if (item.rev, item.fingerprint) != (asked.rev, asked.fingerprint):
        was, now = f"rev {item.rev} ({item.fingerprint[:8]})", f"rev {asked.rev} ({asked.fingerprint[:8]})"
        yield Code.SUSPECT_REQ, f"it is for {was} of the requirement, which is now {now}"
    yield from _of_documents(item, world)
    if not each.approvals:
        yield Code.AWAITING_APPROVAL, f"it is not approved in its present form in the role {VERIFIES}"
    elif not _afterwards(each):
        yield Code.AWAITING_APPROVAL, f"it was approved before {item.date}, when it was not done"
    elif _counting(each, asked) is None:
        yield (
            Code.AWAITING_APPROVAL,
            f"only {item.by}, who made it, approved it, and the requirement demands somebody else",
        )
    yield from _too_old(item, asked, world)
    yield from _of_units(item, asked, world)


def _of_witness(item: Verification, asked: Asked, world: World) -> Iterator[str]:
    """Yield why a verification lacks the required witness, by the roles of the register of signers."""
    if asked.witness and not item.witness:
        yield f"the requirement asks for a witness ({asked.witness}), and it names none"
    people = world.filed.people if item.witness else ()
    found = next((each for each in people if each.is_called(item.witness)), None)
    if found is not None and found.is_called(item.by):
        yield f"{item.witness} is {item.by}, who made it, and cannot be its witness"
    elif people and found is None:
        yield f"its witness, {item.witness}, is not in the register of signers"
    elif found is not None and asked.witness and not found.stands_for(asked.witness, item.date):
        told = f"the requirement asks for a witness ({asked.witness})"
        yield f"{told}, and {item.witness} has neither this role on {item.date} nor this name"


def _of_documents(item: Verification, world: World) -> Iterator[tuple[Code, str]]:
    for document in item.documents:
        there = world.filed.documents.get(document.file, "")
        if there != document.sha256:
            told = (
                f"has another content now, SHA-256 {there[:8]}"
                if there
                else "is not there, as a file below the folder of fixtures"
            )
            yield Code.INTEGRITY, f"{document.file} {told}; it was made with {document.sha256[:8]}"


def _too_old(item: Verification, asked: Asked, world: World) -> Iterator[tuple[Code, str]]:
    if item.date > world.date:
        yield Code.INTEGRITY, f"it is of {item.date}, which is after {world.date}"
    elif asked.max_age_s is not None and days_between(item.date, world.date) * _DAY_S > asked.max_age_s:
        yield Code.EXPIRED, f"it is of {item.date}, and evidence may be {asked.max_age_s / _DAY_S:g} days old"


def _of_units(item: Verification, asked: Asked, world: World) -> Iterator[tuple[Code, str]]:
    yield from ((Code.WRONG_DUT, problem) for problem in _unfit(item.units, asked, world))
    for unit in item.units:
        dut = world.register.duts.get(unit.serial)
        for event in events_after(dut.events, f"{item.date}T00:00:00Z") if dut else ():
            yield Code.STALE_DUT, f"{unit.serial}: {event.kind} on {event.date}: {event.text}"


def _comes_after(approval: Approval | None, seal: Sealed | None) -> bool:
    return approval is not None and seal is not None and seal.seq < approval.seq


def _unfit(units: Sequence[UnitName], asked: Asked, world: World) -> Iterator[str]:
    """Yield the units of a waiver to which the requirement does not apply."""
    for unit in units:
        dut = world.register.duts.get(unit.serial)
        if dut is None or dut.part != unit.part:
            yield f"the register has no unit {unit.serial} of the part {unit.part}"
        elif dut.simulated:
            yield f"{unit.serial} exists on simulated benches only"
        elif asked.part_numbers and unit.part not in asked.part_numbers:
            yield f"the plan is for {', '.join(asked.part_numbers)}, and {unit.serial} is {unit.part}"


def _units(units: Iterable[UnitName]) -> str:
    return ", ".join(f"{each.part} {each.serial}" for each in units)


def _by(approval: Approval) -> str:
    return f"approved by {approval.principal} as {approval.role} on {approval.utc[:10]}"
