"""Results: what the journal's events and the frozen catalogue say, derived and never typed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import Any

from hil.evidence.journal.reader import Body, JournalReading
from hil.evidence.journal.standing import standing_bodies
from hil.evidence.results.eligibility import reasons_against
from hil.evidence.results.facts import Facts, facts_of
from hil.model.verdict import Verdict, worst

__all__ = ["BY_CASES", "FORMAT", "Derived", "derive", "results_of"]

FORMAT = 2
"""What is written; format 1 did not tell when the bench was held in the course of a case."""

BY_CASES = frozenset({"test", "inspection"})
"""The methods whose requirements are verified by cases."""

Derived = dict[str, Any]
"""The content of `data/results.json`."""

_HOLDS = frozenset({"hold", "hold-end"})
_OVERRIDING = frozenset({Verdict.ERROR, Verdict.ABORTED, Verdict.NOT_RUN})


@dataclass(slots=True, kw_only=True)
class _Case:
    """What the events say of one planned case; checks and steps are those of the last attempt.

    Nothing declares a retry, so that no attempt replaces another: `earlier` keeps what those before the last one came
    to, and `times` how often the case was planned.
    """

    planned: Mapping[str, Any]
    times: int = 1
    earlier: dict[str, list[Verdict]] = field(default_factory=dict)
    begun: bool = False
    end: Body | None = None
    attempts: list[dict[str, Any]] = field(default_factory=list)
    checks: list[Body] = field(default_factory=list)
    steps: list[dict[str, Any]] = field(default_factory=list)
    recordings: list[str] = field(default_factory=list)
    holds: list[dict[str, Any]] = field(default_factory=list)
    not_run: list[str] = field(default_factory=list)
    dut_fault: bool = False

    def take(self, event: Body) -> None:
        """Take one event that names this case."""
        match event["kind"]:
            case "case":
                self._keep_earlier()
                self.begun, self.end = True, None
                self.attempts.append({"attempt": event["attempt"], "verdict": None, "reasons": []})
                self.checks, self.steps, self.dut_fault = [], [], False
            case "case-end":
                self.end = event
                if self.attempts:
                    self.attempts[-1] |= {"verdict": event["verdict"], "reasons": event["reasons"]}
            case "check":
                self.checks.append(event)
            case "step":
                step = {"path": event["path"], "number": event["number"], "outcome": None, "duration": None}
                self.steps.append(step)
            case "step-end":
                self._end_step(event)
            case "recording":
                self.recordings.append(event["recording"])
            case "fault":
                self.dut_fault = self.dut_fault or bool(event["dut"])
            case "not-run":
                self.not_run.append(event["reason"])

    def take_hold(self, event: Body) -> None:
        """Take that the bench was held in the course of this case, or released."""
        if event["kind"] == "hold":
            self.holds.append({"t": event["t"], "duration": None, "by": event["by"], "text": event["text"]})
        elif self.holds:
            self.holds[-1]["duration"] = event["duration"]

    def own_verdict(self) -> Verdict:
        """Return how the case ended, whatever its checks say."""
        if self.end is not None:
            return Verdict(self.end["verdict"])
        return Verdict.ABORTED if self.begun else Verdict.NOT_RUN

    def own_verdicts(self) -> list[Verdict]:
        """Return how every attempt ended, and NOT_RUN for one that is missing."""
        before = [Verdict(item["verdict"] or Verdict.ABORTED) for item in self.attempts[:-1]]
        return [*before, self.own_verdict(), *([] if self.all_begun() or not self.begun else [Verdict.NOT_RUN])]

    def reasons(self) -> list[str]:
        """Return why the case ended so."""
        if self.end is not None:
            return list(self.end["reasons"])
        if self.begun:
            return ["the run ended within this case"]
        return self.not_run or ["the run ended before this case"]

    def plan_again(self, planned: Mapping[str, Any]) -> None:
        """Take in that two bodies have this case's id: what one of them carries, both do."""
        self.times += 1
        self.planned = {**self.planned, "requirements": [*self.planned["requirements"], *planned["requirements"]]}

    def all_begun(self) -> bool:
        """Return whether there was an attempt for every time that it was planned."""
        return len(self.attempts) >= self.times

    def _keep_earlier(self) -> None:
        if self.begun:
            for check in self.checks:
                self.earlier.setdefault(check["requirement"], []).append(Verdict(check["verdict"]))
            for identifier in self.planned["requirements"]:
                said = self.end["requirements"].get(identifier) if self.end else None
                self.earlier.setdefault(identifier, []).append(Verdict(said) if said else self.own_verdict())

    def _end_step(self, event: Body) -> None:
        for step in reversed(self.steps):
            if step["number"] == event["number"] and step["outcome"] is None:
                step |= {"outcome": event["outcome"], "duration": event["duration"]}
                return


