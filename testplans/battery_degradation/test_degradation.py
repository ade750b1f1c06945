"""Weeks of charges at 40 degC and discharges at 10 degC, and what they take from the battery."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from hil.analysis import (
    Column,
    Limits,
    as_csv,
    end_uncertainty,
    fade,
    not_observable,
    observed,
    series,
    share_known,
)
from hil.analysis import (
    cycles as cycles_of,
)
from hil.plan import Curve, Figure

LINE_S = 5.0
S_PER_H = 3600.0
BEGINS_WITHIN_S = 60.0
FIRST_SOAK_S = 7200.0
CELL_K = 1.5
BROKEN_OFF = 0.5
"""A current that fades is not much below that which ends a charge when it ends it; this part of it is."""

LEAST_CYCLES = 3
BEGINNING = ("voltage", "current", "temperature")

COLUMNS = (
    ("duration", "s", 1),
    ("charge_time", "s", 1),
    ("discharge_time", "s", 1),
    ("charge_energy", "Wh", 4),
    ("discharge_energy", "Wh", 4),
    ("charge_capacity", "Ah", 4),
    ("discharge_capacity", "Ah", 4),
    ("energy_efficiency", "1", 4),
    ("highest_voltage", "V", 3),
    ("lowest_voltage", "V", 3),
    ("charge_temperature_low", "degC", 1),
    ("charge_temperature_high", "degC", 1),
    ("discharge_temperature_low", "degC", 1),
    ("discharge_temperature_high", "degC", 1),
)
"""Columns of the table of cycles with unit and decimals."""

UNTABLED = ("end_current", "last_change")
"""What is known of a cycle besides: the last current of its charge, and its discharge's last change of voltage."""

FADES = (
    ("energy_fade", "discharge_energy", "Wh"),
    ("capacity_fade", "discharge_capacity", "Ah"),
    ("time_fade", "discharge_time", "s"),
)
"""Changes per cycle: the parameter, the column, and its unit."""

HEADLINES = {
    "energy_fade": "Fade of the energy",
    "capacity_fade": "Fade of the capacity",
    "time_fade": "Fade of the discharge time",
}
"""What the first page of the report calls a fade."""

NO_SOAK = "the tester's firmware is of level 1: it begins a half-cycle at once, and waits for no temperature"


def cycling(test, cell, change, step, parameters):
    """Return a function that follows one cycle; in each rest the plates go to the temperature of what comes next."""
    longest = parameters.longest_half_cycle + BEGINS_WITHIN_S
    rests = BEGINS_WITHIN_S + parameters.rest

    def cycle(*, last):
        with step("Charge"):
            first = cell.awaited(lambda: test.until("phase", equals=1.0, within=rests))
            cell.awaited(lambda: test.until("phase", below=0.5, within=longest))
            cell.charger_holds(parameters.charge_voltage)
        with step("Cool down"):
            cell.awaited(lambda: change(test, parameters.discharge_temperature))
        with step("Discharge"):
            cell.awaited(lambda: test.until("phase", equals=-1.0, within=rests))
            if last:
                return first, cell.awaited(lambda: test.until_over(within=longest))
            after = cell.awaited(lambda: test.until("phase", above=-0.5, within=longest))
        with step("Warm up"):
            cell.awaited(lambda: change(test, parameters.charge_temperature))
        return first, after

    return cycle


def beginning(cell, assembly, parameters, *, soaks):
    """Return a function that starts the tester for so many cycles: for all of them, or what a stopped run left."""

    def begin(cycles):
        target = parameters.charge_temperature
        assembly.hold(target)
        if soaks:
            assembly.soak(target, cell.cycler.temperature, seconds=parameters.soak, within=FIRST_SOAK_S)
        cell.cycler.prepare(cycles, **(settings_of(parameters) if soaks else {}))
        cell.cycler.start()

    return begin


