"""How every analysis gets a log: read it, interpret its times, evaluate the gates; then compute, with status."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING

from hil.cli.analyses.wanted import Wanted
from hil.model.errors import Refused

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    from hil.analysis.gates import Facts, Gate
    from hil.analysis.sampling import SamplingReport
    from hil.analysis.timeline import Timeline
    from hil.logs.columns import Table

__all__ = [
    "INCONCLUSIVE",
    "Log",
    "gates_as_json",
    "log_as_json",
    "named_units",
    "obtain",
    "obtain_beside",
    "refuse_extremes",
    "status",
]

INCONCLUSIVE = "inconclusive"
"""Status of what was computed from a log for which a gate trips."""

_LARGEST, _SMALLEST = 1e100, 1e-100  # beyond these a square overflows or vanishes
_JITTER = 0.6  # of a sampling period, rms: with more, samples cannot be told apart
_COPED = frozenset({"gaps", "jitter", "rate"})  # what averages over evenly placed samples can cope with
_BRACKETS = re.compile(r"[\[(]([^\[\]()]+)[\])]\s*$")  # a unit at the end of a column's name
_LEAST_OF_CLOCK, _TOLD = 10, 0.005  # samples, and part of white noise that rounding added


@dataclass(frozen=True, slots=True, kw_only=True)
class Log:
    """A log that was read, with interpreted times and evaluated gates.

    Attributes:
        file: its name.
        unit: of the samples.
        rate: samples per second.
        sampling: what the timestamps say, None if there are none.
        channels: samples by column, on an even grid; NaN where one is missing.
        gates: every gate with its result.
        remarks: what was understood in another way than it was written, left out or taken for granted, in sentences.
        begin: when its first sample was, in s after the first row of the file.
        coped: names of gates that the analysis copes with when they trip.
    """

    file: str
    unit: str
    rate: float
    sampling: SamplingReport | None
    channels: Mapping[str, NDArray[np.float64]]
    gates: tuple[Gate, ...]
    remarks: tuple[str, ...]
    begin: float = 0.0
    coped: frozenset[str] = field(default=_COPED)

    def doubts(self, channel: str) -> tuple[Gate, ...]:
        """Return the gates that make what is computed from a channel inconclusive."""
        return tuple(
            gate
            for gate in self.gates
            if gate.ok is False and gate.channel in {"", channel} and gate.name not in self.coped
        )


def status(doubts: tuple[Gate, ...], otherwise: str) -> str:
    """Return the status of a figure: the analysis' own, unless a gate trips for the log."""
    return INCONCLUSIVE if doubts and otherwise not in {"not observable", "model rejected"} else otherwise


def gates_as_json(gates: tuple[Gate, ...]) -> list[dict[str, object]]:
    """Return gates as a JSON document holds them."""
    return [asdict(gate) for gate in gates]


def log_as_json(log: Log, *, doubted: bool, gates: tuple[Gate, ...] = ()) -> dict[str, object]:
    """Return how the JSON document of a log's analysis begins.

    Args:
        log: what was analysed.
        doubted: whether a gate trips for any of its channels.
        gates: those of the analysis, besides the log's own.
    """
    return {
        "format": 1,
        "file": log.file,
        "status": INCONCLUSIVE if doubted else "conclusive",
        "sampling": asdict(log.sampling) if log.sampling else None,
        "remarks": list(log.remarks),
        "gates": gates_as_json((*log.gates, *gates)),
    }


def obtain(wanted: Wanted, parts: str = "averages that miss more than 5 %") -> Log:
    """Read a log, interpret its times, cut it to the selected part, and evaluate the gates.

    Args:
        wanted: which samples.
        parts: of the record that the analysis leaves out, and where, as in `averages that miss more than 5 %`; empty if
            it leaves nothing out.

    Raises:
        Refused: what cannot be read, or is no series of samples.
    """
    return obtain_beside([wanted], parts)[0]


