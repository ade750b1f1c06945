"""The opening sentences: what happened, what it is worth, and why."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from hil.documents.text import counted
from hil.evidence.results.outcome import EXCEPTION, CaseOutcome, Condition, HoldOutcome, Outcome, RequirementOutcome
from hil.model.identity import Source
from hil.model.verdict import NO_CHECK, Verdict
from hil.report.numbers import bench_time, duration

__all__ = [
    "Closing",
    "closing_sentence",
    "closings",
    "common_proofs",
    "common_reasons",
    "exceptions",
    "headline",
    "holds",
    "in_short",
    "proofs",
    "safe_word",
    "source_word",
    "subject",
    "uncovered",
    "uncovered_sentence",
    "warnings",
]

_FEW = 3  # requirements without a check that are listed one by one
_SAYING = frozenset({Verdict.PASS, Verdict.RECORDED, Verdict.FAIL, Verdict.INCONCLUSIVE})
_CAN = "the verdict is good, and nothing in this run weakens the evidence"
_TOLD = {
    Verdict.PASS: "passed",
    Verdict.RECORDED: "recorded",
    Verdict.FAIL: "failed",
    Verdict.INCONCLUSIVE: "inconclusive",
    Verdict.NOT_EVALUATED: "not evaluated",
    Verdict.ERROR: "in error",
    Verdict.ABORTED: "aborted",
    Verdict.NOT_RUN: "not run",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Closing:
    """Why this run can or cannot close some requirements; one that it cannot close may stand under several reasons."""

    closes: bool
    reason: str
    requirements: tuple[str, ...]


def headline(results: Outcome) -> str:
    """Return the number of cases by verdict, the worst first."""
    told = [f"{results.counts[word]} {_TOLD[word]}" for word in reversed(Verdict) if results.counts.get(word)]
    return f"{counted(len(results.cases), 'case')}: {', '.join(told)}." if told else "No case was planned."


def subject(results: Outcome) -> str:
    """Return what was tested where and why, in one line."""
    run = results.run
    if run is None:
        return ""
    dut = " ".join(part for part in (run.dut.part, run.dut.serial) if part)
    titled = f"{run.dut.title} ({dut})" if run.dut.title and dut else run.dut.title or dut
    return " · ".join(part for part in (titled, f"bench {run.bench}", run.purpose) if part)


def source_word(results: Outcome) -> str:
    """Return the mark for every page of a run that did not use hardware, empty otherwise."""
    if results.run is None:
        return "SOURCE NOT RECORDED"
    return "" if results.run.source is Source.HARDWARE else results.run.source.upper()


def exceptions(results: Outcome) -> tuple[str, ...]:
    """Return what counts as hardware on the word of the bench file alone, a sentence each."""
    found = (each.text for each in results.conditions or () if each.name == EXCEPTION)
    return tuple(text.removeprefix("EXCEPTION: ") for text in found)


def proofs(conditions: Sequence[Condition] | None) -> tuple[str, ...]:
    """Return what was proven, a sentence each; nothing for packages that do not record it."""
    return tuple(each.text for each in conditions or () if each.proven)


def warnings(results: Outcome) -> tuple[tuple[str, str], ...]:
    """Return what a reader must know before reading anything else, as a word and a sentence."""
    return tuple((word, sentence) for told, word, sentence in _warnings(results) if told)


def _warnings(results: Outcome) -> Iterable[tuple[bool, str, str]]:
    source = source_word(results)
    why = "the instruments were simulated" if source == "SIMULATED" else "no hardware was driven"
    yield bool(source), source, f"{why}; this run is not evidence about hardware."
    for exception in exceptions(results):
        yield True, "EXCEPTION", f"{exception}."
    yield results.interrupted, "INTERRUPTED", "the run did not reach its planned end."
    yield results.tripped, "TRIPPED", "the envelope tripped, and the run stopped."
    unsafe = results.safe is False
    yield unsafe, "NOT SAFE", "at least one output could not be proven safe."
    unknown = results.safe is None
    yield unknown, "SAFE STATE UNKNOWN", "there is no proof on record that the bench was left safe."
    deviates = results.run is not None and bool(results.run.deviations)
    yield deviates, "DEVIATION", "the run deviates from its plan; the report says how."
    entries = results.requirements
    bare = sum(not entry.cases for entry in entries)
    of = f"{bare} of {counted(len(entries), 'requirement')}"
    yield bare > 0, "NOT COVERED", f"{of} {'has' if bare == 1 else 'have'} no case in this run: NOT_RUN."


def holds(case: CaseOutcome) -> tuple[str, ...]:
    """Return when the bench was held during a case, for how long, by whom and why, a sentence each."""
    return tuple(_hold(each) for each in case.holds or ())


def _hold(each: HoldOutcome) -> str:
    lasted = duration(each.duration)
    how_long = f"for {lasted} of bench time" if lasted else "with no end on record"
    why = f" ({each.by}: {each.text})" if each.by else ""
    return f"the bench was held at {bench_time(each.t)} of bench time {how_long}{why}"


def safe_word(results: Outcome) -> str:
    """Return how the bench was left."""
    return {None: "not recorded", True: "left safe", False: "NOT SAFE"}[results.safe]


def closings(results: Outcome) -> tuple[Closing, ...]:
    """Return what the run can close first, then each reason against closing, with the requirements it concerns."""
    groups: dict[tuple[bool, str], list[str]] = {}
    for entry in results.requirements:
        closes = _closes(entry)
        for reason in (_CAN,) if closes else entry.reasons or (f"its verdict is {entry.verdict}",):
            groups.setdefault((closes, reason), []).append(entry.id)
    ordered = sorted(groups.items(), key=lambda group: (not group[0][0], -len(group[1])))
    return tuple(Closing(closes=closes, reason=reason, requirements=tuple(ids)) for (closes, reason), ids in ordered)


def common_reasons(results: Outcome) -> tuple[str, ...]:
    """Return the reasons against closing that concern every one of several requirements."""
    total = len(results.requirements)
    groups = closings(results)
    return tuple(group.reason for group in groups if not group.closes and len(group.requirements) == total > 1)


def common_proofs(results: Outcome) -> tuple[str, ...]:
    """Return what was proven for every one of several requirements."""
    each = [proofs(entry.conditions) for entry in results.requirements]
    return tuple(proof for proof in each[0] if all(proof in others for others in each)) if len(each) > 1 else ()


def closing_sentence(results: Outcome) -> str:
    """Return in one line what this run can close."""
    entries = results.requirements
    able, total = sum(_closes(entry) for entry in entries), len(entries)
    if not total:
        return "This run covers no requirement."
    if able == total:
        return f"This run can close {'its requirement' if total == 1 else f'all {total} requirements'}."
    if total == 1:
        return "This run cannot close its requirement."
    return f"This run can close {able or 'none'} of its {total} requirements."


def uncovered(results: Outcome) -> tuple[RequirementOutcome, ...]:
    """Return the requirements of the run's plans that it does not cover: no case, or none with a verdict."""
    return tuple(entry for entry in results.requirements if not entry.cases or entry.verdict not in _SAYING)


