"""`hil analyse allan`: deviations and noise coefficients of rates at rest."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.cli.options import unit_option
from hil.model.errors import Refused

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from hil.analysis.allan.deviation import Estimator, Taus
    from hil.analysis.sampling import SamplingReport
    from hil.cli.analyses.allan_text import Axis

__all__ = ["allan"]

_LEAST_OF_CLOCK = 10  # samples
_LIKELY_HZ = (1e-3, 1e6)  # rates of logs; beyond them the unit of the timestamps is another more often than not
_TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Choice:
    """Which samples of a log are meant: times are in s after the first sample, columns by number or name."""

    path: Path
    time: str | None
    time_unit: str
    rate: float | None
    columns: tuple[str, ...]
    begin: float
    end: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Samples:
    """The chosen samples: one array per column, and how evenly they were taken."""

    rate: float
    sampling: SamplingReport | None
    rates: dict[str, NDArray[np.float64]]
    remarks: tuple[str, ...]


@click.command("allan")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--time", metavar="COLUMN", help="Column of timestamps, by number or name.")
@click.option(
    "--time-unit", type=click.Choice(list(_TIME_UNITS)), default="s", show_default=True, help="Of the timestamps."
)
@click.option("--rate", type=float, metavar="HZ", help="Samples per second, if the log has no timestamps.")
@click.option("--columns", metavar="A,B,C", help="Columns of rates, by number or name; all but the time by default.")
@unit_option("--unit", required=True, help="Unit of the numbers in the file, such as deg/s or LSB.")
@click.option("--scale", type=float, metavar="FACTOR", help="How many --scaled-unit one --unit is.")
@unit_option("--scaled-unit", help="Unit after scaling, such as deg/s.")
@click.option(
    "--from", "begin", type=float, default=0.0, metavar="S", help="Start this many seconds after the first sample."
)
@click.option("--to", "end", type=float, metavar="S", help="Stop this many seconds after the first sample.")
@click.option(
    "--estimator",
    type=click.Choice(["overlapping", "modified", "hadamard", "total"]),
    default="overlapping",
    show_default=True,
    help="Which deviation the table and the plot show.",
)
@click.option(
    "--taus",
    default="octave",
    show_default=True,
    metavar="TAUS",
    help="Averaging times: octave, dense, or seconds such as 1,10,100.",
)
@click.option("--confidence", type=float, default=0.68, show_default=True, help="Confidence level of the intervals.")
@click.option("--plot", type=click.Path(path_type=Path), metavar="FILE", help="Draw the deviations: .svg or .png.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document and nothing else.")
def allan(  # noqa: PLR0913 - one argument per option
    *,
    file: Path,
    time: str | None,
    time_unit: str,
    rate: float | None,
    columns: str | None,
    unit: str,
    scale: float | None,
    scaled_unit: str | None,
    begin: float,
    end: float | None,
    estimator: Estimator,
    taus: str,
    confidence: float,
    plot: Path | None,
    as_json: bool,
) -> None:
    """Compute Allan deviation and noise coefficients of the rates in FILE, recorded at rest.

    FILE is a text table with or without a header. For every chosen column: a deviation of the Allan
    family with its confidence interval, and white noise (angle random walk), flicker (bias
    instability) and random walk of the rate with their uncertainties, which always come from the
    overlapping Allan deviation. Missing samples are left out of the overlapping one.

    \b
    Examples:
      hil analyse allan docs/data/gyroscope-xsens-rest.txt --time 1 --columns 2,3,4 --unit LSB --to 50
      hil analyse allan rest.csv --rate 100 --columns gx --unit LSB --scale 0.00875 --scaled-unit deg/s
    """  # noqa: D301 - click reads \b
    from hil.analysis.allan.deviation import deviation  # noqa: PLC0415 - start-up stays light
    from hil.analysis.allan.noise import characterise  # noqa: PLC0415 - start-up stays light
    from hil.cli.analyses import allan_text  # noqa: PLC0415 - start-up stays light

    if (scale is None) != (scaled_unit is None):
        raise Refused("--scale and --scaled-unit belong together", "give both, or neither")
    names = tuple(name.strip() for name in columns.split(",")) if columns else ()
    samples = _samples(
        _Choice(path=file, time=time, time_unit=time_unit, rate=rate, columns=names, begin=begin, end=end)
    )
    axes = []
    for name, values in samples.rates.items():
        scaled = values if scale is None else values * scale
        model = characterise(scaled, samples.rate, scaled_unit or unit, confidence=confidence, holes=True)
        curve = model.curve
        if (estimator, taus) != ("overlapping", "octave"):
            curve = deviation(
                scaled, samples.rate, _taus(taus),
                estimator=estimator, unit=curve.unit, confidence=confidence, holes=True,
            )  # fmt: skip
        axes.append(allan_text.Axis(name=name, model=model, curve=curve))
    if plot is not None:
        _draw(plot, axes)
    result = allan_text.Result(file=str(file), sampling=samples.sampling, axes=tuple(axes), remarks=samples.remarks)
    click.echo(allan_text.as_json(result) if as_json else allan_text.as_text(result))


def _samples(choice: _Choice) -> _Samples:
    """Read the log and cut it to the chosen part."""
    import numpy as np  # noqa: PLC0415 - start-up stays light

    from hil.logs.columns import read  # noqa: PLC0415 - start-up stays light

    if (choice.time is None) == (choice.rate is None):
        raise Refused("the sampling rate must come from one place", "give --time COLUMN or --rate HZ, and not both")
    if choice.rate is not None and not 0.0 < choice.rate < float("inf"):
        raise Refused(f"--rate {choice.rate:g} is not possible", "give the samples per second")
    table = read(choice.path, choice.columns, first=choice.time or "")
    timed = int(choice.rate is None)
    if len(table.names) == timed:
        raise Refused(f"{choice.path}: there is no column besides the time", "choose another with --columns")
    if choice.rate is None:
        times = table.values[:, 0] * _TIME_UNITS[choice.time_unit]
    else:
        times = np.arange(len(table.values)) / choice.rate
    part = _part(choice, times - times[0])
    rates = {name: np.ascontiguousarray(table.values[part, place]) for place, name in enumerate(table.names)}
    if choice.rate is None:
        del rates[table.names[0]]
    remarks = (*table.remarks, *_no_numbers(rates))
    if choice.rate is not None:
        return _Samples(rate=choice.rate, sampling=None, rates=rates, remarks=(*remarks, *_clocks(rates)))
    samples = _judged(times[part], rates, remarks)
    if _LIKELY_HZ[0] <= samples.rate <= _LIKELY_HZ[1]:
        return samples
    told = f"{samples.rate:.3g} Hz is an unlikely rate; are the timestamps in {choice.time_unit}? see --time-unit"
    return replace(samples, remarks=(*samples.remarks, told))


def _no_numbers(rates: dict[str, NDArray[np.float64]]) -> list[str]:
    counts = {name: int((values != values).sum()) for name, values in rates.items()}  # noqa: PLR0124 - NaN alone differs
    return [f"column {name}: {count} samples are NaN and count as missing" for name, count in counts.items() if count]


def _clocks(rates: dict[str, NDArray[np.float64]]) -> list[str]:
    """Return a remark for every column that only ever rises: no noise does that, a time or a counter does."""
    return [
        f"column {name} rises with every sample, as a time does: give it to --time, or leave it out with --columns"
        for name, values in rates.items()
        if len(values) >= _LEAST_OF_CLOCK and (values[1:] > values[:-1]).all()
    ]


def _part(choice: _Choice, since: NDArray[np.float64]) -> NDArray[np.bool_]:
    end = float("inf") if choice.end is None else choice.end
    part = (since >= choice.begin) & (since <= end)
    if not part.any():
        asked = f"--from {choice.begin:g}" + ("" if choice.end is None else f" --to {choice.end:g}")
        raise Refused(f"{choice.path}: no sample lies within {asked}", f"the log lasts {since[-1]:g} s")
    return part


def _taus(text: str) -> Taus:
    names: dict[str, Taus] = {"octave": "octave", "dense": "dense"}
    if text in names:
        return names[text]
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise Refused(f"--taus {text} names no averaging times", "give octave, dense, or seconds as 1,10") from None


def _judged(times: NDArray[np.float64], rates: dict[str, NDArray[np.float64]], remarks: tuple[str, ...]) -> _Samples:
    """Take the sampling from the timestamps; put the samples on a grid where some are missing."""
    from hil.analysis.sampling import assess, with_holes  # noqa: PLC0415 - start-up stays light

    sampling = assess(times)
    if sampling.duplicates or sampling.reversals:
        told = "timestamps repeat or run backwards; samples are taken as evenly spaced, so trust only short times"
        remarks = (*remarks, told)
    elif sampling.gaps:
        rates = {name: with_holes(times, values, sampling.rate) for name, values in rates.items()}
        told = f"{sampling.missing} samples are missing; averages that miss more than 5 % of their samples are left out"
        remarks = (*remarks, told)
    return _Samples(rate=sampling.rate, sampling=sampling, rates=rates, remarks=remarks)


def _draw(plot: Path, axes: list[Axis]) -> None:
    from hil.cli.analyses.plots import draw_allan  # noqa: PLC0415 - matplotlib is slow to import

    draw_allan(plot, axes)
