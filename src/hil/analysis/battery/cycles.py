"""Charge-discharge cycles: efficiencies, rests, resistances, and charge throughput."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hil.analysis.battery.half_cycle import Flow, HalfCycle, Limits, flow, half_cycle
from hil.analysis.battery.series import Series
from hil.analysis.battery.steps import Segmentation, Step, StepKind, gaps, segment
from hil.analysis.tracing import traced

__all__ = [
    "Cycle",
    "Group",
    "Resistance",
    "Rest",
    "comparable",
    "cycles",
    "equivalent_full_cycles",
    "groups",
    "resistances",
]

_WHOLE = 0.5  # of the capacity: a discharge that yields less did not begin with a full cell
_SLACK = 0.1  # V: under load the last sample before the cut-off lies above it by the drop over one interval


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """The steps of one cycle.

    Attributes:
        number: the source's cycle number, or counted from 1; continued where a new test restarts its count.
        steps: the steps in order, at least one of them charge or discharge.
        cut: whether the series begins or ends within it, or may lack a part of it, as far as detectable.
        end: index of the sample at which its time ends: the first of the next cycle, or the last of its stretch.
    """

    number: int
    steps: tuple[Step, ...]
    cut: bool
    end: int


def groups(data: Series, steps: Sequence[Step], limits: Limits) -> tuple[Group, ...]:
    """Return the steps of each cycle that has a charge or a discharge.

    No cycle spans stretches. Where a new test restarts its count, numbering continues after the highest number so far,
    so that cycle numbers are unique across tests.

    Args:
        data: the samples.
        steps: from `segment`.
        limits: levels that show whether a step ended or was cut.
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
    charged = {data.test_of(step.first) for step in steps if step.kind is StepKind.CHARGE}
    group = [steps[0]]
    for before, step in pairwise(steps):
        test = data.test_of(step.first)
        full = data.cycle is None and test not in charged and _is_full_again(data, group, step)
        if broken[before.last] or full or _begins(data, group, step, leading.get(test)):
            yield group
            group = []
        group.append(step)
    yield group


def _leading(data: Series, steps: Sequence[Step]) -> dict[int, StepKind]:
    """Return, for each test, whether charge or discharge came first."""
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


def _is_full_again(data: Series, group: Sequence[Step], step: Step) -> bool:
    """Return whether the rest voltage before this discharge is as high as before the first (charges not logged)."""
    discharges = [each.first for each in group if each.kind is StepKind.DISCHARGE]
    if step.kind is not StepKind.DISCHARGE or not discharges:
        return False
    return bool(data.voltage[step.first - 1] > data.voltage[max(discharges[0] - 1, 0)] - _SLACK)


def _told(data: Series, step: Step) -> int:
    """Return the cycle number at the middle of a step: at its edges a mark may come a sample early or late."""
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
    """Return whether a stretch begins within the cycle's first step: the test was already running, unlogged."""
    first = group[0].first
    if not first or group[0].kind is StepKind.REST or not data.broken[first - 1]:
        return False
    return data.test_of(first) == data.test_of(first - 1)


def _ends_cut(data: Series, end: Step, limits: Limits) -> bool:
    """Return whether a stretch ends within the cycle's last step, which only a limit not reached can show.

    Without that limit, a step at the end of the whole series counts as ended, one followed by another stretch as cut.
    """
    if end.kind is StepKind.REST:
        return False
    unknown = end.last < data.time.size - 1
    if end.kind is StepKind.DISCHARGE:
        lowest = data.voltage[end.first : end.last + 1].min()
        return unknown if limits.lower is None else bool(lowest > limits.lower + _SLACK)
    last = abs(data.current[end.last])
    return unknown if limits.cut_off is None else bool(last > 2.0 * limits.cut_off)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rest:
    """A step without current.

    Attributes:
        after: kind of the step before it; None if the series begins with it.
        voltage: voltage of its last sample [V].
        duration: its duration [s]; a cell needs an hour or more to settle.
    """

    after: StepKind | None
    voltage: float
    duration: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Resistance:
    """Resistance at the edge of a step: change of voltage over change of current.

    Attributes:
        time: time of the first sample after the edge [s].
        before: kind of the step before.
        after: kind of the step after.
        value: the resistance [ohm].
        delay: time between the two samples [s]: the resistance includes all that acts within it, and grows with it.
    """

    time: float
    before: StepKind
    after: StepKind
    value: float
    delay: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Cycle:
    """One charge and one discharge with their rests.

    Attributes:
        number: the source's cycle number, or counted from 1.
        start: time of its first sample [s].
        duration: time to the first sample of the next cycle, or to the last sample of its stretch [s].
        complete: whether it has charge and discharge, is not cut by the beginning or end of a series or stretch, as
            far as detectable, and has no gap across an edge.
        charge: its charge; None if there is none.
        discharge: its discharge; None if there is none.
        coulombic_efficiency: charge out over charge in; NaN where one is missing.
        energy_efficiency: energy out over energy in; NaN where one is missing.
        rests: its rests in order.
        resistances: the resistances at its edges.
    """

    number: int
    start: float
    duration: float
    complete: bool
    charge: HalfCycle | None
    discharge: HalfCycle | None
    coulombic_efficiency: float
    energy_efficiency: float
    rests: tuple[Rest, ...]
    resistances: tuple[Resistance, ...]


