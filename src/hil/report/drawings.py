"""Which drawings a run gets: a chart per checked parameter, and the channels of each recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from hil.report.figures import Band, Point, draw_points, draw_traces, finite
from hil.report.material import Body, Material, Trace, inner, inners, text, verdict
from hil.report.numbers import number
from hil.report.sentences import counted
from hil.report.view import Graphic

__all__ = ["charts", "recording_graphics"]

_MOST_POINTS = 2000  # of one channel
_FEWEST_POINTS = 200
_ALL_POINTS = 36_000  # of all channels of a page, so that it can still be mailed
_MOST_ROWS = 40  # of one chart


def charts(checks: Sequence[Body]) -> tuple[Graphic, ...]:
    """Return a chart for each parameter that has a limit or was checked more than once, in order of appearance."""
    groups: dict[tuple[str, str, str], list[Body]] = {}
    for check in checks:
        if finite(check.get("value")) is not None and not isinstance(check.get("value"), str):
            key = (text(check, "requirement"), text(check, "parameter"), text(check, "unit"))
            groups.setdefault(key, []).append(check)
    return tuple(
        graphic
        for (requirement, parameter, unit), members in groups.items()
        if check_bounds(members[0]) or len(members) > 1
        for graphic in _chart(f"{requirement} {parameter}", unit, members)
    )


def recording_graphics(
    material: Material, recordings: Sequence[Body], checks: Sequence[Body]
) -> Mapping[str, tuple[Graphic, ...]]:
    """Return the drawings of each recording by its id.

    Args:
        material: where the samples are.
        recordings: the events with which recordings began.
        checks: every check of the run; a limit is drawn behind channels that have its unit and its `of` or case.
    """
    channels = sum(len(inners(recording, "channels")) for recording in recordings)
    points = max(_FEWEST_POINTS, min(_MOST_POINTS, _ALL_POINTS // max(channels, 1)))
    return {text(recording, "recording"): _recording(material, recording, checks, points) for recording in recordings}


def check_bounds(check: Body) -> Band | None:
    """Return the limit of a check as a band in the unit of its value, or None where it has no such limit."""
    low, high = (finite(inner(check, "limit").get(side)) for side in ("min", "max"))
    if (low is None and high is None) or text(check, "limit_unit") not in {"", text(check, "unit")}:
        return None
    return Band(unit=text(check, "unit"), low=low, high=high)


def _chart(title: str, unit: str, members: Sequence[Body]) -> list[Graphic]:
    several = len({text(check, "case") for check in members}) > 1
    points = [_point(check, several=several) for check in members]
    band = check_bounds(members[0]) or Band(unit=unit, low=None, high=None)
    parts = [points[first : first + _MOST_ROWS] for first in range(0, len(points), _MOST_ROWS)]
    return [
        Graphic(
            title=title,
            described=_told(title, unit, len(part), limited=check_bounds(members[0]) is not None),
            svg=draw_points(title, part, band),
        )
        for part in parts
    ]


def _told(title: str, unit: str, count: int, *, limited: bool) -> str:
    limits = "; dashed lines are its limits, the shade is what they allow" if limited else ""
    return f"{counted(count, 'check')} of {title} in {unit or '1'}, with expanded uncertainty{limits}"


def _point(check: Body, *, several: bool) -> Point:
    same = text(check, "limit_unit") in {"", text(check, "unit")}
    labels = (text(check, "of"), _short(text(check, "case")) if several else "")
    return Point(
        label=" · ".join(label for label in labels if label) or text(check, "parameter"),
        value=finite(check.get("value")) or 0.0,
        expanded=finite(check.get("expanded")) if same else None,
        verdict=verdict(check),
    )


def _short(case: str) -> str:
    return case.rsplit("::", 1)[-1]


def _recording(material: Material, recording: Body, checks: Sequence[Body], points: int) -> tuple[Graphic, ...]:
    name = text(recording, "recording")
    traces = [trace for trace in material.traces(name) if len(trace.times)]
    if not traces:
        return ()
    title = f"{_short(text(recording, 'case'))} · {text(recording, 'name') or name}"
    units = list(dict.fromkeys(trace.unit for trace in traces))
    described = "; ".join(_range(trace) for trace in traces)
    svg = draw_traces(title, traces, _bands(recording, checks, units), points)
    return (Graphic(title=title, described=described, svg=svg),)


def _bands(recording: Body, checks: Sequence[Body], units: Sequence[str]) -> list[Band]:
    """Return the distinct limits of this case's checks that stand in a unit of the recording."""
    case = recording.get("case")
    found = (check_bounds(check) for check in checks if check.get("case") == case)
    return list(dict.fromkeys(band for band in found if band is not None and band.unit in units))


def _range(trace: Trace) -> str:
    import numpy as np  # noqa: PLC0415 - slow to import

    known = trace.values[np.isfinite(trace.values)]
    if not len(known):
        return f"{trace.name}: no finite sample"
    return f"{trace.name} from {number(float(known.min()), 4)} to {number(float(known.max()), 4)} {trace.unit}".strip()
