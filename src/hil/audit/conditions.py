"""The conditions that evidence must meet to close a requirement: one function each, which says why it does not."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import replace

import msgspec

from hil.audit.accepted import Accepted
from hil.audit.inputs import Asked, Instrument, Package, Result, World
from hil.audit.ledgered import Ledgered
from hil.audit.reasons import Code, Reason
from hil.clock.wall import days_between
from hil.model.identity import Dut, Source, UnitEvent
from hil.model.verdict import Verdict
from hil.registers.history import calibration_problem, doubts, events_after
from hil.registers.instruments import RegisteredInstrument

__all__ = ["CONDITIONS", "Claim", "Conditions", "of_claim"]

_SHORT = 8
_DAY_S = 86_400.0
_REMOVED = " (since removed from the register, and the reason is not on record)"
_ELSEWHERE = frozenset({"SIMULATED", "REPLAYED", "UNKNOWN"})
"""The prefixes of a run's own reasons for bytes that did not come from hardware."""


class Claim(msgspec.Struct, frozen=True, kw_only=True):
    """The result of one package for one requirement, and what it is judged by."""

    asked: Asked
    package: Package
    result: Result
    world: World
    ledgered: Ledgered
    accepted: Accepted = msgspec.field(default_factory=Accepted)


class Conditions:
    """The conditions of the claims of one world; equal claims are judged once."""

    def __init__(self) -> None:
        self._known: dict[Hashable, tuple[Reason, ...]] = {}

    def of_claim(self, claim: Claim) -> tuple[Reason, ...]:
        """Return what `of_claim` does."""
        looked_at = _looked_at(claim)
        if looked_at not in self._known:
            self._known[looked_at] = of_claim(claim)
        return self._known[looked_at]


def _looked_at(claim: Claim) -> Hashable:
    """Return everything that conditions use of a claim; world and ledger are the same for all claims."""
    asked, result = claim.asked, claim.result
    meanings = (asked.rev, asked.fingerprint, result.rev, result.fingerprint)
    return (
        id(claim.package),
        result.verdict,
        result.reasons,
        result.of_simulation,
        result.eligible,
        result.instruments,
        asked.part_numbers,
        asked.max_age_s,
        asked.id if claim.accepted.reports else "",
        "" if result.fingerprint == asked.fingerprint else meanings,
    )


def of_claim(claim: Claim) -> tuple[Reason, ...]:
    """Return every reason why this package does not close the requirement; none means that it does."""
    return tuple(
        Reason(code=code, text=text, package=claim.package.folder)
        for condition in CONDITIONS
        for code, text in condition(claim)
    )


_Found = Iterator[tuple[Code, str]]


def _verdict(claim: Claim) -> _Found:
    """The verdict is good."""
    if not Verdict(claim.result.verdict).good:
        yield Code.NO_VERDICT, f"its verdict is {claim.result.verdict}"


def _eligibility(claim: Claim) -> _Found:
    """The run's own results say that it can close the requirement, and its source is hardware."""
    elsewhere = False
    for reason in claim.result.reasons:
        if reason.startswith("its verdict is "):
            continue
        simulated = reason.partition(":")[0] in _ELSEWHERE or reason in claim.result.of_simulation
        elsewhere |= simulated
        yield (Code.SIM_ONLY if simulated else Code.NOT_ELIGIBLE), reason
    if claim.package.source != Source.HARDWARE and not elsewhere:
        yield Code.SIM_ONLY, f"the run's source is {claim.package.source or 'unknown'}"
    if not claim.result.eligible and not claim.result.reasons:
        yield Code.NOT_ELIGIBLE, "its results say that it cannot close the requirement, without a reason"


def _meaning(claim: Claim) -> _Found:
    """The requirement means now what it meant in the run."""
    asked, result = claim.asked, claim.result
    if result.fingerprint != asked.fingerprint:
        then = f"rev {result.rev} ({result.fingerprint[:_SHORT]})" if result.fingerprint else "no recorded meaning"
        yield (
            Code.SUSPECT_REQ,
            f"it was judged against {then}, and is now rev {asked.rev} ({asked.fingerprint[:_SHORT]})",
        )


