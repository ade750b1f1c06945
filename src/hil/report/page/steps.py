"""The procedure as it was run: the steps of a case with what was done in them, runs of equal steps folded into one."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, zip_longest
from pathlib import PurePath
from typing import TypeGuard

from hil.evidence.events import Answer, Effect, Question, Recording, Step, StepEnd
from hil.report.numbers import bench_time, duration, number, quantity
from hil.report.page.as_run import Placed, ids
from hil.report.page.view import Exchange, StepRow

__all__ = ["step_rows"]

_NUMBERS = re.compile(r"-?\d+(?:\.\d+)?")
_FEW = 4  # numbers of a run of steps, and calls of a step, that are named one by one
_EFFECTS = {"reads": "read", "waits": "wait", "asks": "question"}


@dataclass(frozen=True, slots=True)
class _Node:
    """A step with those inside it, or a run of steps that are alike as one."""

    rows: tuple[StepRow, ...]
    effects: tuple[Effect, ...]
    inner: tuple[_Node, ...] = ()

    @property
    def shape(self) -> object:
        """What steps that are alike have in common: their words but for numbers, and what is inside them."""
        return _NUMBERS.sub("#", self.rows[0].title), tuple(each.shape for each in self.inner)

    @property
    def quiet(self) -> bool:
        """Whether nothing in the step needs a row of its own: no question, no exception."""
        alone = all(row.outcome == "done" and not row.exchanges and not row.attempt for row in self.rows)
        return alone and all(each.quiet for each in self.inner)


def step_rows(events: Sequence[Placed]) -> tuple[StepRow, ...]:
    """Return the steps among the events of one case in the order in which they began, set-up and the like first.

    Runs of steps that are alike are folded into one row; one that did not end well, or asked a question, stands alone.
    """
    nodes = [
        _Node((_step(each, each.event, within),), _effects_of(within))
        for place, each in enumerate(events)
        if isinstance(each.event, Step)
        for within in [_within(events, place)]
    ]
    kinds = Effect | Question | Answer | Recording
    outside = [each for each in events if isinstance(each.event, kinds) and not each.step]
    rows = [row for node in _folded(_nested(nodes, 0)) for row in _flat(node)]
    return (_outside(outside), *rows) if outside else tuple(rows)


def _nested(nodes: Sequence[_Node], depth: int) -> tuple[_Node, ...]:
    """Return the steps of a depth, each with those that follow it and are deeper."""
    starts = [place for place, node in enumerate(nodes) if node.rows[0].depth <= depth]
    return tuple(
        replace(nodes[begin], inner=_nested(nodes[begin + 1 : end], depth + 1))
        for begin, end in pairwise([*starts, len(nodes)])
    )


def _folded(nodes: Sequence[_Node]) -> list[_Node]:
    """Return steps with neighbours that are alike as one, the innermost first."""
    found: list[_Node] = []
    for node in (replace(each, inner=tuple(_folded(each.inner))) for each in nodes):
        if found and found[-1].quiet and node.quiet and found[-1].shape == node.shape:
            found[-1] = _joined([found[-1], node])
        else:
            found.append(node)
    return found


def _joined(nodes: Sequence[_Node]) -> _Node:
    inner = tuple(_joined(parts) for parts in zip(*(node.inner for node in nodes), strict=True))
    rows = tuple(row for node in nodes for row in node.rows)
    return _Node(rows, tuple(effect for node in nodes for effect in node.effects), inner)


def _flat(node: _Node) -> Iterator[StepRow]:
    yield node.rows[0] if len(node.rows) == 1 else _run(node)
    for each in node.inner:
        yield from _flat(each)


def _run(node: _Node) -> StepRow:
    """Return one row for a run of steps that are alike."""
    first, last = node.rows[0], node.rows[-1]
    names = [name for row in node.rows for name in row.recordings]
    low, high = (duration(end(row.lasted or 0.0 for row in node.rows)) for end in (min, max))
    return replace(
        first,
        number=f"{first.number} to {last.number}",
        count=len(node.rows),
        title=_title([row.title for row in node.rows]),
        duration=f"each {low}" if low == high else f"{low} to {high}",
        effects=_counted(node.effects),
        recordings=(ids(names),) if names else (),
    )


def _title(titles: Sequence[str]) -> str:
    """Return titles that differ in numbers as one: `Cycle 1 to 115 of 115`, `Measure at 8, 12, 16 mA`."""
    words = _NUMBERS.split(titles[0])
    numbers = [dict.fromkeys(each) for each in zip(*map(_NUMBERS.findall, titles), strict=True)]
    shown = [", ".join(each) if len(each) <= _FEW else _span([*each]) for each in numbers]
    return "".join(part for pair in zip_longest(words, shown, fillvalue="") for part in pair)


def _span(numbers: Sequence[str]) -> str:
    return f"{numbers[0]} to {numbers[-1]}"


def _counted(effects: Iterable[Effect]) -> str:
    """Return the counts of driving calls, reads, waits and questions."""
    driven = Counter(effect.name for effect in effects if effect.effect == "drives")
    calls = [name if count == 1 else f"{name}() {count} times" for name, count in driven.items()]
    return "; ".join((*calls, *_others(effects)))


def _within(events: Sequence[Placed], place: int) -> list[Placed]:
    """Return what happened from the step at `place` until it ended, without the steps inside it."""
    number_ = events[place].step
    until = next(
        (
            later
            for later in range(place + 1, len(events))
            if isinstance(events[later].event, StepEnd) and events[later].step == number_
        ),
        len(events) - 1,
    )
    return [each for each in events[place : until + 1] if each.step == number_]


def _step(placed: Placed, begin: Step, within: Sequence[Placed]) -> StepRow:
    end = next((each.event for each in within if isinstance(each.event, StepEnd)), None)
    return StepRow(
        number=begin.number,
        attempt=placed.attempt,
        depth=begin.number.count("."),
        title=begin.path[-1] if begin.path else "",
        begin=bench_time(begin.t),
        duration=duration(end.duration) if end else "",
        outcome=end.outcome if end else "not ended",
        effects=_effects(within),
        recordings=tuple(each.event.recording for each in within if isinstance(each.event, Recording)),
        exchanges=_exchanges(within),
        lasted=end.duration if end else None,
    )


def _outside(events: Sequence[Placed]) -> StepRow:
    """Return a row for what a case did outside its steps: fixtures that set up, and what follows the last step."""
    return StepRow(
        number="-",
        attempt=events[0].attempt,
        depth=0,
        title="Outside any step",
        begin=bench_time(events[0].event.t),
        duration="",
        outcome="",
        effects=_effects(events),
        recordings=tuple(each.event.recording for each in events if isinstance(each.event, Recording)),
        exchanges=_exchanges(events),
    )


def _effects(within: Iterable[Placed]) -> str:
    """Return the driving calls one by one, and the counts of reads, waits and questions.

    Many calls that differ in numbers alone are one entry at the place of the first: the sweep of a load has a call for
    each of its points, and the journal holds them all.
    """
    effects = _effects_of(within)
    alike: dict[object, list[Effect]] = {}
    for effect in effects:
        if effect.effect == "drives":
            alike.setdefault(_words_of(effect), []).append(effect)
    shown = {
        id(effect): _call(effect) if len(calls) <= _FEW else _calls(calls)
        for calls in alike.values()
        for effect in (calls if len(calls) <= _FEW else calls[:1])
    }
    return "; ".join((*(shown[id(effect)] for effect in effects if id(effect) in shown), *_others(effects)))


def _words_of(effect: Effect) -> object:
    """Return what calls that differ in numbers alone have in common."""
    given = ((key, None if _is_number(value) else str(value)) for key, value in effect.arguments.items())
    return effect.name, tuple(given)


def _is_number(value: object) -> TypeGuard[int | float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _effects_of(within: Iterable[Placed]) -> tuple[Effect, ...]:
    return tuple(each.event for each in within if isinstance(each.event, Effect))


def _others(effects: Iterable[Effect]) -> tuple[str, ...]:
    times: Counter[str] = Counter(effect.effect for effect in effects)
    words = [(times[kind], word) for kind, word in _EFFECTS.items() if times[kind]]
    others = ", ".join(f"{count} {word}{'s' if count > 1 else ''}" for count, word in words)
    return (others,) if others else ()


def _call(effect: Effect) -> str:
    return f"{effect.name}({', '.join(f'{key}={value}' for key, value in effect.arguments.items())})"


def _calls(effects: Sequence[Effect]) -> str:
    """Return calls that differ in numbers alone as one: `load.constant_voltage(voltage=0 to 2.69) 41 times`."""
    given = ((key, [effect.arguments[key] for effect in effects]) for key in effects[0].arguments)
    told = ", ".join(f"{key}={_range(values)}" for key, values in given)
    return f"{effects[0].name}({told}) {len(effects)} times"


def _range(values: Sequence[object]) -> str:
    numbers = sorted({value for value in values if _is_number(value)})
    if not numbers:
        return str(values[0])
    low, high = number(numbers[0]), number(numbers[-1])
    return low if low == high else f"{low} to {high}"


def _exchanges(within: Iterable[Placed]) -> tuple[Exchange, ...]:
    """Return the questions, each with the next answer to it."""
    asked = [each.event for each in within if isinstance(each.event, Question)]
    waiting = [each.event for each in within if isinstance(each.event, Answer)]
    exchanges = []
    for question in asked:
        answer = next((each for each in waiting if each.name == question.name), None)
        if answer is not None:
            waiting.remove(answer)
        exchanges.append(_exchange(question, answer))
    return tuple(exchanges)


def _exchange(question: Question, answer: Answer | None) -> Exchange:
    return Exchange(
        form=question.form,
        text=question.text,
        options=", ".join(question.options),
        answer="" if answer is None else _answer(answer.value, question.unit),
        by="" if answer is None else answer.by,
        witness="" if answer is None else answer.witness,
        asked_witness=question.witness,
        file=answer.file.file if answer and answer.file else "",
        picture=PurePath(question.picture.file).name if question.picture else "",
    )


def _answer(value: bool | float | str, unit: str) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return value if isinstance(value, str) else quantity(value, unit)
