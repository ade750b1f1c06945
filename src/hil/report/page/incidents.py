"""What happened around the procedure: arming, people, everything out of the ordinary, and the safe state."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby, takewhile
from types import MappingProxyType

from hil.evidence.events import (
    Acknowledged,
    Anomaly,
    Answer,
    Armed,
    Attachment,
    ClockJump,
    Confirmed,
    Event,
    Fault,
    Gate,
    Hold,
    HoldAsked,
    HoldEnd,
    HoldRefused,
    Lost,
    MonitorLate,
    Note,
    NotifyFailed,
    Reached,
    Reboot,
    RecordingEnd,
    Recovered,
    Rest,
    Resumed,
    Run,
    Safe,
    Stop,
    Suspended,
    Trip,
)
from hil.report.material import Body, flag, text
from hil.report.numbers import bench_time, duration, quantity
from hil.report.page.as_run import Placed
from hil.report.page.view import Arming, CaseName, GateRow, Happening, SafeRow

__all__ = [
    "Sentence",
    "answered",
    "armings",
    "attached",
    "guarded",
    "happenings",
    "noted",
    "people",
    "safe_off",
    "sentences",
]


_AGAIN = "Armed again"
_CUT_PATH, _NOT_TRIED = "cut path of ", "not tried: "


@dataclass(frozen=True, slots=True)
class Sentence:
    """One sentence about what was done to a bench, and its UTC, ISO 8601, empty if unknown."""

    at: str
    text: str


def armings(events: Iterable[Event]) -> tuple[Arming, ...]:
    """Return the readiness gates, of each arming by itself: a run that was resumed after a stop was armed again.

    A gate after the end of an arming is the guardian's, who does not find the bench safe when it is released.
    """
    titles, parts = ["Arming"], list[list[Gate]]([[]])
    over = False
    for event in events:
        again = isinstance(event, Resumed) and event.entry is not None
        if again or (isinstance(event, Gate) and over):
            titles.append(_AGAIN if again else "At the release of the bench")
            parts.append([])
            over = False
        if isinstance(event, Gate):
            parts[-1].append(event)
            if titles[-1] == _AGAIN and not event.ok:
                titles[-1] = "Not armed again"
        over = over or isinstance(event, Armed) or (isinstance(event, Gate) and not event.ok)
    found = [(title, part) for title, part in zip(titles, parts, strict=True) if part]
    return tuple(
        Arming(
            title=f"{title}, at {bench_time(part[0].t)} of bench time" if len(found) > 1 else "",
            gates=_gates(part),
        )
        for title, part in found
    )


def safe_off(events: Iterable[Event]) -> tuple[SafeRow, ...]:
    """Return every output that was made safe, in order."""
    return tuple(
        SafeRow(
            at=bench_time(event.t),
            output=event.output,
            state=event.state,
            ok=event.ok,
            detail=event.detail,
            duration=duration(event.duration),
        )
        for event in events
        if isinstance(event, Safe)
    )


def people(run: Run | None, events: Sequence[Placed]) -> tuple[tuple[str, str], ...]:
    """Return who took part, with what they did, sorted by name; cases that made files are left out."""
    parts: dict[str, dict[str, None]] = {}
    cases = {each.case for each in events}
    told = [(run.operator, "operator"), (run.on_call or "", "on call")] if run else []
    for each in events:
        event = each.event
        if type(event) in _DID and getattr(event, "ok", True):
            told.append((str(getattr(event, "by", "")), _DID[type(event)]))
        if isinstance(event, Answer):
            told.append((event.witness, "witnessed answers"))
    for name, did in told:
        if name and name not in cases:
            parts.setdefault(name, {})[did] = None
    return tuple((name, ", ".join(done)) for name, done in sorted(parts.items()))


def happenings(
    events: Sequence[Placed],
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
            it down when it was resumed, so that its bench time says nothing.
    """
    acts, found = list(guarded), []
    for place, each in enumerate(events):
        event = each.event
        if isinstance(event, _RESUMES) and _was_ended_by_force([later.event for later in events[place:]]):
            found += acts[:1]
            del acts[:1]
        if (told := _told(event)) is not None:
            kind, said = told
            utc = sent.get(event.seq, "") if isinstance(event, Acknowledged) else ""
            found.append(Happening(at=utc or bench_time(event.t), kind=kind, case=names.get(each.case), text=said))
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
        if not any(text(line, "event") in {"done", "trying"} for line in act):
            told.append("whether every output was proven safe is not on record")
        yield Happening(at=text(act[0], "utc"), kind="guardian", case=None, text="; ".join(told))


