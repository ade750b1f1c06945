"""Why a run cannot close a requirement, whatever its verdict."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from hil.evidence.results.facts import Facts
from hil.evidence.results.outcome import CaseOutcome
from hil.evidence.state import RunState
from hil.model.identity import Purpose, Source
from hil.model.verdict import Verdict

__all__ = ["reasons_against"]


def reasons_against(
    identifier: str, verdict: Verdict, cases: Sequence[CaseOutcome], state: RunState, facts: Facts
) -> list[str]:
    """Return every reason why this run cannot close the requirement; none means that it can.

    Args:
        identifier: the requirement.
        verdict: its verdict in this run.
        cases: the cases that carry it.
        state: what the events before the results tell.
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
    names |= {name for name in used if facts.calibration.get(name, {}).get("due")}
    reasons.extend(_against_calibration(sorted(names), facts))
    return reasons


def _recorded_by(cases: Sequence[CaseOutcome], state: RunState) -> set[str]:
    begun = [state.recordings[name] for case in cases for name in case.recordings]
    return {channel.instrument for event in begun for channel in event.channels}


def _against_sources(state: RunState, used: Mapping[str, str]) -> Iterator[str]:
    source = state.run.source if state.run else None
    if source is not Source.HARDWARE:
        yield f"{(source or 'unknown').upper()}: the run's source"
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
        record = facts.calibration.get(name, {})
        if record.get("dut"):
            continue
        due = record.get("due")
        if not due:
            yield f"{name} has no calibration record"
        elif facts.date > due:
            yield f"{name} was out of calibration: due {due}, used {facts.date}"
