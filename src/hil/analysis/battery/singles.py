"""Gates on single rows, half-cycles and cycles, and on the log as a whole, which medians hide."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hil.analysis.battery.cycles import Cycle
from hil.analysis.battery.half_cycle import HalfCycle
from hil.analysis.battery.series import Series, can_be_warm
from hil.analysis.battery.steps import Step, StepKind
from hil.analysis.gates import Gate

__all__ = ["judge_singles", "judge_states"]

_COULOMBIC = (0.95, 1.02)  # of one cycle; wider than that of the median
_OWN = 0.01  # tolerated relative difference of integrated energy and the instrument's counter
_SMALL = 0.1  # of the largest half-cycle's energy: below it one edge interval is too large a share
_LEAST = 1e-6  # A: no cell is tested at less
_MOST = 100.0  # A: more than any cell of a small satellite
_STEEP = 10.0  # allowed outlier of a single row, in multiples of its step's typical change between samples
_SHARE = 0.1  # and as a share of the step's current
_FAINT = 0.02  # and as a share of the typical current, in any step: in a rest the last digit toggles
_BACK, _BACK_SHARE = 0.5, 0.15  # V, and share of the highest voltage: more than a change of current causes
_HOT = 65.0  # median temperature in degC: no cell is cycled so hot, and 18 degC in °F is above
_NAMED = 3  # suspect items listed by number


def judge_singles(
    data: Series, steps: Sequence[Step], made: Sequence[Cycle], *, capacity: float | None = None, runs: bool = False
) -> tuple[Gate, ...]:
    """Return the gates on single rows, half-cycles and cycles.

    Args:
        data: the samples.
        steps: from `segment`.
        made: from `cycles`.
        capacity: nominal capacity [Ah]; None if unknown.
        runs: whether the log is declared to consist of runs.
    """
    return (
        _one_stretch(data, runs=runs),
        _one_alternation(data, steps, made),
        _coulombic(made),
        _own_energy(made),
        *_rows(data, steps, made, capacity),
        _direction(data, steps, made),
        _resistance(made),
    )


def _rows(data: Series, steps: Sequence[Step], made: Sequence[Cycle], capacity: float | None) -> Iterator[Gate]:
    yield _warmth(data, made)
    yield _stray_rows(data, steps, made)
    usual = _usual(data)
    flows = "charge and discharge are told from rest" if made else "the current never rises above rest"
    advice = "" if made else ": check its column, its unit and --rest-current"
    yield _gate("flow", bool(made), flows + advice)
    if capacity is not None:
        yield _gate("current_unit", None, "judged by capacity_ratio")
        return
    ok = _LEAST <= usual <= _MOST
    advice = "" if ok else ": currents are taken as A; give --current-unit mA if they are in mA, else --capacity"
    yield _gate("current_unit", ok, f"{usual:.3g} A, expected {_LEAST:g} to {_MOST:g} A{advice}")


def judge_states(rows: NDArray[np.int64] | None) -> Gate:
    """Return the gate on agreement of current and logged state.

    Args:
        rows: indices of the disagreeing rows of the log; None if no state was logged.
    """
    if rows is None:
        return _gate("state", None, "not judged: no state was logged")
    if not rows.size:
        return _gate("state", True, "no current against its state")
    told = "1 row has" if rows.size == 1 else f"{rows.size} rows have"
    found = f"{told} a current that flows in a rest or against its state, first row {rows[0] + 1}"
    return _gate("state", False, f"{found}: check the lists of `states:` and --discharge-positive")


def _direction(data: Series, steps: Sequence[Step], made: Sequence[Cycle]) -> Gate:
    """Return the gate on voltage following the current's sign in each step, which an unsigned current violates."""
    against = list[tuple[int, str]]()
    for step in steps:
        part = data.voltage[step.first : step.last + 1]
        if step.kind is StepKind.REST or part.size < 2:
            continue
        back = part.max() - part[-1] if step.kind is StepKind.CHARGE else part[-1] - part.min()
        if back > max(_BACK, _BACK_SHARE * abs(float(part.max()))):
            way = "falls" if step.kind is StepKind.CHARGE else "rises"
            against.append((step.last, f"{way} by {back:.3g} V in the {step.kind} from {data.time[step.first]:g} s"))
    found = "in no charge the voltage falls far, in no discharge it rises far"
    if not against:
        return _gate("direction", True, found)
    advice = "has the current no sign? Name the column of states in a --mapping"
    named = _named([what for _, what in against])
    rows = np.array([place for place, _ in against])
    return _gate("direction", False, f"the voltage {named}: {advice}", _holding(data, made, rows))


