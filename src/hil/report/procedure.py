"""The procedure of a run as plain text: what it would drive, record and ask, and how long it takes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence

from hil.documents.text import counted
from hil.evidence.events import (
    CaseEnd,
    Check,
    Effect,
    Event,
    NotRun,
    Planned,
    PlannedCase,
    Question,
    Recording,
    Run,
    Step,
    StepEnd,
)
from hil.evidence.results.derived import BY_CASES
from hil.report.material import Body, demands, text, unspoken
from hil.report.numbers import bench_time, duration, number, quantity
from hil.report.page.as_run import Placed, attributed, limit_of
from hil.report.tables import labelled

__all__ = ["procedure_lines"]

_INDENT = "  "
_MOST_ALIKE = 3  # how many calls of one kind are listed per step


def procedure_lines(events: Sequence[Event], requirements: Mapping[str, Body]) -> list[str]:
    """Return the procedure in these events: cases, numbered steps, drives, recordings and questions.

    Args:
        events: those of a journal; for a plan, those of a run on the simulated bench.
        requirements: by id, the entries of the catalogue, whose limits stand first.
    """
    placed = attributed(events)
    run = next((event for event in events if isinstance(event, Run)), None)
    planned = [case for event in events if isinstance(event, Planned) for case in event.cases]
    named = dict.fromkeys(name for case in planned for name in case.requirements)
    facts = [*_driven(events), *_deviations(run), *_not_passed(run, placed), *_not_covered(requirements, named)]
    lines = [_head(run, len(planned), events), *labelled(facts)]
    lines += _asked([list(_requirement(name, requirements.get(name, {}))) for name in named])
    by_case = _by(placed, lambda each: each.case)
    for place, case in enumerate(planned, 1):
        lines += ["", *_case(f"[{place}/{len(planned)}]", case, by_case.get(case.case, []))]
    return lines


def _head(run: Run | None, cases: int, events: Sequence[Event]) -> str:
    took = sum(event.duration for event in events if isinstance(event, CaseEnd))
    plans = ", ".join(run.plans) if run else "no plan"
    where = f" on bench {run.bench} ({run.source})" if run else ""
    return f"Procedure of {plans}{where}: {counted(cases, 'case')}, {duration(took)} of bench time"


def _driven(events: Sequence[Event]) -> Iterator[tuple[str, str]]:
    """Yield everything that the cases drive, by role."""
    effects = (event for event in events if isinstance(event, Effect) and event.effect == "drives")
    yield "drives", ", ".join(sorted({event.name.rpartition(".")[0] for event in effects}))


def _deviations(run: Run | None) -> Iterator[tuple[str, str]]:
    yield from (("deviation", deviation) for deviation in (run.deviations if run else ()))


def _not_passed(run: Run | None, events: Sequence[Placed]) -> Iterator[tuple[str, str]]:
    """Yield the number of cases that would not pass."""
    bad = sum(isinstance(each.event, CaseEnd) and each.counted and not each.event.verdict.good for each in events)
    if bad:
        yield "not passed", f"{counted(bad, 'case')}, on the {f'{run.source} bench' if run else 'bench'}"


def _not_covered(requirements: Mapping[str, Body], named: Container[str]) -> Iterator[tuple[str, str]]:
    """Yield the requirements that no case carries; those that their method excludes from cases are listed with it."""
    left = unspoken(requirements, named)
    yield "no case", ", ".join(name for name, why in left if why in BY_CASES)
    yield "other methods", ", ".join(f"{name} ({why})" for name, why in left if why not in BY_CASES)


def _requirement(name: str, entry: Body) -> Iterator[str]:
    """Yield what a requirement demands, a line each, its id before the first."""
    asked = demands(entry) or ("limits not recorded",)
    yield f"{name}  {asked[0]}"
    yield from (f"{' ' * len(name)}  {line}" for line in asked[1:])


def _asked(told: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield the lines of requirements, with an empty one before the first, and around those of several lines."""
    for before, lines in zip([[""] * 2, *told], told, strict=False):
        if max(len(before), len(lines)) > 1:
            yield ""
        yield from lines