def changing(assembly, parameters, *, soaks):
    """Return a function that brings the plates to a temperature, and sees that all has soaked within the rest."""
    within = parameters.rest - parameters.soak_margin - parameters.soak

    def change(test, target):
        cools = target < test.latest("temperature").value
        assembly.hold(target)
        if soaks:
            near = {"below": target + CELL_K} if cools else {"above": target - CELL_K}
            test.until("temperature", within=within, **near)
            assembly.stay(target, lambda: test.latest("temperature"), seconds=parameters.soak)

    return change


def settings_of(parameters):
    """Return what the tester is told; firmware of level 1 is told nothing but what it does anyway."""
    return {
        "rest": parameters.rest,
        "vfull": parameters.full_voltage,
        "iend": parameters.end_current,
        "vend": parameters.end_voltage,
        "vmax": parameters.highest_voltage,
        "vmin": parameters.lowest_voltage,
        "time": parameters.longest_half_cycle,
    }


def cycles_within(test, parts):
    """Return first row and end of every cycle by its number; each beginning of the tester's test has its own part."""
    charging = np.concatenate(([False], test["phase"] == 1.0))
    found = {}
    for start, first, end in parts:
        inside = charging[first + 1 : end + 1] & ~np.concatenate(([False], charging[first + 1 : end]))
        firsts = (first + np.flatnonzero(inside)).tolist()
        found |= dict(enumerate(pairwise([*firsts, end]), start=start.turn))
    return found


def rows_of(test, parts, parameters):
    """Return the numbers of every cycle, one cycle in memory at a time: weeks of lines are never there at once."""
    limits = Limits(upper=parameters.charge_voltage, lower=parameters.end_voltage, cut_off=parameters.end_current)
    within = cycles_within(test, parts)
    return [
        row_of(number, test.part(*within.get(number, (0, 0))), limits)
        for number in range(1, int(parameters.cycles) + 1)
    ]


def row_of(number, part, limits):
    """Return the numbers of one cycle by name of the column; NaN where it lacks a half."""
    row = {"cycle": number} | dict.fromkeys((*UNTABLED, *(name for name, _, _ in COLUMNS)), math.nan)
    if len(part["time"]) < LEAST_CYCLES:
        return row
    data = series(*(part[name] for name in ("time", *BEGINNING[:2])), temperature=part["temperature"])
    found = cycles_of(data, limits)
    charge, discharge = (found[0].charge, found[0].discharge) if found else (None, None)
    charging = part["current"][part["phase"] == 1.0]
    row["end_current"] = charging[-1] if len(charging) else math.nan
    row["duration"] = part["time"][-1] - part["time"][0] + LINE_S
    for name, half in (("charge", charge), ("discharge", discharge)):
        if half is not None:
            row |= {
                f"{name}_time": half.duration,
                f"{name}_energy": half.energy,
                f"{name}_capacity": half.charge,
                f"{name}_temperature_low": half.temperature_low,
                f"{name}_temperature_high": half.temperature_high,
            }
    if charge is not None and discharge is not None:
        row |= {
            "energy_efficiency": found[0].energy_efficiency,
            "highest_voltage": charge.highest_voltage,
            "lowest_voltage": discharge.lowest_voltage,
            "last_change": discharge.last_change,
        }
    return row


def table(rows):
    """Return the table of cycles as text, one line each."""
    columns = [Column("cycle"), *(Column(name, unit, f".{places}f") for name, unit, places in COLUMNS)]
    return as_csv(columns, ([row["cycle"], *(row[name] for name, *_ in COLUMNS)] for row in rows))


def aged(rows, starts):
    """Return how many cycles the cell had gone through at the end of each row's.

    A cycle that only emptied the cell has aged it as any other: those after it lie one further on.
    """
    return [row["cycle"] + sum(start.conditioned and start.turn <= row["cycle"] for start in starts) for row in rows]


def fades_of(rows, starts, skip):
    """Return the lines over the cycles by name of the parameter; none where there are too few cycles."""
    numbers = aged(rows, starts)
    whole = sum(all(math.isfinite(row[column]) for _, column, _ in FADES) for row in rows[skip:])
    if whole < LEAST_CYCLES:
        return {}
    return {name: fade(numbers, [row[column] for row in rows], unit, skip=skip) for name, column, unit in FADES}