def _resistance(made: Sequence[Cycle]) -> Gate:
    edges = [(each.number, edge) for each in made for edge in each.resistances]
    if not edges:
        return _gate("resistance", None, "not judged: there is no edge of current")
    bad = [(number, edge) for number, edge in edges if edge.value < 0.0]
    found = "above zero at every edge of current"
    if not bad:
        return _gate("resistance", True, found)
    named = _named([f"{edge.before} to {edge.after} in cycle {number} {edge.value:.3g} ohm" for number, edge in bad])
    advice = "the sign of the current is wrong, or voltage and current are not of the same moment"
    return _gate("resistance", False, f"{named}; expected {found}: {advice}", [number for number, _ in bad])


def _one_stretch(data: Series, *, runs: bool) -> Gate:
    if data.stretch is None:
        return _gate("one_stretch", None, "not judged: the log does not show where it starts again")
    breaks = int(data.broken.sum())
    if not breaks:
        return _gate("one_stretch", True, "the log has no break")
    places = "1 place" if breaks == 1 else f"{breaks} places"
    found = f"the log starts again at {places}, after an unknown time"
    if runs:
        return _gate("one_stretch", True, f"{found}, as was said of it")
    return _gate("one_stretch", False, f"{found}: the fade counts no time there")


def _one_alternation(data: Series, steps: Sequence[Step], made: Sequence[Cycle]) -> Gate:
    """Return the gate on one charge and one discharge in each cycle numbered by the log.

    Steps with little charge, such as the pulses of a resistance test, are ignored.
    """
    name = "one_alternation"
    if data.cycle is None or not made:
        return _gate(name, None, "not judged: the log does not number its cycles")
    active = [step for step in steps if step.kind is not StepKind.REST]
    charges = np.array([_moved(data, step) for step in active])
    places = np.searchsorted([each.start for each in made], [data.time[_middle(step)] for step in active], "right") - 1
    kinds: dict[int, list[StepKind]] = {}
    for step, charge, place in zip(active, charges, places.tolist(), strict=True):
        if charge >= _SMALL * charges.max():
            kinds.setdefault(place, []).append(step.kind)
    often = {place: sum(a is not b for a, b in pairwise(each)) for place, each in kinds.items()}
    bad = {made[place].number: count for place, count in often.items() if place >= 0 and count > 1}
    found = "charge and discharge follow each other once in each cycle"
    if not bad:
        return _gate(name, True, found)
    named = _named([f"cycle {number} {count} times" for number, count in bad.items()])
    advice = "the column of cycles does not count them: leave it out, and the current tells the cycles"
    return _gate(name, False, f"expected that {found}; {named}: {advice}", list(bad))


def _moved(data: Series, step: Step) -> float:
    part = slice(step.first, step.last + 1)
    return float(np.trapezoid(np.abs(data.current[part]), data.time[part]))


def _middle(step: Step) -> int:
    return (step.first + step.last) // 2


def _coulombic(made: Sequence[Cycle]) -> Gate:
    whole = [each for each in made if each.complete]
    if not whole:
        return _gate("single_coulombic_efficiency", None, "not judged: there is no complete cycle")
    low, high = _COULOMBIC
    bad = [each for each in whole if not low <= each.coulombic_efficiency <= high]
    named = _named([f"cycle {each.number} {each.coulombic_efficiency:.4g}" for each in bad])
    found = f"of each cycle expected {low:g} to {high:g}"
    advice = f"; {named}: charge and discharge do not belong together, or rows are missing" if bad else ""
    return _gate("single_coulombic_efficiency", not bad, found + advice, [each.number for each in bad])


def _own_energy(made: Sequence[Cycle]) -> Gate:
    halves = [
        (name, each.number, half)
        for each in made
        for name, half in (("charge", each.charge), ("discharge", each.discharge))
        if half is not None and np.isfinite(half.own_energy)
    ]
    if not halves:
        return _gate("own_energy", None, "not judged: the instrument did not count energy itself")
    least = _SMALL * max(half.energy for *_, half in halves)
    bad = [each for each in halves if each[-1].energy > least and abs(_apart(each[-1])) > _OWN]
    found = f"trapezoid and the instrument's own energy of each half-cycle expected within {_OWN:.0%}"
    advice = "samples are missing or false, or in another unit than the instrument counts in"
    named = _named([f"{name} {number} {_apart(half):+.2%}" for name, number, half in bad])
    against = [number for _, number, _ in bad]
    return _gate("own_energy", not bad, f"{found}; {named}: {advice}" if bad else found, against)


