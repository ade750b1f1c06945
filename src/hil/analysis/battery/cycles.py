"""Cycles of charge and discharge: efficiencies, rests, resistances, and how much the cell has been through."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hil.analysis.battery.grouping import Group, groups
from hil.analysis.battery.half_cycle import Flow, HalfCycle, Limits, flow, half_cycle
from hil.analysis.battery.series import Series
from hil.analysis.battery.steps import Segmentation, Step, StepKind, gaps, segment

__all__ = ["Cycle", "Resistance", "Rest", "cycles", "equivalent_full_cycles", "resistances"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Rest:
    """A step without current.

    Attributes:
        after: what came before it; None where the series begins with it.
        voltage: of its last sample, in V.
        duration: s that it lasted; a cell needs an hour or more to settle.
    """

    after: StepKind | None
    voltage: float
    duration: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Resistance:
    """Change of voltage over change of current at the edge of a step.

    Attributes:
        time: s, of the first sample after the edge.
        before: kind of the step before.
        after: kind of the step after.
        value: ohm.
        delay: s between the two samples: the resistance is one that acts within this time, and grows with it.
    """

    time: float
    before: StepKind
    after: StepKind
    value: float
    delay: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Cycle:
    """One charge and one discharge, and the rests with them.

    Attributes:
        number: of the source where it counts them, else from 1.
        start: s, of its first sample.
        duration: s to the first sample of the next cycle; to the last sample for the last cycle of a stretch.
        complete: whether it has charge and discharge, is not the part that a series or a stretch of it begins or
            ends in, as far as that can be told, and has lost nothing to a gap across an edge.
        charge: its charge; None where there is none.
        discharge: its discharge.
        coulombic_efficiency: charge out over charge in; NaN where one is missing.
        energy_efficiency: energy out over energy in.
        rests: in order.
        resistances: at its edges.
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


def cycles(data: Series, limits: Limits | None = None, how: Segmentation | None = None) -> tuple[Cycle, ...]:
    """Return the cycles of a series.

    Where the series numbers its cycles these numbers hold, numbered on where a new test begins anew. Else a cycle
    begins with each step of the kind that came first in the test, charge or discharge, after one of the other kind.

    Args:
        data: the samples.
        limits: levels for times to voltage and current.
        how: how steps are told apart.
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
    """Return the resistance at each edge between two steps, gaps and edges of little current left out.

    R = (V1 - V0) / (I1 - I0), of the last sample before the edge and the first after it.

    Args:
        data: the samples.
        steps: from `segment`.
        how: `Segmentation.gap` says what is a gap.
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


def equivalent_full_cycles(made: Sequence[Cycle], capacity: float) -> float:
    """Return the charge that went through the cell, in and out, over twice its capacity.

    Args:
        made: the cycles.
        capacity: nominal, in Ah, above zero.
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
