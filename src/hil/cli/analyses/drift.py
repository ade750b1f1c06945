"""`hil analyse drift`: drift over temperature, offset and hysteresis of axes beside a thermometer."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.cli.analyses.exports import write_exports
from hil.cli.analyses.gyroscope_temperature import in_celsius
from hil.cli.analyses.log import obtain_beside
from hil.cli.analyses.wanted import Wanted, log_options
from hil.cli.options import ABOVE_ZERO, FINITE, JSON, plot_option
from hil.model.errors import Refused

if TYPE_CHECKING:
    from hil.analysis.gates import Gate
    from hil.cli.analyses.drift_text import Fragment
    from hil.cli.analyses.log import Log

__all__ = ["drift"]

_HARMLESS = frozenset({"aliased", "alike", "density", "steady"})  # of gates on noise: a drift is none


@click.command("drift", short_help="Compute drift over temperature and hysteresis.")
@partial(log_options, columns="Columns of the axes, by number or name.")
@click.option("--temperature", required=True, metavar="COLUMN", help="Column of temperatures in degC.")
@click.option(
    "--reference",
    type=FINITE,
    default=25.0,
    show_default=True,
    metavar="DEGC",
    help="Temperature at which offsets are stated.",
)
@click.option(
    "--least-range",
    type=ABOVE_ZERO,
    default=5.0,
    show_default=True,
    metavar="K",
    help="Smallest temperature range over which a fragment gets figures per kelvin.",
)
@click.option(
    "--longest-gap",
    type=ABOVE_ZERO,
    metavar="S",
    help="A longer gap ends a fragment; five sampling periods by default.",
)
@plot_option("values over temperature, heating and cooling separately")
@click.option(
    "--export", type=click.Path(path_type=Path), metavar="FILE", help="Write every fragment's figures as a CSV table."
)
@JSON
def drift(
    *,
    wanted: Wanted,
    temperature: str,
    reference: float,
    least_range: float,
    longest_gap: float | None,
    plot: Path | None,
    export: Path | None,
    as_json: bool,
) -> int:
    """Compute temperature drift, offset and hysteresis of the axes in FILE, recorded while the sensor warms or cools.

    FILE is a text table with a column of temperatures; name the axes with --columns. Gaps split the log into
    fragments. Each fragment yields for every axis the slope over temperature of heating and cooling together, the
    offset on that line, heating minus cooling at the same temperature, and the drift over time, each with an
    uncertainty that includes slow noise; or the reason why it cannot. Gates check times and samples first: if one
    trips, the figures of its axis are inconclusive, nothing is exported, and the exit code is 1.

    \b
    Example:
      hil analyse drift docs/data/gyroscope-heat-lamp-simulated.csv --time t --temperature temperature \\
        --columns x,y,z --unit deg/s
    """  # noqa: D301 - click reads \b
    from hil.cli.analyses import drift_text  # noqa: PLC0415 - start-up stays light

    if not wanted.columns:
        raise Refused("--columns names no axis", "name their columns, as in --columns gx,gy,gz")
    if temperature in (name.strip() for name in wanted.columns.split(",")):
        raise Refused("--temperature is one of --columns", "leave it out there")
    beside = Wanted(
        file=wanted.file, time=wanted.time, time_unit=wanted.time_unit, rate=wanted.rate, columns=temperature,
        unit="degC", begin=wanted.begin, end=wanted.end,
    )  # fmt: skip
    log, warmth = obtain_beside([wanted, beside], "")
    log, doubts = _asked(replace(log, remarks=(*log.remarks, *wanted.remarks)), warmth)
    found = _fragments(log, warmth, reference, least_range, longest_gap)
    result = drift_text.Result(log=log, doubts=doubts, reference=reference, fragments=found)
    if not result.doubted:
        write_exports((export, drift_text.as_table(result)))
    if plot is not None:
        from hil.cli.analyses.plots import draw_drift  # noqa: PLC0415 - matplotlib is slow to import

        draw_drift(plot, log.unit, [fragment.axes for fragment in found])
    click.echo(drift_text.as_json(result) if as_json else drift_text.as_text(result))
    return int(result.doubted)


def _asked(log: Log, warmth: Log) -> tuple[Log, dict[str, tuple[Gate, ...]]]:
    """Return the log with the gates on its temperature, and by axis the gates that trip for it."""
    ((title, temperatures),) = warmth.channels.items()
    warm = in_celsius(title, temperatures, series=True)
    told = [remark for remark in (*log.remarks, *warmth.remarks) if "white noise" not in remark]
    log = replace(log, gates=(*log.gates, warm), remarks=(*dict.fromkeys(told),), coped=log.coped | _HARMLESS)
    against = (warm,) if warm.ok is False else ()
    return log, {name: (*log.doubts(name), *against) for name in log.channels}


def _fragments(
    log: Log, warmth: Log, reference: float, least_range: float, longest_gap: float | None
) -> tuple[Fragment, ...]:
    """Return the contiguous fragments of the log, with the drift of every axis."""
    import numpy as np  # noqa: PLC0415 - start-up stays light

    from hil.analysis import drift_of, fragments  # noqa: PLC0415 - start-up stays light
    from hil.cli.analyses.drift_text import Fragment  # noqa: PLC0415 - as above

    (temperatures,) = warmth.channels.values()
    whole = np.flatnonzero(np.isfinite([temperatures, *log.channels.values()]).all(axis=0))
    if not whole.size:
        raise Refused(f"{log.file}: no row has a number in every column", "choose other columns")
    time, warm = whole / log.rate, temperatures[whole]
    rate = log.rate if whole.size < 2 else 1.0 / float(np.median(np.diff(time)))
    found = []
    for part in fragments(time, rate, longest_gap=longest_gap):
        axes = {
            name: drift_of(
                time[part], warm[part], values[whole][part], log.unit, reference=reference, least_range=least_range
            )
            for name, values in log.channels.items()
        }
        found.append(Fragment(time=time[part], temperature=warm[part], axes=axes))
    return tuple(found)
