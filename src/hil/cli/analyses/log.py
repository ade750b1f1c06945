"""The one way in which an analysis gets a log: read, times understood, gates asked; then it computes, with status."""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from hil.cli.options import unit_option
from hil.model.errors import Refused

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from hil.analysis.gates import Facts, Gate
    from hil.analysis.sampling import SamplingReport
    from hil.analysis.timeline import Timeline
    from hil.logs.columns import Table

__all__ = [
    "INCONCLUSIVE",
    "Log",
    "Wanted",
    "gates_as_json",
    "log_as_json",
    "log_options",
    "named_units",
    "obtain",
    "status",
    "time_unit_option",
]

INCONCLUSIVE = "inconclusive"
"""Status of what was computed from a log that a gate speaks against."""

_Command = TypeVar("_Command", bound=Callable[..., Any])
_TIME_UNITS = ("s", "ms", "us", "ns", "min", "h", "d")
_LARGEST, _SMALLEST = 1e100, 1e-100  # beyond these a square is no number any more
_JITTER = 0.6  # of an interval, rms: with more nobody can tell which sample is which
_COPED = frozenset({"gaps", "jitter", "rate"})  # what averages over evenly placed samples can cope with
_BRACKETS = re.compile(r"[\[(]([^\[\]()]+)[\])]\s*$")  # a unit at the end of a column's name
_LEAST_OF_CLOCK, _TOLD = 10, 0.005  # samples, and part of white noise that rounding added


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """Which samples of a log are meant, and what is known of the sensor.

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Log:
    """A log that was read, whose times are understood, and that the gates were asked about.

    Attributes:
        file: its name.
        unit: of the samples.
        rate: samples per second.
        sampling: what the timestamps say, None if there are none.
        channels: samples by column, on an even grid; NaN where one is missing.
        gates: every gate with its answer.
        remarks: what was understood in another way than it was written, left out or taken for granted, in sentences.
        coped: names of gates that the analysis copes with when they trip.
    """

    file: str
    unit: str
    rate: float
    sampling: SamplingReport | None
    channels: Mapping[str, NDArray[np.float64]]
    gates: tuple[Gate, ...]
    remarks: tuple[str, ...]
    coped: frozenset[str] = field(default=_COPED)

    def doubts(self, channel: str) -> tuple[Gate, ...]:
        """Return the gates that make what is computed from a channel inconclusive."""
        return tuple(
            gate
            for gate in self.gates
            if gate.ok is False and gate.channel in {"", channel} and gate.name not in self.coped
        )


def status(doubts: tuple[Gate, ...], otherwise: str) -> str:
    """Return the status of a figure: what the analysis says of it, unless a gate speaks against the log."""
    return INCONCLUSIVE if doubts and otherwise not in {"not observable", "model rejected"} else otherwise


def gates_as_json(gates: tuple[Gate, ...]) -> list[dict[str, object]]:
    """Return gates as a JSON document holds them."""
    return [asdict(gate) for gate in gates]


def log_as_json(log: Log, *, doubted: bool, gates: tuple[Gate, ...] = ()) -> dict[str, object]:
    """Return how the JSON document of a log's analysis begins.

    Args:
        log: what was analysed.
        doubted: whether a gate speaks against any of its channels.
        gates: what the analysis asked besides the log's own gates.
    """
    return {
        "format": 1,
        "file": log.file,
        "status": INCONCLUSIVE if doubted else "conclusive",
        "sampling": asdict(log.sampling) if log.sampling else None,
        "remarks": list(log.remarks),
        "gates": gates_as_json((*log.gates, *gates)),
    }


def time_unit_option(command: _Command) -> _Command:
    """Give a command `--time-unit`."""
    return click.option(
        "--time-unit",
        type=click.Choice(list(_TIME_UNITS)),
        help="Of the timestamps; s, unless the column's name or their size says another.",
    )(command)


_OPTIONS: tuple[Callable[[Callable[..., Any]], Callable[..., Any]], ...] = (
    click.argument("file", type=click.Path(path_type=Path)),
    click.option("--time", metavar="COLUMN", help="Column of timestamps, by number or name."),
    time_unit_option,
    click.option("--rate", type=float, metavar="HZ", help="Samples per second, if the log has no timestamps."),
    click.option(
        "--columns", metavar="A,B,C", help="Columns of rates, by number or name; all but the time by default."
    ),
    unit_option("--unit", required=True, help="Unit of the numbers in the file, such as deg/s or LSB."),
    click.option("--scale", type=float, metavar="FACTOR", help="How many --scaled-unit one --unit is."),
    unit_option("--scaled-unit", help="Unit after scaling, such as deg/s."),
    click.option(
        "--from", "begin", type=float, default=0.0, metavar="S", help="Start this many seconds after the first sample."
    ),
    click.option("--to", "end", type=float, metavar="S", help="Stop this many seconds after the first sample."),
    click.option("--lsb", type=float, metavar="STEP", help="One count in --unit; found in the readings by default."),
    click.option("--full-scale", type=float, metavar="VALUE", help="Largest reading of either sign, in --unit."),
    click.option("--bandwidth", type=float, metavar="HZ", help="Of the sensor's own filter, 3 dB down."),
    click.option(
        "--noise-density",
        type=float,
        metavar="DENSITY",
        help="Of the data sheet, one-sided, per root of a hertz, in the unit of the result.",
    ),
)


def log_options(command: _Command) -> Callable[..., Any]:
    """Give a command the options that say which samples are meant; it gets them as one argument, `wanted`."""

    @functools.wraps(command)
    def bundled(**options: Any) -> object:  # noqa: ANN401 - options are of many types
        mine = {each.name: options.pop(each.name) for each in fields(Wanted)}
        return command(wanted=Wanted(**mine), **options)

    made: Callable[..., Any] = bundled
    for option in reversed(_OPTIONS):
        made = option(made)
    return made


def obtain(wanted: Wanted, parts: str = "averages") -> Log:
    """Read a log, understand its times, cut it to the part that is meant, and ask the gates.

    Args:
        wanted: which samples.
        parts: of the record, as the analysis calls what it leaves out where too many samples are missing.

    Raises:
        Refused: what cannot be read, or is no series of samples.
    """
    import numpy as np  # noqa: PLC0415 - start-up stays light

    from hil.analysis import quality  # noqa: PLC0415 - start-up stays light
    from hil.logs.columns import read  # noqa: PLC0415 - start-up stays light

    columns = tuple(name.strip() for name in wanted.columns.split(",")) if wanted.columns else ()
    table = read(wanted.file, columns, first=wanted.time or "", clock=True)
    if len(table.names) == (wanted.time is not None):
        raise Refused(f"{wanted.file}: there is no column besides the time", "choose another with --columns")
    timed = _timed(wanted, table) if wanted.rate is None else _untimed(wanted, table)
    facts = wanted.facts()
    channels = {name: _scaled(wanted, name, values) for name, values in timed.channels.items()}
    sampled = () if timed.report is None else quality.sampled(timed.seconds, timed.report, facts)
    gates = (*timed.gates, *sampled, *named_units(channels, wanted.unit), *quality.read(channels, facts, timed.rate))
    coped = _COPED if timed.report is None or timed.report.jitter <= _JITTER else _COPED - {"jitter"}
    if not any(np.isinf(values).any() for values in channels.values()):
        coped |= {"finite"}
    return Log(
        file=str(wanted.file),
        unit=wanted.result_unit,
        rate=timed.rate,
        sampling=timed.report,
        channels=_on_grid(timed, channels),
        gates=gates,
        remarks=(
            *table.remarks,
            *timed.remarks,
            *_missing(channels, timed.report, parts),
            *_rounded(channels, facts),
        ),
        coped=coped,
    )


def named_units(columns: Iterable[str], unit: str) -> tuple[Gate, ...]:
    """Return a gate that trips for each column whose name ends in another unit than the one that was typed."""
    from hil.analysis.gates import Gate  # noqa: PLC0415 - start-up stays light
    from hil.requirements.units import same  # noqa: PLC0415 - slow to import

    found = {name: match[1].strip() for name in columns if (match := _BRACKETS.search(name))}
    told = {name: f"name of column '{name}' says {other}" for name, other in found.items() if not same(other, unit)}
    reasons = {name: f"--unit says {unit}, but the {each}: check which is right" for name, each in told.items()}
    return tuple(Gate(name="unit", channel=name, ok=False, reason=reason) for name, reason in reasons.items())


@dataclass(frozen=True, slots=True, kw_only=True)
class _Timed:
    """Samples whose times are known: the rows that are meant, in order of time."""

    seconds: NDArray[np.float64]
    places: NDArray[np.int64] | None
    rate: float
    report: SamplingReport | None
    channels: dict[str, NDArray[np.float64]]
    gates: tuple[Gate, ...]
    remarks: tuple[str, ...]


def _untimed(wanted: Wanted, table: Table) -> _Timed:
    import numpy as np  # noqa: PLC0415 - start-up stays light

    rate = wanted.rate or math.nan
    seconds = np.arange(len(table.values)) / rate
    part = _part(wanted, seconds)
    channels = {name: np.ascontiguousarray(table.values[part, place]) for place, name in enumerate(table.names)}
    return _Timed(
        seconds=seconds[part],
        places=None,
        rate=rate,
        report=None,
        channels=channels,
        gates=(),
        remarks=tuple(_clocks(channels)),
    )


def _timed(wanted: Wanted, table: Table) -> _Timed:
    import numpy as np  # noqa: PLC0415 - start-up stays light

    from hil.analysis.sampling import placed  # noqa: PLC0415 - start-up stays light
    from hil.analysis.timeline import time_unit, timeline  # noqa: PLC0415 - start-up stays light

    raw = table.values[:, 0]
    unit, told = ("s", "") if table.clocked else time_unit(wanted.time_unit, table.names[0], raw)
    try:
        line: Timeline = timeline(
            raw, unit, typed=table.clocked or wanted.time_unit is not None or bool(told), values=table.values[:, 1:]
        )
    except Refused as error:
        raise Refused(f"{wanted.file}: {error.message}", error.hint) from None
    part = _part(wanted, line.seconds)
    whole = bool(part.all())
    rows: NDArray[np.int64] | slice = slice(None)  # no copy where every row is meant
    if line.rows is not None or not whole:
        rows = (np.arange(len(raw)) if line.rows is None else line.rows)[part]
    report, places = (line.report, line.places) if whole else placed(line.seconds[part])
    return _Timed(
        seconds=line.seconds if whole else line.seconds[part],
        places=places if report.missing else None,
        rate=report.rate,
        report=report,
        channels={
            name: np.ascontiguousarray(table.values[rows, place]) for place, name in enumerate(table.names[1:], start=1)
        },
        gates=line.gates,
        remarks=(*((told,) if told else ()), *line.remarks),
    )


def _part(wanted: Wanted, since: NDArray[np.float64]) -> NDArray[np.bool_]:
    end = math.inf if wanted.end is None else wanted.end
    part = (since >= wanted.begin) & (since <= end)
    if not part.any():
        asked = f"--from {wanted.begin:g}" + ("" if wanted.end is None else f" --to {wanted.end:g}")
        raise Refused(f"{wanted.file}: no sample lies within {asked}", f"the log lasts {since[-1]:g} s")
    return part


def _scaled(wanted: Wanted, name: str, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return samples in the unit of the result; refuse those whose squares are no numbers."""
    from hil.analysis.gates import present  # noqa: PLC0415 - start-up stays light

    scaled = values if wanted.scale is None else values * wanted.scale
    here = present(scaled)
    if not here.size:
        raise Refused(f"{wanted.file}: column {name} holds no number", "choose other columns")
    highest, lowest = float(here.max()), float(here.min())
    largest, span = max(abs(highest), abs(lowest)), highest / 2.0 - lowest / 2.0
    if largest > _LARGEST or 0.0 < span < _SMALLEST:
        number = largest if largest > _LARGEST else span
        raise Refused(
            f"{wanted.file}: column {name} varies by {number:.3g}, beyond what can be squared",
            "check the column, or bring it to another unit with --scale and --scaled-unit",
        )
    return scaled


