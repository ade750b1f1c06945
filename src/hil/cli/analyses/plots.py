"""The plots of the analyses; the same numbers give the same bytes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.dates import ConciseDateFormatter, date2num
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatter, MaxNLocator

from hil.analysis.battery.half_cycle import flow
from hil.analysis.battery.integration import cumulative
from hil.analysis.battery.series import SECONDS_PER_HOUR, Series
from hil.analysis.battery.steps import Segmentation, StepKind, segment
from hil.analysis.battery.summary import Summary, incremental_capacities
from hil.analysis.drift import Drift
from hil.audit.trend import Point, Trend
from hil.cli.analyses import psd_text
from hil.cli.analyses.allan_text import NAMES, Axis, called
from hil.cli.written import whole
from hil.clock.wall import moment_of
from hil.model.errors import Refused

__all__ = ["COLOURS", "MARKS", "draw_allan", "draw_battery", "draw_drift", "draw_psd", "draw_trend", "save"]

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Colours that are safe for colour-blind readers (Okabe and Ito)."""

MARKS = ("o", "s", "^", "D", "v", "P")
"""Marks in the same order."""

_MODELLED = ("overlapping", "total")  # the fitted Allan deviation is also what the total one expects
_KINDS = (StepKind.CHARGE, StepKind.DISCHARGE)
_MOST = 20  # curves of one kind; more are thinned out
_POINTS = 2000  # of one curve
_SHORT, _READABLE = 10.0, 1e4  # of an axis' ends, and easily read numbers
_PANELS = 12  # of a trend, one below the other


def draw_allan(path: Path, axes: Sequence[Axis]) -> None:
    """Draw the Allan deviations of some axes of one unit.

    Args:
        path: what to write; its suffix, .svg or .png, sets the format.
        axes: what to draw, all with one estimator.

    Raises:
        Refused: another suffix, nothing to draw, or a file that cannot be written.
    """
    drawn = [axis for axis in axes if axis.curve.deviation.any()]
    if not drawn:
        raise Refused(f"{path}: there is no deviation above zero to draw", "check the columns' remarks")
    save(path, lambda: _allan(drawn))


def draw_battery(path: Path, data: Series, summary: Summary, how: Segmentation) -> None:
    """Draw voltage over time and charge, dQ/dV, and capacities, energies with their fade, and efficiencies over cycles.

    Args:
        path: what to write; its suffix, .svg or .png, sets the format.
        data: the samples.
        summary: what they show.
        how: how steps are segmented.

    Raises:
        Refused: another suffix, or a file that cannot be written.
    """
    save(path, lambda: _battery(data, summary, how))


def draw_drift(path: Path, unit: str, fragments: Sequence[Mapping[str, Drift]]) -> None:
    """Draw the axes over temperature, a panel each: heating filled, cooling hollow, and the lines of their slopes.

    Args:
        path: what to write; its suffix, .svg or .png, sets the format.
        unit: of the axes.
        fragments: by axis, all with the same ones.

    Raises:
        Refused: another suffix, nothing to draw, or a file that cannot be written.
    """
    if not any(each.time.size for axes in fragments for each in axes.values()):
        raise Refused(f"{path}: no fragment is long enough to draw", "see what the command says of each")
    save(path, lambda: _drift(unit, fragments))


def draw_psd(path: Path, axes: Sequence[psd_text.Axis]) -> None:
    """Draw the spectra of some axes of one unit: bands with intervals, the fitted model, and lines.

    Args:
        path: what to write; its suffix, .svg or .png, sets the format.
        axes: what to draw.

    Raises:
        Refused: another suffix, nothing to draw, or a file that cannot be written.
    """
    drawn = [axis for axis in axes if axis.noise.bands.density.any()]
    if not drawn:
        raise Refused(f"{path}: there is no density above zero to draw", "check the columns' remarks")
    save(path, lambda: _psd(drawn))


def draw_trend(path: Path, parameter: str, found: Sequence[Trend]) -> None:
    """Draw what checks of a parameter found over the days of their runs, a panel for each series.

    Args:
        path: what to write; its suffix, .svg or .png, sets the format.
        parameter: the parameter.
        found: its series.

    Raises:
        Refused: no number to draw, too many panels, another suffix, or a file that cannot be written.
    """
    drawn = [each for each in found if any(_is_placed(point) for point in each.points)]
    if not drawn:
        raise Refused(f"{path}: '{parameter}' has no number to draw", "leave out --plot")
    if len(drawn) > _PANELS:
        raise Refused(
            f"{path}: {len(drawn)} panels do not fit on a page",
            "choose with --requirement, --of or --dut, or take --csv",
        )
    save(path, lambda: _trend(parameter, drawn))


