"""Column mappings for battery logs of any make: columns, units, and state codes.

A mapping is a YAML file of its own, so that one serves all logs of a cycler, whatever the options of the analysis.
"""

from __future__ import annotations

import re
from collections.abc import Mapping as Keys
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from hil.documents.declared import read_document
from hil.documents.findings import Findings
from hil.logs.columns import Reading, Table
from hil.logs.columns import read as read_columns
from hil.model.errors import Refused
from hil.model.notation import Flag, NotNegative, Positive, Text, one_of

__all__ = ["UNITS", "Accuracy", "Cell", "Columns", "Mapped", "Mapping", "States", "Units", "load", "read", "restarted"]

_SCHEMA = "hil/battery-log/1"
_Restarts = Annotated[str, one_of("", "step", "run")]

UNITS: Keys[str, Keys[str, float]] = {
    "voltage": {"V": 1.0, "mV": 1e-3},
    "current": {"A": 1.0, "mA": 1e-3, "uA": 1e-6},
    "temperature": {"degC": 1.0, "K": 1.0},
    "charge": {"Ah": 1.0, "mAh": 1e-3, "As": 1.0 / 3600.0},
    "energy": {"Wh": 1.0, "mWh": 1e-3, "J": 1.0 / 3600.0},
}
"""Units by quantity: the first is used internally, the numbers are factors to it; K also has an offset."""

