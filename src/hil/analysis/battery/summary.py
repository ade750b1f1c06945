"""A whole battery test in one call: cycles, fade, incremental capacity, and gates."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

from hil.analysis.battery.cycles import Cycle, cycles
from hil.analysis.battery.fade import Fade, fade
from hil.analysis.battery.gates import Declared, judge, told
from hil.analysis.battery.half_cycle import Limits, flow
from hil.analysis.battery.incremental import IncrementalCapacity, incremental_capacity
from hil.analysis.battery.integration import cumulative
from hil.analysis.battery.series import Series, usual_interval
from hil.analysis.battery.singles import judge_singles
from hil.analysis.battery.steps import Segmentation, StepKind, segment
from hil.analysis.gates import Gate
from hil.analysis.tracing import traced
from hil.model.errors import Refused

__all__ = ["FADING", "Summary", "incremental_capacities", "summarise"]

FADING = MappingProxyType(
    {
        "discharge_capacity": "Ah",
        "discharge_energy": "Wh",
        "discharge_time": "s",
        "charge_energy": "Wh",
        "energy_efficiency": "1",
    }
)
"""The quantities whose change over cycles is told, with their units."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """What a battery test shows.

    Attributes:
        cycles: in order.
        fades: by name of quantity, over the complete cycles; empty if they are too few.
        gates: all of them, also those that could not be judged.
    """

    cycles: tuple[Cycle, ...]
    fades: Mapping[str, Fade]
    gates: tuple[Gate, ...]


@traced
def summarise(
    data: Series,
    *,
    limits: Limits | None = None,
    declared: Declared | None = None,
    how: Segmentation | None = None,
    skip: int = 0,
    remaining: float = 0.8,
    counted: int | None = None,
) -> Summary:
    """Return cycles, fade and gates of a test.

    Args:
        data: the samples.
        limits: levels that the test is run between.
        declared: what is known of the cell; its limits are those of `limits` where it has none.
        how: how steps are distinguished.
        skip: complete cycles at the beginning that the fade leaves out.
        remaining: fraction of the beginning at which life ends.
        counted: how many cycles somebody says there were, to hold against the time that the test took.
    """
    limits, declared = limits or Limits(), declared or Declared()
    made = cycles(data, limits, how)
    numbers = replace(
        told(made),
        count=math.nan if counted is None else float(counted),
        elapsed=float(data.time[-1] - data.time[0]),
        interval=usual_interval(data.time),
    )
    facts = replace(
        declared,
        upper=limits.upper if declared.upper is None else declared.upper,
        lower=limits.lower if declared.lower is None else declared.lower,
    )
    singles = judge_singles(data, segment(data, how), made, capacity=declared.capacity, runs=declared.runs)
    return Summary(cycles=made, fades=_fades(made, skip, remaining), gates=(*judge(numbers, facts), *singles))


def incremental_capacities(
    data: Series, kind: StepKind, how: Segmentation | None = None
) -> tuple[IncrementalCapacity, ...]:
    """Return dQ/dV of each step of one kind, without its part at constant voltage.

    Steps that are too short on the voltage axis are left out.

    Args:
        data: the samples.
        kind: charge or discharge.
        how: how steps are distinguished.
    """
    steps = segment(data, how)
    charge = cumulative(flow(data, steps, how).charge[kind])
    found = []
    for step in steps:
        part = slice(step.first, step.last + 1 if step.cv is None else step.cv)
        if step.kind is kind and part.stop - part.start > 1:
            try:
                found.append(incremental_capacity(data.voltage[part], charge[part]))
            except Refused:
                continue
    return tuple(found)


def _fades(made: Sequence[Cycle], skip: int, remaining: float) -> dict[str, Fade]:
    whole = [each for each in made if each.complete][skip:]
    if len(whole) < 3:
        return {}
    numbers = [each.number for each in whole]
    rows = {name: [_value(each, name) for each in whole] for name in FADING}
    return {name: fade(numbers, row, FADING[name], remaining=remaining) for name, row in rows.items()}


def _value(cycle: Cycle, name: str) -> float:
    if cycle.charge is None or cycle.discharge is None:
        return math.nan
    return {
        "discharge_capacity": cycle.discharge.charge,
        "discharge_energy": cycle.discharge.energy,
        "discharge_time": cycle.discharge.duration,
        "charge_energy": cycle.charge.energy,
        "energy_efficiency": cycle.energy_efficiency,
    }[name]
