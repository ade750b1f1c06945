"""The sentences that stand first: what happened, what it is worth, and why."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from hil.model.identity import Source
from hil.model.verdict import NO_CHECK, Verdict
from hil.report.material import Body, flag, inner, inners, text, texts, verdict
from hil.report.numbers import bench_time, duration

__all__ = [
    "Closing",
    "closing_sentence",
    "closings",
    "common_reasons",
    "counted",
    "headline",
    "holds",
    "in_short",
    "safe_word",
    "source_word",
    "subject",
    "warnings",
]

_FEW = 3  # requirements without a check that are told one by one
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


def headline(results: Body) -> str:
    """Return how many cases ended how, the worst first."""
    counts = inner(results, "counts")
    told = [f"{counts[word]} {_TOLD[word]}" for word in reversed(Verdict) if counts.get(word)]
    total = len(inners(results, "cases"))
    return f"{counted(total, 'case')}: {', '.join(told)}." if told else "No case was planned."


def subject(results: Body) -> str:
    """Return what was tested where and why, in one line."""
    run = inner(results, "run")
    dut = inner(run, "dut")
    article = " ".join(part for part in (text(dut, "part"), text(dut, "serial")) if part)
    titled = f"{text(dut, 'title')} ({article})" if text(dut, "title") and article else text(dut, "title") or article
    parts = (titled, f"bench {text(run, 'bench')}" if text(run, "bench") else "", text(run, "purpose"))
    return " · ".join(part for part in parts if part)


def source_word(results: Body) -> str:
    """Return what must stand on every page of a run that did not talk to hardware, and nothing otherwise."""
    source = text(inner(results, "run"), "source")
    return "" if source == Source.HARDWARE else source.upper() or "SOURCE NOT RECORDED"


def warnings(results: Body) -> tuple[tuple[str, str], ...]:
    """Return what a reader must know before reading anything else, as a word and a sentence."""
    return tuple((word, sentence) for told, word, sentence in _warnings(results) if told)


def _warnings(results: Body) -> Iterable[tuple[bool, str, str]]:
    source = source_word(results)
    why = "the instruments were simulated" if source == "SIMULATED" else "no hardware was driven"
    yield bool(source), source, f"{why}; this run is no evidence about hardware."
    yield flag(results, "interrupted"), "INTERRUPTED", "the run did not reach its planned end."
    yield flag(results, "tripped"), "TRIPPED", "the bench left its envelope and was made safe."
    unsafe = results.get("safe") is False
    yield unsafe, "NOT SAFE", "at least one output could not be proven in its safe state."
    unknown = results.get("safe") is None
    yield unknown, "SAFE STATE UNKNOWN", "the evidence holds no proof that the bench was left safe."
    deviates = bool(texts(inner(results, "run"), "deviations"))
    yield deviates, "DEVIATION", "the run deviates from its plan; the report says how."
    entries = inners(results, "requirements")
    bare = sum(entry.get("cases") == [] for entry in entries)
    of = f"{bare} of {counted(len(entries), 'requirement')}"
    yield bare > 0, "NOT COVERED", f"{of} {'has' if bare == 1 else 'have'} no case in this run: NOT_RUN."


def holds(case: Body) -> tuple[str, ...]:
    """Return when the bench was held in the course of a case, for how long, by whom and why, a sentence each."""
    return tuple(_hold(each) for each in inners(case, "holds"))


def _hold(each: Body) -> str:
    lasted = duration(each.get("duration"))
    how_long = f"for {lasted} of bench time" if lasted else "with no end on record"
    why = f" ({text(each, 'by')}: {text(each, 'text')})" if text(each, "by") else ""
    return f"the bench was held at {bench_time(each.get('t'))} of bench time {how_long}{why}"


def safe_word(results: Body) -> str:
    """Return how the bench was left."""
    safe = results.get("safe")
    return "not recorded" if safe is None else "left safe" if safe else "NOT SAFE"


def closings(results: Body) -> tuple[Closing, ...]:
    """Return what the run can close first, then each reason against closing, with the requirements it concerns."""
    groups: dict[tuple[bool, str], list[str]] = {}
    for entry in inners(results, "requirements"):
        closes = _closes(entry)
        for reason in (_CAN,) if closes else texts(entry, "reasons") or (f"its verdict is {verdict(entry)}",):
            groups.setdefault((closes, reason), []).append(text(entry, "id"))
    ordered = sorted(groups.items(), key=lambda group: (not group[0][0], -len(group[1])))
    return tuple(Closing(closes=closes, reason=reason, requirements=tuple(ids)) for (closes, reason), ids in ordered)


def common_reasons(results: Body) -> tuple[str, ...]:
    """Return the reasons against closing that concern every one of several requirements."""
    total = len(inners(results, "requirements"))
    groups = closings(results)
    return tuple(group.reason for group in groups if not group.closes and len(group.requirements) == total > 1)


def closing_sentence(results: Body) -> str:
    """Return in one line what this run can close."""
    entries = inners(results, "requirements")
    able, total = sum(_closes(entry) for entry in entries), len(entries)
    if not total:
        return "This run covers no requirement."
    if able == total:
        return f"This run can close {'its requirement' if total == 1 else f'all {total} requirements'}."
    if total == 1:
        return "This run cannot close its requirement."
    return f"This run can close {able or 'none'} of its {total} requirements."


def _closes(requirement: Body) -> bool:
    return flag(requirement, "eligible") and verdict(requirement).good


def in_short(word: Verdict, reasons: Sequence[str]) -> list[str]:
    """Return the reasons of a case for a terminal: checks that an error kept from being made are told in one line."""
    if word not in {Verdict.ERROR, Verdict.ABORTED}:
        return list(reasons)
    missing = [reason.partition(NO_CHECK) for reason in reasons if NO_CHECK in reason]
    others = [reason for reason in reasons if NO_CHECK not in reason]
    if len(missing) <= _FEW or not others:
        return list(reasons)
    names = [name for name, _, _ in missing]
    return [*others, f"checks of {', '.join(names[:-1])} and {names[-1]} are missing; the report names them"]


def counted(count: int, word: str) -> str:
    """Return a number with its noun."""
    return f"{count} {word}{'' if count == 1 else 's'}"
