"""The procedure of a run as plain text: what it would drive, record and ask, and how long it takes."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence

from hil.evidence.results.derived import BY_CASES
from hil.report.frozen import demands, unspoken
from hil.report.material import Body, inner, inners, text, texts, verdict
from hil.report.numbers import bench_time, duration, limit_text, number, with_unit
from hil.report.page.as_run import attributed
from hil.report.sentences import counted
from hil.report.tables import labelled

__all__ = ["procedure_lines"]

_INDENT = "  "
_MOST_ALIKE = 3  # how many of a step's calls of one kind are written out


def procedure_lines(events: Sequence[Body], requirements: Mapping[str, Body]) -> list[str]:
    """Return the procedure that these events tell: cases, numbered steps, drives, recordings and questions.

    Args:
        events: the bodies of a journal; for a plan, those of a run on the simulated bench.
        requirements: by id, the entries of the catalogue, whose limits stand first.
    """
    events = attributed(events)
    run = next((event for event in events if event["kind"] == "run"), {})
    planned = [case for event in events if event["kind"] == "planned" for case in inners(event, "cases")]
    named = dict.fromkeys(name for case in planned for name in texts(case, "requirements"))
    facts = [*_driven(events), *_deviations(run), *_not_passed(run, events), *_not_covered(requirements, named)]
    lines = [_head(run, len(planned), events), *labelled(facts)]
    lines += [line for name in named for line in _requirement(name, requirements.get(name, {}))]
    by_case = _by(events, "case")
    for place, case in enumerate(planned, 1):
        lines += ["", *_case(f"[{place}/{len(planned)}]", case, by_case.get(text(case, "case"), []))]
    return lines


def _head(run: Body, cases: int, events: Sequence[Body]) -> str:
    took = sum(_taken(event) for event in events if event["kind"] == "case-end")
    plans, bench, source = ", ".join(texts(run, "plans")) or "no plan", text(run, "bench"), text(run, "source")
    where = f" on bench {bench} ({source})" if bench else ""
    return f"Procedure of {plans}{where}: {counted(cases, 'case')}, {duration(took)} of bench time"


def _driven(events: Sequence[Body]) -> Iterator[tuple[str, str]]:
    """Give what the cases drive at all, by role."""
    effects = (event for event in events if event["kind"] == "effect" and event.get("effect") == "drives")
    yield "drives", ", ".join(sorted({text(event, "name").rpartition(".")[0] for event in effects}))


def _deviations(run: Body) -> Iterator[tuple[str, str]]:
    yield from (("deviation", deviation) for deviation in texts(run, "deviations"))


def _not_passed(run: Body, events: Sequence[Body]) -> Iterator[tuple[str, str]]:
    """Give how many cases would not pass."""
    bad = sum(not verdict(event).good for event in events if event["kind"] == "case-end" and event["counted"])
    if bad:
        where = f"the {text(run, 'source')} bench" if text(run, "source") else "the bench"
        yield "not passed", f"{counted(bad, 'case')}, on {where}"


def _not_covered(requirements: Mapping[str, Body], named: Container[str]) -> Iterator[tuple[str, str]]:
    """Give the requirements that no case carries; those that no case verifies by their method are told with it."""
    left = unspoken(requirements, named)
    yield "no case", ", ".join(name for name, why in left if why in BY_CASES)
    yield "other methods", ", ".join(f"{name} ({why})" for name, why in left if why not in BY_CASES)


def _requirement(name: str, entry: Body) -> Iterator[str]:
    """Give what a requirement asks for, a line each, its id before the first."""
    asked = demands(entry) or ("limits not recorded",)
    yield ""
    yield f"{name}  {asked[0]}"
    yield from (f"{' ' * len(name)}  {line}" for line in asked[1:])


def _case(place: str, case: Body, events: Sequence[Body]) -> Iterator[str]:
    yield f"{place} {text(case, 'case')}"
    if text(case, "title"):
        yield f"{_INDENT * 2}{text(case, 'title')}"
    ends = [event for event in events if event["kind"] == "case-end"]
    left_out = next((text(event, "reason") for event in events if event["kind"] == "not-run"), "")
    took = duration(sum(_taken(event) for event in ends)) if ends else f"not run{left_out and ': '}{left_out}"
    longest = duration(case.get("max_duration"))
    bad = [event for event in ends if event["counted"] and not verdict(event).good]
    facts = (
        ("requirements", ", ".join(texts(case, "requirements")) or "none (orphan)"),
        ("duration", took + (f", at most {longest}" if longest else "")),
        *(("verdict", "; ".join((verdict(end).value, *texts(end, "reasons")))) for end in bad),
    )
    yield from labelled(facts, indent=_INDENT * 2)
    by_step = _by(events, "step")
    ended = {text(event, "number"): event for event in events if event["kind"] == "step-end"}
    for stretch in _stretches(events):
        if stretch[0]["kind"] == "step":
            number_ = text(stretch[0], "number")
            yield from _step(stretch[0], ended.get(number_, {}), by_step.get(number_, []))
        else:
            yield from _outside(stretch)


def _outside(stretch: Sequence[Body]) -> Iterator[str]:
    """Give what happens outside steps under a heading of its own; fixtures that set up often only read."""
    actions = list(_actions(stretch))
    if actions:
        yield f"{_INDENT * 2}-  {bench_time(stretch[0].get('t'))}  Outside any step"
        yield from (f"{_INDENT * 4}{line}" for line in actions)


def _stretches(events: Sequence[Body]) -> Iterator[list[Body]]:
    """Give every step's beginning alone, and what happens outside steps in one piece between them."""
    outside: list[Body] = []
    for event in events:
        if event["kind"] == "step":
            if outside:
                yield outside
            yield [event]
            outside = []
        elif not text(event, "step") and event["kind"] != "step-end":
            outside.append(event)
    if outside:
        yield outside


