"""`hil analyse allan`: deviations and noise coefficients of rates at rest."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.cli.analyses.log import obtain
from hil.cli.analyses.wanted import Wanted, log_options
from hil.cli.options import CONFIDENCE, JSON, plot_option
from hil.model.errors import Refused

if TYPE_CHECKING:
    from hil.analysis.allan.deviation import Estimator, Taus
    from hil.cli.analyses.allan_text import Axis

__all__ = ["allan"]


@click.command("allan", short_help="Compute Allan deviation and noise coefficients.")
@log_options
@click.option(
    "--estimator",
    type=click.Choice(["overlapping", "nonoverlapping", "modified", "time", "hadamard", "total"]),
    default="overlapping",
    show_default=True,
    help="Deviation shown in table and plot.",
)
@click.option(
    "--taus",
    default="octave",
    show_default=True,
    metavar="TAUS",
    help="Averaging times: octave, dense, or seconds such as 1,10,100.",
)
@click.option("--tau-min", type=float, default=0.0, metavar="S", help="Shortest averaging time in the fit.")
@click.option("--tau-max", type=float, default=math.inf, metavar="S", help="Longest averaging time in the fit.")
@click.option(
    "--method",
    type=click.Choice(["fit", "nearest-slope"]),
    default="fit",
    show_default=True,
    help="How coefficients are found; nearest-slope adds the legacy read-out, for comparison with old tables.",
)
@CONFIDENCE
@plot_option("the deviations")
@JSON
def allan(  # noqa: PLR0913 - one argument per option
    *,
    wanted: Wanted,
    estimator: Estimator,
    taus: str,
    tau_min: float,
    tau_max: float,
    method: str,
    confidence: float,
    plot: Path | None,
    as_json: bool,
) -> int:
    """Compute Allan deviation and noise coefficients of the rates in FILE, recorded at rest.

    FILE is a text table with or without a header. Each chosen column gets a deviation of the Allan family with its
    confidence interval, and the coefficients with their uncertainties: quantisation, angle random walk (white noise),
    bias instability (flicker), rate random walk and rate ramp. Coefficients always come from the overlapping Allan
    deviation, which leaves missing samples out. Gates check times and samples first: if one trips, the figures of its
    column are inconclusive, and the exit code is 1.

    \b
    Examples:
      hil analyse allan docs/data/gyroscope-xsens-rest.txt --time 1 --columns 2,3,4 --unit LSB --to 50
      hil analyse allan rest.csv --rate 100 --columns gx --unit LSB --scale 0.00875 --scaled-unit deg/s
    """  # noqa: D301 - click reads \b
    from concurrent.futures import ThreadPoolExecutor  # noqa: PLC0415 - start-up stays light

    from hil.analysis.allan.deviation import deviation  # noqa: PLC0415 - start-up stays light
    from hil.analysis.allan.noise import characterise  # noqa: PLC0415 - start-up stays light
    from hil.analysis.allan.slopes import nearest_slopes  # noqa: PLC0415 - start-up stays light
    from hil.cli.analyses import allan_text  # noqa: PLC0415 - start-up stays light

    if not 0.0 <= tau_min < tau_max:
        raise Refused(
            f"--tau-min {tau_min:g} and --tau-max {tau_max:g} leave no averaging time",
            "give the shorter one as --tau-min, in s",
        )
    log = obtain(wanted)

    def axis(name: str) -> Axis:
        values = log.channels[name]
        model = characterise(
            values, log.rate, log.unit,
            confidence=confidence, tau_min=tau_min, tau_max=tau_max, bandwidth=wanted.bandwidth, holes=True,
        )  # fmt: skip
        curve = model.curve
        if (estimator, taus) != ("overlapping", "octave"):
            curve = deviation(
                values, log.rate, _taus(taus),
                estimator=estimator, unit=curve.unit, confidence=confidence, holes=True,
            )  # fmt: skip
        legacy = nearest_slopes(model.curve) if method == "nearest-slope" else {}
        return allan_text.Axis(name=name, model=model, curve=curve, legacy=legacy, doubts=log.doubts(name))

    with ThreadPoolExecutor(max_workers=os.cpu_count()) as threads:  # NumPy's loops run beside each other
        axes = list(threads.map(axis, log.channels))
    if plot is not None:
        _draw(plot, axes)
    result = allan_text.Result(log=log, axes=tuple(axes))
    click.echo(allan_text.as_json(result) if as_json else allan_text.as_text(result))
    return int(any(axis.doubts for axis in axes))


def _taus(text: str) -> Taus:
    names: dict[str, Taus] = {"octave": "octave", "dense": "dense"}
    if text in names:
        return names[text]
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise Refused(f"--taus {text} names no averaging times", "give octave, dense, or seconds as 1,10") from None


def _draw(plot: Path, axes: list[Axis]) -> None:
    from hil.cli.analyses.plots import draw_allan  # noqa: PLC0415 - matplotlib is slow to import

    draw_allan(plot, axes)