def _integrity(claim: Claim) -> _Found:
    """The package is whole, and it is the one that the ledger saw sealed."""
    package = claim.package
    sealed = claim.ledgered.evidence_of(package)
    if not package.sealed:
        yield Code.INTEGRITY, package.problem or "the package is not sealed"
    elif sealed and sealed != package.digest:
        yield (
            Code.INTEGRITY,
            (
                f"the package has the evidence digest {package.digest[:_SHORT]}, "
                f"and the ledger saw {sealed[:_SHORT]} sealed: it was rewritten"
            ),
        )
    elif package.before and package.before not in claim.ledgered.heads:
        yield (
            Code.INTEGRITY,
            "it names a head of the ledger that the ledger never had: the ledger was cut off or rewritten",
        )
    elif not sealed:
        yield Code.UNKNOWN_TO_LEDGER, "the ledger has no seal of this package"


def _times(claim: Claim) -> _Found:
    """Its times agree with the order of the ledger, and with today."""
    package, today = claim.package, claim.world.date
    if why := claim.ledgered.backwards_of(package):
        yield Code.INTEGRITY, f"the times of the run are implausible: {why}"
    if today and package.ended[:10] > today:
        yield Code.INTEGRITY, f"the run ended {package.ended[:10]}, which is after {today}: a clock is wrong"


def _signature(claim: Claim) -> _Found:
    """The package is signed, if the workspace requires it."""
    if claim.world.policy.signatures and not claim.world.policy.valid.get(claim.package.digest):
        yield Code.UNSIGNED, "the package has no valid signature, and the workspace requires one"


def _approval(claim: Claim) -> _Found:
    """The package has every approval that the workspace requires."""
    valid = claim.world.policy.valid.get(claim.package.digest, frozenset())
    for role in claim.world.policy.approvals:
        if role not in valid:
            yield Code.AWAITING_APPROVAL, f"the approval by {role} is missing"


def _unit(claim: Claim) -> _Found:
    """The unit is one that the plan is for, and is now as it was then."""
    package, known = claim.package, claim.world.register.duts
    parts = claim.asked.part_numbers
    if parts and package.part not in parts:
        yield Code.WRONG_DUT, f"the plan is for {', '.join(parts)}, and {package.serial} is {package.part}"
    dut = known.get(package.serial)
    if dut is None:
        yield Code.WRONG_DUT, f"the register has no unit {package.serial or 'without serial number'}"
        return
    if dut.part != package.part:
        yield Code.WRONG_DUT, f"{dut.serial} is {dut.part} in the register, and was {package.part} in the run"
    yield from _unit_since(dut, package, claim.ledgered.removed.events.get(dut.serial, ()))
    yield from claim.accepted.stale(claim.asked.id, package)


def _unit_since(dut: Dut, package: Package, removed: Sequence[UnitEvent]) -> _Found:
    for what, then, now in (
        ("hardware", package.hardware, dut.hardware),
        ("firmware", package.firmware, dut.firmware),
    ):
        if then != now:
            yield Code.STALE_DUT, f"{dut.serial} has {what} {now or 'not recorded'} now, and had {then or 'none'} then"
    for event in events_after(dut.events, package.began):
        yield Code.STALE_DUT, f"{dut.serial}: {event.kind} on {event.date}: {event.text}"
    for event in events_after(removed, package.began):
        yield Code.STALE_DUT, f"{dut.serial}: {event.kind} on {event.date}: {event.text}{_REMOVED}"


def _calibration(claim: Claim) -> _Found:
    """Every instrument behind the value was in calibration, and is not in doubt since."""
    package, known, removed = claim.package, claim.world.register.instruments, claim.ledgered.removed.instruments
    for name in claim.result.instruments:
        used = package.instruments.get(name, Instrument())
        entry, before = _registered(used, known), _registered(used, removed)
        told = [*_missing(name, used, entry, before), *_calibration_of(entry, package)]
        more = (each for each in _calibration_of(before, package) if each not in told)
        told += [(code, f"{text}{_REMOVED}") for code, text in more]
        yield from told or _without_late(claim, used, entry)