def _by(events: Sequence[Body], key: str) -> dict[str, list[Body]]:
    grouped: dict[str, list[Body]] = {}
    for event in events:
        grouped.setdefault(text(event, key), []).append(event)
    return grouped


def _step(step: Body, end: Body, within: Sequence[Body]) -> Iterator[str]:
    number_ = text(step, "number")
    shift = _INDENT * (2 + number_.count("."))
    path = texts(step, "path")
    yield f"{shift}{number_}  {bench_time(step.get('t'))}  {path[-1] if path else ''}  {_during(end)}".rstrip()
    yield from (f"{shift}{_INDENT * 2}{line}" for line in _actions(within))


def _during(end: Body) -> str:
    took = duration(end.get("duration"))
    return f"({took})" if took else ""


def _actions(events: Sequence[Body]) -> Iterator[str]:
    """Give what is driven, recorded, asked and checked, in order; calls alike are counted after the first few."""
    drives = [event for event in events if event["kind"] == "effect" and event.get("effect") == "drives"]
    alike: dict[str, int] = {}
    totals: dict[str, int] = {}
    for event in drives:
        totals[text(event, "name")] = totals.get(text(event, "name"), 0) + 1
    for event in events:
        name = text(event, "name")
        if event["kind"] == "effect" and event.get("effect") == "drives":
            alike[name] = alike.get(name, 0) + 1
            if alike[name] <= _MOST_ALIKE:
                yield f"drives   {name}({_arguments(event.get('arguments'))})"
            elif alike[name] == totals[name]:
                yield f"drives   {name} {counted(totals[name] - _MOST_ALIKE, 'more time')}"
        elif event["kind"] == "recording":
            yield f"records  {_recorded(event)}"
        elif event["kind"] == "question":
            options = ", ".join(texts(event, "options"))
            yield f"asks     {text(event, 'form')}: {text(event, 'text')}" + (f" ({options})" if options else "")
        elif event["kind"] == "check":
            of = f" [{text(event, 'of')}]" if text(event, "of") else ""
            limit = limit_text(inner(event, "limit"), text(event, "limit_unit"))
            rule = f"  ({limit}, {text(event, 'decision')})" if limit else ""
            yield f"checks   {text(event, 'requirement')} {text(event, 'parameter')}{of}{rule}"


def _recorded(recording: Body) -> str:
    channels = inners(recording, "channels")
    parts = [", ".join(f"{text(item, 'name')} [{text(item, 'unit') or '1'}]" for item in channels)]
    if recording.get("rate") is not None:
        parts.append(f"{number(recording['rate'])} Hz")
    if recording.get("duration") is not None:
        parts.append(duration(recording["duration"]))
    return f"{text(recording, 'name')}: {', '.join(part for part in parts if part)}"


def _arguments(arguments: object) -> str:
    if isinstance(arguments, Mapping):
        return ", ".join(_named_arguments(arguments))
    if isinstance(arguments, list | tuple):
        return ", ".join(_value(item) for item in arguments)
    return "" if arguments is None else _value(arguments)


def _named_arguments(arguments: Body) -> Iterable[str]:
    for name, value in arguments.items():
        if name == "args" and isinstance(value, list | tuple):
            yield from (_value(item) for item in value)
        elif name == "kwargs" and isinstance(value, Mapping):
            yield from _named_arguments(value)
        else:
            yield f"{name}={_value(value)}"


def _value(value: object) -> str:
    if isinstance(value, Mapping) and "value" in value and "unit" in value:
        return with_unit(number(value["value"]), text(value, "unit"))
    if isinstance(value, Mapping):
        return "{" + ", ".join(_named_arguments(value)) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    return "none" if value is None else number(value)


def _taken(event: Body) -> float:
    took = event.get("duration")
    return float(took) if isinstance(took, int | float) else 0.0