@traced
def cycles(data: Series, limits: Limits | None = None, how: Segmentation | None = None) -> tuple[Cycle, ...]:
    """Return the cycles of a series.

    Cycle numbers of the series are used, and continued where a new test restarts its count. Without them a cycle begins
    with each step of the kind that came first in the test, charge or discharge, after one of the other kind.

    Args:
        data: the samples.
        limits: voltage and current limits of the test.
        how: segmentation settings.
    """
    how, limits = how or Segmentation(), limits or Limits()
    steps = segment(data, how)
    flows = flow(data, steps, how)
    edges = resistances(data, steps, how)
    made = []
    for group in groups(data, steps, limits):
        ends = (float(data.time[group.steps[0].first]), float(data.time[group.end]))
        near = tuple(each for each in edges if ends[0] <= each.time <= data.time[group.steps[-1].last])
        made.append(_cycle(data, group, ends, flows, limits, near, steps))
    return tuple(made)


def resistances(data: Series, steps: Sequence[Step], how: Segmentation | None = None) -> tuple[Resistance, ...]:
    """Return the resistance at each edge between two steps, without gaps and edges with little change of current.

    R = (V1 - V0) / (I1 - I0), from the last sample before the edge and the first after it.

    Args:
        data: the samples.
        steps: from `segment`.
        how: segmentation settings; `gap` defines a gap.
    """
    missing = gaps(data.time, how) | data.broken
    least = 0.1 * float(np.percentile(np.abs(data.current), 95.0))
    found = []
    for before, after in pairwise(steps):
        place = after.first
        change = float(data.current[place] - data.current[place - 1])
        if missing[place - 1] or abs(change) <= least:
            continue
        found.append(
            Resistance(
                time=float(data.time[place]),
                before=before.kind,
                after=after.kind,
                value=float(data.voltage[place] - data.voltage[place - 1]) / change,
                delay=float(data.time[place] - data.time[place - 1]),
            )
        )
    return tuple(found)


def comparable(made: Sequence[Cycle], limits: Limits, capacity: float | None) -> tuple[Cycle, ...]:
    """Return the cycles that medians and fades are taken from: the complete ones.

    In a log without any charge these are the discharges that reached the lower limit and, if the capacity is known,
    yielded at least half of it: that they began with a full cell cannot be verified further.

    Args:
        made: the cycles.
        limits: limits of the test.
        capacity: nominal capacity [Ah]; None if unknown.
    """
    if capacity is None or any(each.charge is not None for each in made):
        return tuple(each for each in made if each.complete)
    lowest = math.inf if limits.lower is None else limits.lower + _SLACK
    return tuple(
        each
        for each in made
        if (half := each.discharge) is not None
        and half.lowest_voltage <= lowest
        and half.charge >= _WHOLE * capacity
        and not half.gaps
    )


def equivalent_full_cycles(made: Sequence[Cycle], capacity: float) -> float:
    """Return the equivalent full cycles: charge throughput, in and out, over twice the capacity.

    Args:
        made: the cycles.
        capacity: nominal capacity [Ah], above zero.
    """
    halves = [half for each in made for half in (each.charge, each.discharge) if half is not None]
    return sum(half.charge for half in halves) / (2.0 * capacity)


def _cycle(
    data: Series,
    group: Group,
    ends: tuple[float, float],
    flows: Flow,
    limits: Limits,
    edges: tuple[Resistance, ...],
    steps: Sequence[Step],
) -> Cycle:
    halves = {}
    for kind in (StepKind.CHARGE, StepKind.DISCHARGE):
        own = [step for step in group.steps if step.kind is kind]
        halves[kind] = half_cycle(data, own, flows, limits) if own else None
    charge, discharge = halves[StepKind.CHARGE], halves[StepKind.DISCHARGE]
    lost = bool(flows.lost[max(group.steps[0].first - 1, 0) : group.steps[-1].last + 1].any())
    both = charge is not None and discharge is not None
    return Cycle(
        number=group.number,
        start=ends[0],
        duration=ends[1] - ends[0],
        complete=both and not lost and not group.cut,
        charge=charge,
        discharge=discharge,
        coulombic_efficiency=_ratio(discharge, charge, "charge"),
        energy_efficiency=_ratio(discharge, charge, "energy"),
        rests=tuple(_rest(data, steps, step) for step in group.steps if step.kind is StepKind.REST),
        resistances=edges,
    )


def _rest(data: Series, steps: Sequence[Step], step: Step) -> Rest:
    place = steps.index(step)
    return Rest(
        after=steps[place - 1].kind if place and not data.broken[step.first - 1] else None,
        voltage=float(data.voltage[step.last]),
        duration=float(data.time[step.last] - data.time[step.first]),
    )


def _ratio(out: HalfCycle | None, taken: HalfCycle | None, what: str) -> float:
    if out is None or taken is None or not getattr(taken, what) > 0:
        return math.nan
    return float(getattr(out, what) / getattr(taken, what))