def _is_placed(point: Point) -> bool:
    return isinstance(point.value, float) and bool(point.run.began)


def _trend(parameter: str, drawn: Sequence[Trend]) -> Figure:
    figure = Figure(figsize=(7.0, 0.6 + 2.6 * len(drawn)), dpi=120, layout="constrained")
    units = sorted({point.run.dut for each in drawn for point in each.points})
    panels = np.atleast_1d(figure.subplots(len(drawn), 1, sharex=True))
    for axes, each in zip(panels.tolist(), drawn, strict=True):
        _series(axes, each, units)
        axes.set_ylabel(parameter if each.unit in {"", "1"} else f"{parameter} [{each.unit}]")
        called_of = f" of {each.of}" if each.of else ""
        axes.set_title(f"{each.requirement}{called_of}, {each.case.rpartition('::')[2]}", fontsize="small", loc="left")
        axes.grid(visible=True, color="#dddddd", linewidth=0.5)
    moments = {moment_of(point.run.began) for each in drawn for point in each.points if _is_placed(point)}
    if len(moments) == 1:  # an axis of one moment would be years long
        only = date2num(moments.pop())
        axes.set_xlim(only - 0.5, only + 0.5)
    axes.xaxis.set_major_formatter(ConciseDateFormatter(axes.xaxis.get_major_locator()))
    axes.set_xlabel("beginning of the run, UTC")
    return figure


def _series(axes: Axes, found: Trend, units: Sequence[str]) -> None:
    """Draw values with their expanded uncertainties, hollow where it was not hardware, and limits as they were."""
    placed = [point for point in found.points if _is_placed(point)]
    groups = dict.fromkeys((point.run.dut, point.run.source) for point in placed)
    for dut, source in groups:
        own = [point for point in placed if (point.run.dut, point.run.source) == (dut, source)]
        number = units.index(dut)
        hardware = source == "hardware"
        axes.errorbar(
            np.array([moment_of(point.run.began) for point in own]),
            np.array([point.value for point in own], dtype=float),
            yerr=[point.expanded or 0.0 for point in own],
            fmt=MARKS[number % len(MARKS)],
            color=COLOURS[number % len(COLOURS)],
            markerfacecolor=COLOURS[number % len(COLOURS)] if hardware else "none",
            markersize=5,
            capsize=2,
            label=dut if hardware else f"{dut}, {source.upper()}",
        )
    when = np.array([moment_of(point.run.began) for point in placed])
    label: str | None = "limit"
    for name in ("min", "max"):
        ends = [float("nan") if (end := getattr(point.limit, name)) is None else float(end) for point in placed]
        if np.isfinite(ends).any():
            axes.plot(when, ends, "k_--", linewidth=1, drawstyle="steps-post", label=label)
            label = None
    axes.legend(fontsize="small")


def _allan(drawn: Sequence[Axis]) -> Figure:
    figure = Figure(figsize=(7.0, 5.0), dpi=120, layout="constrained")
    axes = figure.add_subplot()
    for place, axis in enumerate(drawn):
        curve, colour = axis.curve, COLOURS[place % len(COLOURS)]
        seen = curve.deviation > 0.0
        tau, deviation = curve.tau[seen], curve.deviation[seen]
        # With very few degrees of freedom and little confidence an interval may lie beside its estimate.
        reach = [(deviation - curve.low[seen]).clip(0.0), (curve.high[seen] - deviation).clip(0.0)]
        mark = MARKS[place % len(MARKS)]
        axes.errorbar(
            tau, deviation, yerr=reach, fmt=mark, color=colour, markersize=4, capsize=2, label=called(axis.name)
        )
        if axis.model.fitted.size and curve.estimator in _MODELLED:
            fitted = axis.model.in_fit
            for part, line in ((fitted, "-"), (~fitted | (np.cumsum(fitted) == 1), ":")):
                axes.plot(axis.model.curve.tau[part], axis.model.fitted[part], line, color=colour, linewidth=1)
    curve = drawn[0].curve
    lines = ", lines: fitted noise, dotted where not fitted" if curve.estimator in _MODELLED else ""
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("averaging time [s]")
    axes.set_ylabel(f"{NAMES[curve.estimator]} deviation [{curve.unit}]")
    axes.set_title(f"bars: {curve.confidence:.4g} confidence{lines}", fontsize="small", loc="right")
    axes.grid(visible=True, which="both", color="#dddddd", linewidth=0.5)
    _plain(axes)
    axes.legend()
    return figure


