"""What the user says about a log: which samples of which file, and what is known about the sensor."""

from __future__ import annotations

import functools
import math
import shlex
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from hil.cli.options import unit_option
from hil.model.errors import Refused

if TYPE_CHECKING:
    from hil.analysis.gates import Facts

__all__ = ["Wanted", "log_options", "time_unit_option"]

_Command = TypeVar("_Command", bound=Callable[..., Any])
_FLAGS = {"begin": "from", "end": "to"}
_TIME_UNITS = ("s", "ms", "us", "ns", "min", "h", "d")


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """Which samples of a log are meant, and what is known about the sensor.

    Times are in s after the first sample; columns by number or name; count and full scale in `unit`, the density in
    the unit of the result.
    """

    file: Path
    time: str | None = None
    time_unit: str | None = None
    rate: float | None = None
    columns: str | None = None
    unit: str = "1"
    scale: float | None = None
    scaled_unit: str | None = None
    begin: float = 0.0
    end: float | None = None
    lsb: float | None = None
    full_scale: float | None = None
    bandwidth: float | None = None
    noise_density: float | None = None

    def __post_init__(self) -> None:
        if (self.scale is None) != (self.scaled_unit is None):
            raise Refused("--scale and --scaled-unit belong together", "give both, or neither")
        if (self.time is None) == (self.rate is None):
            raise Refused("the sampling rate must come from one place", "give --time COLUMN or --rate HZ, and not both")
        for name in ("rate", "lsb", "full_scale", "bandwidth", "noise_density", "scale"):
            value = getattr(self, name)
            if (value is not None and not 0.0 < abs(value) < math.inf) or (name != "scale" and (value or 1.0) < 0.0):
                raise Refused(f"--{name.replace('_', '-')} {value:g} is not possible", "give a number above zero")

    @property
    def result_unit(self) -> str:
        """Unit of the samples that are analysed."""
        return self.scaled_unit or self.unit

    @property
    def remarks(self) -> tuple[str, ...]:
        """What the times of a result need to be told, where it begins later than its log."""
        return (f"times count from {self.begin:g} s of the log (--from)",) if self.begin else ()

    def arguments(self) -> str:
        """Return these samples as the arguments of a command, as one types them."""
        words = [str(self.file)]
        for each in fields(self)[1:]:
            value = getattr(self, each.name)
            if value not in {each.default, None}:
                words.append("--" + _FLAGS.get(each.name, each.name.replace("_", "-")))
                words.append(value if isinstance(value, str) else f"{value:.12g}")
        return shlex.join(words)

    def facts(self) -> Facts:
        """What is known of the sensor, in the unit of the samples that are analysed."""
        from hil.analysis.gates import Facts  # noqa: PLC0415 - start-up stays light

        scale = abs(self.scale or 1.0)
        return Facts(
            lsb=None if self.lsb is None else self.lsb * scale,
            full_scale=None if self.full_scale is None else self.full_scale * scale,
            bandwidth=self.bandwidth,
            noise_density=self.noise_density,
        )


def time_unit_option(command: _Command) -> _Command:
    """Give a command `--time-unit`."""
    return click.option(
        "--time-unit",
        type=click.Choice(list(_TIME_UNITS)),
        help="Unit of the timestamps; s, unless the column's name or their size says otherwise.",
    )(command)


def _columns_option(told: str) -> Callable[[_Command], _Command]:
    """Give a command `--columns`, with what it says of them."""
    return click.option("--columns", metavar="A,B,C", help=told)


_COLUMNS = _columns_option("Columns of rates, by number or name; all but the time by default.")
_OPTIONS: tuple[Callable[[Callable[..., Any]], Callable[..., Any]], ...] = (
    click.argument("file", type=click.Path(path_type=Path)),
    click.option("--time", metavar="COLUMN", help="Column of timestamps, by number or name."),
    time_unit_option,
    click.option("--rate", type=float, metavar="HZ", help="Sampling rate, if the log has no timestamps."),
    _COLUMNS,
    unit_option("--unit", required=True, help="Unit of the numbers in the file, such as deg/s or LSB."),
    click.option("--scale", type=float, metavar="FACTOR", help="Factor from --unit to --scaled-unit."),
    unit_option("--scaled-unit", help="Unit after scaling, such as deg/s."),
    click.option(
        "--from", "begin", type=float, default=0.0, metavar="S", help="Start S seconds after the first sample."
    ),
    click.option("--to", "end", type=float, metavar="S", help="Stop S seconds after the first sample."),
    click.option("--lsb", type=float, metavar="STEP", help="One count, in --unit; by default found from the readings."),
    click.option("--full-scale", type=float, metavar="VALUE", help="Full-scale reading of either sign, in --unit."),
    click.option("--bandwidth", type=float, metavar="HZ", help="-3 dB bandwidth of the sensor's own filter."),
    click.option(
        "--noise-density",
        type=float,
        metavar="DENSITY",
        help="One-sided noise density from the data sheet, in the unit of the result per root hertz.",
    ),
)


def log_options(command: _Command, *, columns: str = "") -> Callable[..., Any]:
    """Give a command the options that say which samples are meant; it gets them as one argument, `wanted`.

    Args:
        command: the command.
        columns: what it says of `--columns`, where that is no choice.
    """

    @functools.wraps(command)
    def bundled(**options: Any) -> object:  # noqa: ANN401 - options are of many types
        mine = {each.name: options.pop(each.name) for each in fields(Wanted)}
        return command(wanted=Wanted(**mine), **options)

    made: Callable[..., Any] = bundled
    for option in reversed(_OPTIONS):
        made = _columns_option(columns)(made) if columns and option is _COLUMNS else option(made)
    return made
