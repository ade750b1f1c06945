"""Gates of a battery test: plausibility checks of its results before any conclusion."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.analysis.battery.cycles import Cycle
from hil.analysis.battery.half_cycle import HalfCycle
from hil.analysis.battery.series import SECONDS_PER_HOUR
from hil.analysis.gates import Gate

__all__ = ["Declared", "Told", "judge", "told", "tripped"]

_INTERVAL = (0.02, 3600.0)  # s: no cycler logs faster, or more slowly
_SWING = (180.0, 3.6e6)  # s: 20 C and C/1000
_MILLI = 100.0  # ratio from which the unit is wrong rather than a gain
_WIDE = 0.8  # V: swing that takes most of any cell's charge


@dataclass(frozen=True, slots=True, kw_only=True)
class Declared:
    """Prior knowledge of the cell and the test; None where unknown.

    Attributes:
        capacity: nominal capacity [Ah].
        energy: nominal energy [Wh].
        upper: highest permitted voltage [V].
        lower: lowest permitted voltage [V].
        slack: allowance beyond these for the instrument's uncertainty [V].
        mean_voltage: range of the chemistry's mean voltage [V]; by default lithium ion with cobalt, nickel or manganese
            at moderate currents. Lithium iron phosphate needs (3.0, 3.5).
        coulombic: range of plausible coulombic efficiencies.
        energetic: range of plausible energy efficiencies.
        nominal: range of plausible ratios of measured to nominal.
        elapsed: tolerance on cycles times duration against elapsed time, relative.
        runs: whether the log is known to consist of runs with unknown times between them.
    """

    capacity: float | None = None
    energy: float | None = None
    upper: float | None = None
    lower: float | None = None
    slack: float = 0.02
    mean_voltage: tuple[float, float] = (3.4, 3.95)
    coulombic: tuple[float, float] = (0.98, 1.005)
    energetic: tuple[float, float] = (0.85, 0.97)
    nominal: tuple[float, float] = (0.8, 1.15)
    elapsed: float = 0.05
    runs: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """Summary figures of a test, computed from samples or taken from a table; NaN where missing.

    Attributes:
        charge_in: charge of a charge half-cycle [Ah].
        charge_out: charge of a discharge [Ah].
        energy_in: energy of a charge half-cycle [Wh].
        energy_out: energy of a discharge [Wh].
        highest: highest voltage of all samples, including rests [V].
        lowest: lowest voltage of all samples, including rests [V].
        duration: duration of one cycle [s].
        count: number of cycles.
        elapsed: duration of the test [s].
        interval: typical sampling interval [s].
        swing: median duration of a charge or discharge over most of a cell's voltage range [s].
    """

    charge_in: float = math.nan
    charge_out: float = math.nan
    energy_in: float = math.nan
    energy_out: float = math.nan
    highest: float = math.nan
    lowest: float = math.nan
    duration: float = math.nan
    count: float = math.nan
    elapsed: float = math.nan
    interval: float = math.nan
    swing: float = math.nan


def told(made: Sequence[Cycle], whole: Sequence[Cycle] | None = None) -> Told:
    """Return the summary figures of a test: medians over its complete cycles, extremes over all.

    Args:
        made: the cycles; without a complete one all but the extremes are NaN.
        whole: the cycles for the medians, by default the complete ones.
    """
    halves = [half for each in made for half in (each.charge, each.discharge) if half is not None]
    extremes = Told(
        highest=max((half.highest_voltage for half in halves), default=math.nan),
        lowest=min((half.lowest_voltage for half in halves), default=math.nan),
        swing=_swing(halves),
    )
    whole = [each for each in made if each.complete] if whole is None else whole
    if not whole:
        return extremes
    ins, outs = [each.charge for each in whole], [each.discharge for each in whole]
    return replace(
        extremes,
        charge_in=_median(ins, "charge"),
        charge_out=_median(outs, "charge"),
        energy_in=_median(ins, "energy"),
        energy_out=_median(outs, "energy"),
        duration=float(np.median([each.duration for each in whole])),
    )


def judge(numbers: Told, declared: Declared) -> tuple[Gate, ...]:
    """Return every gate with its finding; `ok` is None where a figure or a fact is missing.

    Args:
        numbers: from `told`, or from a published table.
        declared: what they are held against.
    """
    return tuple(_gates(numbers, declared))


def tripped(numbers: Told, declared: Declared) -> tuple[Gate, ...]:
    """Return the gates that trip.

    Args:
        numbers: from `told`, or from a published table.
        declared: what they are held against.
    """
    return tuple(gate for gate in judge(numbers, declared) if gate.ok is False)


def _gates(numbers: Told, declared: Declared) -> Iterator[Gate]:
    span = declared.mean_voltage
    for name, energy, charge in (
        ("mean_charge_voltage", numbers.energy_in, numbers.charge_in),
        ("mean_discharge_voltage", numbers.energy_out, numbers.charge_out),
    ):
        advice = "current or voltage is measured elsewhere than at the cell, or has a wrong gain or offset"
        yield _between(name, "V", _over(energy, charge), span, advice)
    yield _sign(numbers)
    advice = "the current has an offset, or charge and discharge do not belong together"
    yield _between(
        "coulombic_efficiency", "1", _over(numbers.charge_out, numbers.charge_in), declared.coulombic, advice
    )
    advice = "voltage or current is measured elsewhere than at the cell, or the resistance is high"
    yield _between("energy_efficiency", "1", _over(numbers.energy_out, numbers.energy_in), declared.energetic, advice)
    ratio = _over(numbers.charge_out, declared.capacity)
    advice = "the gain of the current or the declared value is wrong"
    milli = "currents are taken as A; give --current-unit mA if they are in mA"
    yield _between("capacity_ratio", "1", ratio, declared.nominal, milli if ratio > _MILLI else advice)
    yield _between("energy_ratio", "1", _over(numbers.energy_out, declared.energy), declared.nominal, advice)
    yield _elapsed(numbers, declared)
    yield _time_unit(numbers)
    yield _limit("highest_voltage", numbers.highest, declared.upper, declared.slack)
    yield _limit("lowest_voltage", numbers.lowest, declared.lower, -declared.slack)


def _between(name: str, unit: str, value: float, span: tuple[float, float], advice: str) -> Gate:
    if math.isnan(value):
        return Gate(name=name, channel="", ok=None, reason="not judged: a number that it needs is missing")
    suffix = "" if unit == "1" else f" {unit}"
    ok = span[0] <= value <= span[1]
    found = f"{value:.4g}{suffix}, expected {span[0]:g} to {span[1]:g}{suffix}"
    return Gate(name=name, channel="", ok=ok, reason=found if ok else f"{found}: {advice}")


def _sign(numbers: Told) -> Gate:
    """Return the gate on charge voltage above discharge voltage, as the cell's resistance requires."""
    taken, given = _over(numbers.energy_in, numbers.charge_in), _over(numbers.energy_out, numbers.charge_out)
    if math.isnan(taken) or math.isnan(given):
        return Gate(name="current_sign", channel="", ok=None, reason="not judged: it needs a charge and a discharge")
    found = f"mean voltage {taken:.4g} V of the charge, {given:.4g} V of the discharge"
    advice = ": the charge must be the higher one; check the sign of the current (--discharge-positive)"
    return Gate(name="current_sign", channel="", ok=taken >= given, reason=found if taken >= given else found + advice)


