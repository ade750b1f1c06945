"""Which drawings a run gets: a chart per checked parameter, and the channels of each recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from hil.report.drawing.points import Point, draw_points
from hil.report.drawing.scales import Band, finite
from hil.report.drawing.traces import decimate, draw_traces
from hil.report.material import Body, Material, Trace, inner, inners, text, verdict
from hil.report.numbers import number, with_unit
from hil.report.page.view import Graphic
from hil.report.sentences import counted

__all__ = ["charts", "recording_graphics"]

_MOST_POINTS = 2000  # of one channel
_FEWEST_POINTS = 200
_ALL_POINTS = 36_000  # of all channels of a page, so that it can still be mailed
_MOST_DRAWINGS = 40  # of recordings, for the same reason
_MOST_ROWS = 40  # of one chart


def charts(checks: Sequence[Body]) -> tuple[Graphic, ...]:
    """Return a chart for each parameter that has a limit or was checked more than once, in order of appearance.

    What a recording had to be is in the table: its length and rate are as planned, and nothing to look at.
    """
    groups: dict[tuple[str, str, str], list[Body]] = {}
    for check in checks:
        if finite(check.get("value")) is not None and not isinstance(check.get("value"), str):
            key = (text(check, "requirement"), text(check, "parameter"), text(check, "unit"))
            groups.setdefault(key, []).append(check)
    return tuple(
        graphic
        for (requirement, parameter, unit), members in groups.items()
        if (check_bounds(members[0]) or len(members) > 1) and not _of_recordings(members)
        for graphic in _chart(requirement, parameter, unit, members)
    )


def recording_graphics(
    material: Material,
    recordings: Sequence[Body],
    checks: Sequence[Body],
    envelope: Sequence[Body],
    fed: Sequence[Body] = (),
) -> Mapping[str, tuple[Graphic, ...]]:
    """Return by case the drawings of its recordings; those with the same channels share one over bench time.

    Args:
        material: where the samples are.
        recordings: the events with which recordings began; those of no case are the envelope's.
        checks: every check of the run; a limit stands behind the channels of its case that have its unit.
        envelope: the limits of the bench file, which stand behind the channels of the same name.
        fed: the events that tell which of them a recording fed; these stand behind its channels, and not those of
            checks, which speak of single moments of it.
    """
    groups: dict[tuple[str, object], list[Body]] = {}
    for recording in recordings:
        channels = tuple((text(channel, "name"), text(channel, "unit")) for channel in inners(recording, "channels"))
        groups.setdefault((text(recording, "case"), channels), []).append(recording)
    drawn = list(groups.items())[:_MOST_DRAWINGS]
    share = _ALL_POINTS // max(sum(len(inners(members[0], "channels")) for _, members in drawn), 1)
    points = max(_FEWEST_POINTS, min(_MOST_POINTS, share))
    graphics: dict[str, tuple[Graphic, ...]] = {}
    for (case, _), members in drawn:
        found = _bands(case, members, checks, envelope, fed)
        graphics[case] = graphics.get(case, ()) + _drawn(material, members, found, points)
    return graphics


def check_bounds(check: Body) -> Band | None:
    """Return the limit of a check as a band in the unit of its value, or None where it has no such limit."""
    low, high = (finite(inner(check, "limit").get(side)) for side in ("min", "max"))
    if (low is None and high is None) or text(check, "limit_unit") not in {"", text(check, "unit")}:
        return None
    return Band(unit=text(check, "unit"), low=low, high=high)


def _of_recordings(members: Sequence[Body]) -> bool:
    return all(check_bounds(check) and text(check, "verdict") == "RECORDED" for check in members)


def _chart(requirement: str, parameter: str, unit: str, members: Sequence[Body]) -> list[Graphic]:
    title = f"{requirement} {parameter}"
    several = len({text(check, "case") for check in members}) > 1
    points = [_point(check, several=several) for check in members]
    band = check_bounds(members[0]) or Band(unit=unit, low=None, high=None)
    parts = [points[first : first + _MOST_ROWS] for first in range(0, len(points), _MOST_ROWS)]
    return [
        Graphic(
            title=title,
            described=_told(title, part, band),
            svg=draw_points(title, parameter, part, band),
        )
        for part in parts
    ]


def _told(title: str, points: Sequence[Point], band: Band) -> str:
    """Return what a chart shows: how many checks, and what bars, lines and shade mean where there are any."""
    within = "" if band.unit in {"", "1"} else f" in {band.unit}"
    barred = sum(point.expanded is not None for point in points)
    bars = "; bars are expanded uncertainties" if barred else ""
    some = f", known of {barred}" if 0 < barred < len(points) else ""
    limits = "; dashed lines are limits, the shade is what they allow" if band.edges else ""
    return f"{counted(len(points), 'check')} of {title}{within}{bars}{some}{limits}."


def _point(check: Body, *, several: bool) -> Point:
    same = text(check, "limit_unit") in {"", text(check, "unit")}
    labels = (text(check, "of"), _short(text(check, "case")) if several else "")
    return Point(
        label=" · ".join(label for label in labels if label) or text(check, "parameter"),
        value=finite(check.get("value")) or 0.0,
        expanded=(finite(check.get("expanded")) or None) if same else None,  # of zero there is nothing to draw
        verdict=verdict(check),
    )


def _short(case: str) -> str:
    return case.rsplit("::", 1)[-1]


def _drawn(material: Material, recordings: Sequence[Body], bands: Sequence[Band], points: int) -> tuple[Graphic, ...]:
    parts = [material.traces(text(recording, "recording")) for recording in recordings]
    parts = [[trace for trace in traces if len(trace.times)] for traces in parts]
    parts = [traces for traces in parts if traces]
    if not parts:
        return ()
    names = ", ".join(dict.fromkeys(text(recording, "name") for recording in recordings))
    count = f" ({len(parts)} recordings)" if len(parts) > 1 else ""
    title = " · ".join(part for part in (_short(text(recordings[0], "case")), names + count) if part)
    each = max(points // len(parts), 4)
    joined = [_joined([traces[place] for traces in parts], each) for place in range(len(parts[0]))]
    described = "; ".join(_range([traces[place] for traces in parts]) for place in range(len(parts[0])))
    return (Graphic(title=title, described=described, svg=draw_traces(title, joined, bands)),)


def _joined(pieces: Sequence[Trace], points: int) -> Trace:
    """Return one channel of several recordings as one, with a hole between two of them."""
    import numpy as np  # noqa: PLC0415 - slow to import

    few = [decimate(piece.times, piece.values, points) for piece in pieces]
    hole = np.array([np.nan])
    times = np.concatenate([part for when, _ in few for part in (when, when[-1:])][:-1])
    values = np.concatenate([part for _, what in few for part in (what, hole)][:-1])
    return Trace(name=pieces[0].name, unit=pieces[0].unit, times=times, values=values)


def _bands(
    case: str, recordings: Sequence[Body], checks: Sequence[Body], envelope: Sequence[Body], fed: Sequence[Body]
) -> list[Band]:
    """Return the distinct limits that hold for these recordings' channels, by unit; a plain number has no kind."""
    units = {text(channel, "unit") for recording in recordings for channel in inners(recording, "channels")} - {"1"}
    names = {text(recording, "name") for recording in recordings}
    own = {text(recording, "recording") for recording in recordings}
    meant = {text(event, "limit") for event in fed if text(event, "recording") in own}
    watched = [
        Band(unit=text(limit, "unit"), low=finite(limit.get("min")), high=finite(limit.get("max")))
        for limit in envelope
        if text(limit, "id") in (meant if case else names)
    ]
    known = {band.unit for band in watched}
    judged = [check_bounds(check) for check in checks if case and text(check, "case") == case]
    rest = [band for band in judged if band is not None and band.unit not in known]
    return list(dict.fromkeys(band for band in [*watched, *rest] if band.unit in units))


def _range(pieces: Sequence[Trace]) -> str:
    import numpy as np  # noqa: PLC0415 - slow to import

    name, unit = pieces[0].name, pieces[0].unit
    known = np.concatenate([piece.values[np.isfinite(piece.values)] for piece in pieces])
    if not len(known):
        return f"{name}: no finite sample"
    low, high = float(known.min()), float(known.max())
    if number(low, 4) == number(high, 4):
        return f"{name} {with_unit(number(low, 4), unit)} throughout"
    return f"{name} from {number(low, 4)} to {with_unit(number(high, 4), unit)}"
