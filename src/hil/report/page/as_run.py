"""The procedure as it was run: steps, effects, questions, checks and recordings of each case."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

from hil.model.verdict import Verdict
from hil.report.material import Body, flag, inner, inners, text, texts, verdict
from hil.report.numbers import bench_time, duration, limit_text, measured, number, with_unit
from hil.report.page.view import CaseName, CheckRow, Exchange, RecordingRow, StepRow

__all__ = ["attributed", "check_row", "checks_of", "fed_limits", "recording_rows", "step_rows", "watched_rows"]

_EFFECTS = {"reads": "read", "waits": "wait", "asks": "question"}
_OUTSIDE = frozenset({"effect", "question", "answer", "recording"})


def attributed(events: Sequence[Body]) -> list[Body]:
    """Return the events with case, step and attempt where the journal leaves them to what came before.

    An answer belongs to the case and step of its question, and what tells of a recording to that recording's. Events
    of a case that was tried more than once name their attempt as `tried`, and the last one's are the `counted` ones.
    """
    owners: dict[object, Body] = {}
    attempts: Counter[object] = Counter()
    placed: list[dict[str, object]] = []
    for event in events:
        kind = event["kind"]
        key = event.get("recording") if "recording" in event else (event.get("name"), event.get("ordinal"))
        if kind in {"question", "recording"}:
            owners[key] = {name: event.get(name) for name in ("case", "step")}
        owner = owners.get(key, {}) if kind in {"answer", "rows", "recording-end"} else {}
        case = event.get("case", owner.get("case"))
        attempts[case] += kind == "case"
        placed.append({**owner, **event, "tried": attempts[case]})
    return [
        event | {"tried": event["tried"] if attempts[case] > 1 else None, "counted": event["tried"] == attempts[case]}
        for event in placed
        for case in (event.get("case"),)
    ]


def step_rows(events: Sequence[Body]) -> tuple[StepRow, ...]:
    """Return the steps among the events of one case in the order in which they began, set-up and the like first."""
    steps = [_step(event, _within(events, place)) for place, event in enumerate(events) if event["kind"] == "step"]
    outside = [event for event in events if event["kind"] in _OUTSIDE and not text(event, "step")]
    return (_outside(outside), *steps) if outside else tuple(steps)


def checks_of(events: Sequence[Body], names: Mapping[str, CaseName]) -> tuple[CheckRow, ...]:
    """Return every check among the events, with the case that it belongs to by name."""
    return tuple(check_row(event, names) for event in events if event["kind"] == "check")


def check_row(check: Body, names: Mapping[str, CaseName] | None = None) -> CheckRow:
    """Return one check, written out."""
    unit, limit_unit = text(check, "unit"), text(check, "limit_unit")
    expanded = check.get("expanded") if limit_unit in {"", unit} else None
    limit = limit_text(inner(check, "limit"), limit_unit)
    return CheckRow(
        case=text(check, "case"),
        named=(names or {}).get(text(check, "case")),
        step=text(check, "step"),
        attempt=text(check, "tried"),
        requirement=text(check, "requirement"),
        parameter=text(check, "parameter"),
        of=text(check, "of"),
        value=measured(check.get("value"), expanded, unit),
        coverage=_coverage(check, unit, limit_unit),
        limit=limit,
        margin=_signed(check.get("margin"), limit_unit),
        tur="" if check.get("tur") is None else number(check["tur"], 2),
        decision=text(check, "decision") if limit else "",
        verdict=verdict(check),
        reason=text(check, "reason"),
        instruments=", ".join(texts(check, "instruments")),
    )


def recording_rows(events: Sequence[Body]) -> tuple[RecordingRow, ...]:
    """Return the recordings among the events in the order in which they began; alike ones of one case share a row."""
    ends = {text(event, "recording"): event for event in events if event["kind"] == "recording-end"}
    begun = {text(event, "recording"): event for event in events if event["kind"] == "recording"}
    alike: dict[object, list[RecordingRow]] = {}
    for name, event in begun.items():
        row = _recording(event, ends.get(name))
        same = (text(event, "case"), row.name, row.channels, row.rate, row.duration, row.rows, row.whole, row.source)
        alike.setdefault(same, []).append(row)
    return tuple(_merged(rows, ends) for rows in alike.values())


def watched_rows(events: Sequence[Body]) -> tuple[RecordingRow, ...]:
    """Return the recordings of the envelope's own readings; where a limit was judged on rows, they have no gap."""
    fed = {text(event, "limit") for event in events if event["kind"] == "fed"}
    rows = recording_rows([event for event in events if not text(event, "case")])
    return tuple(replace(row, gap="judged on rows") if row.name in fed else row for row in rows)