def _elapsed(numbers: Told, declared: Declared) -> Gate:
    expected = _over(numbers.elapsed, numbers.duration)
    if math.isnan(expected) or math.isnan(numbers.count):
        return Gate(
            name="elapsed_time",
            channel="",
            ok=None,
            reason="not judged: it needs a count of cycles and the elapsed time",
        )
    ok = abs(numbers.count / expected - 1.0) <= declared.elapsed
    hours = numbers.elapsed / SECONDS_PER_HOUR
    found = f"{hours:.4g} h hold {expected:.4g} cycles of {numbers.duration / SECONDS_PER_HOUR:.3g} h"
    return Gate(name="elapsed_time", channel="", ok=ok, reason=f"{found}, {numbers.count:g} were counted")


def _time_unit(numbers: Told) -> Gate:
    """Return the gate on the time unit: hours read as seconds would discharge a cell within moments."""
    found, doubt = [], False
    for value, span, what in (
        (numbers.interval, _INTERVAL, f"samples each {numbers.interval:.3g} s"),
        (numbers.swing, _SWING, f"a charge or discharge in {numbers.swing:.3g} s, {_rate(numbers.swing)}"),
    ):
        if not math.isnan(value):
            found.append(what)
            doubt |= not span[0] <= value <= span[1]
    if not found:
        return Gate(name="time_unit", channel="", ok=None, reason="not judged: there are no samples")
    advice = ": implausible; check the unit of the time (--time-unit)" if doubt else ""
    return Gate(name="time_unit", channel="", ok=not doubt, reason="; ".join(found) + advice)


def _rate(swing: float) -> str:
    return "" if math.isnan(swing) or swing <= 0 else f"about {SECONDS_PER_HOUR / swing:.2g} C"


def _swing(halves: Sequence[HalfCycle]) -> float:
    lasted = [half.duration for half in halves if half.highest_voltage - half.lowest_voltage >= _WIDE]
    return float(np.median(lasted)) if lasted else math.nan


def _limit(name: str, value: float, limit: float | None, slack: float) -> Gate:
    if limit is None or math.isnan(value):
        return Gate(name=name, channel="", ok=None, reason="not judged: it needs a limit and samples")
    ok = value <= limit + slack if slack >= 0 else value >= limit + slack
    found = f"{value:.4g} V, limit {limit:g} V"
    advice = "stop such a test, and find out what drove the cell beyond it"
    if value > _MILLI * limit:
        advice = "voltages are taken as V; give --voltage-unit mV if they are in mV"
    return Gate(name=name, channel="", ok=ok, reason=found if ok else f"{found}: {advice}")


def _over(value: float, by: float | None) -> float:
    return value / by if by is not None and by > 0 else math.nan


def _median(halves: Sequence[HalfCycle | None], what: str) -> float:
    values = [getattr(half, what) for half in halves if half is not None]
    return float(np.median(values)) if values else math.nan