def sentences(facts: Iterable[Body]) -> Iterator[Sentence]:
    """Yield what the guardian wrote down, and what a run did to its bench, in sentences.

    Consecutive facts that say the same about several outputs are one sentence.

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
    if fact.get("proven") == []:
        proven = "it guarded no output, so nothing was proven safe"
    return f"the guardian finished: {proven}"


def _trying(fact: Body, _: str) -> str:
    unproven = fact["unproven"]
    if not isinstance(unproven, list | tuple):
        raise TypeError
    return f"NOT PROVEN SAFE: {', '.join(map(str, unproven))}; the guardian kept trying"


def _made_safe(fact: Body, outputs: str) -> str:
    if fact["ok"]:
        return f"the run made {outputs} safe"
    return f"NOT MADE SAFE by the run: {outputs}, which is not {fact['state']}: {fact['detail']}"


def _gates(gates: Iterable[Gate]) -> tuple[GateRow, ...]:
    """Return a row for each gate; neighbours that say the same about several of a kind, such as limits, share one."""

    def same(row: GateRow) -> tuple[str, bool, bool, str]:
        return row.name.partition(" ")[0], row.ok, row.tried, row.detail

    rows = []
    for (kind, ok, tried, detail), alike in groupby(map(_gate, gates), same):
        first, *others = (row.name for row in alike)
        names = ", ".join((first, *(name.removeprefix(f"{kind} ") for name in others)))
        rows.append(GateRow(name=names, ok=ok, tried=tried, detail=detail))
    return tuple(rows)


def _gate(gate: Gate) -> GateRow:
    tried = not (gate.name.startswith(_CUT_PATH) and _NOT_TRIED in gate.detail)
    return GateRow(name=gate.name, ok=gate.ok, tried=tried, detail=gate.detail)


def _was_ended_by_force(events: Sequence[Event]) -> bool:
    """Return whether a guardian may have ended the run that is resumed with the first of these events.

    It is resumed once somebody has acknowledged that, which is written down next; one that was stopped with its bench
    safe is resumed without a word.
    """
    first, *later = events
    before_next = takewhile(lambda event: not isinstance(event, _RESUMES), later)
    return isinstance(first, Recovered) or any(isinstance(event, Acknowledged) for event in before_next)


def noted(text: str, by: str) -> str:
    """Return a note and its author."""
    return f"{text} ({by or 'by whom is not recorded'})"


def answered(value: object) -> str:
    """Return an answer in words: `yes` for true."""
    return {True: "yes", False: "no"}[value] if isinstance(value, bool) else str(value)


def attached(file: str, text: str, by: str) -> str:
    """Return which file was attached, its description, and who attached it."""
    return noted(f"{file}: {text}" if text else file, by)


def _told(event: Event) -> tuple[str, str] | None:  # noqa: PLR0911, PLR0912, C901 - a row for each kind
    """Return kind and text of an incident; None for an ordinary event."""
    match event:
        case Acknowledged():
            return "acknowledged", noted(event.text, event.by)
        case Confirmed():
            return "confirmed again", noted(f"{event.text} {answered(event.value)}", event.by)
        case Anomaly():
            return "anomaly", event.text
        case Trip():
            shown = "" if event.value is None else f" ({quantity(event.value, event.unit)})"
            return "trip", f"{event.limit}: {event.text}{shown}"
        case MonitorLate():
            return "late monitor", f"{event.limit}: {event.text}"
        case Lost():
            return "lost", event.text
        case Stop():
            return "stop", f"{event.reason}, at once" if event.urgent else event.reason
        case Fault():
            return "fault", _fault(event)
        case RecordingEnd(complete=False):
            gap = duration(event.gaps)
            return "gap", f"recording {event.recording} is incomplete" + (f", largest gap {gap}" if gap else "")
        case Rest(ok=False) if type(event) is Rest:
            return "rest state", f"{event.output} not {event.state}: {event.detail}"
        case Note():
            return "note", noted(event.text, event.by)
        case Attachment():
            return "attachment", f"{attached(event.file, event.text, event.by)}, sha256 {event.sha256}"
        case Hold():
            lines = (f"{each.output} {'' if each.ok else 'NOT '}{each.state}, {each.detail}" for each in event.outputs)
            return "hold", f"{noted(event.text, event.by)}: {'; '.join(lines)}".removeprefix(" ")
        case HoldEnd():
            lasted = f"{event.how} after {duration(event.duration)} of bench time"
            return "hold", f"{lasted}: {noted(event.text, event.by)}" if event.how == "released" else lasted
        case HoldRefused():
            return "hold refused", noted(event.text, event.by)
        case NotifyFailed():
            return "notification failed", f"of '{event.event}': {event.reason}"
        case Recovered():
            torn = f" ({event.torn_bytes} torn bytes were cut off and kept)" if event.torn_bytes else ""
            return "recovery", event.text + torn
        case Resumed():
            return "resumed", _resumed(event)
        case Reboot() | Suspended() | ClockJump():
            return _OF_MACHINE[type(event)], f"{event.text} ({duration(event.seconds)})"
        case _:
            return None


def _fault(event: Fault) -> str:
    owner = "the device under test" if event.dut else "bench or device under test" if event.undecided else "the bench"
    hint = f"; {event.hint}" if event.hint else ""
    return f"{event.device} ({owner}): {event.error}: {event.message}{hint}"


def _resumed(event: Resumed) -> str:
    """Return that the run was interrupted, for how long, and from where its bench was resumed."""
    told = f"{event.text}, after {duration(event.seconds)} of wall time"
    if event.entry is None:
        told += f"; its simulated bench was rebuilt from {bench_time(event.checkpoint)} on"
    return f"{told}; {event.deviation}" if event.deviation else told


_RESUMES = (Recovered, Resumed)
_OF_MACHINE: Mapping[type[Event], str] = {Reboot: "reboot", Suspended: "suspended", ClockJump: "clock jump"}
_DID: Mapping[type[Event], str] = {
    Acknowledged: "acknowledged what the guardian did",
    Answer: "answered questions",
    Attachment: "attached files",
    Confirmed: "gave safety confirmations",
    HoldAsked: "held or released the bench",
    Note: "wrote notes",
    Reached: "was reached on call",
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
    "trying": _trying,
}
"""Facts of the guardian and of a run that speak of its bench; the name of a fact is in one of the two only."""
