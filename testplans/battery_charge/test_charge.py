"""Ten cycles of charge and discharge, and what every one of them tells of the battery."""

from __future__ import annotations

import math

import pytest

from hil.analysis import (
    Certainty,
    Column,
    Declared,
    Limits,
    StepKind,
    as_csv,
    incremental_capacities,
    not_observable,
    observed,
    series,
    summarise,
)
from hil.plan import Curve, Figure

OF_THE_DECLARATION = {"capacity_ratio", "energy_ratio"}
"""Gates that speak against what the maker declares as much as against the tester."""

BROKEN_OFF = 0.5
"""A current that fades is not much below that which ends a charge when it ends it; this part of it is."""

IN_THE_REST = "the run was stopped in the rest after this discharge"
REST_VOLTAGES = ("rest_voltage_charged", "rest_voltage_discharged")
NO_REST = "there was no rest after this half-cycle: the parameter 'rest' is 0 s"

S_PER_H = 3600.0
LINE_S = 5.0

TABLE = (
    ("discharge_time", "h", 4),
    ("charge_time", "h", 4),
    ("charge_temperature_high", "degC", 1),
    ("charge_temperature_low", "degC", 1),
    ("discharge_temperature_high", "degC", 1),
    ("discharge_temperature_low", "degC", 1),
    ("charge_energy", "Wh", 3),
    ("discharge_energy", "Wh", 3),
    ("charge_capacity", "Ah", 4),
    ("discharge_capacity", "Ah", 4),
    ("charge_mean_voltage", "V", 4),
    ("discharge_mean_voltage", "V", 4),
    ("coulombic_efficiency", "1", 4),
    ("energy_efficiency", "1", 4),
    ("constant_current_time", "h", 4),
    ("constant_voltage_time", "h", 4),
    ("constant_current_capacity", "Ah", 4),
    ("constant_voltage_capacity", "Ah", 4),
    ("resistance", "ohm", 4),
    ("rest_voltage_charged", "V", 3),
    ("rest_voltage_discharged", "V", 3),
    ("end_of_charge_voltage", "V", 3),
    ("end_of_charge_current", "A", 3),
    ("end_of_discharge_voltage", "V", 3),
)
"""Columns of the table of iterations with unit and decimals; the first ones are those of the published Table 1."""

COLUMNS_OF_TABLE_1 = 8

LIMITED = {
    "end_of_charge_voltage": "EPS-BAT-001",
    "end_of_charge_current": "EPS-BAT-001",
    "end_of_discharge_voltage": "EPS-BAT-002",
    "charge_energy": "EPS-BAT-006",
}
HEADLINES = {
    "discharge_energy": "Discharged energy",
    "energy_efficiency": "Energy efficiency",
    "resistance": "Resistance",
}
"""What the first page of the report calls a column."""

OF_TABLE_1 = "EPS-BAT-007"
BEYOND_TABLE_1 = "EPS-BAT-008"


def certainty_of(recording):
    """Return how well the tester knows: by its certificate, and by its clock, which not every firmware tells."""
    return Certainty(
        interval=LINE_S,
        voltage=recording.uncertainty("voltage"),
        current=recording.uncertainty("current"),
        temperature=recording.uncertainty("temperature"),
        drift=recording.stream.drift,
        drift_uncertainty=recording.stream.drift_uncertainty,
    )


def of_half(half, kind, known):
    """Return what charge and discharge have in common, by name of the column."""
    return {
        f"{kind}_temperature_high": Figure(value=half.temperature_high, unit="degC", uncertainty=known.temperature),
        f"{kind}_temperature_low": Figure(value=half.temperature_low, unit="degC", uncertainty=known.temperature),
        f"{kind}_energy": Figure(value=half.energy, unit="Wh", uncertainty=known.energy(half)),
        f"{kind}_capacity": Figure(value=half.charge, unit="Ah", uncertainty=known.charge(half)),
        f"{kind}_mean_voltage": Figure(value=half.mean_voltage, unit="V", uncertainty=known.voltage),
    }