def fed_limits(events: Sequence[Body]) -> tuple[str, ...]:
    """Return a sentence for limits of the envelope that recordings fed: they were judged on rows, not by readings."""
    fed: dict[str, list[str]] = {}
    for event in events:
        if event["kind"] == "fed":
            fed.setdefault(text(event, "limit"), []).append(text(event, "recording"))
    alike: dict[tuple[str, ...], list[str]] = {}
    for limit, names in fed.items():
        alike.setdefault(tuple(names), []).append(limit)
    return tuple(
        f"{', '.join(limits)} {'were' if len(limits) > 1 else 'was'} judged on every row of"
        f" recording{'s' * (len(names) > 1)} {_ids(names)}; {'they were' if len(limits) > 1 else 'it was'} not"
        " read separately while rows arrived in time."
        for names, limits in alike.items()
    )


def _merged(rows: Sequence[RecordingRow], ends: Mapping[str, Body]) -> RecordingRow:
    """Return one row for recordings that are alike but for their number and their largest gap."""
    if len(rows) == 1:
        return rows[0]
    gaps = [float(gap) for row in rows if isinstance(gap := ends.get(row.id, {}).get("gaps"), int | float)]
    low, high = (duration(end(gaps, default=None)) for end in (min, max))
    gap = low if low == high else f"{low} to {high}"
    return replace(rows[0], id=_ids([row.id for row in rows]), count=len(rows), gap=gap)


def _ids(ids: Sequence[str]) -> str:
    """Return ids that differ by their number as ranges of it: `003 to 007, 009-field`; any others one by one."""
    parts = [identifier.partition("-") for identifier in ids]
    if len({rest for _, _, rest in parts}) > 1 or not all(number_.isdecimal() for number_, _, _ in parts):
        return ", ".join(ids)
    ranges: list[list[str]] = []
    for number_, _, _ in parts:
        if ranges and int(number_) == int(ranges[-1][-1]) + 1:
            ranges[-1] = [ranges[-1][0], number_]
        else:
            ranges.append([number_])
    return f"{', '.join(' to '.join(ends) for ends in ranges)}-{parts[0][2]}"


def _within(events: Sequence[Body], place: int) -> list[Body]:
    """Return what happened from the step at `place` until it ended, without the steps inside it."""
    number_ = events[place].get("number")
    until = next(
        (later for later in range(place + 1, len(events)) if _ends(events[later], number_)),
        len(events) - 1,
    )
    return [event for event in events[place : until + 1] if event.get("step", event.get("number")) == number_]


def _ends(event: Body, number_: object) -> bool:
    return event["kind"] == "step-end" and event.get("number") == number_


def _step(begin: Body, within: Sequence[Body]) -> StepRow:
    end = next((event for event in within if event["kind"] == "step-end"), None)
    path, number_ = texts(begin, "path"), text(begin, "number")
    return StepRow(
        number=number_,
        attempt=text(begin, "tried"),
        depth=number_.count("."),
        title=path[-1] if path else "",
        begin=bench_time(begin.get("t")),
        duration=duration(end.get("duration")) if end else "",
        outcome=text(end, "outcome") if end else "not ended",
        effects=_effects(within),
        recordings=tuple(text(event, "recording") for event in within if event["kind"] == "recording"),
        exchanges=_exchanges(within),
    )


