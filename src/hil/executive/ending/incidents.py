"""What happened to the bench of a run that was left by force, told in sentences: when, what, and by whom."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

from hil.bench.latching import latches_of
from hil.evidence.folder import GUARDIAN, JOURNAL
from hil.evidence.journal.reader import read_journal
from hil.evidence.safed import guardian_lines
from hil.model.errors import EvidenceError
from hil.report.numbers import duration

__all__ = ["Happened", "moment", "what_happened", "written_down"]

_Fact = Mapping[str, Any]
_Words = Callable[[_Fact, str], str]
"""Tells a fact, with the outputs of all facts beside it that say the same of others."""


@dataclass(frozen=True, slots=True)
class Happened:
    """One sentence of what happened, and its UTC, ISO 8601, empty where nobody knows."""

    at: str
    text: str


def what_happened(folder: Path) -> list[Happened]:
    """Return what tripped, what was made safe or stayed unsafe, what the guardian did, and what is latched, by time."""
    told = [*_of_run(folder), *_of_guardian(guardian_lines(folder)), *_of_latches(folder)]
    return sorted(dict.fromkeys(told), key=lambda each: each.at.rstrip("Z") or "~")


def moment(utc: str) -> str:
    """Return an instant as people read it, to the millisecond; what is no instant as it is."""
    day, _, time = utc.partition("T")
    whole, _, part = time.rstrip("Z").partition(".")
    return f"{day} {whole}.{part[:3]:0<3} UTC" if time.endswith("Z") else utc


def written_down(folder: Path) -> list[Path]:
    """Return the files in which the guardian and the run have written it down, as far as they are there."""
    return [path for path in (folder / GUARDIAN, folder / JOURNAL) if path.is_file()]


def _of_latches(folder: Path) -> Iterator[Happened]:
    for latch in latches_of(folder.name).values():
        unproven = f"; not proven safe: {', '.join(latch.outputs)}" if latch.outputs else ""
        yield Happened(latch.since, f"bench {latch.bench} is latched since then: {latch.why}{unproven}")


def _of_run(folder: Path) -> Iterator[Happened]:
    try:
        lines = read_journal(folder / JOURNAL).lines
    except EvidenceError:
        return
    facts = ({**line.body, "event": line.body["kind"], "utc": line.wall.get("utc", "")} for line in lines)
    yield from _sentences((fact for fact in facts if fact["event"] in _RUN), _RUN)


def _of_guardian(lines: Iterable[_Fact]) -> Iterator[Happened]:
    yield from _sentences(lines, _GUARDIAN)


def _sentences(facts: Iterable[_Fact], words: Mapping[str, _Words]) -> Iterator[Happened]:
    """Yield a sentence for each fact, and one for all that say the same one after the other of several outputs."""

    def same(fact: _Fact) -> tuple[str, bool, str]:
        detail = str(fact.get("detail", "")) if not fact.get("ok") or fact.get("event") == "proof" else ""
        return str(fact.get("event", "")), bool(fact.get("ok")), detail

    for _, alike in groupby(facts, same):
        group = list(alike)
        outputs = ", ".join(dict.fromkeys(str(fact["output"]) for fact in group if "output" in fact))
        told: dict[str, str] = {}
        for fact in group:
            told.setdefault(_sentence(fact, words, outputs), str(fact.get("utc", "")))
        yield from (Happened(at, text) for text, at in told.items())


def _sentence(fact: _Fact, words: Mapping[str, _Words], outputs: str) -> str:
    try:
        return words[str(fact.get("event", ""))](fact, outputs)
    except (KeyError, TypeError):  # of another version, or damaged
        return _plain(fact)


def _plain(fact: _Fact) -> str:
    """Return what a fact says that this version has no words for, and a line that could not be read."""
    if set(fact) == {"text"}:
        return f"a line of the guardian's journal cannot be read: {fact['text']}"
    return ", ".join(f"{name} {value}" for name, value in fact.items() if name not in {"utc", "boot"})


def _off(fact: _Fact, outputs: str) -> str:
    said = f": {fact['detail']}" if fact.get("detail") else ""
    return f"the guardian switched off {outputs}" if fact["ok"] else f"{outputs} did not take the guardian's word{said}"


def _proof(fact: _Fact, outputs: str) -> str:
    detail = str(fact.get("detail", ""))
    if not fact["ok"]:
        return f"NOT PROVEN SAFE by the guardian: {outputs}: {detail.removeprefix('not proven: ')}"
    return f"the guardian proved safe {outputs}" if detail == "safe" else f"{outputs} is {detail}"


def _done(fact: _Fact, _outputs: str) -> str:
    unproven = ", ".join(map(str, fact["unproven"]))
    return f"the guardian was done; {f'NOT PROVEN SAFE: {unproven}' if unproven else 'every output is proven safe'}"


def _made_safe(fact: _Fact, outputs: str) -> str:
    if fact["ok"]:
        return f"the run made safe {outputs}"
    return f"NOT MADE SAFE by the run: {outputs}, which is not {fact['state']}: {fact['detail']}"


_GUARDIAN: Mapping[str, _Words] = {
    "acting": lambda fact, _: f"the guardian acted: {fact['why']}",
    "done": _done,
    "executive ended": lambda fact, _: (
        "the process of the run has ended" if fact["ok"] else "the process of the run could NOT be ended"
    ),
    "failed": lambda fact, _: f"a step of the guardian failed: {fact['why']}",
    "first pass over": lambda fact, _: (
        f"the guardian had told every output to be off after {duration(fact['seconds'])}"
    ),
    "latched": lambda _fact, _: "the guardian latched the bench",
    "not latched": lambda fact, _: f"the guardian could NOT latch the bench: {fact['why']}",
    "off": _off,
    "proof": _proof,
}
_RUN: Mapping[str, _Words] = {
    "safe": _made_safe,
    "stop": lambda fact, _: f"the run was stopped: {fact['reason']}",
    "trip": lambda fact, _: f"the run tripped: {fact['text']}",
}