def _apart(half: HalfCycle) -> float:
    return half.energy / half.own_energy - 1.0 if half.own_energy > 0 else np.inf


def _warmth(data: Series, made: Sequence[Cycle]) -> Gate:
    if data.temperature is None:
        return _gate("temperature", None, "not judged: no temperature was recorded")
    false = np.isfinite(data.temperature) & ~can_be_warm(data.temperature)
    if not false.any():
        return _fever(data.temperature)
    place = int(np.flatnonzero(false)[0])
    rows = "1 row" if false.sum() == 1 else f"{false.sum()} rows"
    found = f"{rows} beyond -60 to 120 degC, first {data.temperature[place]:g} at {data.time[place]:g} s, not counted"
    reason = f"{found}: the sensor is open or shorted, or its unit is not degC"
    return _gate("temperature", False, reason, _holding(data, made, np.flatnonzero(false)))


def _fever(temperature: NDArray[np.float64]) -> Gate:
    """Trip where the cell is hotter for half of the test than cells are ever cycled."""
    middle = float(np.nanmedian(temperature)) if np.isfinite(temperature).any() else 0.0
    if middle <= _HOT:
        return _gate("temperature", True, "all between -60 and 120 degC")
    told = f"half of the test at {middle:.3g} degC or more, hotter than cells are cycled"
    fahrenheit = f"{(middle - 32.0) / 1.8:.3g} degC if the column holds °F"
    return _gate("temperature", False, f"{told}: {fahrenheit}; leave --temperature out if the test was so hot")


def _stray_rows(data: Series, steps: Sequence[Step], made: Sequence[Cycle]) -> Gate:
    faint = _FAINT * _usual(data)
    columns = [("voltage", data.voltage, "V", 0.05, 0.0), ("current", data.current, "A", faint, _SHARE)]
    if data.temperature is not None:
        possible = np.where(can_be_warm(data.temperature), data.temperature, np.nan)
        columns.append(("temperature", possible, "degC", 5.0, 0.0))
    found = list[tuple[int, str]]()
    for name, values, unit, least, share in columns:
        for step in steps:
            part = values[step.first : step.last + 1]
            for place in _standing_out(part, least, share):
                found.append((step.first + int(place), f"{name} {part[place]:g} {unit}"))
    if not found:
        return _gate("stray_rows", True, "no row stands out from both neighbours")
    places = np.unique([place for place, _ in found])
    rows = "1 row stands" if places.size == 1 else f"{places.size} rows stand"
    named = _named([f"{what} at {data.time[place]:g} s" for place, what in sorted(found)])
    reason = f"{rows} out from both neighbours; {named}: is it true, or a fault of the log?"
    return _gate("stray_rows", False, reason, _holding(data, made, places))


def _holding(data: Series, made: Sequence[Cycle], rows: NDArray[np.int64]) -> list[int]:
    """Return the numbers of the cycles that contain these rows, empty if any row is in no cycle.

    The row at which a cycle ends belongs to the next one, if there is one.
    """
    times = data.time[rows]
    places = np.searchsorted([each.start for each in made], times, side="right") - 1
    if (places < 0).any():
        return []
    ends = np.array([each.start + each.duration for each in made])[places]
    return [] if (times > ends).any() else [made[place].number for place in np.unique(places)]


def _standing_out(part: NDArray[np.float64], least: float, share: float) -> NDArray[np.int64]:
    """Return the indices within a step whose value differs from both neighbours by more than noise explains."""
    if part.size < 5:
        return np.zeros(0, dtype=np.int64)
    changes = np.abs(np.diff(part))
    if not np.isfinite(changes).any():
        return np.zeros(0, dtype=np.int64)
    floor = max(least, share * float(np.nanmedian(np.abs(part))))
    usual = float(np.nanpercentile(changes, 80.0))
    before, here, after = part[:-2], part[1:-1], part[2:]
    beyond = np.maximum(here - np.maximum(before, after), np.minimum(before, after) - here)
    return np.asarray(np.flatnonzero(beyond > max(floor, _STEEP * usual)) + 1, dtype=np.int64)


def _usual(data: Series) -> float:
    """Return a current [A] that few rows exceed."""
    return float(np.percentile(np.abs(data.current), 95.0))


def _named(names: Sequence[str]) -> str:
    more = len(names) - _NAMED
    return ", ".join(names[:_NAMED]) + (f" and {more} more" if more > 0 else "")


def _gate(name: str, ok: bool | None, reason: str, against: Sequence[int] = ()) -> Gate:
    return Gate(name=name, channel="", ok=ok, reason=reason, cycles=tuple(dict.fromkeys(against)))