def resistance_of(made, known):
    """Return the resistance [ohm] that acts within one line where the charge gives way to the discharge."""
    edge = next((each for each in made.resistances if each.after is StepKind.DISCHARGE), None)
    if edge is None:
        return not_observable("ohm")
    return Figure(value=edge.value, unit="ohm", uncertainty=known.resistance(made.discharge.current))


def rest_voltage(made, after, known):
    """Return the voltage [V] at the end of the rest after a charge or a discharge."""
    rest = next((each for each in made.rests if each.after is after), None)
    return not_observable("V") if rest is None else Figure(value=rest.voltage, unit="V", uncertainty=known.voltage)


def row_of(made, known, end_current):
    """Return the figures of one cycle by name of the column; all of them not observable where it has a half only."""
    if made is None or made.charge is None or made.discharge is None:
        return {name: not_observable(unit) for name, unit, _ in TABLE}
    charge, discharge = made.charge, made.discharge

    def hours(seconds, uncertainty):
        return Figure(value=seconds / S_PER_H, unit="h", uncertainty=uncertainty and uncertainty / S_PER_H)

    charged, discharged = charge.time_to_cut_off, discharge.time_to_limit
    of_charge = known.time_to(charged, known.current, charge.cut_off_sensitivity)
    of_fading = known.time_to(charge.cv_time, known.current, charge.cut_off_sensitivity)
    of_discharge = known.time_to(discharged, known.voltage, discharge.limit_sensitivity)

    def capacity(value, share):
        uncertainty = known.charge(charge)
        return Figure(value=value, unit="Ah", uncertainty=None if uncertainty is None else uncertainty * share)

    constant = charge.cc_time / charge.duration
    emptied = Figure(value=discharge.lowest_voltage, unit="V", uncertainty=known.end_of(discharge))
    return {
        **of_half(charge, "charge", known),
        **of_half(discharge, "discharge", known),
        "charge_time": hours(charged, of_charge),
        "discharge_time": hours(discharged, of_discharge),
        "constant_current_time": hours(charge.cc_time, known.time(charge.cc_time)),
        "constant_voltage_time": hours(charge.cv_time, of_fading),
        "constant_current_capacity": capacity(charge.cc_charge, constant),
        "constant_voltage_capacity": capacity(charge.cv_charge, 1 - constant),
        "coulombic_efficiency": Figure(
            value=made.coulombic_efficiency, unit="1", uncertainty=known.ratio(made, made.coulombic_efficiency)
        ),
        "energy_efficiency": Figure(
            value=made.energy_efficiency, unit="1", uncertainty=known.ratio(made, made.energy_efficiency)
        ),
        "resistance": resistance_of(made, known),
        "rest_voltage_charged": rest_voltage(made, StepKind.CHARGE, known),
        "rest_voltage_discharged": rest_voltage(made, StepKind.DISCHARGE, known),
        "end_of_charge_voltage": Figure(value=charge.highest_voltage, unit="V", uncertainty=known.voltage),
        "end_of_charge_current": Figure(value=end_current, unit="A", uncertainty=known.current),
        "end_of_discharge_voltage": emptied,
    }


def end_currents(lines):
    """Return the current [A] of the last line of each charge, by number of the cycle."""
    charging = lines["phase"] == 1.0
    return {
        int(cycle): current for cycle, current in zip(lines["cycle"][charging], lines["current"][charging], strict=True)
    }


def table(rows):
    """Return the table of iterations as text, one line each; empty where there is no number."""
    columns = [Column("iteration"), *(Column(name, unit, f".{places}f", missing="") for name, unit, places in TABLE)]
    return as_csv(columns, ([number, *(row[name].value for name, *_ in TABLE)] for number, row in rows.items()))


def densities(lines, numbers):
    """Return dQ/dV over the voltage, as curves, for charge and discharge of the first and the last of some cycles."""
    curves = []
    for number in dict.fromkeys([*numbers[:1], *numbers[-1:]]):
        part = next(each for each in lines if number in each["cycle"])
        own = part["cycle"] == number
        data = series(*(part[name][own] for name in ("time", "voltage", "current")))
        for kind in (StepKind.CHARGE, StepKind.DISCHARGE):
            for found in incremental_capacities(data, kind)[:1]:
                name, density = f"{kind.value}, cycle {number}", found.drawn(kind)
                curves.append(Curve(name=name, x=found.voltage[::2].tolist(), y=density[::2].tolist()))
    return curves