def fewer(rows, skip):
    """Return why so few cycles show no fade."""
    settling = f" after {skip} of settling" if skip else ""
    return f"a fade needs {LEAST_CYCLES} whole cycles{settling}, and the test had {len(rows)}"


def draw_fades(rows, starts, fades, skip, chart):
    """Draw what every discharge gave over the cycles, with the line of its fade."""
    numbers = aged(rows, starts)
    for name, column, unit in FADES[:2]:
        model = None
        if line := fades.get(name):
            ends = numbers[skip], numbers[-1]
            model = ends, [line.beginning.value + line.slope.value * (end - ends[0]) for end in ends]
        chart(
            f"{column.replace('_', ' ').capitalize()} over cycles",
            Curve(name="discharge", x=numbers, y=[row[column] for row in rows], model=model),
            x=("cycle", "1"),
            y=(column.replace("_", " "), unit),
            lines="the fade that fits best",
        )


def fades_as_csv(fades):
    """Return what the lines tell as text: least squares with its interval, Theil and Sen, and where life ends."""
    numbers = ("slope", "low", "high", "probability", "theil_sen", "theil_sen_low", "theil_sen_high")
    columns = [Column("quantity"), Column("unit"), *(Column(name, form=".3e") for name in numbers)]
    columns += [Column("significant_from"), Column("life_ends", form=".0f")]
    return as_csv(
        columns,
        (
            [
                *(name, line.slope.unit, line.slope.value, line.low, line.high, line.probability),
                *(line.robust, line.robust_low, line.robust_high),
                *(line.first_significant or "", line.end_of_life.cycle),
            ]
            for name, line in fades.items()
        ),
    )


def extreme(rows, column, unit, worst, uncertainty):
    """Return the lowest or highest number of a column; not observable where a cycle lacks it."""
    numbers = [row[column] for row in rows]
    if not numbers or not all(map(math.isfinite, numbers)):
        return not_observable(unit)
    return Figure(value=worst(numbers), unit=unit, uncertainty=uncertainty)


def uncertainty_of_ends(rows, meter):
    """Return the standard uncertainty [V] of the ends of all discharges: the greatest last change counts."""
    changes = [abs(row["last_change"]) for row in rows if math.isfinite(row["last_change"])]
    return end_uncertainty(meter, max(changes)) if meter is not None and changes else None


def total(rows, column):
    """Return the sum of a column of energies [Wh]; not observable where a cycle lacks it."""
    numbers = [row[column] for row in rows]
    return Figure(value=sum(numbers), unit="Wh") if all(map(math.isfinite, numbers)) else not_observable("Wh")


def share(rows, column):
    """Return which part of the cycles has a number there."""
    return share_known([row[column] for row in rows])


def elapsed_ratio(rows, test, parts):
    """Return cycles times their mean duration over the time of the lines that count, without stops of the run."""
    durations = [row["duration"] for row in rows if math.isfinite(row["duration"])]
    spans = [test.time[end - 1] - test.time[first] + LINE_S for _, first, end in parts if end > first]
    if not durations or not spans:
        return not_observable("1")
    elapsed = sum(spans)
    return Figure(value=len(rows) * sum(durations) / len(durations) / elapsed, unit="1")


def broken_off(rows, end_current):
    """Return a doubt for every charge whose current did not fade to that which ends a charge, but broke off."""
    return [
        f"the charge of cycle {row['cycle']} ended with {row['end_current']:.3f} A: it did not fade, it broke off"
        for row in rows
        if row["end_current"] < BROKEN_OFF * end_current
    ]


