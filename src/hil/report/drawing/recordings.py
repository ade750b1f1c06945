"""Recordings as drawings: their channels over time, a panel per unit, with the limits of that unit behind them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

from hil.evidence.events import Capture, Fed, Recording
from hil.report.drawing.checks import short
from hil.report.drawing.panel import (
    TITLE,
    WIDTH,
    Band,
    Graphic,
    Panel,
    Scale,
    Sheet,
    draw_limits,
    finite,
    plain,
    polyline,
    spread,
    width_of,
)
from hil.report.material import Body, Material, Trace, decimate, text
from hil.report.numbers import number, with_unit

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["draw_traces", "recording_graphics"]

_MOST_POINTS = 2000  # of one channel
_FEWEST_POINTS = 200
_ALL_POINTS = 36_000  # of all channels of a page, so that it can still be mailed
_MOST_DRAWINGS = 40  # of recordings, for the same reason
_ABOVE, _BELOW, _BETWEEN, _HEIGHT = 260, 380, 180, 1_200
_ENTRY = 150  # the height of one name beside a panel
_NAME = 24
_MARK = 160  # the length of the mark at the trigger's level
_KINDS = 4  # of colours, and of dashes: together they tell sixteen channels apart
_TIMES = ((7200.0, 3600.0, "h"), (300.0, 60.0, "min"))
_SHORT = ((2.0, 1.0, "s"), (2e-3, 1e-3, "ms"), (2e-6, 1e-6, "µs"))


def recording_graphics(
    material: Material,
    recordings: Sequence[Recording],
    judged: Mapping[str, Sequence[Band]],
    envelope: Sequence[Body],
    fed: Sequence[Fed] = (),
) -> Mapping[str, tuple[Graphic, ...]]:
    """Return by case the drawings of its recordings; those with the same channels share one over bench time.

    A capture has one of its own, over the time after its trigger, and no limits behind it: those of checks speak of
    figures made of it, not of every sample.

    Args:
        material: where the samples are.
        recordings: the events with which recordings began; those of no case are the envelope's.
        judged: by case the limits of its checks; each stands behind the channels of the case that have its unit.
        envelope: the limits of the bench file, which stand behind the channels of the same name.
        fed: the events that tell which of them a recording fed; these stand behind its channels, and not those of
            checks, which speak of single moments of it.
    """
    groups: dict[tuple[str, object], list[Recording]] = {}
    for recording in recordings:
        channels = tuple((channel.name, channel.unit) for channel in recording.channels)
        own = recording.recording if recording.capture else ""
        groups.setdefault((recording.case or "", (channels, own)), []).append(recording)
    drawn = list(groups.items())[:_MOST_DRAWINGS]
    share = _ALL_POINTS // max(sum(len(members[0].channels) for _, members in drawn), 1)
    points = max(_FEWEST_POINTS, min(_MOST_POINTS, share))
    graphics: dict[str, tuple[Graphic, ...]] = {}
    for (case, _), members in drawn:
        found = [] if members[0].capture else _bands(case, members, judged.get(case, ()), envelope, fed)
        graphics[case] = graphics.get(case, ()) + _drawn(material, members, found, points)
    return graphics


def draw_traces(title: str, traces: Sequence[Trace], bands: Sequence[Band], capture: Capture | None = None) -> str:
    """Return the channels over time as SVG, one panel per unit, with the limit bands of that unit behind them.

    Args:
        title: what stands above.
        traces: the channels.
        bands: the limits.
        capture: what makes it a capture; its trigger is marked, and times count from there.
    """
    panels = [[trace for trace in traces if trace.unit == unit] for unit in dict.fromkeys(t.unit for t in traces)]
    begin, end = spread([time for trace in traces for time in _ends(trace)], 0.01)
    sizes, least = (_SHORT, (1e-9, "ns")) if capture else (_TIMES, (1.0, "s"))
    scale, word = next(((size, name) for long, size, name in sizes if end - begin > long), least)
    time = "time after the trigger" if capture else "bench time"
    ranges = [_extent(own, [band for band in bands if band.unit == own[0].unit]) for own in panels]
    named = [width_of(plain(trace.name, _NAME)) + 520 for own in panels if len(own) > 1 for trace in own]
    right = WIDTH - max(named, default=120)
    left = 340 + max(width_of(label) for low, high in ranges for _, label in _ticks(low, high))
    across = Scale(low=begin / scale, high=end / scale, first=left, last=right)
    sheet, top = Sheet(), _ABOVE
    sheet.text("title", (left, TITLE), plain(title))
    for own, (low, high) in zip(panels, ranges, strict=True):
        bottom = top + max(_HEIGHT, _ENTRY * len(own))
        panel = Panel(x=across, y=Scale(low=low, high=high, first=bottom, last=top))
        draw_limits(sheet, panel, [band for band in bands if band.unit == own[0].unit], upright=False)
        panel.across(sheet, 9, labelled=own is panels[-1], title=across.titled(f"{time} / {word}"))
        panel.upward(sheet, _ticks(low, high), grid=True)
        unit = panel.y.titled(own[0].unit) or "1"
        panel.named(sheet, f"{own[0].name} / {unit}" if len(own) == 1 else unit)
        if capture:
            _trigger(sheet, panel, capture, [trace.name for trace in own])
        _lines(sheet, panel, own, scale)
        top = bottom + _BETWEEN
    return sheet.svg(title, top - _BETWEEN + _BELOW)


def _trigger(sheet: Sheet, panel: Panel, capture: Capture, names: Sequence[str]) -> None:
    """Mark the time zero, and on the channel that triggered its level."""
    if panel.x.low <= 0 <= panel.x.high:
        place = panel.x.at(0.0)
        sheet.line("axis", (place, panel.y.first), (place, panel.y.last))
    if capture.channel in names and panel.y.low <= capture.level <= panel.y.high:
        level = panel.y.at(capture.level)
        sheet.line("axis", (panel.x.first, level), (panel.x.first + _MARK, level))


def _drawn(
    material: Material, recordings: Sequence[Recording], bands: Sequence[Band], points: int
) -> tuple[Graphic, ...]:
    parts = [material.traces(recording.recording) for recording in recordings]
    parts = [[trace for trace in traces if len(trace.times)] for traces in parts]
    parts = [traces for traces in parts if traces]
    if not parts:
        return ()
    names = ", ".join(dict.fromkeys(recording.name for recording in recordings))
    count = f" ({len(parts)} recordings)" if len(parts) > 1 else ""
    title = " · ".join(part for part in (short(recordings[0].case or ""), names + count) if part)
    each = max(points // len(parts), 4)
    joined = [_joined([traces[place] for traces in parts], each) for place in range(len(parts[0]))]
    described = "; ".join(_told([traces[place] for traces in parts]) for place in range(len(parts[0])))
    capture = recordings[0].capture
    if capture:
        level = with_unit(number(capture.level, 4), next((t.unit for t in joined if t.name == capture.channel), ""))
        described += f"; triggered by {capture.channel}, {capture.slope} through {level}"
    return (Graphic(title=title, described=described, svg=draw_traces(title, joined, bands, capture)),)


def _joined(pieces: Sequence[Trace], points: int) -> Trace:
    """Return one channel of several recordings as one, with a hole between two of them."""
    import numpy as np  # noqa: PLC0415 - slow to import

    few = [decimate(piece.times, piece.values, points) for piece in pieces]
    hole = np.array([np.nan])
    times = np.concatenate([part for when, _ in few for part in (when, when[-1:])][:-1])
    values = np.concatenate([part for _, what in few for part in (what, hole)][:-1])
    return Trace(name=pieces[0].name, unit=pieces[0].unit, times=times, values=values)


def _bands(
    case: str, recordings: Sequence[Recording], judged: Sequence[Band], envelope: Sequence[Body], fed: Sequence[Fed]
) -> list[Band]:
    """Return the distinct limits that hold for these recordings' channels, by unit; a plain number has no kind."""
    units = {channel.unit for recording in recordings for channel in recording.channels} - {"1"}
    names = {recording.name for recording in recordings}
    own = {recording.recording for recording in recordings}
    meant = {event.limit for event in fed if event.recording in own}
    watched = [
        Band(unit=text(limit, "unit"), low=finite(limit.get("min")), high=finite(limit.get("max")))
        for limit in envelope
        if text(limit, "id") in (meant if case else names)
    ]
    known = {band.unit for band in watched}
    rest = [band for band in judged if band.unit not in known]
    return list(dict.fromkeys(band for band in [*watched, *rest] if band.unit in units))