def _plain(axes: Axes) -> None:
    """Label a short logarithmic axis with plain numbers: 20, 30 instead of 2 x 10^1, 3 x 10^1."""
    low, high = axes.get_ylim()
    if high < _SHORT * low and low > 1.0 / _READABLE and high < _READABLE:
        axes.yaxis.set_major_formatter(LogFormatter())
        axes.yaxis.set_minor_formatter(LogFormatter())


def _psd(drawn: Sequence[psd_text.Axis]) -> Figure:
    figure = Figure(figsize=(7.0, 5.0), dpi=120, layout="constrained")
    axes = figure.add_subplot()
    for place, axis in enumerate(drawn):
        bands, whole, colour = axis.noise.bands, axis.noise.spectrum, COLOURS[place % len(COLOURS)]
        few = slice(1, -1, max(whole.density.size // (5 * _POINTS), 1))
        axes.plot(whole.frequency[few], whole.density[few], color=colour, linewidth=0.4, alpha=0.4)
        axes.fill_between(bands.frequency, bands.low, bands.high, color=colour, alpha=0.3, linewidth=0)
        mark = MARKS[place % len(MARKS)]
        axes.plot(bands.frequency, bands.density, mark, color=colour, markersize=3, label=called(axis.name))
        axes.plot(bands.frequency, bands.fitted, color=colour, linewidth=1)
        for line in axis.noise.lines:
            top = int(np.argmax(whole.density[line.first : line.last + 1])) + line.first
            axes.plot(whole.frequency[top], whole.density[top], "x", color=colour, markersize=6)
    whole = drawn[0].noise.spectrum
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel(f"one-sided power spectral density [{psd_text.squared(whole.unit)}]")
    axes.set_title(
        f"marks: bands, {whole.confidence:.4g} confidence shaded; lines: fitted noise; x: spectral lines",
        fontsize="small", loc="right",
    )  # fmt: skip
    axes.grid(visible=True, which="both", color="#dddddd", linewidth=0.5)
    _plain(axes)
    axes.legend()
    return figure


def _battery(data: Series, summary: Summary, how: Segmentation) -> Figure:
    figure = Figure(figsize=(9.0, 10.0), dpi=120, layout="constrained")
    parts: list[tuple[str, str, Callable[[Axes], None]]] = [
        ("time [h]", "voltage [V]", lambda axes: _over_time(axes, data)),
        ("charge of the step [Ah]", "voltage [V]", lambda axes: _over_charge(axes, data, how)),
        ("voltage [V]", "dQ/dV [Ah/V]", lambda axes: _density(axes, data, how)),
        ("cycle", "capacity [Ah]", lambda axes: _over_cycles(axes, summary, "charge", "discharge_capacity")),
        ("cycle", "energy [Wh]", lambda axes: _over_cycles(axes, summary, "energy", "discharge_energy")),
    ]
    if any(each.complete for each in summary.compared):
        parts.append(("cycle", "efficiency", lambda axes: _efficiencies(axes, summary)))
    for place, (across, up, fill) in enumerate(parts):
        axes = figure.add_subplot(3, 2, place + 1)
        fill(axes)
        axes.set_xlabel(across)
        axes.set_ylabel(up)
        if across == "cycle":
            axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
        axes.grid(visible=True, color="#dddddd", linewidth=0.5)
    return figure


def _over_time(axes: Axes, data: Series) -> None:
    few = slice(None, None, max(data.time.size // (5 * _POINTS), 1))
    axes.plot(data.time[few] / SECONDS_PER_HOUR, data.voltage[few], color=COLOURS[0], linewidth=0.8)


def _over_charge(axes: Axes, data: Series, how: Segmentation) -> None:
    steps = segment(data, how)
    flows = flow(data, steps, how)
    for number, kind in enumerate(_KINDS):
        charge = cumulative(flows.charge[kind])
        own = [step for step in steps if step.kind is kind]
        for step in own[:: max(len(own) // _MOST, 1)]:
            part = slice(step.first, step.last + 1, max((step.last - step.first) // _POINTS, 1))
            passed = charge[part] - charge[step.first]
            axes.plot(passed, data.voltage[part], color=COLOURS[number], linewidth=0.8)


def _density(axes: Axes, data: Series, how: Segmentation) -> None:
    for number, kind in enumerate(_KINDS):
        curves = incremental_capacities(data, kind, how)
        for curve in curves[:: max(len(curves) // _MOST, 1)]:
            axes.plot(curve.voltage, curve.drawn(kind), color=COLOURS[number], linewidth=0.8)


def _over_cycles(axes: Axes, summary: Summary, quantity: str, fading: str) -> None:
    """Draw a quantity of both halves of each cycle, hollow where it is in no fade, and the line of its fade."""
    compared = {each.number for each in summary.compared}
    for number, kind in enumerate(_KINDS):
        halves = [(each.number, getattr(each, kind.value)) for each in summary.cycles]
        rows = [(place, getattr(half, quantity)) for place, half in halves if half is not None]
        for own, fill in ((True, COLOURS[number]), (False, "none")):
            drawn = np.array([row for row in rows if (row[0] in compared) is own]).reshape(-1, 2)
            label = kind.value if own else f"{kind.value}, incomplete"
            if drawn.size:
                axes.plot(
                    *drawn.T, MARKS[number], color=COLOURS[number], markerfacecolor=fill, markersize=4, label=label
                )
    line = summary.fades.get(fading)
    if line is not None:
        faded = [each.number for each in summary.compared[summary.skip :]]
        ends = np.array([faded[0], faded[-1]])
        values = line.beginning.value + line.slope.value * (ends - ends[0])
        axes.plot(ends, values, color="black", linewidth=1, label=f"{line.slope.value:.3g} {line.slope.unit}")
    if summary.cycles:
        axes.legend(fontsize="small")


def _efficiencies(axes: Axes, summary: Summary) -> None:
    for number, name in enumerate(("coulombic", "energy")):
        rows = [(each.number, getattr(each, f"{name}_efficiency")) for each in summary.compared]
        drawn = np.array([row for row in rows if np.isfinite(row[1])]).reshape(-1, 2)
        if drawn.size:
            axes.plot(*drawn.T, MARKS[number], color=COLOURS[number], markersize=4, label=name)
            axes.legend(fontsize="small")


def _drift(unit: str, fragments: Sequence[Mapping[str, Drift]]) -> Figure:
    figure = Figure(figsize=(7.0, 0.6 + 2.6 * len(fragments[0])), dpi=120, layout="constrained")
    panels = np.atleast_1d(figure.subplots(len(fragments[0]), 1, sharex=True))
    for axes, name in zip(panels.tolist(), fragments[0], strict=True):
        for place, each in enumerate(found[name] for found in fragments):
            mark, colour = MARKS[place % len(MARKS)], COLOURS[place % len(COLOURS)]
            for chosen, fill in ((each.heating > 0, colour), (each.heating <= 0, "none")):
                across, up = each.temperature[chosen], each.value[chosen]
                axes.plot(across, up, mark, color=colour, markerfacecolor=fill, markersize=4)
            if "slope" not in each.reasons:
                ends = np.array([each.temperature.min(), each.temperature.max()])
                axes.plot(ends, each.line(ends), color=colour, linewidth=1)
        axes.set_ylabel(f"{called(name)} [{unit}]")
        axes.grid(visible=True, color="#dddddd", linewidth=0.5)
    panels[0].set_title("filled: heating; hollow: cooling or steady; lines: drift", fontsize="small", loc="right")
    panels[-1].set_xlabel("temperature [degC]")
    return figure


def save(path: Path, make: Callable[[], Figure]) -> None:
    """Write a figure without dates and random names.

    Args:
        path: what to write; its suffix, .svg or .png, sets the format.
        make: makes the figure, under the settings that it is written with.

    Raises:
        Refused: another suffix, or a file that cannot be written.
    """
    form = path.suffix.lower().lstrip(".")
    if form not in {"svg", "png"}:
        raise Refused(f"{path}: a plot is written as .svg or .png", "choose one of these endings")
    with mpl.rc_context({"svg.hashsalt": "hil", "svg.fonttype": "path", "path.simplify": False}):
        figure = make()
        canvas = FigureCanvasSVG(figure) if form == "svg" else FigureCanvasAgg(figure)
        try:
            with whole(path) as stream:
                if isinstance(canvas, FigureCanvasSVG):
                    canvas.print_svg(stream, metadata={"Date": None})
                else:
                    canvas.print_png(stream, metadata={"Software": None})
        except OSError as error:
            raise Refused(f"{path}: {error.strerror}", "choose a place that can be written") from None
