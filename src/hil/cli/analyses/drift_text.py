"""What `hil analyse drift` prints: a table for each fragment, one JSON document, or one CSV table."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil.analysis.drift import Drift
from hil.analysis.gates import Gate
from hil.cli.analyses.allan_text import called, heading, stated
from hil.cli.analyses.log import Log, log_as_json, status
from hil.documents.text import fitting
from hil.model.figure import Figure, FigureStatus, encoded
from hil.report.tables import aligned

__all__ = ["Fragment", "Result", "as_json", "as_table", "as_text"]

_WIDTH = 80
_FIGURES = {"slope": "drift", "offset": "offset", "hysteresis": "hysteresis", "per_hour": "drift over time"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Fragment:
    """A contiguous part of a log: times in s, temperatures in degC, and the drift of every axis."""

    time: NDArray[np.float64]
    temperature: NDArray[np.float64]
    axes: Mapping[str, Drift]


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """All results of one call.

    Attributes:
        log: what was analysed.
        doubts: by axis, the gates that trip for it.
        reference: temperature of the offsets in degC.
        fragments: in order of time.
    """

    log: Log
    doubts: Mapping[str, tuple[Gate, ...]]
    reference: float
    fragments: tuple[Fragment, ...]

    @property
    def doubted(self) -> bool:
        """Whether a gate trips for any axis."""
        return any(self.doubts.values())


def as_json(result: Result) -> str:
    """Return the result as one JSON document; what is not finite is null."""
    fragments = [
        {
            **_extent(fragment),
            "axes": [_axis(name, each, result.doubts[name]) for name, each in fragment.axes.items()],
        }
        for fragment in result.fragments
    ]
    document = {
        **log_as_json(result.log, doubted=result.doubted),
        "reference": result.reference,
        "fragments": fragments,
    }
    return json.dumps(document, allow_nan=False, indent=2)


def _extent(fragment: Fragment) -> dict[str, float]:
    """Return where a fragment lies in time [s] and temperature [degC]."""
    time, temperature = fragment.time, fragment.temperature
    ends = {"begin": time[0], "end": time[-1], "coldest": temperature.min(), "hottest": temperature.max()}
    return {"samples": time.size, **{name: round(float(each), 9) for name, each in ends.items()}}


def _axis(name: str, found: Drift, doubts: tuple[Gate, ...]) -> dict[str, object]:
    points = zip(
        found.time.tolist(), found.temperature.tolist(), found.value.tolist(), found.heating.tolist(), strict=True
    )
    return {
        "name": name,
        **{each: _figure(getattr(found, each), doubts) for each in (*_FIGURES, "warming")},
        "probability": found.probability("slope") if "slope" not in found.reasons else None,
        "reasons": dict(found.reasons),
        "points": [dict(zip(("time", "temperature", "value", "heating"), each, strict=True)) for each in points],
    }


def _figure(figure: Figure, doubts: tuple[Gate, ...]) -> dict[str, object]:
    return {**encoded(figure), "status": status(doubts, figure.status.value)}  # type: ignore[dict-item]


def as_table(result: Result) -> str:
    """Return a CSV table: a row for every axis of every fragment; a missing figure is empty, with the reason."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    names = [word for name in _FIGURES for word in (name, f"{name} uncertainty", f"{name} unit")]
    rows.writerow(
        ["fragment", "axis", "begin s", "end s", "coldest degC", "hottest degC", "samples", *names, "reasons"]
    )
    for number, fragment in enumerate(result.fragments, 1):
        extent = _extent(fragment)
        where = [f"{extent[each]:.9g}" for each in ("begin", "end", "coldest", "hottest", "samples")]
        for axis, found in fragment.axes.items():
            cells = []
            for name in _FIGURES:
                figure: Figure = getattr(found, name)
                told = figure.status is FigureStatus.MEASURED
                cells += (
                    [f"{figure.value:.9g}", f"{figure.uncertainty:.3g}", figure.unit] if told else ["", "", figure.unit]
                )
            rows.writerow([number, axis, *where, *cells, "; ".join(_reasons(found))])
    return text.getvalue()


def as_text(result: Result) -> str:
    """Return the result as plain text: a table for each fragment, with why figures are missing below it."""
    doubts = dict.fromkeys(gate for each in result.doubts.values() for gate in each)
    other = [gate for gate in result.log.gates if gate.ok is False and gate not in doubts]
    told = [*(f"INCONCLUSIVE: {gate}" for gate in doubts), *(f"note: {gate}" for gate in other)]
    lines = fitting([*heading(result.log), *told, *(f"note: {remark}" for remark in result.log.remarks)], _WIDTH)
    for number, fragment in enumerate(result.fragments, 1):
        lines += ["", *_part(number, fragment, result)]
    return "\n".join(lines)


def _part(number: int, fragment: Fragment, result: Result) -> Iterator[str]:
    extent = _extent(fragment)
    unit = "" if any(gate.name == "celsius" and gate.ok is False for gate in result.log.gates) else " degC"
    where = "fragment {} of {}: {begin:.6g} to {end:.6g} s, {samples:d} samples, {coldest:.1f} to {hottest:.1f}{}"
    yield where.format(number, len(result.fragments), unit, **extent)
    heating = next(iter(fragment.axes.values())).heating
    if heating.any():
        yield f"heating in {(heating > 0).sum()} of {heating.size} bins, cooling in {(heating < 0).sum()}"
        yield f"offsets at {result.reference:g} degC; hysteresis is heating minus cooling"
    rows = []
    for axis, found in fragment.axes.items():
        figures = [getattr(found, name) for name in _FIGURES]
        told = ["inconclusive" if result.doubts[axis] else _stated(each) for each in figures]
        rows.append((called(axis), *told))
    yield from aligned(rows, head=("", *_FIGURES.values()))
    notes = dict.fromkeys(why for found in fragment.axes.values() for why in _reasons(found))
    yield from fitting([f"note: {why}" for why in notes], _WIDTH)


def _stated(figure: Figure) -> str:
    return "-" if figure.status is FigureStatus.NOT_OBSERVABLE else stated(figure)


def _reasons(found: Drift) -> list[str]:
    """Return why figures are missing, each reason once."""
    named: dict[str, list[str]] = {}
    for name, said in _FIGURES.items():
        if name in found.reasons:
            named.setdefault(found.reasons[name], []).append(said)
    return [f"no {', '.join(names)}: {reason}" for reason, names in named.items()]