def median_of(cycles, known):
    """Return capacity and energy of the discharge of a middling whole cycle, not observable without one."""
    halves = sorted((each.discharge for each in cycles if each.complete), key=lambda half: half.charge)
    if not halves:
        return not_observable("Ah"), not_observable("Wh")
    half = halves[len(halves) // 2]
    return (
        Figure(value=half.charge, unit="Ah", uncertainty=known.charge(half)),
        Figure(value=half.energy, unit="Wh", uncertainty=known.energy(half)),
    )


def declared(parameters):
    """Return what is known of the cell beforehand, as the tester sees it: leads and fuse add to it and take from it."""
    lowest, highest = parameters.mean_voltages
    drop = parameters.leads * parameters.charge_current
    return Declared(
        capacity=parameters.in_unit("declared_capacity", "Ah"),
        energy=parameters.in_unit("declared_energy", "Wh"),
        mean_voltage=(lowest - drop, highest + drop),
    )


def parts_of(test, parts):
    """Return the lines that count by beginning of the tester's test, with cycles as the plan numbers them.

    The tester counts from 1 each time that it begins.
    """
    found = []
    for start, first, end in parts:
        lines = test.part(first, end)
        lines["cycle"] = lines["cycle"] + (start.turn - 1 - start.conditioned)
        found.append(lines)
    return found


def summary_of(lines, cycles, parameters):
    """Return cycles and gates of the lines after one beginning of the test."""
    data = series(
        *(lines[name] for name in ("time", "voltage", "current")),
        temperature=lines["temperature"],
        cycle=lines["cycle"],
    )
    limits = Limits(upper=parameters.charge_voltage, lower=parameters.end_voltage, cut_off=parameters.end_current)
    return summarise(data, limits=limits, declared=declared(parameters), counted=cycles)


def summaries_of(lines, starts, parameters):
    """Return the summary after each beginning of the test."""
    ends = [*(start.turn for start in starts[1:]), int(parameters.iterations) + 1]
    return [
        summary_of(each, end - start.turn, parameters) for each, start, end in zip(lines, starts, ends, strict=True)
    ]


def untold(summary):
    """Return the gates of the declaration that whole cycles cannot be held against: what is declared is missing."""
    whole = any(cycle.complete for cycle in summary.cycles)
    return [gate for gate in summary.gates if whole and gate.ok is None and gate.name in OF_THE_DECLARATION]


def doubts_of(number, made, told, ends, parameters):
    """Return what speaks against the numbers of one cycle, what gates found in it among that."""
    doubts = [str(gate) for gate in told if number in gate.cycles]
    if made is None or not made.complete:
        return [*doubts, f"cycle {number} is not whole"]
    if ends[number] < BROKEN_OFF * parameters.end_current:
        doubts.append(
            f"the charge of cycle {number} ended with {ends[number]:.3f} A: the current did not fade, it broke off"
        )
    rise = made.discharge.temperature_high - made.discharge.temperature_low
    if rise < parameters.least_rise:
        doubts.append(
            f"the temperature rose by {rise:.1f} K in the discharge of cycle {number}, {parameters.least_rise:g} K at"
            " least are expected: is the thermistor at the cell?"
        )
    return doubts


@pytest.mark.requirement(
    "EPS-BAT-001",
    "EPS-BAT-002",
    "EPS-BAT-003",
    "EPS-BAT-004",
    "EPS-BAT-005",
    "EPS-BAT-006",
    "EPS-BAT-007",
    "EPS-BAT-008",
    "EPS-BAT-009",
    "EPS-BAT-010",
)
@pytest.mark.max_duration(600000)
@pytest.mark.repeatable(
    "a cycle that was broken off is run again from an emptied cell, and no number comes from its rest"
)
def test_charge(cell, iterations, check, chart, step, artifact, parameters):
    """Ten cycles at C/2 between 4.2 V and 2.7 V in the metal container, and every cycle's numbers."""
    cycles = int(parameters.iterations)
    with step("Lay the cell into the metal container"):
        cell.put("container")
    with step("Put the charger in readiness"):
        before = cell.ready(parameters.charge_voltage, parameters.charge_current)
    with step("Charge and discharge the battery"):
        test, starts = cell.tested(
            cycles,
            lambda: iterations("Cycle", cycles),
            name="test",
            half_cycle=parameters.longest_half_cycle,
            rest=parameters.rest,
            voltage=parameters.charge_voltage,
            empty=parameters.empty_voltage,
            vfull=parameters.full_voltage,
            iend=parameters.end_current,
            vend=parameters.end_voltage,
            vmax=parameters.highest_voltage,
            vmin=parameters.lowest_voltage,
        )
    with step("Take the charger away and let the cell rest"):
        after = cell.relaxed(parameters.relaxation)
    with step("Look at the record before anything is concluded from it"):
        check("EPS-BAT-010", "lost_lines", test.stream.lost)
        check("EPS-BAT-010", "clock_drift", observed(test.stream.drift, "1", test.stream.drift_uncertainty))
        artifact("starts.csv", cell.starts_as_csv(starts))
        lines, known = parts_of(test, cell.parts(test, starts)), certainty_of(test)
        summaries = summaries_of(lines, starts, parameters)
        told = [gate for summary in summaries for gate in summary.gates if gate.ok is False]
        doubts = [str(gate) for gate in told if gate.name not in OF_THE_DECLARATION and not gate.cycles]
        made = {each.number: each for summary in summaries for each in summary.cycles}
        ends = {number: current for each in lines for number, current in end_currents(each).items()}
        check("EPS-BAT-008", "open_circuit_voltage", before, of="before")
        check("EPS-BAT-008", "open_circuit_voltage", after, of="after")
    with step("State the numbers of every cycle"):
        rows = {n: row_of(made.get(n), known, ends.get(n, math.nan)) for n in range(1, cycles + 1)}
        artifact("iterations.csv", table(rows))
        own = {number: doubts_of(number, made.get(number), told, ends, parameters) for number in rows}
        stopped = {start.turn - 1 for start in starts}
        for place, (name, _, _) in enumerate(TABLE):
            requirement = LIMITED.get(name, OF_TABLE_1 if place < COLUMNS_OF_TABLE_1 else BEYOND_TABLE_1)
            for number, row in rows.items():
                if name == "rest_voltage_discharged" and number == cycles:
                    continue  # nothing comes after the last discharge but the end of the test
                rested = [IN_THE_REST] if name == "rest_voltage_discharged" and number in stopped else []
                if name in REST_VOLTAGES and not parameters.rest:
                    rested = [NO_REST]
                against = [*doubts, *own[number], *rested]
                headline = HEADLINES.get(name, "")
                check(
                    requirement,
                    name,
                    row[name],
                    of=f"{number}",
                    doubts=against,
                    at=f"cycle {number}",
                    headline=headline,
                )
        for quantity, unit in (("capacity", "A.h"), ("energy", "W.h")):
            chart(
                f"{quantity.capitalize()} over cycles",
                *(
                    Curve(name=kind, x=[*rows], y=[row[f"{kind}_{quantity}"] for row in rows.values()])
                    for kind in ("charge", "discharge")
                ),
                x=("cycle", "1"),
                y=(quantity, unit),
            )
        if curves := densities(lines, [number for number, each in made.items() if each.complete]):
            chart("Incremental capacity", *curves, x=("voltage", "V"), y=("dQ/dV", "A.h/V"))
    with step("Hold capacity and energy against what is declared"):
        capacity, energy = median_of(made.values(), known)
        told += [gate for summary in summaries for gate in untold(summary)]
        against = dict.fromkeys([*map(str, told), *(doubt for number in rows for doubt in own[number])])
        check("EPS-BAT-009", "discharge_capacity", capacity, doubts=[*against])
        check("EPS-BAT-009", "discharge_energy", energy, doubts=[*against])