def uncovered_sentence(results: Outcome, most: int) -> str:
    """Return in one line which requirements the run leaves uncovered, empty if it leaves none.

    Args:
        results: the run's results.
        most: how many are named.
    """
    left = uncovered(results)
    if not left:
        return ""
    named = [f"{entry.id} ({entry.verdict if entry.cases else 'no case'})" for entry in left[:most]]
    more = f" and {len(left) - most} more" if len(left) > most else ""
    return f"This run leaves {counted(len(left), 'requirement')} of its plans uncovered: {', '.join(named)}{more}."


def _closes(requirement: RequirementOutcome) -> bool:
    return requirement.eligible and requirement.verdict.good


def in_short(word: Verdict, reasons: Sequence[str]) -> list[str]:
    """Return the reasons of a case for a terminal.

    Of two reasons that begin alike, the longer one is kept. Checks that an error prevented share one line.
    """
    reasons = [each for each in reasons if not any(other.startswith(f"{each}; ") for other in reasons)]
    if word not in {Verdict.ERROR, Verdict.ABORTED}:
        return reasons
    missing = [reason.partition(NO_CHECK) for reason in reasons if NO_CHECK in reason]
    others = [reason for reason in reasons if NO_CHECK not in reason]
    if len(missing) <= _FEW or not others:
        return reasons
    names = [name for name, _, _ in missing]
    return [*others, f"checks of {', '.join(names[:-1])} and {names[-1]} are missing; the report names them"]