def _case(place: str, case: PlannedCase, events: Sequence[Placed]) -> Iterator[str]:
    yield f"{place} {case.case}"
    if case.title:
        yield f"{_INDENT * 2}{case.title}"
    ends = [(each.event, each.counted) for each in events if isinstance(each.event, CaseEnd)]
    left_out = next((each.event.reason for each in events if isinstance(each.event, NotRun)), "")
    took = duration(sum(end.duration for end, _ in ends)) if ends else f"not run{left_out and ': '}{left_out}"
    facts = (
        ("requirements", ", ".join(case.requirements) or "none (orphan)"),
        ("duration", f"{took}, at most {duration(case.max_duration)}"),
        *((("repeatable", case.repeatable),) if case.repeatable else ()),
        *(
            ("verdict", "; ".join((end.verdict.value, *end.reasons)))
            for end, counts in ends
            if counts and not end.verdict.good
        ),
    )
    yield from labelled(facts, indent=_INDENT * 2)
    by_step = _by(events, lambda each: each.step)
    ended = {each.event.number: each.event for each in events if isinstance(each.event, StepEnd)}
    for stretch in _stretches(events):
        first = stretch[0].event
        if isinstance(first, Step):
            yield from _step(first, ended.get(first.number), by_step.get(first.number, []))
        else:
            yield from _outside(stretch)


def _outside(stretch: Sequence[Placed]) -> Iterator[str]:
    """Yield what happens outside steps under its own heading; set-up fixtures often only read."""
    actions = list(_actions(stretch))
    if actions:
        yield f"{_INDENT * 2}-  {bench_time(stretch[0].event.t)}  Outside any step"
        yield from (f"{_INDENT * 4}{line}" for line in actions)


def _stretches(events: Sequence[Placed]) -> Iterator[list[Placed]]:
    """Yield every step's beginning alone, and what happens outside steps in one piece between them."""
    outside: list[Placed] = []
    for each in events:
        if isinstance(each.event, Step):
            if outside:
                yield outside
            yield [each]
            outside = []
        elif not each.step:
            outside.append(each)
    if outside:
        yield outside


def _by(events: Sequence[Placed], key: Callable[[Placed], str]) -> dict[str, list[Placed]]:
    grouped: dict[str, list[Placed]] = {}
    for each in events:
        grouped.setdefault(key(each), []).append(each)
    return grouped


def _step(step: Step, end: StepEnd | None, within: Sequence[Placed]) -> Iterator[str]:
    shift = _INDENT * (2 + step.number.count("."))
    during = f"({duration(end.duration)})" if end else ""
    yield f"{shift}{step.number}  {bench_time(step.t)}  {step.path[-1]}  {during}".rstrip()
    yield from (f"{shift}{_INDENT * 2}{line}" for line in _actions(within))


def _actions(events: Sequence[Placed]) -> Iterator[str]:
    """Yield what is driven, recorded, asked and checked, in order; equal calls are counted after the first few."""
    driven = [each.event for each in events if isinstance(each.event, Effect) and each.event.effect == "drives"]
    totals = Counter(effect.name for effect in driven)
    seen: Counter[str] = Counter()
    for each in events:
        event = each.event
        if isinstance(event, Effect) and event.effect == "drives":
            seen[event.name] += 1
            if seen[event.name] <= _MOST_ALIKE:
                yield f"drives   {event.name}({', '.join(_named_arguments(event.arguments))})"
            elif seen[event.name] == totals[event.name]:
                yield f"drives   {event.name} {counted(totals[event.name] - _MOST_ALIKE, 'more time')}"
        elif isinstance(event, Recording):
            yield f"records  {_recorded(event)}"
        elif isinstance(event, Question):
            options = f" ({', '.join(event.options)})" if event.options else ""
            yield f"asks     {event.form}: {event.text}{options}"
        elif isinstance(event, Check):
            of, limit = f" [{event.of}]" if event.of else "", limit_of(event)
            yield f"checks   {event.requirement} {event.parameter}{of}" + (
                f"  ({limit}, {event.decision})" if limit else ""
            )


def _recorded(recording: Recording) -> str:
    channels = ", ".join(f"{channel.name} [{channel.unit or '1'}]" for channel in recording.channels)
    parts = (channels, f"{number(recording.rate)} Hz", duration(recording.duration))
    return f"{recording.name}: {', '.join(part for part in parts if part)}"


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
        return quantity(value["value"], text(value, "unit"))
    if isinstance(value, Mapping):
        return "{" + ", ".join(_named_arguments(value)) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    return "none" if value is None else number(value)
