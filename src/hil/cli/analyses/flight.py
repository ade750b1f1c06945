"""`hil analyse flight`: find and judge the phases of a log of gyroscope and magnetometer."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.cli.analyses.log import Log, obtain_beside
from hil.cli.analyses.wanted import Wanted, log_options
from hil.cli.options import ABOVE_ZERO, JSON, plot_option, unit_option
from hil.model.errors import HilError, Refused

if TYPE_CHECKING:
    import numpy as np

__all__ = ["flight"]

_STILL = 1.0  # deg/s: a bias of a small gyroscope drifts by less, and nothing turns slower for long


@click.command("flight", short_help="Find rest and rotation in a flight log.")
@partial(log_options, columns="Columns of the rates of x, y and z, by number or name.")
@click.option("--field", metavar="A,B,C", help="Columns of the magnetometer, by number or name.")
@unit_option("--field-unit", help="Unit of the magnetometer's numbers, such as uT or LSB.")
@click.option(
    "--field-full-scale",
    type=ABOVE_ZERO,
    metavar="VALUE",
    help="Full-scale reading of the magnetometer, of either sign.",
)
@click.option(
    "--still", type=ABOVE_ZERO, metavar="RATE", help="How far rates may be off the bias at rest; 1 deg/s by default."
)
@click.option(
    "--window", type=ABOVE_ZERO, default=2.0, show_default=True, metavar="S", help="Length of the analysis window."
)
@click.option(
    "--shortest", type=ABOVE_ZERO, default=10.0, show_default=True, metavar="S", help="Shortest phase that is reported."
)
@plot_option("rates and field with the phases")
@JSON
def flight(  # noqa: PLR0913 - one argument per option
    *,
    wanted: Wanted,
    field: str | None,
    field_unit: str | None,
    field_full_scale: float | None,
    still: float | None,
    window: float,
    shortest: float,
    plot: Path | None,
    as_json: bool,
) -> int:
    """Find when a gyroscope and a magnetometer were at rest and when they turned, from the log in FILE.

    --columns names the rates of x, y and z, --field the magnetometer, which may have another sampling rate: a row
    without a new reading of a sensor holds an empty cell, nan, or the last reading. A phase at rest yields bias and
    white noise, and must pass all gates for a log at rest; a rotation shows whether rates and field turn through the
    same angle. A gate that trips is named with its phase, and the exit code is 1.

    \b
    Example:
      hil analyse flight docs/data/flight-simulated.csv --time t --columns gx,gy,gz --unit deg/s \\
        --field mx,my,mz --field-unit uT
    """  # noqa: D301 - click reads \b
    from hil.analysis.flight import flight_phases  # noqa: PLC0415 - start-up stays light
    from hil.cli.analyses import flight_text  # noqa: PLC0415 - start-up stays light

    logs = obtain_beside(
        _sensors(wanted, field, field_unit, field_full_scale), "windows that miss more than half", at_rest=False,
        own_pace=True,
    )  # fmt: skip
    rates, vectors = logs[0], logs[1] if field else None
    limit, radians = _rates(rates.unit, still)
    found = flight_phases(
        _table(rates), rates.rate, rates.unit,
        still=limit, radians=radians, field=None if vectors is None else _beside(vectors, rates),
        field_unit=logs[-1].unit, field_rate=logs[-1].rate, microtesla=_microtesla(logs[-1].unit),
        window=window, shortest=shortest, facts=wanted.facts(),
        field_facts=replace(wanted.facts(), lsb=None, noise_density=None, bandwidth=None, full_scale=field_full_scale),
    )  # fmt: skip
    if plot is not None:
        from hil.cli.analyses.flight_plot import draw  # noqa: PLC0415 - matplotlib is slow to import

        draw(plot, rates, vectors, found)
    logs[0] = replace(logs[0], remarks=(*logs[0].remarks, *wanted.remarks))
    result = flight_text.Result(logs=tuple(logs), flight=found, wanted=wanted)
    click.echo(flight_text.as_json(result) if as_json else flight_text.as_text(result))
    return int(bool(result.doubts))


def _sensors(wanted: Wanted, field: str | None, unit: str | None, full_scale: float | None) -> list[Wanted]:
    for option, columns in (("--columns", wanted.columns), ("--field", field)):
        if columns is not None and columns.count(",") != 2:
            raise Refused(f"{option} names {columns.count(',') + 1} columns", "name those of x, y and z")
    if wanted.columns is None:
        reason = "rest is detected from the rates" if field is None else "a constant field allows rotation about itself"
        hint = "name the columns of the rates of x, y and z"
        alone = "; hil analyse magnetometer calibrates from the field alone"
        raise Refused(f"--columns is missing: {reason}", hint if field is None else f"{hint}{alone}")
    if (field is None) != (unit is None):
        raise Refused("--field and --field-unit belong together", "give both, or neither")
    if field is None or unit is None:
        return [wanted]
    bare = replace(wanted, lsb=None, bandwidth=None, noise_density=None, scale=None, scaled_unit=None)
    return [wanted, replace(bare, columns=field, unit=unit, full_scale=full_scale)]


def _rates(unit: str, still: float | None) -> tuple[float, float]:
    """Return the slowest turn in the unit of the rates, and how many rad/s that unit is; NaN for counts."""
    from hil.requirements.units import convert  # noqa: PLC0415 - slow to import

    try:
        return still or convert(_STILL, "deg/s", unit), convert(1.0, unit, "rad/s")
    except HilError:
        if still is None:
            raise Refused(
                f"{unit} is not a unit of rate, so 1 deg/s does not convert to it",
                "give --scale and --scaled-unit deg/s, or --still in this unit",
            ) from None
        return still, math.nan


def _microtesla(unit: str) -> float:
    from hil.requirements.units import convert  # noqa: PLC0415 - slow to import

    try:
        return convert(1.0, unit, "uT")
    except HilError:
        return math.nan


def _beside(log: Log, other: Log) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Return samples at the times of another log, NaN where there is none; of several in one interval the last."""
    import numpy as np  # noqa: PLC0415 - start-up stays light

    table, size = _table(log), next(iter(other.channels.values())).size
    if log.rate == other.rate and log.begin == other.begin and len(table) == size:
        return table
    later = round((log.begin - other.begin) * other.rate)
    places = later + np.rint(np.arange(len(table)) * (other.rate / log.rate)).astype(np.int64)
    inside = (places >= 0) & (places < size) & np.isfinite(table).any(axis=1)
    grid = np.full((size, table.shape[1]), np.nan)
    grid[places[inside]] = table[inside]
    return grid


def _table(log: Log) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    import numpy as np  # noqa: PLC0415 - start-up stays light

    return np.stack(list(log.channels.values()), axis=1)