def obtain_beside(sensors: Sequence[Wanted], parts: str, *, at_rest: bool = True, own_pace: bool = False) -> list[Log]:
    """Read the samples of several sensors from one log, at the same times.

    Args:
        sensors: which samples, of one file and with one time; where there are several, each names its columns.
        parts: as of `obtain`.
        at_rest: whether the whole record is taken at rest; if not, its samples pass no gates.
        own_pace: whether each sensor may have its own rate: rows in which it has no cell, NaN, or its last reading
            once more are then not of its log.

    Raises:
        Refused: as `obtain` does.
    """
    from hil.logs.columns import read  # noqa: PLC0415 - start-up stays light

    wanted = sensors[0]
    named = [tuple(name.strip() for name in each.columns.split(",")) if each.columns else () for each in sensors]
    asked = [name for each in named for name in each]
    table = read(wanted.file, asked, first=wanted.time or "", clock=True, blank=own_pace)
    if len(table.names) == (wanted.time is not None):
        raise Refused(f"{wanted.file}: there is no column besides the time", "choose another with --columns")
    twice = [name for name in table.names if table.names.count(name) > 1]
    if twice:
        raise Refused(f"column '{twice[0]}' is named twice", "name each column once")
    parted = _own(table, named, wanted) if own_pace else None
    every = parted or [_timed(wanted, table) if wanted.rate is None else _untimed(wanted, table)] * len(sensors)
    found, names = [], list(table.names[wanted.rate is None :])
    for its, timed, columns in zip(sensors, every, named, strict=True):
        own, names = (names[: len(columns)], names[len(columns) :]) if columns else (names, [])
        channels = {name: _scaled(its, name, timed.channels[name]) for name in own}
        found.append(_log(its, timed, channels, (*table.remarks, *timed.remarks), parts, at_rest=at_rest))
    return found


def _own(table: Table, named: Sequence[Sequence[str]], wanted: Wanted) -> list[_Timed] | None:
    """Return the samples of each sensor in the rows that are its own, None if every row is of every sensor."""
    import numpy as np  # noqa: PLC0415 - start-up stays light

    from hil.analysis.paces import own_rows  # noqa: PLC0415 - start-up stays light

    if wanted.rate is not None:
        seconds = np.arange(len(table.values)) / wanted.rate
        values = np.column_stack((seconds, table.values))
        table = replace(table, names=("time", *table.names), values=values, clocked=True)
    ends = np.cumsum([1, *map(len, named)]).tolist()
    parts = [*pairwise(ends)]
    if all(own_rows(table.values[:, first:after]) is None for first, after in parts):
        return None
    found = []
    for first, after in parts:
        own = own_rows(table.values[:, first:after], apart=True)
        names, values = table.names[first:after], table.values[:, [0, *range(first, after)]]
        part = replace(table, names=(table.names[0], *names), values=values if own is None else values[own])
        timed = _timed(wanted, part, zero=float(table.values[0, 0]))
        if own is not None:
            told = f"{len(own)} of {len(values)} rows hold a reading of {', '.join(names)}, at {timed.rate:.4g} Hz"
            timed = replace(timed, remarks=(*timed.remarks, f"{told}; the others repeat it or hold none"))
        found.append(timed)
    return found


def _log(
    wanted: Wanted,
    timed: _Timed,
    channels: Mapping[str, NDArray[np.float64]],
    remarks: tuple[str, ...],
    parts: str,
    *,
    at_rest: bool,
) -> Log:
    import numpy as np  # noqa: PLC0415 - start-up stays light

    from hil.analysis import quality  # noqa: PLC0415 - start-up stays light

    facts = wanted.facts()
    sampled = () if timed.report is None else quality.sampled(timed.seconds, timed.report, facts)
    asked = quality.read(channels, facts, timed.rate) if at_rest else _infinite(channels)
    coped = _COPED if timed.report is None or timed.report.jitter <= _JITTER else _COPED - {"jitter"}
    if not any(np.isinf(values).any() for values in channels.values()):
        coped |= {"finite"}
    return Log(
        file=str(wanted.file),
        unit=wanted.result_unit,
        rate=timed.rate,
        sampling=timed.report,
        channels=_on_grid(timed, channels),
        gates=(*timed.gates, *sampled, *named_units(channels, wanted.unit), *asked),
        remarks=(*remarks, *_missing(channels, timed.report, parts), *_rounded(channels, facts)),
        begin=timed.begin,
        coped=coped,
    )


