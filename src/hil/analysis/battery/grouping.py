"""Which steps make a cycle, what its number is, and whether the series cuts it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from hil.analysis.battery.half_cycle import Limits
from hil.analysis.battery.series import Series
from hil.analysis.battery.steps import Step, StepKind

__all__ = ["Group", "groups"]

_SLACK = 0.1  # V: under load the last sample before the cut-off lies above it by what one interval takes


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """The steps of one cycle.

    Attributes:
        number: of the source where it counts them, else from 1; numbered on where a new test begins anew.
        steps: in order, at least one of them charge or discharge.
        cut: whether the series begins or ends within it, or may lack a part of it, as far as that can be told.
        end: index of the sample at which its time ends: the first of the next cycle, or the last of its stretch.
    """

    number: int
    steps: tuple[Step, ...]
    cut: bool
    end: int


def groups(data: Series, steps: Sequence[Step], limits: Limits) -> tuple[Group, ...]:
    """Return the steps of each cycle that has a charge or a discharge.

    No cycle goes across stretches. Where a new test counts from the beginning again, its numbers go on behind the
    highest before them, so that no two cycles of different tests share one.

    Args:
        data: the samples.
        steps: from `segment`.
        limits: levels that show whether a step was ended or cut.
    """
    broken = data.broken
    found = [each for each in _runs(data, steps) if any(step.kind is not StepKind.REST for step in each)]
    numbers = _numbers(data, found)
    made = []
    for place, group in enumerate(found):
        last = group[-1].last
        ends = last == data.time.size - 1 or bool(broken[last])
        after = found[place + 1] if place + 1 < len(found) else None
        skipped = after is not None and ends and data.cycle is not None and numbers[place + 1] > numbers[place] + 1
        cut = skipped or _begins_cut(data, group) or (ends and _ends_cut(data, group[-1], limits))
        made.append(
            Group(number=numbers[place], steps=tuple(group), cut=cut, end=last if ends else min(last + 1, broken.size))
        )
    return tuple(made)


def _runs(data: Series, steps: Sequence[Step]) -> Iterator[list[Step]]:
    broken, leading = data.broken, _leading(data, steps)
    group = [steps[0]]
    for before, step in pairwise(steps):
        if broken[before.last] or _begins(data, group, step, leading.get(data.test_of(step.first))):
            yield group
            group = []
        group.append(step)
    yield group


def _leading(data: Series, steps: Sequence[Step]) -> dict[int, StepKind]:
    """Return by test whether charge or discharge came first."""
    leading = dict[int, StepKind]()
    for step in steps:
        if step.kind is not StepKind.REST:
            leading.setdefault(data.test_of(step.first), step.kind)
    return leading


def _begins(data: Series, group: Sequence[Step], step: Step, leading: StepKind | None) -> bool:
    active = [each for each in group if each.kind is not StepKind.REST]
    if step.kind is StepKind.REST or not active:
        return False
    if data.cycle is not None:
        return _told(data, step) != _told(data, active[-1])
    return step.kind is leading and any(each.kind is not leading for each in active)


def _told(data: Series, step: Step) -> int:
    """Return the number of the cycle in the middle of a step: at its edges a mark may come a sample early or late."""
    return 0 if data.cycle is None else int(data.cycle[(step.first + step.last) // 2])


def _numbers(data: Series, found: Sequence[Sequence[Step]]) -> list[int]:
    numbers = list[int]()
    test, offset = 0, 0
    for counted, group in enumerate(found, start=1):
        if data.cycle is None:
            numbers.append(counted)
            continue
        told = _told(data, next(step for step in group if step.kind is not StepKind.REST))
        if data.test_of(group[0].first) != test:
            test, highest = data.test_of(group[0].first), max(numbers, default=0)
            offset = highest - told + 1 if numbers and told <= highest else 0
        numbers.append(told + offset)
    return numbers


def _begins_cut(data: Series, group: Sequence[Step]) -> bool:
    """Tell whether a stretch begins within the cycle's first step: the same test had gone on before, unseen."""
    first = group[0].first
    if not first or group[0].kind is StepKind.REST or not data.broken[first - 1]:
        return False
    return data.test_of(first) == data.test_of(first - 1)


def _ends_cut(data: Series, end: Step, limits: Limits) -> bool:
    """Tell whether a stretch ends within the cycle's last step; only a level that was not reached shows it.

    Without the level the end of the whole series counts as an end, what another stretch follows as cut.
    """
    if end.kind is StepKind.REST:
        return False
    unknown = end.last < data.time.size - 1
    if end.kind is StepKind.DISCHARGE:
        lowest = data.voltage[end.first : end.last + 1].min()
        return unknown if limits.lower is None else bool(lowest > limits.lower + _SLACK)
    last = abs(data.current[end.last])
    return unknown if limits.cut_off is None else bool(last > 2.0 * limits.cut_off)