def _told(pieces: Sequence[Trace]) -> str:
    import numpy as np  # noqa: PLC0415 - slow to import

    name, unit = pieces[0].name, pieces[0].unit
    known = np.concatenate([piece.values[np.isfinite(piece.values)] for piece in pieces])
    if not len(known):
        return f"{name}: no finite sample"
    low, high = float(known.min()), float(known.max())
    if number(low, 4) == number(high, 4):
        return f"{name} {with_unit(number(low, 4), unit)} throughout"
    return f"{name} from {number(low, 4)} to {with_unit(number(high, 4), unit)}"


def _ends(trace: Trace) -> list[float]:
    ends = [float(trace.times[0]), float(trace.times[-1])] if len(trace.times) else []
    return [end for end in ends if finite(end) is not None]


def _extent(traces: Sequence[Trace], bands: Sequence[Band]) -> tuple[float, float]:
    """Return the ends of the upward axis: every value is within, and every limit too."""
    edges = [edge for band in bands for edge in band.edges]
    extremes = [
        float(end) for trace in traces for known in (_drawable(trace.values),) if known.any()
        for end in (trace.values[known].min(), trace.values[known].max())
    ]  # fmt: skip
    return spread([*edges, *extremes], 0.06)


def _drawable(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    import numpy as np  # noqa: PLC0415 - slow to import

    return np.isfinite(values) & (np.abs(values) < 1e300)


def _ticks(low: float, high: float) -> list[tuple[float, str]]:
    return Scale(low=low, high=high, first=0, last=1).ticks(6)


def _lines(sheet: Sheet, panel: Panel, traces: Sequence[Trace], scale: float) -> None:
    for place, trace in enumerate(traces):
        kind = f"line c{place % _KINDS} d{(place + place // _KINDS) % _KINDS}"
        sheet.path(kind, _path(panel, trace, scale))
        if len(traces) > 1:
            left, line = panel.x.last + 120, panel.y.last + 60 + _ENTRY * place
            sheet.line(kind, (left, line), (left + 260, line))
            sheet.text("begin", (left + 320, line + 40), plain(trace.name, _NAME))


def _path(panel: Panel, trace: Trace, scale: float) -> str:
    """Return the steps of a channel's line, interrupted where there is no number."""
    import numpy as np  # noqa: PLC0415 - slow to import

    known = _drawable(trace.values) & _drawable(trace.times)
    x, y = (np.zeros(len(known), dtype=np.int64) for _ in range(2))
    for axis, values, places in ((panel.x, trace.times / scale, x), (panel.y, trace.values, y)):
        share = (values[known] - axis.low) / (axis.high - axis.low)
        places[known] = np.rint(axis.first + share * (axis.last - axis.first))
    cuts = np.flatnonzero(np.diff(known)) + 1
    runs = pairwise([0, *cuts.tolist(), len(known)])
    return "".join(polyline(_bends(x[begin:end], y[begin:end])) for begin, end in runs if end > begin and known[begin])


def _bends(x: NDArray[np.int64], y: NDArray[np.int64]) -> list[tuple[int, int]]:
    """Return the places of a line without those that it passes anyway on a level stretch."""
    import numpy as np  # noqa: PLC0415 - slow to import

    kept = np.ones(len(x), dtype=bool)
    kept[1:-1] = (y[1:-1] != y[:-2]) | (y[1:-1] != y[2:])
    return list(zip(x[kept].tolist(), y[kept].tolist(), strict=True))
