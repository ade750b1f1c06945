"""What `hil analyse battery` prints: tables for people, or one JSON document for machines."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass

import numpy as np

from hil.analysis.battery.certainty import Certainty
from hil.analysis.battery.counted import Net, net
from hil.analysis.battery.cycles import Cycle, equivalent_full_cycles
from hil.analysis.battery.fade import Fade
from hil.analysis.battery.half_cycle import HalfCycle
from hil.analysis.battery.incremental import IncrementalCapacity
from hil.analysis.battery.series import SECONDS_PER_HOUR, Series
from hil.analysis.battery.steps import Segmentation, StepKind, segment
from hil.analysis.battery.summary import Summary, incremental_capacities
from hil.cli.analyses.log import INCONCLUSIVE, gates_as_json
from hil.documents.text import fitting
from hil.logs.battery import BatteryLog
from hil.logs.mapping import Accuracy
from hil.report.tables import aligned

__all__ = ["Result", "as_json", "as_text"]

_CYCLE = ("cycle", "kind", "Ah", "Wh", "mean V", "duration", "at limit", "cut-off", "CV Ah")
_NUMBERS = frozenset(range(2, len(_CYCLE)))
_WIDTH = 80
_SUMS = ("net", "trapezoid", "counted edges", "its own", "difference", "relative")


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """What is printed.

    Attributes:
        file: the log's name.
        log: what was read.
        data: what was analysed.
        summary: what it shows.
        capacity: nominal, in Ah, None where it is not known.
        how: how steps were segmented.
        accuracy: bounds of the errors of the meters.
    """

    file: str
    log: BatteryLog
    data: Series
    summary: Summary
    capacity: float | None
    how: Segmentation
    accuracy: Accuracy

    def certainty(self) -> Certainty:
        """Return the accuracy of the meters; a bound over the root of three is a standard uncertainty."""
        bounds = {name: (value or 0.0) / math.sqrt(3.0) for name, value in asdict(self.accuracy).items()}
        return Certainty(
            interval=0.0,
            voltage=bounds["voltage_offset"],
            current=bounds["current_offset"],
            current_gain=bounds["current_gain"],
            voltage_gain=bounds["voltage_gain"],
        )


def as_json(result: Result) -> str:
    """Return the result as one JSON document; what is not finite is null."""
    summary = result.summary
    document = {
        "format": 1,
        "file": result.file,
        "maker": result.log.maker,
        "rows": int(result.data.time.size),
        "remarks": _remarks(result),
        **_sums_as_json(result.log, result.data, result.how),
        "nominal_capacity_Ah": result.capacity,
        "equivalent_full_cycles": _through(result),
        "cycles": [asdict(each) | {"uncertainty": _uncertain(each, result)} for each in summary.cycles],
        "uncertainty": {"bounds": asdict(result.accuracy), "from": _sources(result)},
        "compared": [each.number for each in summary.compared],
        "incremental_capacity_peaks": {
            kind.value: [[asdict(peak) for peak in curve.peaks] for curve in _curves(result, kind)] for kind in _KINDS
        },
        "fade": {name: asdict(each) for name, each in summary.fades.items()},
        "status": INCONCLUSIVE if any(gate.ok is False for gate in summary.gates) else "conclusive",
        "reasons": [str(gate) for gate in summary.gates if gate.ok is False],
        "gates": gates_as_json(summary.gates),
    }
    return json.dumps(_finite(document), allow_nan=False, indent=2)


def _uncertain(cycle: Cycle, result: Result) -> dict[str, float]:
    """Return the standard uncertainties of a cycle by quantity and unit."""
    known = result.certainty()
    found = {}
    for name, half in (("charge", cycle.charge), ("discharge", cycle.discharge)):
        if half is not None:
            found[f"{name}_Ah"], found[f"{name}_Wh"] = known.flowed(half)
    found["coulombic_efficiency"], found["energy_efficiency"] = known.efficiencies(cycle)
    return found


def _sources(result: Result) -> str:
    """Return what the standard uncertainties of charges, energies and efficiencies come from."""
    units = {"current_gain": "of the current", "current_offset": "A", "voltage_gain": "of the voltage",
             "voltage_offset": "V"}  # fmt: skip
    told = [f"± {value:g} {units[name]}" for name, value in asdict(result.accuracy).items() if value]
    meters = (
        f", and {', '.join(told)}, each over the root of three" if told else "; no accuracy of the meters was given"
    )
    return f"the moments of switching between samples{meters}"


_KINDS = (StepKind.CHARGE, StepKind.DISCHARGE)


def _finite(value: object) -> object:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(each) for each in value]
    return value


def _curves(result: Result, kind: StepKind) -> tuple[IncrementalCapacity, ...]:
    return incremental_capacities(result.data, kind, result.how)


def _through(result: Result) -> float | None:
    return equivalent_full_cycles(result.summary.cycles, result.capacity) if result.capacity else None


def as_text(result: Result) -> str:
    """Return the result as plain text: cycles, rests and resistances, peaks, fade, gates."""
    hours = float(result.data.time[-1] - result.data.time[0]) / SECONDS_PER_HOUR
    made = result.summary.cycles
    head = f"{result.file} ({result.log.maker}): {result.data.time.size} rows, {hours:.4g} h, {_count(len(made))}"
    lines = [f"note: {remark}" for remark in _remarks(result)]
    lines += _sums_as_lines(result.log, result.data, result.how)
    lines += ["", *_cycles(result), f"± standard uncertainties, of {_sources(result)}", "", *_edges(made)]
    for kind in _KINDS:
        curves = _curves(result, kind)
        if curves and curves[0].peaks:
            lines.append(f"dQ/dV of the first {kind}: peaks at " + _peaks(curves[0]))
    through = _through(result)
    if through is not None:
        lines.append(f"equivalent full cycles: {through:.4g} of {result.capacity:g} Ah")
    for name, each in result.summary.fades.items():
        lines += ["", *_fade(name, each)]
    if not result.summary.fades:
        lines.append(_no_fade(result))
    lines += ["", *_gates(result.summary)]
    return "\n".join([head, *fitting(lines, _WIDTH)])


def _no_fade(result: Result) -> str:
    made = result.summary.cycles
    if made and result.capacity is None and all(cycle.charge is None for cycle in made):
        return "no fade: the log holds discharges only; give --capacity, to identify complete ones"
    told = f"{len(result.summary.compared)} of {_count(len(made))} complete"
    return f"no fade: {told}; it needs three after those that --skip leaves out"


def _remarks(result: Result) -> list[str]:
    remarks = list(result.log.remarks)
    left_out = result.log.time.size - result.data.time.size
    if left_out:
        rows = "1 row" if left_out == 1 else f"{left_out} rows"
        without = "without a time, voltage, current or cycle"
        remarks.append(f"{rows} {without} {'is' if left_out == 1 else 'are'} left out")
    tests = 0 if result.data.test is None else int(np.unique(result.data.test).size)
    if tests > 1:
        remarks.append(f"{tests} tests in the log: their cycles are numbered consecutively, in the order of the log")
    if not result.summary.cycles:
        remarks.append("the current never rises above rest: check its column, its unit and --rest-current")
    return remarks


def _count(number: int) -> str:
    return "1 cycle" if number == 1 else f"{number} cycles"


def _cycles(result: Result) -> Iterator[str]:
    """Give a line for each half of a cycle, and more about the cycle below them."""
    made, compared = result.summary.cycles, {each.number for each in result.summary.compared}
    halves = [
        (cycle.number, name, half)
        for cycle in made
        for name, half in (("charge", cycle.charge), ("discharge", cycle.discharge))
        if half is not None
    ]
    rows = [(f"{number}", name, *_half(half)) for number, name, half in halves]
    head, *lines = aligned(rows, head=_CYCLE, right=_NUMBERS)
    yield head
    for cycle in made:
        yield from (line for (number, *_), line in zip(halves, lines, strict=True) if number == cycle.number)
        yield from (
            f"       {line}"
            for line in _remarks_of(cycle, _uncertain(cycle, result), compared=cycle.number in compared)
        )


def _remarks_of(cycle: Cycle, known: dict[str, float], *, compared: bool) -> Iterator[str]:
    out = cycle.discharge
    yield ", ".join(
        f"{name} ± {known[f'{name}_Ah']:.2g} Ah ± {known[f'{name}_Wh']:.2g} Wh"
        for name, half in (("charge", cycle.charge), ("discharge", out))
        if half is not None
    )
    if out is not None and math.isfinite(out.charge_to_limit):
        yield f"down to the lower limit: {out.charge_to_limit:.5f} Ah, {out.energy_to_limit:.5f} Wh"
    if cycle.charge is not None and cycle.discharge is not None:
        told = [
            f"{name} {_cell(value, 5)} ± {_cell(known[f'{name}_efficiency'], 2)}"
            for name, value in (("coulombic", cycle.coulombic_efficiency), ("energy", cycle.energy_efficiency))
        ]
        yield f"efficiency: {', '.join(told)}"
    warm = [
        f"{name} {half.temperature_low:.3g} to {half.temperature_high:.3g} degC, rise {half.temperature_rise:.2g} K"
        for name, half in (("charge", cycle.charge), ("discharge", out))
        if half is not None and math.isfinite(half.temperature_low)
    ]
    if warm:
        yield "; ".join(warm)
    if not compared:
        yield "incomplete cycle: left out of fade and medians"
    bridged = sum(half.gaps for half in (cycle.charge, cycle.discharge) if half is not None)
    if bridged:
        yield f"{bridged} {'gap' if bridged == 1 else 'gaps'} in the rows"


def _half(half: HalfCycle) -> tuple[str, ...]:
    times = (half.duration, half.time_to_limit, half.time_to_cut_off)
    return (
        f"{half.charge:.5f}",
        f"{half.energy:.5f}",
        f"{half.mean_voltage:.4f}",
        *map(_clock, times),
        f"{half.cv_charge:.4f}",
    )


def _cell(number: float, digits: int) -> str:
    return f"{number:.{digits}g}" if math.isfinite(number) else "-"


def _clock(seconds: float) -> str:
    if not math.isfinite(seconds):
        return "-"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02d}:{rest:02d}"


def _edges(made: tuple[Cycle, ...]) -> Iterator[str]:
    groups: dict[str, list[tuple[float, float]]] = {}
    for cycle in made:
        for edge in cycle.resistances:
            groups.setdefault(f"{edge.before} to {edge.after}", []).append((edge.value, edge.delay))
    for name, pairs in groups.items():
        value, delay = np.median(pairs, axis=0).tolist()
        yield f"resistance {name}: {value:.4g} ohm within {delay:.3g} s (median of {len(pairs)})"
    rests: dict[str, list[tuple[float, float]]] = {}
    for cycle in made:
        for rest in cycle.rests:
            rests.setdefault(f"after {rest.after}" if rest.after else "at the beginning", []).append(
                (rest.voltage, rest.duration)
            )
    for name, pairs in rests.items():
        voltage, duration = np.median(pairs, axis=0).tolist()
        yield f"rest {name}: {voltage:.4f} V after {_clock(duration)} (median of {len(pairs)})"


def _peaks(curve: IncrementalCapacity) -> str:
    return ", ".join(f"{peak.voltage:.3f} V ({peak.height:.3g} Ah/V)" for peak in curve.peaks)


def _fade(name: str, each: Fade) -> Iterator[str]:
    percent = f"{each.confidence:.0%}"
    verdict = "significant" if each.significant else "not significant"
    yield f"fade of {name.replace('_', ' ')}: {each.slope.value:.4g} {each.slope.unit}, {verdict}"
    yield f"  {percent} from {each.low:.4g} to {each.high:.4g}, probability by chance {each.probability:.2g}"
    yield f"  Theil-Sen {each.robust:.4g}, from {each.robust_low:.4g} to {each.robust_high:.4g}"
    if each.first_significant is not None:
        yield f"  significant from cycle {each.first_significant} on"
    end = each.end_of_life
    if math.isfinite(end.cycle) and each.significant:
        yield f"  {end.level:.4g} {each.beginning.unit} at cycle {end.cycle:.4g}, from {end.low:.4g} to {end.high:.4g}"


def _gates(summary: Summary) -> Iterator[str]:
    words = {True: "good", False: "DOUBT", None: "unknown"}
    yield from aligned((words[gate.ok], str(gate)) for gate in summary.gates)


def _sums_as_json(log: BatteryLog, data: Series, how: Segmentation) -> dict[str, object]:
    """Return net charge and energy with their parts, the instrument's own, and the differences.

    Args:
        log: what was read.
        data: what was analysed.
        how: how steps are segmented.
    """
    made = _sums(log, data, how)
    return {
        "net": {f"{what}_{unit}": found.value for what, unit, found, _ in made},
        "own": {f"{what}_{unit}": own for what, unit, _, own in made},
        "apart": {
            f"{what}_{unit}": None if own is None else found.value - own for what, unit, found, own in made
        },
        "sums": {f"{what}_{unit}": asdict(found) for what, unit, found, _ in made},
    }  # fmt: skip


def _sums_as_lines(log: BatteryLog, data: Series, how: Segmentation) -> Iterator[str]:
    """Yield a table of both sums where the instrument has its own, and what its count stands for.

    Args:
        log: what was read.
        data: what was analysed.
        how: how steps are segmented.
    """
    made = [each for each in _sums(log, data, how) if each[3] is not None]
    yield from aligned([_sum_row(*each) for each in made], head=_SUMS if made else (), right=range(1, len(_SUMS)))
    if made and made[0][2].edges:
        told = ", ".join(
            f"{found.counted:.3g} {unit} (samples alone: ± {found.open:.2g} {unit})" for _, unit, found, _ in made
        )
        number = made[0][2].edges
        switches = "1 switch" if number == 1 else f"{number} switches"
        yield f"{switches} between rest and current as the instrument counted: {told}"


def _sum_row(what: str, unit: str, found: Net, own: float | None) -> tuple[str, ...]:
    apart = found.value - (own or 0.0)
    relative = f"{found.value / own - 1.0:+.1e}" if own else ""
    return (f"{what} {unit}", f"{found.samples:.6f}", f"{found.value:.6f}", f"{own:.6f}", f"{apart:+.1e}", relative)


def _sums(log: BatteryLog, data: Series, how: Segmentation) -> list[tuple[str, str, Net, float | None]]:
    steps = segment(data, how)
    return [
        ("charge", "Ah", net(data, steps, energy=False), log.own_charge),
        ("energy", "Wh", net(data, steps, energy=True), log.own_energy),
    ]
