"""Timestamps of a log: unit, wrapped counters, rows out of order, and the grid index of each sample."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.gates import Gate
from hil.analysis.sampling import SamplingReport, placed
from hil.documents.text import counted

__all__ = ["TIME_UNITS", "Timeline", "time_unit", "timeline", "unwrapped"]

_Array: TypeAlias = NDArray[np.float64]
_Places: TypeAlias = NDArray[np.int64]

TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "d": 86400.0}
"""Units of timestamps, in s."""

_WRITTEN = {
    **{name: name for name in TIME_UNITS},
    "µs": "us", "μs": "us", "usec": "us", "microseconds": "us", "micros": "us",
    "msec": "ms", "milliseconds": "ms", "millis": "ms", "nsec": "ns", "nanoseconds": "ns",
    "sec": "s", "secs": "s", "second": "s", "seconds": "s",
    "minutes": "min", "hours": "h", "hour": "h", "days": "d", "day": "d",
}  # fmt: skip
_LAST_WORD = re.compile(r"(?:^|[\s_\[(/.,])([^\s_\[(/.,\])]+)[\])]?\s*$")
_EPOCHS = {"s": 1e9, "ms": 1e12, "us": 1e15, "ns": 1e18}  # about the year 2001; tenfold is the year 2286
_LIKELY = (2.5e-5, 2.0)  # s between samples of a sensor; beyond them another unit is likelier
_OTHERS = ("ms", "us", "ns", "h", "d", "s")  # units that times may be in instead, the likeliest first
_COUNTERS = frozenset(
    {"sample", "samples", "index", "idx", "counter", "count", "counts", "cnt", "seq", "sequence", "packet", "frame"}
    | {"row", "record", "nr", "no", "number"}
)
"""Last words of the names of columns that count samples."""

_WORDS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+")
_MODULI = (
    *(2.0**bits * unit for bits in (16, 24, 31, 32) for unit in (1.0, 1e-3, 1e-6)),
    *(2.0**32 * unit for unit in (1e-9, 1e-2)),
    *(86400.0 * unit for unit in (1.0, 1e3, 1e6)),
    *(3600.0 * unit for unit in (1.0, 1e3)),
    *(60.0 * unit for unit in (1.0, 1e3)),
    24.0, 1.0, 1e3, 1e6, 1e9,
)  # fmt: skip
_NEAR = 0.6  # of an interval: a wrapped counter goes on as it would have
_MOVED = 16  # places: rows that stand further from theirs were not swapped by two threads
_PARTS, _LEAST, _LOOKED_AT = 8, 20, 4096  # parts whose rates are compared, intervals that tell one, and are looked at
_SAME_RATE, _SURE = 0.02, 8.0  # of the rate, and standard deviations of it: by less rates do not differ
_NAMED = 10  # samples that a gate names


@dataclass(frozen=True, slots=True, kw_only=True)
class Timeline:
    """The interpreted timestamps of a log.

    Attributes:
        seconds: times since the first sample [s], shape (k,); ascending unless a gate trips.
        rows: row index in the log of each, shape (k,); None for all rows in order.
        places: index of each sample on an even grid, shape (k,).
        report: sampling report.
        gates: gates on the timestamps.
        remarks: reinterpretations of the timestamps, in sentences.
    """

    seconds: _Array
    rows: _Places | None
    places: _Places
    report: SamplingReport
    gates: tuple[Gate, ...]
    remarks: tuple[str, ...]


def time_unit(typed: str | None, column: str, values: ArrayLike) -> tuple[str, str]:
    """Return the unit of timestamps, and a remark if it was inferred and is not s.

    Args:
        typed: the unit given by the user, None if not given.
        column: name of the column, such as `time [ms]` or `timestamp_us`.
        values: the timestamps, shape (n,); epoch times show their unit by their magnitude.
    """
    if typed is not None:
        return typed, ""
    found = _LAST_WORD.search(column)
    unit = _WRITTEN.get(found[1] if found[1] in _WRITTEN else found[1].lower(), "") if found else ""
    if unit and column not in _WRITTEN:
        return unit, "" if unit == "s" else f"times are in {unit}, as the column's name '{column}' says"
    start = float(np.ravel(np.asarray(values, dtype=np.float64))[:1].sum())
    for name, least in _EPOCHS.items():
        if name != "s" and least <= start < 10.0 * least:
            return name, f"times are in {name} since 1970, as their size says"
    return "s", ""


def timeline(
    timestamps: ArrayLike, unit: str = "s", *, typed: bool = True, column: str = "", values: ArrayLike | None = None
) -> Timeline:
    """Interpret the timestamps of a log.

    Wrapped counters are unwrapped, duplicate rows dropped, and swapped rows put back in order, each with a remark.
    Anything unexplained trips a gate.

    Args:
        timestamps: timestamps as written, shape (n,).
        unit: unit of the timestamps, a key of TIME_UNITS.
        typed: whether the user gave the unit; otherwise an implausible interval, or a column named as a sample
            counter, trips the gate `time_unit`.
        column: name of the column.
        values: values beside each timestamp, shape (n, channels).

    Raises:
        Refused: fewer than three timestamps, or no two in ascending order.
    """
    raw = np.asarray(timestamps, dtype=np.float64)
    remarks: list[str] = []
    gates: list[Gate] = []
    rows: _Places | None = None
    if not (raw.size > 2 and (raw[1:] > raw[:-1]).all() and math.isfinite(raw[0]) and math.isfinite(raw[-1])):
        raw, gates = _filled(raw, remarks)
        raw, told = unwrapped(raw)
        remarks += told
        raw, rows = _in_order(raw, values, remarks)
    seconds = raw - raw[:1]
    seconds *= TIME_UNITS[unit]
    report, places = placed(seconds)
    gates += [_likely(report, unit, column, typed=typed), _one_rate(seconds, report)]
    remarks += _remarks(report)
    if not typed and column.isdecimal() and report.rate == 1.0 and not report.jitter_max:
        remarks.append("times rise by 1 from sample to sample: if they count samples, give --rate instead of --time")
    return Timeline(
        seconds=seconds, rows=rows, places=places, report=report, gates=tuple(gates), remarks=tuple(remarks)
    )


def _filled(raw: _Array, remarks: list[str]) -> tuple[_Array, list[Gate]]:
    """Interpolate timestamps that are not numbers."""
    bad = np.flatnonzero(~np.isfinite(raw))
    if not bad.size or bad.size > raw.size - 2:
        return raw, []
    good = np.flatnonzero(np.isfinite(raw))
    filled = raw.copy()
    filled[bad] = np.interp(bad, good, raw[good])
    told = f"{counted(bad.size, 'timestamp')} of {raw.size} not a number, the first is number {bad[0] + 1}"
    remarks.append(f"{told}; taken from the timestamps beside it")
    ends = bad[0] == 0 or bad[-1] == raw.size - 1
    numbers = tuple((bad[:_NAMED] + 1).tolist())
    ok = not ends and bad.size <= 0.01 * raw.size
    return filled, [Gate(name="times", channel="", ok=ok, reason=told, samples=numbers)]


def unwrapped(raw: _Array) -> tuple[_Array, tuple[str, ...]]:
    """Return unwrapped timestamps of a counter, shape (n,), and a remark if it wrapped.

    Args:
        raw: timestamps as written, shape (n,).
    """
    steps = np.diff(raw)
    back = np.flatnonzero(steps < 0.0)
    forward = steps[steps > 0.0]
    if not back.size or not forward.size or float(forward.max()) == math.inf:
        return raw, ()
    usual = float(np.median(forward))
    span = float(np.ptp(raw))
    for modulus in sorted(_MODULI):
        if modulus < span:
            continue
        beyond = steps[back] + modulus
        large = -steps[back] > modulus / 2.0
        fits = (beyond > 0.0) & (beyond < max(usual * (1.0 + _NEAR), 1.1 * float(np.quantile(forward, 0.99))))
        if large.any() and fits[large].all():
            turns = np.zeros(raw.size)
            turns[back[large] + 1] = modulus
            often = "once" if large.sum() == 1 else f"{large.sum()} times"
            at = ", ".join(str(place + 2) for place in back[large][:_NAMED].tolist())
            told = f"times start over {often}, at sample {at}, as a counter of {modulus:.10g} does: continued"
            return np.asarray(raw + np.cumsum(turns)), (told,)
    return raw, ()


def _in_order(raw: _Array, values: ArrayLike | None, remarks: list[str]) -> tuple[_Array, _Places | None]:
    """Drop duplicate rows, and put swapped rows back in order."""
    steps = np.diff(raw)
    rows: _Places | None = None
    if values is not None and (steps == 0.0).any():
        beside = np.asarray(values, dtype=np.float64)
        twice = np.flatnonzero(steps == 0.0)
        same = twice[((beside[twice] == beside[twice + 1]) | np.isnan(beside[twice])).all(axis=1)]
        if same.size == twice.size and same.size <= 0.1 * raw.size:
            rows = np.delete(np.arange(raw.size, dtype=np.int64), same + 1)
            raw = raw[rows]
            what = "row repeats the row" if same.size == 1 else "rows repeat the rows"
            remarks.append(f"{same.size} {what} before, time and values, the first is number {same[0] + 2}: left out")
    steps = np.diff(raw)
    back = np.flatnonzero(steps < 0.0)
    if not back.size or back.size > 0.1 * raw.size:
        return raw, rows
    order = np.argsort(raw, kind="stable").astype(np.int64)
    moved = np.abs(order - np.arange(raw.size))
    arranged = raw[order]
    if moved.max() > _MOVED or (np.diff(arranged) < 0.5 * np.median(steps[steps > 0.0])).any():
        return raw, rows
    remarks.append(
        f"{int((moved > 0).sum())} rows stand out of order, the first is number {back[0] + 2}: put in order of time"
    )
    return arranged, order if rows is None else rows[order]


def _likely(report: SamplingReport, unit: str, column: str, *, typed: bool) -> Gate:
    interval = 1.0 / report.rate
    if not typed and _counts_samples(column):
        reason = f"column '{column}' counts samples, as its name says, and tells no time: give --rate instead of --time"
        return Gate(name="time_unit", channel="", ok=False, reason=f"{reason}, or --time-unit {unit} if it does")
    reason = f"{interval:.4g} s between samples, {report.rate:.4g} Hz, with times taken in {unit}"
    ok = typed or _LIKELY[0] <= interval <= _LIKELY[1]
    if not ok:
        reason += f", is unlikely: type {_others(interval, unit)}--time-unit {unit} if it is right"
    return Gate(name="time_unit", channel="", ok=ok, reason=reason)


def _others(interval: float, unit: str) -> str:
    """Return a hint with every unit that makes the interval plausible."""
    written = interval / TIME_UNITS[unit]
    likely = [each for each in _OTHERS if _LIKELY[0] <= written * TIME_UNITS[each] <= _LIKELY[1]]
    return "".join(f"--time-unit {each} if they are in {each}, " for each in likely)


def _counts_samples(column: str) -> bool:
    words = [word.lower() for word in _WORDS.findall(column)]
    return bool(words) and words[-1] in _COUNTERS and not any("time" in word for word in words)


def _one_rate(seconds: _Array, report: SamplingReport) -> Gate:
    """Trip where the typical intervals of two eighths differ by 2 % and significantly."""
    usual, spread = [], 0.0
    for part in np.array_split(seconds, _PARTS):
        begin = max(0, (part.size - _LOOKED_AT) // 2)
        steps = np.diff(part[begin : begin + _LOOKED_AT])
        steps = steps[steps > 0.0]
        if steps.size < _LEAST:
            break
        usual.append(float(np.median(steps)))
        spread = max(spread, 1.86 * float(np.median(np.abs(steps - usual[-1]))) / math.sqrt(steps.size))
    if len(usual) < _PARTS or report.rounded or report.burst > 1.0:
        return Gate(name="one_rate", channel="", ok=None, reason="the times do not tell whether the rate changes")
    shortest, longest = min(usual), max(usual)
    reason = f"{1.0 / longest:.4g} to {1.0 / shortest:.4g} Hz in the eighths of the record"
    ok = longest - shortest <= _SAME_RATE * shortest + _SURE * spread
    return Gate(name="one_rate", channel="", ok=ok, reason=reason if ok else f"the rate changes: {reason}")


def _remarks(report: SamplingReport) -> list[str]:
    remarks = []
    if report.rounded:
        step = f"{report.resolution:.3g} s"
        remarks.append(f"times are rounded to {step}, intervals of {1.0 / report.rate:.4g} s to neighbouring multiples")
    if report.burst > 1.0:
        remarks.append(
            f"samples come in bursts of {report.burst:.3g}; they are taken as evenly spaced, the rate from their count"
        )
    return remarks
