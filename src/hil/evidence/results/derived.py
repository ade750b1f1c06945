"""Derivation of the results from the journal's events and the frozen files; nothing is entered by hand."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import msgspec

from hil.evidence.attempts import abandoned
from hil.evidence.events import Check, Event
from hil.evidence.journal.reader import JournalReading
from hil.evidence.results.eligibility import Eligibility, sources_of
from hil.evidence.results.facts import Facts, FrozenCalibration, FrozenRequirement, facts_of
from hil.evidence.results.outcome import (
    CHANNELS,
    FORMAT,
    AttemptOutcome,
    CaseOutcome,
    CaseVerdict,
    HoldOutcome,
    Outcome,
    RequirementOutcome,
    StepOutcome,
    rule,
    silence,
)
from hil.evidence.state import CaseState, RunState, before_results, fold, standing
from hil.model.identity import Purpose, Source
from hil.model.verdict import Verdict, worst

__all__ = ["BY_CASES", "Sources", "derive", "reasons_against", "results_of"]

BY_CASES = frozenset({"test", "inspection"})
"""The methods whose requirements are verified by cases."""


_REASONS_ONLY = 2
"""Last format that lists reasons against closing a requirement instead of conditions."""

_WITHOUT_GIVEN_UP = 2
"""Last format whose results do not include the attempts given up at an interruption."""

_NOTHING = FrozenRequirement()
_NO_RECORD = FrozenCalibration()


@dataclass(frozen=True, kw_only=True)
class Sources:
    """The sources of everything derived in a package; derived values are computed on first use.

    Attributes:
        folder: the run's folder.
        reading: its journal.
    """

    folder: Path
    reading: JournalReading

    @cached_property
    def state(self) -> RunState:
        """The state after all events, including those after the results."""
        return fold(self.reading.events)

    @cached_property
    def facts(self) -> Facts:
        """What was frozen.

        Raises:
            DamagedFile: if a frozen file cannot be read.
        """
        return facts_of(self.folder, self.reading)

    def results(self, form: int) -> Outcome:
        """Return the results in a format."""
        return derive(self.reading.events, self.facts, content_digest=self.reading.content_digest, form=form)


def results_of(folder: Path, reading: JournalReading, form: int = FORMAT) -> Outcome:
    """Derive the results of a run's folder from its journal and its frozen files, in a format.

    Raises:
        EvidenceError: if a frozen file cannot be read.
    """
    return Sources(folder=folder, reading=reading).results(form)


def derive(events: Iterable[Event], facts: Facts, *, content_digest: str, form: int = FORMAT) -> Outcome:
    """Derive cases, requirements and the run's verdict; none is better than its evidence.

    A planned case that did not end is ABORTED if it began and NOT_RUN if it did not. A requirement's verdict is the
    worst of all planned cases that carry it. Events from `results` on are ignored.
    """
    happened = tuple(before_results(events))
    state = fold(standing(happened))
    if form > _WITHOUT_GIVEN_UP and state.resumptions:
        state.give_up(abandoned(happened))
    cases = tuple(_case(case, state, facts, form) for case in state.cases.values())
    carried: dict[str, list[CaseOutcome]] = {}
    for case in cases:
        for identifier in case.requirements:
            carried.setdefault(identifier, []).append(case)
    checks = _by_requirement(check for case in cases for check in case.checks)
    eligibility = Eligibility(state, facts) if form > _REASONS_ONLY else None
    return Outcome(
        format=form,
        run=state.run and msgspec.structs.replace(state.run, deviations=state.deviations),
        interrupted=state.interrupted,
        tripped=state.trip is not None,
        safe=state.safe,
        content_digest=content_digest,
        cases=cases,
        requirements=tuple(
            _requirement(each, carried.get(each, ()), checks.get(each, ()), state, facts, eligibility)
            for each in sorted(carried.keys() | _due(facts))
        ),
        counts=dict(Counter(case.verdict for case in cases)),
        verdict=_verdict_of_run(cases, state),
        conditions=None if eligibility is None else eligibility.of_run,
    )


def _case(case: CaseState, state: RunState, facts: Facts, form: int) -> CaseOutcome:
    checked = _by_requirement(case.checks)
    identifiers = sorted({*case.planned.requirements, *checked, *case.earlier})
    requirements = {each: _within(each, case, checked.get(each, ()), facts, form) for each in identifiers}
    return CaseOutcome(
        case=case.planned.case,
        title=case.planned.title,
        plan=case.planned.plan,
        verdict=worst([*case.own_verdicts, *requirements.values()]),
        reasons=_reasons(case),
        requirements=requirements,
        duration=case.end.duration if case.end else None,
        attempts=_attempts(case),
        used=_used(case, state, form),
        checks=tuple(case.checks),
        steps=tuple(
            StepOutcome(
                path=each.begun.path,
                number=each.begun.number,
                outcome=each.ended.outcome if each.ended else None,
                duration=each.ended.duration if each.ended else None,
            )
            for each in case.steps
        ),
        recordings=tuple(case.recordings),
        holds=_holds(case) if form > 1 else None,
        repeatable=case.planned.repeatable if form > _WITHOUT_GIVEN_UP else "",
    )


def _by_requirement(checks: Iterable[Check]) -> dict[str, list[Check]]:
    found: dict[str, list[Check]] = {}
    for check in checks:
        found.setdefault(check.requirement, []).append(check)
    return found


def _used(case: CaseState, state: RunState, form: int) -> Mapping[str, str]:
    used = case.end.used if case.end else {}
    return sources_of(used, state) if form > _REASONS_ONLY else used


def _reasons(case: CaseState) -> tuple[str, ...]:
    """Return why a case ended as it did, with the attempts that count; if it ended, its last event names them, too."""
    counted = () if case.planned.repeatable else tuple(each.counts for each in case.given_up)
    return tuple(dict.fromkeys((*counted, *case.reasons)))


def _attempts(case: CaseState) -> tuple[AttemptOutcome, ...]:
    """Return every attempt; those given up come before the last one, which replaced them."""
    ended = [
        AttemptOutcome(
            attempt=each.begun.attempt,
            verdict=each.ended.verdict if each.ended else None,
            reasons=each.ended.reasons if each.ended else (),
        )
        for each in case.attempts
    ]
    if not case.given_up:
        return tuple(ended)
    left = [AttemptOutcome(attempt=0, verdict=None, reasons=(each.text,), read=each.read) for each in case.given_up]
    everyone = [*ended[:-1], *left, *ended[-1:]]
    return tuple(msgspec.structs.replace(each, attempt=number) for number, each in enumerate(everyone, 1))


def _holds(case: CaseState) -> tuple[HoldOutcome, ...]:
    return tuple(
        HoldOutcome(
            t=each.begun.t,
            duration=each.ended.duration if each.ended else None,
            by=each.begun.by,
            text=each.begun.text,
        )
        for each in case.holds
    )


def _within(identifier: str, case: CaseState, checks: Sequence[Check], facts: Facts, form: int) -> Verdict:
    """Return one case's verdict on one requirement: the worst of its checks, of the case's own word, and of its end."""
    own = case.own_verdict
    entry = facts.catalogue.get(identifier, _NOTHING)
    limits = entry.limits
    due = {(limit.parameter, of) for limit in limits for of in limit.of or (None,)}
    asked = form > _REASONS_ONLY and entry.records is not None
    recorded = not asked or any(check.parameter == CHANNELS for check in checks)
    found = [*case.earlier.get(identifier, ()), *case.left_verdicts, *(check.verdict for check in checks)]
    if not case.all_begun:
        found.append(Verdict.NOT_RUN)
    if case.end is not None and identifier in case.end.requirements:
        found.append(case.end.requirements[identifier])
    return rule(
        found,
        missing=not checks or not due <= {(check.parameter, check.of) for check in checks} or not recorded,
        silent=silence([limit.parameter for limit in limits], dut=case.dut_fault, undecided=case.undecided),
        taken_out=own is Verdict.NOT_RUN,
        ended=own,
    )


def _requirement(
    identifier: str,
    cases: Sequence[CaseOutcome],
    checks: Sequence[Check],
    state: RunState,
    facts: Facts,
    eligibility: Eligibility | None,
) -> RequirementOutcome:
    entry = facts.catalogue.get(identifier, _NOTHING)
    verdict = worst(case.requirements[identifier] for case in cases) if cases else Verdict.NOT_RUN
    own = None if eligibility is None else eligibility.of_requirement(identifier, verdict, cases, checks)
    reasons = (
        tuple(reasons_against(identifier, verdict, cases, state, facts))
        if eligibility is None or own is None
        else eligibility.reasons_in(own)
    )
    return RequirementOutcome(
        id=identifier,
        rev=entry.rev,
        text=entry.text,
        kind=entry.kind,
        method=entry.method,
        source=entry.source,
        verdict=verdict,
        cases=tuple(CaseVerdict(case=case.case, verdict=case.requirements[identifier]) for case in cases),
        checks=len(checks),
        eligible=not reasons,
        reasons=reasons,
        conditions=own,
    )


def _due(facts: Facts) -> set[str]:
    """Return the requirements that cases have to verify, whether or not a planned case does."""
    return {
        identifier
        for identifier, entry in facts.catalogue.items()
        if entry.method in BY_CASES and entry.kind != "parent" and not entry.withdrawn
    }


def _verdict_of_run(cases: Iterable[CaseOutcome], state: RunState) -> Verdict:
    verdicts = [worst(case.verdict for case in cases)]
    if state.interrupted:
        verdicts.append(Verdict.ABORTED)
    never_made_safe = state.armed and state.safe is None and not state.interrupted
    if state.trip or state.safe is False or never_made_safe:
        verdicts.append(Verdict.ERROR)
    return worst(verdicts)


def reasons_against(
    identifier: str, verdict: Verdict, cases: Sequence[CaseOutcome], state: RunState, facts: Facts
) -> list[str]:
    """Return every reason, as of formats 1 and 2, why a run cannot close the requirement; none means that it can.

    Args:
        identifier: the requirement.
        verdict: its verdict in this run.
        cases: the cases that carry it.
        state: the state after the events before the results.
        facts: frozen catalogue, calibration, and the run's last day.
    """
    used = {name: source for case in cases for name, source in case.used.items()}
    checks = [check for case in cases for check in case.checks if check.requirement == identifier]
    reasons = [] if verdict.good else [f"its verdict is {verdict}"]
    if not cases:
        reasons.append("no planned case carries it")
    if identifier not in facts.catalogue:
        reasons.append("it is not in the frozen catalogue")
    reasons.extend(_against_sources(state, used))
    reasons.extend(_against_run(state))
    reasons.extend(_against_dut(state))
    names = {name for check in checks for name in check.instruments} | _recorded_by(cases, state)
    names |= {name for name in used if facts.calibration.get(name, _NO_RECORD).due}
    reasons.extend(_against_calibration(sorted(names), facts))
    return reasons


def _recorded_by(cases: Sequence[CaseOutcome], state: RunState) -> set[str]:
    begun = [state.recordings[name] for case in cases for name in case.recordings]
    return {channel.instrument for event in begun for channel in event.channels}


def _against_sources(state: RunState, used: Mapping[str, str]) -> Iterator[str]:
    source = state.run.source if state.run else None
    if source is not Source.HARDWARE:
        yield f"the run's source is {source or 'unknown'}"
    for each in sorted({*used.values()} - {Source.HARDWARE}):
        names = ", ".join(sorted(name for name, its in used.items() if its == each))
        yield f"{each.upper()}: {names}"


def _against_run(state: RunState) -> Iterator[str]:
    purpose: Purpose | None = state.run.purpose if state.run else None
    if purpose is None or not purpose.closes:
        yield f"the purpose {purpose} does not close requirements"
    for deviation in state.deviations:
        yield f"deviation: {deviation}"
    if state.interrupted:
        yield "the run was interrupted"
    if state.trip:
        yield "the envelope tripped"
    if state.safe is not True:
        yield "the bench was not proven safe at the end"


def _against_dut(state: RunState) -> Iterator[str]:
    if state.run is None or not state.run.dut.serial:
        yield "the device under test has no serial number"
    for gate in state.gates:
        if not gate.ok:
            yield f"readiness gate {gate.name}: {gate.detail}"


def _against_calibration(instruments: Sequence[str], facts: Facts) -> Iterator[str]:
    for name in instruments:
        record = facts.calibration.get(name, _NO_RECORD)
        if record.dut:
            continue
        if not record.due:
            yield f"{name} has no calibration record"
        elif facts.date > record.due:
            yield f"{name} was out of calibration: due {record.due}, used {facts.date}"
