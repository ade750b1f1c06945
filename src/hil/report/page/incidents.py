"""What happened around the procedure: people, and everything out of the ordinary."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby, takewhile
from types import MappingProxyType

from hil.report.material import Body, flag, inners, text, texts
from hil.report.numbers import bench_time, duration, number, with_unit
from hil.report.page.view import CaseName, Happening

__all__ = ["Sentence", "answered", "attached", "deviations", "guarded", "happenings", "noted", "people", "sentences"]


@dataclass(frozen=True, slots=True)
class Sentence:
    """One sentence of what was done to a bench, and its UTC, ISO 8601, empty where nobody knows."""

    at: str
    text: str


def people(run: Body, events: Sequence[Body]) -> tuple[tuple[str, str], ...]:
    """Return who took part, with what they did, sorted by name."""
    parts: dict[str, dict[str, None]] = {}
    if text(run, "operator"):
        parts.setdefault(text(run, "operator"), {})["operator"] = None
    if text(run, "on_call"):
        parts.setdefault(text(run, "on_call"), {})["on call"] = None
    for event in events:
        did = _DID.get(text(event, "kind"))
        if did and text(event, "by") and event.get("ok") is not False:
            parts.setdefault(text(event, "by"), {})[did] = None
    return tuple((name, ", ".join(done)) for name, done in sorted(parts.items()))


def deviations(run: Body) -> tuple[str, ...]:
    """Return what the run was asked to do differently from its plan."""
    return texts(run, "deviations")


def happenings(
    events: Sequence[Body],
    names: Mapping[str, CaseName],
    guarded: Iterable[Happening] = (),
    sent: Mapping[int, str] = MappingProxyType({}),
) -> tuple[Happening, ...]:
    """Return anomalies, trips, gaps, faults, stops, notes and recoveries in the order of the journal.

    Args:
        events: the journal's.
        names: how cases are named.
        guarded: what the guardian did, each before what became of the run then.
        sent: UTC of what was said from elsewhere, by its event's sequence number: a run that had ended by then wrote
            it down when it went on, so that its bench time says nothing.
    """
    acts, found = list(guarded), []
    for place, event in enumerate(events):
        kind = text(event, "kind")
        if kind in _GOES_ON and _was_ended_by_force(events[place:]):
            found += acts[:1]
            del acts[:1]
        if told := _TOLD.get(kind, _nothing)(event):
            case = names.get(text(event, "case"))
            number = event.get("seq")
            utc = sent.get(number, "") if kind == "acknowledged" and isinstance(number, int) else ""
            found.append(Happening(at=utc or bench_time(event.get("t")), kind=_WORDS[kind], case=case, text=told))
    return (*found, *acts)


def guarded(lines: Iterable[Body]) -> Iterator[Happening]:
    """Yield each time that the guardian acted: why, what it did when, and what it could not prove.

    Args:
        lines: its journal; one that could not be read is its text alone.
    """
    acts: list[list[Body]] = []
    for line in lines:
        if text(line, "event") == "acting":
            acts.append([line])
        elif acts:
            acts[-1].append(line)
    for act in acts:
        told = [sentence.text for sentence in sentences(act)]
        if not any(text(line, "event") == "done" for line in act):
            told.append("whether every output was proven safe is not on record")
        yield Happening(at=text(act[0], "utc"), kind="guardian", case=None, text="; ".join(told))


def sentences(facts: Iterable[Body]) -> Iterator[Sentence]:
    """Yield what the guardian wrote down, and what a run did to its bench, in sentences.

    Facts that say the same of several outputs, one after the other, are one sentence.

    Args:
        facts: lines of the guardian's journal; events of a run with their UTC, and their kind as `event`.
    """

    def same(fact: Body) -> tuple[str, bool, str]:
        detail = text(fact, "detail") if not flag(fact, "ok") or text(fact, "event") == "proof" else ""
        return text(fact, "event"), flag(fact, "ok"), detail

    for _, alike in groupby(facts, same):
        group = list(alike)
        outputs = ", ".join(dict.fromkeys(text(fact, "output") for fact in group if "output" in fact))
        told: dict[str, str] = {}
        for fact in group:
            told.setdefault(_sentence(fact, outputs), text(fact, "utc"))
        yield from (Sentence(at, said) for said, at in told.items())


def _sentence(fact: Body, outputs: str) -> str:
    try:
        return _SENTENCES[text(fact, "event")](fact, outputs)
    except (KeyError, TypeError):  # of another version, or damaged
        if set(fact) == {"text"}:
            return f"a line of the guardian's journal cannot be read: {fact['text']}"
        return ", ".join(f"{name} {value}" for name, value in fact.items() if name not in {"utc", "boot"})


def _switched_off(fact: Body, outputs: str) -> str:
    said = f": {fact['detail']}" if fact.get("detail") else ""
    return (
        f"the guardian switched off {outputs}" if fact["ok"] else f"{outputs} did not take the guardian's command{said}"
    )


def _proof(fact: Body, outputs: str) -> str:
    detail = text(fact, "detail")
    if not fact["ok"]:
        return f"NOT PROVEN SAFE by the guardian: {outputs}: {detail.removeprefix('not proven: ')}"
    return f"the guardian proved {outputs} safe" if detail == "safe" else f"{outputs} is {detail}"


def _done(fact: Body, _: str) -> str:
    unproven = fact["unproven"]
    if not isinstance(unproven, list | tuple):
        raise TypeError
    proven = f"NOT PROVEN SAFE: {', '.join(map(str, unproven))}" if unproven else "every output is proven safe"
    return f"the guardian finished: {proven}"


def _made_safe(fact: Body, outputs: str) -> str:
    if fact["ok"]:
        return f"the run made {outputs} safe"
    return f"NOT MADE SAFE by the run: {outputs}, which is not {fact['state']}: {fact['detail']}"


def _was_ended_by_force(events: Sequence[Body]) -> bool:
    """Tell whether a guardian may have ended the run that goes on with the first of these events.

    It is resumed once somebody has acknowledged that, which is written down next; one that was stopped with its bench
    safe goes on without a word.
    """
    first, *behind = (text(event, "kind") for event in events)
    return first == "recovered" or "acknowledged" in takewhile(lambda kind: kind not in _GOES_ON, behind)


def _nothing(_: Body) -> str:
    return ""


def noted(event: Body) -> str:
    """Return what a note says and who wrote it."""
    return f"{text(event, 'text')} ({_by(event)})"


def answered(event: Body) -> str:
    """Return what was answered, as a person says it: `yes` for what is true."""
    value = event.get("value")
    return {True: "yes", False: "no"}[value] if isinstance(value, bool) else text(event, "value")


def attached(event: Body) -> str:
    """Return which file was attached, what is said of it, and who attached it."""
    said = f": {text(event, 'text')}" if text(event, "text") else ""
    return f"{text(event, 'file')}{said} ({_by(event)})"


def _by(event: Body) -> str:
    return text(event, "by") or "by whom is not recorded"


def _reading(event: Body) -> str:
    value = event.get("value")
    shown = with_unit(number(value), text(event, "unit")) if value is not None else ""
    return ": ".join(part for part in (text(event, "limit"), text(event, "text") or shown) if part) + (
        f" ({shown})" if shown and text(event, "text") else ""
    )


def _stop(event: Body) -> str:
    return f"{text(event, 'reason')}, at once" if flag(event, "urgent") else text(event, "reason")


def _fault(event: Body) -> str:
    owner = "the device under test" if flag(event, "dut") else "the bench"
    said = f"{text(event, 'device')} ({owner}): {text(event, 'error')}: {text(event, 'message')}"
    return f"{said}; {text(event, 'hint')}" if text(event, "hint") else said


def _gap(event: Body) -> str:
    """Return what is missing of a recording; a whole one is nothing to tell."""
    if flag(event, "complete"):
        return ""
    gap = duration(event.get("gaps"))
    return f"recording {text(event, 'recording')} is incomplete" + (f", largest gap {gap}" if gap else "")


def _rest(event: Body) -> str:
    """Return where the bench did not come to its rest state between cases."""
    return "" if flag(event, "ok") else f"{text(event, 'output')} not {text(event, 'state')}: {text(event, 'detail')}"


def _attachment(event: Body) -> str:
    return f"{attached(event)}, sha256 {text(event, 'sha256')}"


def _hold(event: Body) -> str:
    lines = (
        f"{text(line, 'output')} {'' if flag(line, 'ok') else 'NOT '}{text(line, 'state')}, {text(line, 'detail')}"
        for line in inners(event, "outputs")
    )
    return f"{noted(event)}: {'; '.join(lines)}".removeprefix(" ")


def _hold_end(event: Body) -> str:
    lasted = f"{text(event, 'how')} after {duration(event.get('duration'))} of bench time"
    return f"{lasted}: {noted(event)}" if text(event, "how") == "released" else lasted


def _recovered(event: Body) -> str:
    torn = event.get("torn_bytes")
    return text(event, "text") + (f" ({torn} torn bytes were cut off and kept)" if torn else "")


def _for_seconds(event: Body) -> str:
    """Return what happened to the machine, and how long it was."""
    return f"{text(event, 'text')} ({duration(event.get('seconds'))})"


def _resumed(event: Body) -> str:
    """Return that the run was interrupted, for how long, and from where its bench went on."""
    told = f"{text(event, 'text')}, after {duration(event.get('seconds'))} of wall time"
    if "entry" not in event:
        told += f"; its simulated bench was rebuilt from {bench_time(event.get('checkpoint'))} on"
    return f"{told}; {text(event, 'deviation')}" if text(event, "deviation") else told


_GOES_ON = frozenset({"recovered", "resumed"})
_DID = {
    "acknowledged": "acknowledged what the guardian did",
    "answer": "answered questions",
    "attachment": "attached files",
    "confirmed": "gave safety confirmations",
    "hold-asked": "held or released the bench",
    "note": "wrote notes",
    "reached": "was reached on call",
}
_WORDS = {
    "acknowledged": "acknowledged",
    "confirmed": "confirmed again",
    "hold": "hold",
    "hold-end": "hold",
    "hold-refused": "hold refused",
    "notify-failed": "notification failed",
    "anomaly": "anomaly",
    "trip": "trip",
    "monitor-late": "late monitor",
    "stop": "stop",
    "fault": "fault",
    "recording-end": "gap",
    "rest": "rest state",
    "note": "note",
    "attachment": "attachment",
    "recovered": "recovery",
    "resumed": "resumed",
    "reboot": "reboot",
    "suspended": "suspended",
    "clock-jump": "clock jump",
}
_TOLD: Mapping[str, Callable[[Body], str]] = {
    "acknowledged": noted,
    "confirmed": lambda event: f"{text(event, 'text')} {answered(event)} ({_by(event)})",
    "anomaly": lambda event: text(event, "text"),
    "trip": _reading,
    "monitor-late": _reading,
    "stop": _stop,
    "fault": _fault,
    "recording-end": _gap,
    "rest": _rest,
    "note": noted,
    "attachment": _attachment,
    "hold": _hold,
    "hold-end": _hold_end,
    "hold-refused": noted,
    "notify-failed": lambda event: f"of '{text(event, 'event')}': {text(event, 'reason')}",
    "recovered": _recovered,
    "resumed": _resumed,
    "reboot": _for_seconds,
    "suspended": _for_seconds,
    "clock-jump": _for_seconds,
}
_SENTENCES: Mapping[str, Callable[[Body, str], str]] = {
    "acting": lambda fact, _: f"the guardian acted: {fact['why']}",
    "done": _done,
    "executive ended": lambda fact, _: (
        "the process of the run was ended" if fact["ok"] else "the process of the run could NOT be ended"
    ),
    "failed": lambda fact, _: f"a step of the guardian failed: {fact['why']}",
    "first pass over": lambda fact, _: f"the guardian commanded every output off within {duration(fact['seconds'])}",
    "latched": lambda *_: "the guardian latched the bench",
    "not latched": lambda fact, _: f"the guardian could NOT latch the bench: {fact['why']}",
    "off": _switched_off,
    "proof": _proof,
    "safe": _made_safe,
    "stop": lambda fact, _: f"the run was stopped: {fact['reason']}",
    "trip": lambda fact, _: f"the run tripped: {fact['text']}",
}
"""Facts of the guardian and of a run that speak of its bench; the name of a fact is in one of the two only."""
