"""The plot of a battery test: voltage over charge, dQ/dV, capacity and temperature over cycles."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hil.analysis.battery.half_cycle import flow
from hil.analysis.battery.integration import cumulative
from hil.analysis.battery.series import SECONDS_PER_HOUR, Series
from hil.analysis.battery.steps import Segmentation, StepKind, segment
from hil.analysis.battery.summary import Summary, incremental_capacities
from hil.cli.analyses.drawing import COLOURS, MARKS, save

__all__ = ["draw"]

_KINDS = (StepKind.CHARGE, StepKind.DISCHARGE)
_MOST = 20  # curves of one kind; more are thinned out
_POINTS = 2000  # of one curve


def draw(path: Path, data: Series, summary: Summary, how: Segmentation) -> None:
    """Draw voltage over time, voltage over charge, dQ/dV, and capacities over cycles.

    Args:
        path: what to write; its ending, .svg or .png, says the format.
        data: the samples.
        summary: what they show.
        how: how steps are told apart.

    Raises:
        Refused: another ending, or a file that cannot be written.
    """
    save(path, lambda: _figure(data, summary, how))


def _figure(data: Series, summary: Summary, how: Segmentation) -> Figure:
    figure = Figure(figsize=(9.0, 7.0), dpi=120, layout="constrained")
    parts: list[tuple[str, str, Callable[[Axes], None]]] = [
        ("time [h]", "voltage [V]", lambda axes: _over_time(axes, data)),
        ("charge of the step [Ah]", "voltage [V]", lambda axes: _over_charge(axes, data, how)),
        ("voltage [V]", "dQ/dV [Ah/V]", lambda axes: _density(axes, data, how)),
        ("cycle", "capacity [Ah]", lambda axes: _over_cycles(axes, summary)),
    ]
    for place, (across, up, fill) in enumerate(parts):
        axes = figure.add_subplot(2, 2, place + 1)
        fill(axes)
        axes.set_xlabel(across)
        axes.set_ylabel(up)
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
            sign = 1.0 if kind is StepKind.CHARGE else -1.0
            axes.plot(curve.voltage, sign * curve.density, color=COLOURS[number], linewidth=0.8)


def _over_cycles(axes: Axes, summary: Summary) -> None:
    for number, kind in enumerate(_KINDS):
        halves = [(each.number, getattr(each, kind.value)) for each in summary.cycles]
        rows = np.array([(place, half.charge) for place, half in halves if half is not None]).reshape(-1, 2)
        if rows.size:
            axes.plot(rows[:, 0], rows[:, 1], MARKS[number], color=COLOURS[number], markersize=4, label=kind.value)
    if summary.cycles:
        axes.legend()
