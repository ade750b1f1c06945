"""The engine: the status of every requirement, from catalogue, registers, ledger and packages; it reads nothing."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from hil.audit.accepted import Accepted, accepted
from hil.audit.conditions import Claim, Conditions
from hil.audit.document import (
    FORMAT,
    CloseOut,
    Compliance,
    Document,
    Evidence,
    Inputs,
    OtherCode,
    Planning,
    Row,
    summary_of,
)
from hil.audit.elsewhere import by_children, on_hardware
from hil.audit.gaps import exceptions_of, gaps_of, problems_of
from hil.audit.inputs import Approval, Asked, Package, World, catalogue_digest
from hil.audit.ledgered import Ledgered, ledgered
from hil.audit.reasons import Code, Reason
from hil.audit.remembered import removed_from
from hil.model.identity import Purpose, Source
from hil.model.verdict import Verdict
from hil.registers.nonconformances import Waiver
from hil.requirements.requirement import Kind, Method

__all__ = ["audit"]

_RANK = {code: rank for rank, code in enumerate(Code)}
_FAILS = frozenset({Code.FAILED, Code.SUPERSEDED_BY_FAIL})
_HARDWARE = frozenset({Source.HARDWARE, ""})
"""The sources whose FAIL counts; one that is not known may be hardware."""


def audit(world: World) -> Document:
    """Return the document: a row per requirement that is asked for, closed only if every condition holds."""
    book = replace(
        ledgered(world.entries, world.packages, world.policy, world.head),
        damage="".join(world.problems[:1]),
        removed=removed_from(world.asked, world.register, world.remembered),
    )
    filed = accepted(world)
    packages = sorted(world.packages, key=book.place_of)
    present = frozenset(each.id for each in world.asked if not each.withdrawn)
    by = _Judging(book=book, filed=filed, world=world, present=present)
    asked = _asked(by, packages)
    children = _children(asked)
    by_requirement: dict[str, list[Package]] = defaultdict(list)
    for package in packages:
        for identifier in package.results:
            by_requirement[identifier].append(package)
    planned = _Planned(world)
    rows: dict[str, Row] = {}
    for identifier in _from_below(asked, children):
        claims = tuple(by.claim(asked[identifier], each) for each in by_requirement[identifier])
        below = [rows[child] for child in children[identifier] if child in rows]
        rows[identifier] = _row(asked[identifier], claims, below, by, planned(identifier))
    ordered = tuple(rows[identifier] for identifier in asked)
    gaps = tuple(sorted(gaps_of(ordered, packages, world)))
    return Document(
        format=FORMAT,
        workspace=world.name,
        as_of=world.as_of,
        version=world.version,
        inputs=Inputs(
            catalogue=catalogue_digest(world.asked),
            duts=world.register.sha256.get("units", ""),
            instruments=world.register.sha256.get("instruments", ""),
            records=filed.sha256,
            analysis=world.analysis,
            ledger=world.head,
            entries=len(world.entries),
            packages={each.folder: each.digest for each in packages},
        ),
        summary=summary_of(ordered, gaps),
        rows=ordered,
        gaps=gaps,
        problems=(*world.problems, *problems_of(packages, book)),
        exceptions=tuple(sorted(exceptions_of(packages))),
        others=tuple(sorted(OtherCode(package=each.folder, text=told) for each in packages for told in each.others)),
    )


_WITHDRAWN = Reason(
    code=Code.WITHDRAWN, text="it was withdrawn or removed from the catalogue, and the reason is not on record"
)
_WITHDRAWN_FAILED = Reason(
    code=Code.WITHDRAWN, text="it was withdrawn or removed from the catalogue after a FAIL: sign what was done"
)


def _asked(by: _Judging, packages: Iterable[Package]) -> dict[str, Asked]:
    """Return the requirements that have a row, by id: those that are asked for, and those that something is left of."""
    present = {each.id: each for each in by.world.asked if each.id in by.present}
    return dict(sorted({**_failed(by, packages), **by.book.removed.asked, **present}.items()))


def _failed(by: _Judging, packages: Iterable[Package]) -> dict[str, Asked]:
    """Return the requirements that are gone and failed on hardware, and what was done about it is not signed."""
    found: dict[str, Asked] = {}
    known = {each.id: each for each in by.world.asked}
    for package in packages:
        for identifier in package.results.keys() - by.present:
            its = package.results[identifier]
            unknown = Asked(id=identifier, rev=its.rev, fingerprint=its.fingerprint, text="", kind="", method="")
            claim = by.claim(known.get(identifier, unknown), package)
            if counts_as_fail(claim) and not _disposed(claim, by):
                found[identifier] = claim.asked
    return found


def _taken_out(asked: Asked, by: _Judging) -> Iterator[Reason]:
    removed = by.book.removed
    if asked.id not in by.present:
        yield _WITHDRAWN if asked.id in removed.asked else _WITHDRAWN_FAILED
    for each in removed.parents.get(asked.id, ()):
        yield Reason(code=Code.WITHDRAWN, text=f"{each} is no longer below it, and the reason is not on record")


def _children(asked: Mapping[str, Asked]) -> dict[str, tuple[str, ...]]:
    found: dict[str, list[str]] = {identifier: [] for identifier in asked}
    for each in asked.values():
        for parent in each.parents:
            if parent in found:
                found[parent].append(each.id)
    return {identifier: tuple(sorted(below)) for identifier, below in found.items()}


def _from_below(asked: Mapping[str, Asked], children: Mapping[str, Sequence[str]]) -> Iterator[str]:
    """Yield every requirement after those below it, without recursion: a chain may be as long as the catalogue.

    Requirements that were taken out at different times may stand in a circle; they come last.
    """
    waiting = {identifier: len(below) for identifier, below in children.items()}
    ready = [identifier for identifier, count in waiting.items() if not count]
    while ready:
        identifier = ready.pop()
        yield identifier
        for parent in asked[identifier].parents:
            if parent in waiting:
                waiting[parent] -= 1
                if not waiting[parent]:
                    ready.append(parent)
    yield from (identifier for identifier, count in waiting.items() if count > 0)


class _Planned:
    """Which cases carry a requirement by the sources of the plans; None where only the packages can tell."""

    def __init__(self, world: World) -> None:
        self._carried: dict[str, list[str]] = defaultdict(list)
        for case in world.cases or ():
            for identifier in case.requirements:
                self._carried[identifier].append(case.case)
        self._all_told = all(case.requirements or not case.marked for case in world.cases or ())
        self._known = world.cases is not None

    def __call__(self, identifier: str) -> tuple[str, ...] | None:
        cases = tuple(self._carried.get(identifier, ()))
        return cases if cases or (self._known and self._all_told) else None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Judging:
    """What every row is judged by."""

    book: Ledgered
    filed: Accepted
    world: World
    present: frozenset[str]
    conditions: Conditions = field(default_factory=Conditions)

    def claim(self, asked: Asked, package: Package) -> Claim:
        """Return what a package says of a requirement, and what that is judged by."""
        result = package.results[asked.id]
        return Claim(
            asked=asked,
            package=package,
            result=result,
            world=self.world,
            ledgered=self.book,
            accepted=self.filed,
        )


def _row(
    asked: Asked, claims: Sequence[Claim], below: Sequence[Row], by: _Judging, planned: tuple[str, ...] | None
) -> Row:
    evidence = tuple(_evidence(each, by.conditions.of_claim(each)) for each in claims)
    by_itself = asked.kind != Kind.PARENT
    waived = by.filed.waiver_of(asked, by.world) if by_itself else None
    against = tuple(_against(asked, claims, evidence, by, waived)) if by_itself else ()
    stated = by.filed.stated(asked, by.world) if by_itself else ()
    shown = next((each for each in reversed(stated) if each.closes), None)
    own = against = (*_taken_out(asked, by), *against)
    inherited = tuple(_inherited(below))
    closing = next((each for each in reversed(evidence) if each.closes), None)
    if waived and (closing or shown) and not _is_needed(asked, waived, claims, by):
        waived = None
    if by_itself and closing is None and shown is None and waived is None:
        own += tuple(reason for each in _speaking(evidence) for reason in each.reasons)
        own += tuple(reason for each in stated for reason in each.reasons)
    if not by_itself and not below:
        own += (Reason(code=Code.NO_CHILDREN, text="it is met by the requirements below it, and there are none"),)
    reasons = (*_in_order(own), *inherited)
    would = (
        on_hardware(claims, [each.reasons for each in evidence], against, below) if by_itself else by_children(below)
    )
    told = next((each.cases for each in reversed(evidence) if each.cases), ())
    still = tuple(case for case in told if planned is None or case.partition("[")[0] in planned)
    return Row(
        id=asked.id,
        rev=asked.rev,
        fingerprint=asked.fingerprint,
        text=asked.text,
        kind=asked.kind,
        method=asked.method,
        source=asked.source,
        anomaly=asked.anomaly,
        parents=asked.parents,
        children=tuple(row.id for row in below),
        level=asked.level,
        stage=asked.stage,
        planning=Planning(
            plan=asked.plan, document=asked.document, issue=asked.issue, place=asked.place, cases=still or planned or ()
        ),
        evidence=evidence,
        stated=stated,
        compliance=_compliance(reasons, evidence, below, by_itself=by_itself, waived=waived is not None),
        close_out=CloseOut.OPEN if reasons else CloseOut.CLOSED,
        reasons=reasons,
        on_hardware=would if reasons else None,
        closed_by="" if reasons else closing.package if closing else shown.number if shown else "",
        waiver=waived[0].id if waived and not reasons else "",
        records=tuple(by.filed.told(asked, by.world)),
    )


def _evidence(claim: Claim, reasons: tuple[Reason, ...]) -> Evidence:
    package, result = claim.package, claim.result
    return Evidence(
        package=package.folder,
        digest=package.digest,
        date=package.ended,
        verdict=result.verdict,
        cases=result.cases,
        rev=result.rev,
        source=package.source,
        purpose=package.purpose,
        dut=package.serial,
        eligible=result.eligible,
        closes=not reasons,
        reasons=reasons,
        exceptions=tuple(instrument for instrument, _ in package.exceptions),
    )


def _speaking(evidence: Sequence[Evidence]) -> Iterator[Evidence]:
    """Yield the evidence whose reasons a requirement has: of runs not on hardware, the newest of each unit.

    They can neither close it nor speak against it, and older ones would only bury what keeps it open now.
    """
    seen: set[tuple[str, str]] = set()
    for each in reversed(evidence):
        trial = each.source not in _HARDWARE
        if not trial or (each.source, each.dut) not in seen:
            yield each
        if trial:
            seen.add((each.source, each.dut))


def _is_needed(asked: Asked, waived: tuple[Waiver, Approval], claims: Sequence[Claim], by: _Judging) -> bool:
    """Return whether a FAIL would keep a requirement open without its waiver."""
    return any(by.filed.failed(asked)) or any(
        counts_as_fail(claim)
        and not _disposed(claim, by)
        and by.filed.covers(waived, claim.package, by.book.seal_of(claim.package))
        for claim in claims
    )


def _disposed(claim: Claim, by: _Judging) -> bool:
    """Return whether the disposition of a FAIL is approved."""
    package = claim.package
    return by.book.disposed(package) or by.filed.disposed(claim.asked.id, package, by.book.seal_of(package))


def _against(
    asked: Asked,
    claims: Sequence[Claim],
    evidence: Sequence[Evidence],
    by: _Judging,
    waived: tuple[Waiver, Approval] | None,
) -> Iterator[Reason]:
    """Yield what keeps a requirement open regardless, so that leaving evidence out cannot close it."""
    book = by.book
    yield from by.filed.open_reports(asked.id)
    yield from by.filed.failed(asked) if waived is None else ()
    if not claims and waived is None and not by.filed.shown.get(asked.id):
        yield Reason(code=Code.NO_EVIDENCE, text=_no_evidence(asked))
    good = [place for place, each in enumerate(evidence) if Verdict(each.verdict).good and each.source in _HARDWARE]
    for place, claim in enumerate(claims):
        covered = by.filed.covers(waived, claim.package, book.seal_of(claim.package))
        if counts_as_fail(claim) and not covered and not _disposed(claim, by):
            yield _fail(claim, later=bool(good) and place > good[0], earlier=bool(good) and place < good[-1])
        if _doubtful(claim) and claim.package.problem:
            yield Reason(code=Code.INTEGRITY, text=claim.package.problem, package=claim.package.folder)
    if book.damage:
        text = f"the ledger cannot show which packages are missing: {book.damage}"
        yield Reason(code=Code.INTEGRITY, text=text)
    for each in book.missing:
        yield Reason(code=Code.MISSING_PACKAGE, text=each.text, package=each.run)


def counts_as_fail(claim: Claim) -> bool:
    """Return whether a result counts against its requirement: a FAIL from hardware, for a purpose that can close."""
    package = claim.package
    serious = package.purpose in {Purpose.QUALIFICATION, Purpose.ACCEPTANCE, ""}
    return claim.result.failed and package.source in _HARDWARE and serious


def _doubtful(claim: Claim) -> bool:
    """Return whether a package that is not whole may hide a FAIL: unless the ledger saw that it was not hardware."""
    seal = claim.ledgered.seals.get(claim.package.run) or claim.ledgered.seals.get(claim.package.folder)
    source = seal.source if seal else claim.package.source
    return not claim.package.sealed and source in _HARDWARE


def _fail(claim: Claim, *, later: bool, earlier: bool) -> Reason:
    folder, day = claim.package.folder, claim.package.ended[:10]
    if later:
        text = f"it failed on {day}, after evidence that was good"
        return Reason(code=Code.SUPERSEDED_BY_FAIL, text=text, package=folder)
    if earlier:
        text = f"it failed on {day}, and what was done about it is not signed"
        return Reason(code=Code.OPEN_NCR, text=text, package=folder)
    return Reason(code=Code.FAILED, text=f"it failed on {day}", package=folder)


def _no_evidence(asked: Asked) -> str:
    if asked.method != Method.TEST:
        return f"it is verified by {asked.method}, and neither a package nor a verification shows that"
    return "no package has evidence for it"


def _inherited(below: Iterable[Row]) -> Iterator[Reason]:
    """Yield what the requirements below keep open; a FAIL is passed all the way up, with its requirement."""
    for row in below:
        if not row.closed:
            codes = ", ".join(dict.fromkeys(reason.code for reason in row.reasons))
            yield Reason(code=Code.CHILD_OPEN, text=f"{row.id} is open: {codes}", origin=row.id)
        for reason in row.reasons:
            if reason.code in _FAILS:
                yield Reason(code=reason.code, text=reason.text, package=reason.package, origin=reason.origin or row.id)


def _in_order(reasons: Iterable[Reason]) -> list[Reason]:
    """Return reasons by their codes, each sentence once, with the newest package that it is true of."""
    newest = {(reason.code, reason.text): reason for reason in reasons}
    return sorted(newest.values(), key=lambda reason: (_RANK[reason.code], reason.text))


def _compliance(
    reasons: Sequence[Reason], evidence: Sequence[Evidence], below: Sequence[Row], *, by_itself: bool, waived: bool
) -> Compliance:
    if not reasons:
        met = not waived and all(row.compliance is Compliance.YES for row in below)
        return Compliance.YES if met else Compliance.PARTIAL
    if any(reason.code in _FAILS for reason in reasons):
        return Compliance.NO
    own = any(Verdict(each.verdict).good and each.source == Source.HARDWARE for each in evidence)
    if own or (not by_itself and any(row.compliance is not Compliance.NO for row in below)):
        return Compliance.PARTIAL
    return Compliance.NO