_KELVIN = 273.15
_SUFFIX = re.compile(r"(?:[/(\[]\s*([^/()\[\]]+?)\s*[)\]]?|[\s_.,]([^\s_.,/()\[\]]+))\s*$")
_RESTS = 0.02  # of the typical current: below it the direction is undefined
_HALF = 0.5  # of a counter's last value: it restarted where it falls below, beyond rounding


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """Columns by number or name, empty where absent.

    The `step` number reveals a restart of the time even after a step of one row.
    Without `discharge`, `charge` counts in both directions, as does `charge_energy` without `discharge_energy`.
    """

    time: Text = ""
    voltage: Text = ""
    current: Text = ""
    temperature: Text = ""
    cycle: Text = ""
    step: Text = ""
    state: Text = ""
    charge: Text = ""
    discharge: Text = ""
    charge_energy: Text = ""
    discharge_energy: Text = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Units:
    """Units of columns whose names do not state them; those of `charge` and `energy` apply in both directions."""

    time: Annotated[str, one_of("", "s", "ms", "us", "ns", "min", "h", "d")] = ""
    voltage: Annotated[str, one_of("", *UNITS["voltage"])] = ""
    current: Annotated[str, one_of("", *UNITS["current"])] = ""
    temperature: Annotated[str, one_of("", *UNITS["temperature"])] = ""
    charge: Annotated[str, one_of("", *UNITS["charge"])] = ""
    energy: Annotated[str, one_of("", *UNITS["energy"])] = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class States:
    """The words or codes of the column `state`."""

    charge: tuple[Text, ...] = ()
    discharge: tuple[Text, ...] = ()
    rest: tuple[Text, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """Prior knowledge of the cell: capacity [Ah], energy [Wh], voltage limits [V], and end-of-charge current [A]."""

    capacity: Positive | None = None
    energy: Positive | None = None
    upper: Positive | None = None
    lower: NotNegative | None = None
    cut_off: Positive | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Accuracy:
    """Error limits of the meters: relative gains, such as 0.001 for 0.1 %, and offsets in A and V."""

    current_gain: NotNegative | None = None
    current_offset: NotNegative | None = None
    voltage_gain: NotNegative | None = None
    voltage_offset: NotNegative | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Mapping:
    """Mapping for the logs of a cycler.

    Attributes:
        columns: columns by content.
        units: units of columns whose names do not state them.
        states: meaning of the `state` column's codes.
        discharge_positive: whether positive current discharges.
        time_restarts: what restarts the time column: `step`, where each step begins at the end of the previous one;
            `run`, with unknown time between runs; empty if it does not restart.
        cell: prior knowledge of the cell.
        accuracy: error limits of the meters.
    """

    columns: Columns = field(default_factory=Columns)
    units: Units = field(default_factory=Units)
    states: States = field(default_factory=States)
    discharge_positive: Flag = False
    time_restarts: _Restarts = ""
    cell: Cell = field(default_factory=Cell)
    accuracy: Accuracy = field(default_factory=Accuracy)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mapped:
    """The mapped columns of a log; arrays of the same length.

    Attributes:
        time: time as written, in s if it was a clock time.
        clocked: whether it was a clock time.
        names: column names, by the fields of `Columns`.
        columns: likewise the values, in V, A, degC, Ah and Wh; current is positive for charging.
        contradicted: indices of rows whose current disagrees with the state, or flows in a rest.
        remarks: reinterpretations and omissions, in sentences.
    """

    time: NDArray[np.float64]
    clocked: bool
    names: Keys[str, str]
    columns: Keys[str, NDArray[np.float64]]
    contradicted: NDArray[np.int64]
    remarks: tuple[str, ...]

    def counted(self, quantity: str, seconds: NDArray[np.float64]) -> tuple[NDArray[np.float64] | None, float | None]:
        """Return the instrument's net counter of `charge` or `energy` per row, and its total; None without a counter.

        A counter that never changes is ignored.

        A counter that falls back has restarted: from zero if the previous row is at rest; otherwise the samples stand
        in for the uncounted amount between the two rows.

        Args:
            quantity: `charge` or `energy`.
            seconds: times of the rows [s].
        """
        into, out = ("charge", "discharge") if quantity == "charge" else ("charge_energy", "discharge_energy")
        if into not in self.columns:
            return None, None
        current = self.columns["current"]
        size = np.abs(current)
        rests = size <= _RESTS * _usual(size)
        signs = np.where(rests, np.append(0.0, np.sign(current)[:-1]), np.sign(current))
        ways = [(into, signs)] if out not in self.columns else [(into, np.ones(size.size)), (out, -np.ones(size.size))]
        rate = current if quantity == "charge" else current * self.columns["voltage"]
        passed = np.diff(seconds) * (rate[:-1] + rate[1:]) / 7200.0
        net = np.zeros(size.size)
        for name, way in ways:
            counter = _held(np.abs(self.columns[name]))
            fell = counter[1:] < _HALF * counter[:-1]
            sampled = np.clip(np.nan_to_num(way[1:] * passed), 0.0, None)
            steps = np.where(fell, np.where(rests[:-1], counter[1:], sampled), np.diff(counter))
            net[1:] += np.cumsum(np.nan_to_num(way[1:]) * steps)
        return (net, float(net[-1])) if net.any() else (None, None)


def _usual(size: NDArray[np.float64]) -> float:
    finite = size[np.isfinite(size)]
    return float(np.percentile(finite, 95.0)) if finite.size else 0.0


def _held(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values with NaN replaced by the previous value, or zero at the beginning."""
    known = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(values.size), 0))
    return np.nan_to_num(values[known])


def load(path: Path) -> Mapping:
    """Load a mapping.

    Raises:
        InvalidDocument: with every error, each with its line and column.
    """
    findings = Findings()
    document = read_document(path, str(path), findings, Mapping, schema=_SCHEMA)
    findings.raise_if_any()
    if document is None:
        raise Refused(f"{path}: not a mapping", f"begin it with schema: {_SCHEMA}")
    return document.model


def read(file: Path, mapping: Mapping, *, named: str = "the mapping") -> Mapped:
    """Read the mapped columns of a log.

    Args:
        file: the log.
        mapping: with columns of time, voltage and current.
        named: the mapping's own file, for errors.

    Raises:
        Refused: as `hil.logs.columns.read`, or an invalid unit, or a state missing from the mapping.
    """
    wanted = {each.name: getattr(mapping.columns, each.name) for each in fields(Columns)}
    wanted = {name: column for name, column in wanted.items() if column}
    states = _state_of(mapping, named) if "state" in wanted else {}
    table = read_columns(
        file, [column for name, column in wanted.items() if name != "time"], first=wanted["time"], clock=True,
        readings=states,
    )  # fmt: skip
    names = dict(zip(wanted, table.names, strict=True))
    remarks = list(table.remarks)
    columns = _scaled(table, names, mapping.units, remarks)
    if mapping.discharge_positive:
        columns["current"] = -columns["current"]
    contradicted = _directed(columns) if "state" in columns else np.zeros(0, dtype=np.int64)
    return Mapped(
        time=table.values[:, 0], clocked=table.clocked, names=names, columns=columns, contradicted=contradicted,
        remarks=tuple(remarks),
    )  # fmt: skip


def _state_of(mapping: Mapping, named: str) -> dict[str, Reading]:
    """Return the parser of the state column: 1 for charge, -1 for discharge, 0 for rest."""
    words = [*mapping.states.charge, *mapping.states.discharge, *mapping.states.rest]
    twice = next((word for word in words if words.count(word) > 1), None)
    if twice is not None:
        raise Refused(f"{named}: the state '{twice}' is listed twice in `states:`", "list each word once")
    codes = dict.fromkeys(mapping.states.charge, 1.0) | dict.fromkeys(mapping.states.discharge, -1.0)
    codes |= dict.fromkeys(mapping.states.rest, 0.0)
    if not any(codes.values()):
        raise Refused(
            f"{named}: a column of states, and no word that says charge or discharge",
            "list its words as `states:` with `charge: [...]`, `discharge: [...]` and `rest: [...]`",
        )

    def number(cell: str) -> float:
        word = cell.strip().strip('"')
        found = codes.get(word)
        if found is None:
            raise ValueError(word)
        return found

    hint = f"add it to `charge`, `discharge` or `rest` of `states:` in {named}"
    return {mapping.columns.state: Reading(number=number, what=f"state that {named} lists", hint=hint)}


def _scaled(table: Table, names: Keys[str, str], units: Units, remarks: list[str]) -> dict[str, NDArray[np.float64]]:
    """Convert the columns to internal units, with a remark for each whose name states a different one."""
    columns = dict(zip(names, np.where(np.isinf(table.values), np.nan, table.values).T, strict=True))
    quantities = {name: name for name in ("voltage", "current", "temperature")}
    quantities |= dict.fromkeys(("charge", "discharge"), "charge")
    quantities |= dict.fromkeys(("charge_energy", "discharge_energy"), "energy")
    for name, quantity in quantities.items():
        if name not in columns:
            continue
        base = next(iter(UNITS[quantity]))
        unit = getattr(units, quantity)
        if not unit:
            unit = _told(names[name], quantity) or base
            if unit != base:
                remarks.append(f"{name.replace('_', ' ')} is in {unit}, as the column's name '{names[name]}' says")
        columns[name] = columns[name] * UNITS[quantity][unit] - (_KELVIN if unit == "K" else 0.0)
    return columns


def _told(column: str, quantity: str) -> str:
    """Return the unit at the end of a column's name, such as `Current(mA)`, `I/mA` or `Q charge/mA.h`; or empty."""
    found = _SUFFIX.search(column)
    if found is None:
        return ""
    word = (found[1] or found[2]).replace(".", "").replace("·", "").replace("*", "").replace("µ", "u").casefold()
    return next((unit for unit in UNITS[quantity] if unit.casefold() == word), "")


def _directed(columns: dict[str, NDArray[np.float64]]) -> NDArray[np.int64]:
    """Sign an unsigned current by its state, and return the rows where current and state disagree."""
    state, current = columns["state"], columns["current"]
    size = np.abs(current)
    flows = size > _RESTS * _usual(size)
    wrong = flows & (state == 0.0)
    active = flows & (state != 0.0)
    if (active & (current > 0.0)).any() and (active & (current < 0.0)).any():  # else it is unsigned
        wrong |= active & (np.sign(current) != state)
    columns["current"] = np.where(state == 0.0, np.where(flows, current, 0.0), size * state)
    return np.flatnonzero(wrong)


def restarted(
    time: NDArray[np.float64], how: str, step: NDArray[np.float64] | None = None
) -> tuple[NDArray[np.float64], NDArray[np.int64] | None, tuple[str, ...]]:
    """Return a restarting time as a continuous one, the stretch number of each row, and remarks.

    Args:
        time: time [s].
        how: `step` or `run`, see `Mapping`; the stretches are None for `step`.
        step: step number of each row, None if unknown.
    """
    good = np.isfinite(time)
    if not good.all():
        found, stretches, remarks = restarted(time[good], how, None if step is None else step[good])
        whole = np.full(time.size, np.nan)
        whole[good] = found
        if stretches is None:
            return whole, None, remarks
        places = np.zeros(time.size, dtype=np.int64)
        places[good] = stretches
        return whole, np.maximum.accumulate(places), remarks
    steps = np.diff(time)
    back = np.flatnonzero(steps < 0.0 if step is None or how == "run" else np.diff(_held(step)) != 0.0)
    if not back.size:
        return time, None, ()
    often = "once" if back.size == 1 else f"{back.size} times"
    added = np.zeros(time.size)
    added[back + 1] = time[back]
    if how == "step":
        told = f"the time starts over {often}, first at row {back[0] + 2}: a step begins where the one before ended"
        return time + np.cumsum(added), None, (told,)
    forward = steps[steps > 0.0]
    added[back + 1] += (float(np.median(forward)) if forward.size else 1.0) - time[back + 1]
    stretch = np.zeros(time.size, dtype=np.int64)
    stretch[back + 1] = 1
    told = f"the time starts over {often}, first at row {back[0] + 2}: what lies between is not known"
    return time + np.cumsum(added), np.cumsum(stretch), (told,)