@pytest.mark.requirement(
    "EPS-DEG-001",
    "EPS-DEG-002",
    "EPS-DEG-003",
    "EPS-DEG-004",
    "EPS-DEG-005",
    "EPS-DEG-006",
    "EPS-DEG-007",
    "EPS-DEG-008",
    "EPS-DEG-009",
    "EPS-DEG-010",
    "EPS-DEG-011",
)
@pytest.mark.max_duration(60 * 86400)
@pytest.mark.repeatable(
    "a cycle that was broken off is run again from an emptied cell, and no number comes from its rest"
)
def test_degradation(cell, assembly, record, iterations, check, chart, step, artifact, parameters):
    """Charges at 40 degC and discharges at 10 degC for 844 hours, each begun after a soak, and what they cost."""
    count = int(parameters.cycles)
    soaks = cell.cycler.level() != "1"
    with step("Lay the cell between the plates of the assembly"):
        cell.put("assembly")
    with step("Put the charger in readiness"):
        cell.ready(parameters.charge_voltage, parameters.charge_current)
    with step("Charge and discharge the battery"):
        begin = beginning(cell, assembly, parameters, soaks=soaks)
        change = changing(assembly, parameters, soaks=soaks)
        with record.during("test", cell.cycler, rate=1 / LINE_S) as running:
            cycle = cycling(running, cell, change, step, parameters)
            starts = cell.follow(
                count, iterations("Cycle", count), begin=begin, cycle=cycle, empty=parameters.empty_voltage
            )
            state = cell.cycler.state()
    test = running.recording
    parts = cell.parts(test, starts)
    ended = [] if state == "ended" else [f"the test did not come to its end, the tester says '{state}'"]
    with step("Look at the record before anything is concluded from it"):
        rows = rows_of(test, parts, parameters)
        artifact("starts.csv", cell.starts_as_csv(starts))
        artifact("cycles.csv", table(rows))
        check("EPS-DEG-011", "lost_lines", test.stream.lost, doubts=[] if test.stream.losses_known else [NO_SOAK])
        check("EPS-DEG-011", "clock_drift", observed(test.stream.drift, "1", test.stream.drift_uncertainty))
        check("EPS-DEG-009", "elapsed_ratio", elapsed_ratio(rows, test, parts), doubts=ended)
    with step("Judge charges, discharges and temperatures"):
        charged = [*ended, *broken_off(rows, parameters.end_current)]
        volts, degrees = test.uncertainty("voltage"), test.uncertainty("temperature")
        check("EPS-DEG-001", "charges", share(rows, "charge_energy"), doubts=charged)
        check("EPS-DEG-001", "end_of_charge_voltage", extreme(rows, "highest_voltage", "V", min, volts), doubts=charged)
        check("EPS-DEG-002", "discharges", share(rows, "discharge_energy"), doubts=ended)
        emptied = extreme(rows, "lowest_voltage", "V", max, uncertainty_of_ends(rows, volts))
        check("EPS-DEG-002", "end_of_discharge_voltage", emptied, doubts=ended)
        check("EPS-DEG-010", "highest_voltage", Figure(value=test["voltage"].max(), unit="V", uncertainty=volts))
        doubts = ended if soaks else [NO_SOAK]
        for parameter in ("charge_temperature", "discharge_temperature"):
            lowest = extreme(rows, f"{parameter}_low", "degC", min, degrees)
            highest = extreme(rows, f"{parameter}_high", "degC", max, degrees)
            check("EPS-DEG-007", parameter, lowest, of="lowest", doubts=doubts)
            check("EPS-DEG-007", parameter, highest, of="highest", doubts=doubts)
    with step("State energies and fade"):
        check("EPS-DEG-006", "charged_energy", total(rows, "charge_energy"), doubts=ended)
        given = total(rows, "discharge_energy")
        check("EPS-DEG-006", "discharged_energy", given, doubts=ended, headline="Energy of all discharges")
        skip = int(parameters.settling)
        fades = fades_of(rows, starts, skip)
        unknown = [] if fades else [fewer(rows, skip)]
        artifact("fade.csv", fades_as_csv(fades))
        for name, _, unit in FADES:
            slope = fades[name].slope if name in fades else not_observable(f"{unit}/cycle")
            check("EPS-DEG-008", name, slope, doubts=[*charged, *unknown], headline=HEADLINES[name])
        draw_fades(rows, starts, fades, skip, chart)
