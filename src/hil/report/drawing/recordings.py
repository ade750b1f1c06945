"""Recordings as drawings: their channels over time, a panel per unit, with limits behind them where they count."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

from hil.evidence.events import Capture, Fed, Recording
from hil.report.drawing.checks import short
from hil.report.drawing.panel import (
    WIDTH,
    Band,
    Graphic,
    Panel,
    Scale,
    Sheet,
    draw_limits,
    finite,
    legend_height,
    plain,
    polyline,
    spread,
    width_of,
)
from hil.report.material import Body, Material, Trace, decimate, text
from hil.report.numbers import number, quantity, span

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["draw_traces", "recording_graphics"]

_MOST_POINTS = 2000  # of one channel
_FEWEST_POINTS = 200
_ALL_POINTS = 36_000  # of all channels of a page, so that it can still be mailed
_MOST_DRAWINGS = 40  # of recordings, for the same reason
_ABOVE, _BELOW, _BETWEEN, _HEIGHT = 60, 380, 180, 1_050
_MANY, _LOW = 3, 620  # from this number on, panels are lower
_NAME = 24
_MARK = 160  # the length of the mark at the trigger's level
_KINDS = 4  # of colours, and of dashes: together they distinguish sixteen channels
_TIMES = ((7200.0, 3600.0, "h"), (300.0, 60.0, "min"))
_SHORT = ((2.0, 1.0, "s"), (2e-3, 1e-3, "ms"), (2e-6, 1e-6, "µs"))


def recording_graphics(
    material: Material,
    recordings: Sequence[Recording],
    envelope: Sequence[Body],
    fed: Sequence[Fed] = (),
    end: float = 0.0,
) -> Mapping[str, tuple[Graphic, ...]]:
    """Return by case the drawings of its recordings; those with the same channels share one over bench time.

    A capture has one of its own, over the time after its trigger, and no limits behind it. Readings of the envelope
    are drawn limit by limit over the whole run, where the limit counted; those of a limit that a recording fed end
    where it took over, and are not drawn, because the recording is. Limits of checks speak of single figures, and
    stand beside them.

    Args:
        material: where the samples are.
        recordings: the events with which recordings began; those of no case are the envelope's.
        envelope: the limits of the bench file, which stand behind what they are judged on.
        fed: the events that say which of them a recording fed.
        end: bench time at which the run ended, in s.
    """
    limits = {text(limit, "id"): limit for limit in envelope}
    taken_over = {event.limit for event in fed}
    groups: dict[tuple[str, object], list[Recording]] = {}
    for recording in recordings:
        if not recording.case and (recording.name not in limits or recording.name in taken_over):
            continue
        channels = tuple((channel.name, channel.unit) for channel in recording.channels)
        own = recording.recording if recording.capture or not recording.case else ""
        groups.setdefault((recording.case or "", (channels, own)), []).append(recording)
    drawn = list(groups.items())[:_MOST_DRAWINGS]
    share = _ALL_POINTS // max(sum(len(members[0].channels) for _, members in drawn), 1)
    points = max(_FEWEST_POINTS, min(_MOST_POINTS, share))
    currents = _currents(material, recordings) if any(text(limit, "while") for limit in envelope) else {}
    graphics: dict[str, tuple[Graphic, ...]] = {}
    for (case, _), members in drawn:
        found = [] if members[0].capture else _bands(members, limits, fed, currents)
        span = (0.0, end) if not case and end > 0 else None
        graphics[case] = graphics.get(case, ()) + _drawn(material, members, found, points, span)
    return graphics


def draw_traces(
    title: str,
    traces: Sequence[Trace],
    bands: Sequence[Band],
    capture: Capture | None = None,
    span: tuple[float, float] | None = None,
) -> str:
    """Return the channels over time as SVG, one panel per unit, with the limit bands of that unit behind them.

    Args:
        title: the text alternative.
        traces: the channels.
        bands: the limits.
        capture: what makes it a capture; its trigger is marked, and times count from there.
        span: start and end of the axis; without it, those of the traces.
    """
    panels = [[trace for trace in traces if trace.unit == unit] for unit in dict.fromkeys(t.unit for t in traces)]
    begin, end = span or spread([time for trace in traces for time in _ends(trace)], 0.01)
    sizes, least = (_SHORT, (1e-9, "ns")) if capture else (_TIMES, (1.0, "s"))
    scale, word = next(((size, name) for long, size, name in sizes if end - begin > long), least)
    time = "time after the trigger" if capture else "bench time"
    ranges = [_extent(own, _behind(own, bands)) for own in panels]
    left = 330 + max(width_of(label) for low, high in ranges for _, label in _ticks(low, high))
    across = Scale(low=begin / scale, high=end / scale, first=left, last=WIDTH - 100)
    sheet, top = Sheet(), _ABOVE
    for own, (low, high) in zip(panels, ranges, strict=True):
        names = [plain(trace.name, _NAME) for trace in own] if len(own) > 1 else []
        top += legend_height(names, across.last - across.first)
        bottom = top + (_HEIGHT if len(panels) < _MANY else _LOW)
        panel = Panel(x=across, y=Scale(low=low, high=high, first=bottom, last=top))
        scaled = [replace(band, windows=_scaled(band.windows, scale)) for band in _behind(own, bands)]
        draw_limits(sheet, panel, scaled)
        panel.across(sheet, 7, labelled=own is panels[-1], title=across.titled(f"{time} / {word}"))
        panel.upward(sheet, _ticks(low, high), grid=True)
        unit = panel.y.titled("" if own[0].unit == "1" else own[0].unit)
        panel.named(sheet, " / ".join(part for part in (own[0].name if len(own) == 1 else "", unit) if part))
        if capture:
            _trigger(sheet, panel, capture, [trace.name for trace in own])
        panel.legend(sheet, [(f"line {_kind(place)}", name) for place, name in enumerate(names)])
        for place, trace in enumerate(own):
            sheet.path(f"line {_kind(place)}", _path(panel, trace, scale))
        top = bottom + _BETWEEN
    return sheet.svg(title, top - _BETWEEN + _BELOW)


def _kind(place: int) -> str:
    return f"c{place % _KINDS} d{(place + place // _KINDS) % _KINDS}"


def _scaled(windows: Iterable[tuple[float, float]], scale: float) -> tuple[tuple[float, float], ...]:
    return tuple((begin / scale, end / scale) for begin, end in windows)


def _behind(own: Sequence[Trace], bands: Sequence[Band]) -> list[Band]:
    """Return the limits that stand behind the channels of a panel."""
    names = {trace.name for trace in own}
    return [band for band in bands if band.unit == own[0].unit and (not band.channel or band.channel in names)]


def _trigger(sheet: Sheet, panel: Panel, capture: Capture, names: Sequence[str]) -> None:
    """Mark the time zero, and on the channel that triggered its level."""
    if panel.x.low <= 0 <= panel.x.high:
        place = panel.x.at(0.0)
        sheet.line("axis", (place, panel.y.first), (place, panel.y.last))
    if capture.channel in names and panel.y.low <= capture.level <= panel.y.high:
        level = panel.y.at(capture.level)
        sheet.line("axis", (panel.x.first, level), (panel.x.first + _MARK, level))


def _drawn(
    material: Material,
    recordings: Sequence[Recording],
    bands: Sequence[Band],
    points: int,
    span: tuple[float, float] | None,
) -> tuple[Graphic, ...]:
    parts = [material.traces(recording.recording) for recording in recordings]
    parts = [[trace for trace in traces if len(trace.times)] for traces in parts]
    parts = [traces for traces in parts if traces]
    if not parts:
        return ()
    first = recordings[0]
    counting = bands[0].windows if not first.case and bands else ()
    if counting:  # unjudged readings would hide those that a limit was applied to
        parts = [[_within(trace, counting) for trace in traces] for traces in parts]
    names = ", ".join(dict.fromkeys(recording.name for recording in recordings))
    title = names + (f" ({len(parts)} recordings)" if len(parts) > 1 else "")
    each = max(points // len(parts), 4)
    joined = [_joined([traces[place] for traces in parts], each) for place in range(len(parts[0]))]
    moving = [trace for trace in joined if not _is_level(trace)]
    described = "; ".join(_told([traces[place] for traces in parts]) for place in range(len(parts[0])))
    if counting:
        described += "; shown where the limit counts"
    if first.capture:
        unit = next((t.unit for t in joined if t.name == first.capture.channel), "")
        level = quantity(first.capture.level, unit, 4)
        described += f"; triggered by {first.capture.channel}, {first.capture.slope} through {level}"
    told = " · ".join(part for part in (short(first.case or ""), title) if part)
    svg = draw_traces(told, moving or joined, bands, first.capture, span)
    return (Graphic(title=title, described=f"{described}.", svg=svg),)


def _within(trace: Trace, windows: Sequence[tuple[float, float]]) -> Trace:
    """Return a channel with holes outside all windows."""
    import numpy as np  # noqa: PLC0415 - slow to import

    edges = np.array(windows)
    inside = np.searchsorted(edges[:, 0], trace.times, "right") > np.searchsorted(edges[:, 1], trace.times, "left")
    return replace(trace, values=np.where(inside, trace.values, np.nan))


def _joined(pieces: Sequence[Trace], points: int) -> Trace:
    """Return one channel of several recordings as one, with a hole between two of them."""
    import numpy as np  # noqa: PLC0415 - slow to import

    few = [decimate(piece.times, piece.values, points) for piece in pieces]
    hole = np.array([np.nan])
    times = np.concatenate([part for when, _ in few for part in (when, when[-1:])][:-1])
    values = np.concatenate([part for _, what in few for part in (what, hole)][:-1])
    return Trace(name=pieces[0].name, unit=pieces[0].unit, times=times, values=values)


def _bands(
    recordings: Sequence[Recording],
    limits: Mapping[str, Body],
    fed: Sequence[Fed],
    currents: Mapping[str | None, Trace],
) -> list[Band]:
    """Return the limits that hold for what these recordings hold: their own, or those that they fed.

    What is derived from rows, such as a slope, a charge since the last change, or a difference, is another quantity.
    """
    own = {recording.recording for recording in recordings}
    channels = {channel.name: channel for recording in recordings for channel in recording.channels}
    if recordings[0].case:
        meant = dict.fromkeys(event.limit for event in fed if event.recording in own)
        found = [
            limit for name in meant for limit in [limits.get(name, {})]
            if not any(text(limit, key) for key in ("of", "against", "since"))
        ]  # fmt: skip
    else:
        found = [limits[recordings[0].name]]
    bands = []
    for limit in found:
        quantity = text(limit, "quantity") if recordings[0].case else next(iter(channels))
        channel = channels.get(quantity)
        if channel is None or channel.unit != text(limit, "unit"):
            continue
        flow = text(limit, "while")
        windows = _windows(currents.get(channel.instrument), flow, finite(text(limit, "threshold")) or 0.0)
        if windows or not flow:
            low, high = finite(limit.get("min")), finite(limit.get("max"))
            bands.append(Band(unit=channel.unit, low=low, high=high, channel=quantity, windows=windows))
    return list(dict.fromkeys(bands))


def _currents(material: Material, recordings: Sequence[Recording]) -> dict[str | None, Trace]:
    """Return by instrument the current of the recording that lasted longest: it tells when a limit counts."""
    found: dict[str | None, Trace] = {}
    for recording in recordings:
        channel = next((each for each in recording.channels if each.name == "current" and each.unit == "A"), None)
        if channel is None:
            continue
        trace = next((each for each in material.traces(recording.recording) if each.name == "current"), None)
        if trace is not None and len(trace.times) > len(getattr(found.get(channel.instrument), "times", ())):
            found[channel.instrument] = trace
    return found


def _windows(current: Trace | None, flow: str, threshold: float) -> tuple[tuple[float, float], ...]:
    """Return the intervals in which such a current flowed, in s."""
    import numpy as np  # noqa: PLC0415 - slow to import

    if current is None or not flow:
        return ()
    signed = {"discharging": -current.values, "flowing": np.abs(current.values)}.get(flow, current.values)
    flows = np.concatenate(([False], np.nan_to_num(signed) > threshold, [False])).astype(int)
    edges = np.diff(flows)
    begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    return tuple((float(current.times[a]), float(current.times[b])) for a, b in zip(begins, ends, strict=True) if b > a)


def _is_level(trace: Trace) -> bool:
    """Return whether a channel is constant: then its number says it all."""
    known = trace.values[_drawable(trace.values)]
    return len(known) == 0 or number(float(known.min()), 4) == number(float(known.max()), 4)


def _told(pieces: Sequence[Trace]) -> str:
    import numpy as np  # noqa: PLC0415 - slow to import

    name, unit = pieces[0].name, pieces[0].unit
    known = np.concatenate([piece.values[np.isfinite(piece.values)] for piece in pieces])
    if not len(known):
        return f"{name}: no finite sample"
    low, high = float(known.min()), float(known.max())
    told = span(low, high, unit, 4)
    return f"{name} from {told}" if " to " in told else f"{name} {told} throughout"


def _ends(trace: Trace) -> list[float]:
    ends = [float(trace.times[0]), float(trace.times[-1])] if len(trace.times) else []
    return [end for end in ends if finite(end) is not None]


def _extent(traces: Sequence[Trace], bands: Sequence[Band]) -> tuple[float, float]:
    """Return the ends of the vertical axis, which holds every value and every limit."""
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


def _path(panel: Panel, trace: Trace, scale: float) -> str:
    """Return the steps of a channel's line, interrupted where a number is missing."""
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
    """Return the places of a line without those inside a level stretch."""
    import numpy as np  # noqa: PLC0415 - slow to import

    kept = np.ones(len(x), dtype=bool)
    kept[1:-1] = (y[1:-1] != y[:-2]) | (y[1:-1] != y[2:])
    return list(zip(x[kept].tolist(), y[kept].tolist(), strict=True))
