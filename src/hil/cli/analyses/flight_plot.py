"""The plot of `hil analyse flight`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hil.analysis.flight import Flight
from hil.analysis.motion import AXES, Kind
from hil.cli.analyses.log import Log
from hil.cli.analyses.plots import COLOURS, save

__all__ = ["draw"]

_SHADES = {Kind.REST: "#d9ead3", Kind.ROTATION: "#fce5cd", Kind.UNSTEADY: "#eeeeee", Kind.MISSING: "#f4cccc"}
_POINTS = 20_000  # of a line: more than a page can show


def draw(path: Path, rates: Log, field: Log | None, found: Flight) -> None:
    """Draw rates and field over time, over the shades of the phases; phases for which a gate trips are hatched.

    Args:
        path: what to write; its suffix, .svg or .png, sets the format.
        rates, field: the samples, on an even grid.
        found: the phases.

    Raises:
        Refused: another suffix, or a file that cannot be written.
    """
    save(path, lambda: _drawn([("rate", rates), *([] if field is None else [("field", field)])], found))


def _drawn(parts: list[tuple[str, Log]], found: Flight) -> Figure:
    figure = Figure(figsize=(9.0, 3.2 * len(parts)), dpi=120, layout="constrained")
    panels = np.atleast_1d(figure.subplots(len(parts), 1, sharex=True)).tolist()
    for axes, (what, log) in zip(panels, parts, strict=True):
        _shaded(axes, found, labelled=axes is panels[0])
        times = log.begin - parts[0][1].begin + np.arange(next(iter(log.channels.values())).size) / log.rate
        for number, (axis, values) in enumerate(zip(AXES, log.channels.values(), strict=True)):
            few = slice(None, None, max(values.size // _POINTS, 1))
            axes.plot(times[few], values[few], color=COLOURS[number], linewidth=0.6, label=axis)
        axes.set_ylabel(f"{what} [{log.unit}]")
        axes.set_xlim(0.0, found.phases[-1].end)
        axes.grid(visible=True, color="#dddddd", linewidth=0.5)
        axes.legend(fontsize="small", ncols=7, loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False)
    panels[-1].set_xlabel("time [s]")
    return figure


def _shaded(axes: Axes, found: Flight, *, labelled: bool) -> None:
    named: set[Kind] = set()
    for phase in found.phases:
        doubted = any(gate.ok is False for gate in phase.gates)
        label = phase.kind.value if labelled and phase.kind not in named else None
        named.add(phase.kind)
        axes.axvspan(
            phase.begin, phase.end, facecolor=_SHADES[phase.kind], edgecolor="#b00020" if doubted else "white",
            hatch="//" if doubted else None, linewidth=0.5, label=label, zorder=0,
        )  # fmt: skip