def _infinite(channels: Mapping[str, NDArray[np.float64]]) -> tuple[Gate, ...]:
    """Return gates on infinite samples for a record that was not taken at rest; NaN counts as missing."""
    import numpy as np  # noqa: PLC0415 - start-up stays light

    from hil.analysis.gates import finite  # noqa: PLC0415 - start-up stays light

    return tuple(finite(name, values[~np.isnan(values)]) for name, values in channels.items())


def named_units(columns: Iterable[str], unit: str) -> tuple[Gate, ...]:
    """Return a gate that trips for each column whose name ends in a unit other than the one given."""
    from hil.analysis.gates import Gate  # noqa: PLC0415 - start-up stays light
    from hil.requirements.units import same  # noqa: PLC0415 - slow to import

    found = {name: match[1].strip() for name in columns if (match := _BRACKETS.search(name))}
    told = {name: f"name of column '{name}' says {other}" for name, other in found.items() if not same(other, unit)}
    reasons = {name: f"--unit says {unit}, but the {each}: check which is right" for name, each in told.items()}
    return tuple(Gate(name="unit", channel=name, ok=False, reason=reason) for name, reason in reasons.items())


@dataclass(frozen=True, slots=True, kw_only=True)
class _Timed:
    """Samples whose times are known: the selected rows, in chronological order."""

    seconds: NDArray[np.float64]
    places: NDArray[np.int64] | None
    rate: float
    report: SamplingReport | None
    channels: dict[str, NDArray[np.float64]]
    gates: tuple[Gate, ...]
    remarks: tuple[str, ...]
    begin: float = 0.0


def _untimed(wanted: Wanted, table: Table) -> _Timed:
    import numpy as np  # noqa: PLC0415 - start-up stays light

    rate = wanted.rate or math.nan
    seconds = np.arange(len(table.values)) / rate
    part = _part(wanted, seconds)
    channels = {name: np.ascontiguousarray(table.values[part, place]) for place, name in enumerate(table.names)}
    return _Timed(
        seconds=seconds[part],
        places=None,
        rate=rate,
        report=None,
        channels=channels,
        gates=(),
        remarks=tuple(_clocks(channels)),
        begin=float(seconds[part][0]),
    )


def _timed(wanted: Wanted, table: Table, *, zero: float = math.nan) -> _Timed:
    """Interpret the times of samples; `zero` is the timestamp of the file's first row, if it is not theirs."""
    import numpy as np  # noqa: PLC0415 - start-up stays light

    from hil.analysis.sampling import placed  # noqa: PLC0415 - start-up stays light
    from hil.analysis.timeline import TIME_UNITS, time_unit, timeline  # noqa: PLC0415 - start-up stays light

    raw = table.values[:, 0]
    unit, told = ("s", "") if table.clocked else time_unit(wanted.time_unit, table.names[0], raw)
    try:
        typed = table.clocked or wanted.time_unit is not None
        line: Timeline = timeline(raw, unit, typed=typed, column=table.names[0], values=table.values[:, 1:])
    except Refused as error:
        raise Refused(f"{wanted.file}: {error.message}", error.hint) from None
    later = (float(raw[0]) - zero) * TIME_UNITS[unit]
    since = line.seconds + later if later > 0.0 else line.seconds
    part = _part(wanted, since)
    whole = bool(part.all())
    rows: NDArray[np.int64] | slice = slice(None)  # no copy if every row is selected
    if line.rows is not None or not whole:
        rows = (np.arange(len(raw)) if line.rows is None else line.rows)[part]
    report, places = (line.report, line.places) if whole else placed(line.seconds[part])
    return _Timed(
        seconds=line.seconds if whole else line.seconds[part],
        places=places if report.missing else None,
        rate=report.rate,
        report=report,
        channels={
            name: np.ascontiguousarray(table.values[rows, place]) for place, name in enumerate(table.names[1:], start=1)
        },
        gates=line.gates,
        remarks=(*((told,) if told else ()), *line.remarks),
        begin=float(since[part.argmax()]),
    )


