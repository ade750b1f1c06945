"""`hil analyse psd`: power spectrum, lines and noise coefficients of rates at rest."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hil.cli.analyses.log import Log, obtain
from hil.cli.analyses.wanted import Wanted, log_options
from hil.cli.options import ABOVE_ZERO, CONFIDENCE, JSON, Within, plot_option
from hil.model.errors import HilError, Refused

if TYPE_CHECKING:
    from hil.cli.analyses.psd_text import Axis

__all__ = ["psd"]


@click.command("psd", short_help="Compute power spectrum, lines and noise.")
@log_options
@click.option("--segment", type=int, metavar="SAMPLES", help="Length of a segment; an eighth of the log by default.")
@click.option(
    "--window",
    type=click.Choice(["hann", "blackmanharris", "flattop", "boxcar"]),
    default="hann",
    show_default=True,
    help="Window of each segment.",
)
@click.option(
    "--overlap",
    type=float,
    default=0.5,
    show_default=True,
    metavar="FRACTION",
    help="Overlap of consecutive segments.",
)
@click.option(
    "--detrend",
    type=click.Choice(["none", "constant", "linear"]),
    default="constant",
    show_default=True,
    help="What is removed from each segment.",
)
@CONFIDENCE
@click.option(
    "--false-alarm",
    type=Within(0.0, 1.0, min_open=True, max_open=True),
    default=0.01,
    show_default=True,
    metavar="PROBABILITY",
    help="Probability of finding a line in a column of noise alone.",
)
@click.option(
    "--rotation",
    type=ABOVE_ZERO,
    metavar="HZ",
    help="Speed of the rate table, in turns per second; lines at its harmonics are labelled.",
)
@click.option(
    "--density",
    type=(float, str),
    metavar="VALUE UNIT",
    help="One-sided white noise from the data sheet, such as 0.007 deg/s/sqrt(Hz).",
)
@click.option("--points", is_flag=True, help="With --json: give every point of the spectrum, not only bands.")
@plot_option("the spectra")
@JSON
def psd(
    *,
    wanted: Wanted,
    false_alarm: float,
    rotation: float | None,
    density: tuple[float, str] | None,
    points: bool,
    plot: Path | None,
    as_json: bool,
    **how: Any,  # noqa: ANN401 - options are of many types
) -> int:
    """Compute power spectrum, lines and noise coefficients of the rates in FILE, recorded at rest.

    FILE is a text table with or without a header. Each chosen column gets the one-sided power spectral density by
    Welch's method, with its interval; lines that noise does not explain; and white noise, flicker, random walk and
    quantisation from bands without these lines, compared with those of the Allan deviation. Gates check times and
    samples first: if one trips, the figures of its column are inconclusive, and the exit code is 1.

    \b
    Examples:
      hil analyse psd docs/data/gyroscope-xsens-rest.txt --time 1 --columns 2,3,4 --unit LSB --to 50
      hil analyse psd rest.csv --rate 100 --unit deg/s --density 0.007 "deg/s/sqrt(Hz)"
    """  # noqa: D301 - click reads \b
    from hil.analysis import Welch, agreement, characterise  # noqa: PLC0415 - start-up stays light
    from hil.analysis import psd as spectral  # noqa: PLC0415 - as above
    from hil.cli.analyses import psd_text  # noqa: PLC0415 - start-up stays light

    if points and not as_json:
        raise Refused("--points changes nothing without --json", "add --json, or leave --points out")
    sheet = _sheet(wanted, density)
    log = obtain(replace(wanted, noise_density=None), parts="segments that miss more than 5 %")
    axes = []
    for name, values in log.channels.items():
        noise = spectral(
            values, log.rate, log.unit, how=Welch(**how), bandwidth=wanted.bandwidth, rotation=rotation,
            false_alarm=false_alarm, holes=True,
        )  # fmt: skip
        allan = characterise(values, log.rate, log.unit, holes=True)
        axis = psd_text.Axis(name=name, noise=noise, agreement=agreement(noise, allan), doubts=log.doubts(name))
        axes.append(axis if sheet is None else _compared(axis, log, sheet))
    if plot is not None:
        from hil.cli.analyses.plots import draw_psd  # noqa: PLC0415 - matplotlib is slow to import

        draw_psd(plot, axes)
    result = psd_text.Result(log=log, axes=tuple(axes))
    click.echo(psd_text.as_json(result, points=points) if as_json else psd_text.as_text(result))
    return int(any(axis.doubts for axis in axes))


def _sheet(wanted: Wanted, density: tuple[float, str] | None) -> float | None:
    """Return the density of the data sheet, one-sided, in the unit of the result per root of a hertz."""
    from hil.requirements.units import convert  # noqa: PLC0415 - slow to import

    if density is None:
        return wanted.noise_density
    if wanted.noise_density is not None:
        raise Refused("--density and --noise-density mean the same", "give --density VALUE UNIT alone")
    unit = f"{wanted.result_unit}/sqrt(Hz)"
    try:
        value = convert(density[0], density[1], unit)
    except HilError as error:
        raise Refused(f"--density: {error.message}", f"give it in {unit}, or in a unit that converts to it") from None
    if not 0.0 < value < math.inf:
        raise Refused(f"--density {density[0]:g} is not possible", "give a number above zero")
    return value


def _compared(axis: Axis, log: Log, sheet: float) -> Axis:
    """Return an axis with its density over that of the data sheet; far from 1 it is suspicious, hence inconclusive."""
    from hil.analysis import Facts, quality  # noqa: PLC0415 - start-up stays light
    from hil.cli.analyses.psd_text import Comparison  # noqa: PLC0415 - start-up stays light
    from hil.model.figure import FigureStatus  # noqa: PLC0415 - as above

    found = axis.noise.density
    value = found.value
    if found.status is not FigureStatus.MEASURED:  # the density near 1 s still shows a wrong unit
        value = quality.density(log.channels[axis.name], log.rate)
    gate = quality.density_agrees(axis.name, value, Facts(noise_density=sheet))
    return replace(
        axis,
        comparison=Comparison(sheet=sheet, ratio=found * (1.0 / sheet), gate=gate),
        doubts=(*axis.doubts, gate) if gate.ok is False else axis.doubts,
    )