def _on_grid(timed: _Timed, channels: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
    """Put samples on an even grid, with a hole for each that is missing or infinite."""
    import numpy as np  # noqa: PLC0415 - start-up stays light

    from hil.analysis.sampling import with_holes  # noqa: PLC0415 - start-up stays light

    found = {}
    for name, values in channels.items():
        finite = np.where(np.isinf(values), np.nan, values) if np.isinf(values).any() else values
        found[name] = finite if timed.places is None else with_holes(timed.places, finite)
    return found


def _missing(channels: Mapping[str, NDArray[np.float64]], report: SamplingReport | None, parts: str) -> list[str]:
    counts = {name: int((values != values).sum()) for name, values in channels.items()}  # noqa: PLR0124 - NaN alone differs
    told = [f"column {name}: {count} samples are NaN and count as missing" for name, count in counts.items() if count]
    if report is not None and report.missing:
        number = f"{report.missing} samples are" if report.missing > 1 else "1 sample is"
        told.append(f"{number} missing; {parts} that miss more than 5 % of their samples are left out")
    return told


def _rounded(channels: Mapping[str, NDArray[np.float64]], facts: Facts) -> list[str]:
    from hil.analysis.extremes import rounding  # noqa: PLC0415 - start-up stays light

    parts = {name: rounding(values, facts) for name, values in channels.items()}
    return [
        f"column {name}: readings are rounded to counts, so white noise reads about {part:.1%} above the sensor's own"
        for name, part in parts.items()
        if part >= _TOLD
    ]


def _clocks(rates: Mapping[str, NDArray[np.float64]]) -> list[str]:
    """Return a remark for every column that only ever rises: no noise does that, a time or a counter does."""
    return [
        f"column {name} rises with every sample, as a time does: give it to --time, or leave it out with --columns"
        for name, values in rates.items()
        if len(values) >= _LEAST_OF_CLOCK and (values[1:] > values[:-1]).all()
    ]