def _part(wanted: Wanted, since: NDArray[np.float64]) -> NDArray[np.bool_]:
    end = math.inf if wanted.end is None else wanted.end
    part = (since >= wanted.begin) & (since <= end)
    if not part.any():
        asked = f"--from {wanted.begin:g}" + ("" if wanted.end is None else f" --to {wanted.end:g}")
        raise Refused(f"{wanted.file}: no sample lies within {asked}", f"the log lasts {since[-1]:g} s")
    return part


def _scaled(wanted: Wanted, name: str, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return samples in the unit of the result; refuse those whose squares overflow or vanish."""
    scaled = values if wanted.scale is None else values * wanted.scale
    refuse_extremes(wanted.file, name, scaled)
    return scaled


def refuse_extremes(file: Path, column: str, values: NDArray[np.float64]) -> None:
    """Refuse a column without a number, or with numbers whose squares overflow or vanish.

    Args:
        file: whose column it is.
        column: its name.
        values: what it holds, shape (n,).

    Raises:
        Refused: as it says.
    """
    from hil.analysis.gates import present  # noqa: PLC0415 - start-up stays light

    here = present(values)
    if not here.size:
        raise Refused(f"{file}: column {column} holds no number", "choose other columns")
    highest, lowest = float(here.max()), float(here.min())
    largest, span = max(abs(highest), abs(lowest)), highest / 2.0 - lowest / 2.0
    if largest > _LARGEST or 0.0 < span < _SMALLEST:
        number = largest if largest > _LARGEST else span
        raise Refused(
            f"{file}: column {column} varies by {number:.3g}, beyond what can be squared",
            "check the column, or bring it to another unit with --scale and --scaled-unit",
        )


def _on_grid(timed: _Timed, channels: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
    """Put samples on an even grid, with a hole for each that is missing or infinite."""
    import numpy as np  # noqa: PLC0415 - start-up stays light

    from hil.analysis.sampling import with_holes  # noqa: PLC0415 - start-up stays light

    found = {}
    for name, values in channels.items():
        finite = np.where(np.isinf(values), np.nan, values) if np.isinf(values).any() else values
        found[name] = finite if timed.places is None else with_holes(timed.places, finite)
    return found


def _missing(channels: Mapping[str, NDArray[np.float64]], report: SamplingReport | None, parts: str) -> list[str]:
    counts = {name: int((values != values).sum()) for name, values in channels.items()}  # noqa: PLR0124 - NaN alone differs
    told = [f"column {name}: {count} samples are NaN and count as missing" for name, count in counts.items() if count]
    if report is not None and report.missing:
        number = f"{report.missing} samples are" if report.missing > 1 else "1 sample is"
        left = f"; {parts} of their samples are left out" if parts else ""
        told.append(f"{number} missing{left}")
    return told


def _rounded(channels: Mapping[str, NDArray[np.float64]], facts: Facts) -> list[str]:
    from hil.analysis.extremes import rounding  # noqa: PLC0415 - start-up stays light

    parts = {name: rounding(values, facts) for name, values in channels.items()}
    return [
        f"column {name}: readings are rounded to counts, so white noise reads about {part:.1%} above the sensor's own"
        for name, part in parts.items()
        if part >= _TOLD
    ]


def _clocks(rates: Mapping[str, NDArray[np.float64]]) -> list[str]:
    """Return a remark for every column that rises monotonically, as a time or a counter does and noise does not."""
    return [
        f"column {name} rises with every sample, as a time does: give it to --time, or leave it out with --columns"
        for name, values in rates.items()
        if len(values) >= _LEAST_OF_CLOCK and (values[1:] > values[:-1]).all()
    ]
