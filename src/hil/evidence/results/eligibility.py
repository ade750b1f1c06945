"""Why a run cannot close a requirement, whatever its verdict."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from hil.evidence.journal.reader import Body
from hil.evidence.results.facts import Facts
from hil.model.identity import Purpose, Source
from hil.model.verdict import Verdict

__all__ = ["reasons_against"]


def reasons_against(
    identifier: str, verdict: Verdict, results: Mapping[str, Any], events: Sequence[Body], facts: Facts
) -> list[str]:
    """Return every reason why this run cannot close the requirement; none means that it can.

    Args:
        identifier: the requirement.
        verdict: its verdict in this run.
        results: the results as far as they are derived: run, cases, interrupted, tripped, safe.
        events: the journal's events before the results.
        facts: frozen catalogue, calibration, and the run's last day.
    """
    cases = [case for case in results["cases"] if identifier in case["requirements"]]
    used = {name: source for case in cases for name, source in case["used"].items()}
    checks = [check for case in cases for check in case["checks"] if check["requirement"] == identifier]
    reasons = [] if verdict.good else [f"its verdict is {verdict}"]
    if not cases:
        reasons.append("no planned case carries it")
    if identifier not in facts.catalogue:
        reasons.append("it is not in the frozen catalogue")
    reasons.extend(_against_sources(results["run"], used))
    reasons.extend(_against_run(results))
    reasons.extend(_against_dut(results["run"], events))
    names = {name for check in checks for name in check["instruments"]} | _recorded_by(cases, events)
    names |= {name for name in used if facts.calibration.get(name, {}).get("due")}
    reasons.extend(_against_calibration(sorted(names), facts))
    return reasons


def _recorded_by(cases: Sequence[Mapping[str, Any]], events: Sequence[Body]) -> set[str]:
    recordings = {identifier for case in cases for identifier in case["recordings"]}
    begun = [event for event in events if event["kind"] == "recording" and event["recording"] in recordings]
    return {channel["instrument"] for event in begun for channel in event["channels"]}


def _against_sources(run: Body, used: Mapping[str, str]) -> Iterator[str]:
    if run.get("source") != Source.HARDWARE:
        yield f"{str(run.get('source', 'unknown')).upper()}: the run's source"
    for source in sorted({*used.values()} - {Source.HARDWARE}):
        names = ", ".join(sorted(name for name, its in used.items() if its == source))
        yield f"{source.upper()}: {names}"


def _against_run(results: Mapping[str, Any]) -> Iterator[str]:
    purpose = results["run"].get("purpose")
    if purpose not in {item for item in Purpose if item.closes}:
        yield f"the purpose {purpose} does not close requirements"
    for deviation in results["run"].get("deviations", []):
        yield f"deviation: {deviation}"
    if results["interrupted"]:
        yield "the run was interrupted"
    if results["tripped"]:
        yield "the envelope tripped"
    if results["safe"] is not True:
        yield "the bench was not proven safe at the end"


def _against_dut(run: Body, events: Sequence[Body]) -> Iterator[str]:
    if not run.get("dut", {}).get("serial"):
        yield "the device under test has no serial number"
    for event in events:
        if event["kind"] == "gate" and not event["ok"]:
            yield f"readiness gate {event['name']}: {event['detail']}"


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