def _missing(name: str, used: Instrument, entry: RegisteredInstrument | None, before: object) -> _Found:
    """Yield what the register no longer has of an instrument."""
    if entry is None and (used.entry or before):
        gone = used.entry or f"the certificate {used.certificate}"
        yield Code.STALE_CAL, f"the register no longer has {gone}, which was {name} then"
    if entry and used.certificate and all(used.certificate != each.file for each in entry.certificates):
        yield Code.STALE_CAL, f"the register no longer has the certificate {used.certificate} of {entry.id}"


def _without_late(claim: Claim, used: Instrument, entry: RegisteredInstrument | None) -> _Found:
    """Yield what the certificates say against a package, leaving out those entered after it was sealed.

    A certificate of an earlier day that the ledger did not have by then proves nothing of that run. What it finds out
    of tolerance counts all the same.
    """
    seal = claim.ledgered.seal_of(claim.package)
    if entry is None or seal is None:
        return
    since, left, late = claim.ledgered.removed.since, [], []
    for each in entry.certificates:
        its = since.get((entry.id, each.number))
        known = each.file == used.certificate or (its is not None and its.seq < seal.seq)
        if known or each.date > claim.package.ended[:10]:
            left.append(each)
        else:
            entered = f"in the ledger since {its.utc[:10]}" if its else "not in the ledger yet"
            late.append(f"certificate {each.number} of {each.date}, {entered}")
    if late:
        for code, text in _calibration_of(replace(entry, certificates=tuple(left)), claim.package):
            yield code, f"{text}; {', '.join(late)}, was entered after the run was sealed, and proves nothing about it"


def _calibration_of(entry: RegisteredInstrument | None, package: Package) -> _Found:
    """Yield what the certificates of an instrument say against a package."""
    if entry is None:
        return
    if problem := calibration_problem(entry, package.began, package.ended):
        yield Code.STALE_CAL, problem
    for doubt in doubts(entry):
        if doubt.covers(package.began, package.ended):
            yield Code.CAL_RETRO, doubt.reason


def _registered(used: Instrument, known: Mapping[str, RegisteredInstrument]) -> RegisteredInstrument | None:
    """Return the entry of an instrument: by its name in the register, else by its certificate."""
    if used.entry or not used.certificate:
        return known.get(used.entry)
    return next((each for each in known.values() if used.certificate in {it.file for it in each.certificates}), None)


def _analysis(claim: Claim) -> _Found:
    """The analysis is the one that gave the verdict, or gave it again; the last replay counts."""
    package, now = claim.package, claim.world.analysis
    again = claim.ledgered.replay_of(package, now)
    if again and not again.same:
        by = "the analysis that judged it" if package.analysis == now else f"the analysis {now[:_SHORT]}"
        yield (
            Code.STALE_ANALYSIS,
            f"its replay on {again.utc[:10]} by {by} gave a different result: hil replay shows the differences",
        )
    elif not again and package.analysis != now:
        then = f"the analysis {package.analysis[:_SHORT]}" if package.analysis else "an analysis that is not recorded"
        yield (
            Code.STALE_ANALYSIS,
            (
                f"it was judged by {then} (hil {package.version or 'of an unknown version'}), "
                f"and the analysis is now {now[:_SHORT]}: replay the package"
            ),
        )


def _age(claim: Claim) -> _Found:
    """The evidence is as young as the requirement asks for."""
    allowed = claim.asked.max_age_s
    if allowed is None or not claim.package.ended or not claim.world.date:
        return
    age = days_between(claim.package.ended, claim.world.date)
    if age * _DAY_S > allowed:
        yield Code.EXPIRED, f"it is {age} days old, and may be {allowed / _DAY_S:g}"


CONDITIONS = (
    _verdict,
    _eligibility,
    _meaning,
    _integrity,
    _times,
    _signature,
    _approval,
    _unit,
    _calibration,
    _analysis,
    _age,
)
"""Every condition, in reporting order."""