def results_of(folder: Path, reading: JournalReading, form: int = FORMAT) -> Derived:
    """Derive the results of a run's folder from its journal and what was frozen in it, in a format.

    Raises:
        EvidenceError: where what was frozen cannot be read.
    """
    return derive(reading.bodies, facts_of(folder, reading), content_digest=reading.content_digest, form=form)


def derive(events: Sequence[Body], facts: Facts, *, content_digest: str, form: int = FORMAT) -> Derived:
    """Derive cases, requirements and the run's verdict; none is better than its evidence.

    A planned case that did not end is ABORTED if it began and NOT_RUN if it did not. A requirement's verdict is the
    worst of all planned cases that carry it. Events from `results` on are not looked at.
    """
    events = standing_bodies(list(takewhile(lambda event: event["kind"] != "results", events)))
    run = next((event for event in events if event["kind"] == "run"), {})
    kinds = {event["kind"] for event in events}
    safe_ends = [bool(event["ok"]) for event in events if event["kind"] == "safe-end"]
    results: Derived = {
        "format": form,
        "run": _facts_of_run(run, events),
        "interrupted": bool(kinds & {"recovered", "stop"}) or not run,
        "tripped": "trip" in kinds,
        "safe": all(safe_ends) if safe_ends else None,
        "content_digest": content_digest,
    }
    cases = [_case(case, facts, form) for case in _cases(events)]
    results["cases"] = cases
    results["requirements"] = [
        _requirement(identifier, results, events, facts)
        for identifier in sorted({identifier for case in cases for identifier in case["requirements"]} | _due(facts))
    ]
    results["counts"] = dict(Counter(case["verdict"] for case in cases))
    results["verdict"] = _verdict_of_run(results, armed="armed" in kinds)
    return results


def _facts_of_run(run: Body, events: Sequence[Body]) -> dict[str, Any]:
    """Return what the run was asked for, with what deviated in the course of it."""
    facts = {key: value for key, value in run.items() if key not in {"seq", "t", "kind"}}
    resumed = [event["deviation"] for event in events if event["kind"] == "resumed" and event["deviation"]]
    return {**facts, "deviations": [*facts["deviations"], *resumed]} if resumed else facts


def _cases(events: Sequence[Body]) -> list[_Case]:
    cases: dict[str, _Case] = {}
    current: _Case | None = None
    for event in events:
        if event["kind"] == "planned":
            for planned in event["cases"]:
                if planned["case"] in cases:
                    cases[planned["case"]].plan_again(planned)
                else:
                    cases[planned["case"]] = _Case(planned=planned)
        elif isinstance(event.get("case"), str):
            unplanned = {"case": event["case"], "title": "", "plan": "", "requirements": []}
            named = cases.setdefault(event["case"], _Case(planned=unplanned))
            named.take(event)
            current = {"case": named, "case-end": None}.get(event["kind"], current)
        elif event["kind"] in _HOLDS and current is not None:
            current.take_hold(event)
    return list(cases.values())


