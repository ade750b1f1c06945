"""Analysis of a whole battery test in one call: cycles, fade, incremental capacity and gates."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

from hil.analysis.battery.cycles import Cycle, comparable, cycles
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

_LEAST = 3  # cycles needed for a fade

__all__ = ["FADING", "Summary", "incremental_capacities", "summarise"]

FADING = MappingProxyType(
    {
        "discharge_capacity": "Ah",
        "capacity_at_cut_off": "Ah",
        "discharge_energy": "Wh",
        "discharge_time": "s",
        "charge_energy": "Wh",
        "energy_efficiency": "1",
    }
)
"""The quantities whose change over cycles is reported, with their units."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """Results of a battery test.

    Attributes:
        cycles: all cycles in order.
        compared: the cycles that medians and fades are taken from.
        fades: fades over these, by name of quantity; empty if they are too few.
        gates: all gates, including those that could not be judged.
        skip: number of initial compared cycles that the fades leave out.
    """

    cycles: tuple[Cycle, ...]
    compared: tuple[Cycle, ...]
    fades: Mapping[str, Fade]
    gates: tuple[Gate, ...]
    skip: int = 0


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
        limits: limits of the test.
        declared: prior knowledge of the cell; missing voltage limits are taken from `limits`.
        how: segmentation settings.
        skip: number of initial complete cycles that the fade leaves out.
        remaining: end of life as a fraction of the initial value.
        counted: claimed number of cycles, to compare with the duration of the test.
    """
    limits, declared = limits or Limits(), declared or Declared()
    made = cycles(data, limits, how)
    whole = comparable(made, limits, declared.capacity)
    numbers = replace(
        told(made, whole),
        highest=float(data.voltage.max()),
        lowest=float(data.voltage.min()),
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
    gates = (*judge(numbers, facts), *singles)
    return Summary(cycles=made, compared=whole, fades=_fades(whole[skip:], remaining), gates=gates, skip=skip)


def incremental_capacities(
    data: Series, kind: StepKind, how: Segmentation | None = None
) -> tuple[IncrementalCapacity, ...]:
    """Return dQ/dV of each step of one kind, without its constant-voltage part.

    Steps that span too little voltage are left out.

    Args:
        data: the samples.
        kind: charge or discharge.
        how: segmentation settings.
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


def _fades(whole: Sequence[Cycle], remaining: float) -> dict[str, Fade]:
    found = {}
    for name, unit in FADING.items():
        rows = [(each.number, _value(each, name)) for each in whole]
        rows = [row for row in rows if math.isfinite(row[1])]
        if len(rows) >= _LEAST:
            numbers, values = zip(*rows, strict=True)
            found[name] = fade(numbers, values, unit, remaining=remaining)
    return found


def _value(cycle: Cycle, name: str) -> float:
    """Return a quantity of a cycle, NaN where its half-cycle is missing."""
    if name == "energy_efficiency":
        return cycle.energy_efficiency
    half = cycle.charge if name == "charge_energy" else cycle.discharge
    values = {
        "discharge_capacity": "charge",
        "capacity_at_cut_off": "charge_to_limit",
        "discharge_energy": "energy",
        "discharge_time": "duration",
        "charge_energy": "energy",
    }
    return math.nan if half is None else float(getattr(half, values[name]))