def _outside(events: Sequence[Body]) -> StepRow:
    """Return a row for what a case did outside its steps: fixtures that set up, and what follows the last step."""
    return StepRow(
        number="-",
        attempt=text(events[0], "tried"),
        depth=0,
        title="Outside any step",
        begin=bench_time(events[0].get("t")),
        duration="",
        outcome="",
        effects=_effects(events),
        recordings=tuple(text(event, "recording") for event in events if event["kind"] == "recording"),
        exchanges=_exchanges(events),
    )


def _effects(within: Sequence[Body]) -> str:
    """Return what was driven, call by call, and how often it was read, waited and asked."""
    effects = [event for event in within if event["kind"] == "effect"]
    driven = [_call(event) for event in effects if event.get("effect") == "drives"]
    counted = Counter(text(event, "effect") for event in effects)
    words = [(counted[kind], word) for kind, word in _EFFECTS.items() if counted[kind]]
    return "; ".join((*driven, ", ".join(f"{count} {word}{'s' if count > 1 else ''}" for count, word in words))).strip(
        "; "
    )


def _call(effect: Body) -> str:
    arguments = inner(effect, "arguments")
    return f"{text(effect, 'name')}({', '.join(f'{key}={arguments[key]}' for key in arguments)})"


def _exchanges(within: Sequence[Body]) -> tuple[Exchange, ...]:
    """Return the questions, each with the next answer to it."""
    waiting = [event for event in within if event["kind"] == "answer"]
    exchanges = []
    for question in (event for event in within if event["kind"] == "question"):
        key = (question.get("name"), question.get("ordinal"))
        answer = next((event for event in waiting if (event.get("name"), event.get("ordinal")) == key), None)
        if answer is not None:
            waiting.remove(answer)
        exchanges.append(_exchange(question, answer or {}))
    return tuple(exchanges)


def _exchange(question: Body, answer: Body) -> Exchange:
    value = answer.get("value")
    shown = measured(value.get("value"), None, text(value, "unit")) if isinstance(value, dict) else _answer(value)
    return Exchange(
        form=text(question, "form"),
        text=text(question, "text"),
        options=", ".join(texts(question, "options")),
        answer=shown,
        by=text(answer, "by"),
    )


def _answer(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "" if value is None else number(value) if isinstance(value, int | float) else str(value)


def _coverage(check: Body, unit: str, limit_unit: str) -> str:
    """Return what else is known of the uncertainty: its size in the limit's unit, or that it is unknown."""
    expanded, value = check.get("expanded"), check.get("value")
    if not isinstance(value, int | float):
        return ""
    if check.get("uncertainty") is None and expanded is None:
        of_recording = verdict(check) is Verdict.RECORDED and limit_text(inner(check, "limit"), limit_unit)
        return "" if of_recording else "uncertainty not recorded"  # a length or a rate is counted, not measured
    if isinstance(expanded, int | float) and limit_unit not in {"", unit}:
        return f"U = {with_unit(number(expanded, 2), limit_unit)}"
    return ""


def _signed(margin: object, unit: str) -> str:
    if not isinstance(margin, int | float):
        return ""
    digits = number(margin, 3)
    return with_unit(f"+{digits}" if margin > 0 else digits, unit)


def _recording(begin: Body, end: Body | None) -> RecordingRow:
    gap = end.get("gaps") if end else None
    return RecordingRow(
        id=text(begin, "recording"),
        name=text(begin, "name"),
        count=1,
        channels="; ".join(_channel(channel) for channel in inners(begin, "channels")),
        rate=f"{number(begin.get('rate'))} Hz" if begin.get("rate") is not None else "",
        duration=duration(begin.get("duration")),
        rows=f"{end.get('rows'):,}".replace(",", " ") if end and isinstance(end.get("rows"), int) else "",
        gap=duration(gap),
        whole="not ended" if end is None else "complete" if flag(end, "complete") else "incomplete",
        source=text(begin, "source"),
    )


def _channel(channel: Body) -> str:
    instrument = text(channel, "instrument")
    unit = text(channel, "unit")
    return f"{text(channel, 'name')} [{unit or '1'}]" + (f" from {instrument}" if instrument else "")