def _case(case: _Case, facts: Facts, form: int) -> dict[str, Any]:
    checked = (check["requirement"] for check in case.checks)
    identifiers = {*case.planned["requirements"], *checked, *case.earlier}
    requirements = {identifier: _within(identifier, case, facts) for identifier in sorted(identifiers)}
    return {
        "case": case.planned["case"],
        "title": case.planned["title"],
        "plan": case.planned["plan"],
        "verdict": worst([*case.own_verdicts(), *requirements.values()]),
        "reasons": case.reasons(),
        "requirements": requirements,
        "duration": case.end["duration"] if case.end else None,
        "attempts": case.attempts,
        "used": dict(case.end["used"]) if case.end else {},
        "checks": [dict(check) for check in case.checks],
        "steps": case.steps,
        "recordings": case.recordings,
        **({"holds": case.holds} if form > 1 else {}),
    }


def _within(identifier: str, case: _Case, facts: Facts) -> Verdict:
    """Return what one case says of one requirement: the worst of its checks, of the case's word, and of its end.

    A case that took itself out is NOT_RUN, and what it found before stands.
    """
    own = case.own_verdict()
    checks = [check for check in case.checks if check["requirement"] == identifier]
    verdicts = [*case.earlier.get(identifier, ()), *(Verdict(check["verdict"]) for check in checks)]
    if not case.all_begun():
        verdicts.append(Verdict.NOT_RUN)
    # A device under test that falls silent explains what is missing: the case's own word counts then.
    excused = case.dut_fault or own is Verdict.NOT_RUN
    if not excused and (not checks or _is_short(facts.catalogue.get(identifier, {}), checks)):
        verdicts.append(Verdict.NOT_EVALUATED)
    if case.end is not None and identifier in case.end["requirements"]:
        verdicts.append(Verdict(case.end["requirements"][identifier]))
    if own in _OVERRIDING:
        verdicts.append(own)
    return worst(verdicts)


def _is_short(entry: Mapping[str, Any], checks: Sequence[Body]) -> bool:
    due = {(limit["parameter"], of) for limit in entry.get("limits") or [] for of in limit.get("of") or [None]}
    return not due <= {(check["parameter"], check["of"]) for check in checks}


def _requirement(identifier: str, results: Derived, events: Sequence[Body], facts: Facts) -> dict[str, Any]:
    entry = facts.catalogue.get(identifier, {})
    cases = [case for case in results["cases"] if identifier in case["requirements"]]
    checks = [check for case in cases for check in case["checks"] if check["requirement"] == identifier]
    verdict = worst(case["requirements"][identifier] for case in cases) if cases else Verdict.NOT_RUN
    reasons = reasons_against(identifier, verdict, results, events, facts)
    return {
        "id": identifier,
        **{key: entry.get(key) for key in ("rev", "text", "kind", "method", "source")},
        "verdict": verdict,
        "cases": [{"case": case["case"], "verdict": case["requirements"][identifier]} for case in cases],
        "checks": len(checks),
        "eligible": not reasons,
        "reasons": reasons,
    }


def _due(facts: Facts) -> set[str]:
    """Return the requirements that a test has to verify, whether or not a planned case does."""
    return {
        identifier
        for identifier, entry in facts.catalogue.items()
        if entry.get("method") in BY_CASES and entry.get("kind") != "parent" and not entry.get("withdrawn")
    }


def _verdict_of_run(results: Derived, *, armed: bool) -> Verdict:
    verdicts = [worst(case["verdict"] for case in results["cases"])]
    if results["interrupted"]:
        verdicts.append(Verdict.ABORTED)
    never_made_safe = armed and results["safe"] is None and not results["interrupted"]
    if results["tripped"] or results["safe"] is False or never_made_safe:
        verdicts.append(Verdict.ERROR)
    return worst(verdicts)
