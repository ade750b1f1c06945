"""`hil analyse gyroscope-temperature`: calibrate a gyroscope from a table of means."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.cli.analyses.exports import export_options, write_exports
from hil.cli.analyses.log import named_units
from hil.cli.options import FINITE, JSON, ZERO_OR_MORE, plot_option, unit_option
from hil.model.errors import Refused
from hil.model.figure import Figure

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from hil.analysis.gates import Gate
    from hil.analysis.gyroscope.calibrate import CalibrationReport
    from hil.analysis.gyroscope.readings import Reading
    from hil.logs.columns import Table

__all__ = ["gyroscope_temperature", "in_celsius"]

_OTHER_DEGREES = re.compile(r"(?:^|[\s_\[(/])(°F|degF|F|K|degK|kelvin|fahrenheit)[\])]?\s*$", re.IGNORECASE)
_DEGC = re.compile(r"(?:^|[\s_\[(/])(°C|degC|C|celsius)[\])]?\s*$", re.IGNORECASE)
_HOTTEST = 85.0  # degC that sensors are made for
_LARGEST = 1e100  # beyond this a square overflows
_LEAST_SPAN = 2.0  # K between the temperatures of a table: less shows no dependence


@dataclass(frozen=True, slots=True, kw_only=True)
class _Columns:
    """Which columns of the table hold what, by number or name."""

    temperature: str
    means: tuple[str, ...]
    rates: tuple[str, ...]
    uncertainties: tuple[str, ...]
    uncertainty: float | None


@click.command("gyroscope-temperature", short_help="Calibrate a gyroscope over temperature.")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--temperature", required=True, metavar="COLUMN", help="Column of temperatures in degC.")
@click.option("--means", required=True, metavar="A,B,C", help="Columns of mean readings, one for each axis.")
@click.option("--axes", default="x,y,z", show_default=True, metavar="A,B,C", help="Names of the axes.")
@click.option("--rates", metavar="A,B,C", help="Columns of true rates about each axis; rows with zeros are at rest.")
@click.option("--uncertainties", metavar="A,B,C", help="Columns of standard uncertainties of the means.")
@click.option("--uncertainty", type=FINITE, metavar="U", help="One standard uncertainty for all means.")
@unit_option("--unit", required=True, help="Unit of means, rates and uncertainties, such as deg/s.")
@click.option(
    "--reference",
    type=FINITE,
    default=25.0,
    show_default=True,
    metavar="DEGC",
    help="Temperature about which the polynomials are expanded.",
)
@click.option(
    "--degree",
    type=click.IntRange(1, 3),
    metavar="N",
    help="Degree of the polynomials, 1 to 3; by default chosen from the data.",
)
@click.option(
    "--rate-uncertainty",
    type=ZERO_OR_MORE,
    default=0.0,
    metavar="U",
    help="Relative standard uncertainty of the table's rates.",
)
@click.option(
    "--margin",
    type=ZERO_OR_MORE,
    default=0.0,
    metavar="K",
    help="How far beyond the measured temperatures the calibration is valid.",
)
@plot_option("the fits")
@export_options
@JSON
def gyroscope_temperature(  # noqa: PLR0913 - one argument per option
    *,
    file: Path,
    temperature: str,
    means: str,
    axes: str,
    rates: str | None,
    uncertainties: str | None,
    uncertainty: float | None,
    unit: str,
    reference: float,
    degree: int | None,
    rate_uncertainty: float,
    margin: float,
    plot: Path | None,
    export: Path | None,
    c_header: Path | None,
    as_json: bool,
) -> int:
    """Calibrate bias, scale and alignment over temperature from the table of means in FILE.

    Each row is the mean reading of all axes at one temperature, at rest or at one true rate about one
    axis. Bias and scale become polynomials of temperature whose degree you or the data choose:
    rate = scale(T) * (measured - bias(T)). What is exported is read back, and must reproduce the table.
    If a gate trips, nothing is exported, and the exit code is 1.

    \b
    Example:
      hil analyse gyroscope-temperature docs/data/gyroscope-temperature-simulated.csv --unit deg/s \\
        --temperature temperature --means x,y,z --rates rate_x,rate_y,rate_z --uncertainties ux,uy,uz
    """  # noqa: D301 - click reads \b
    from hil.analysis.gyroscope import interchange  # noqa: PLC0415 - start-up stays light
    from hil.analysis.gyroscope.calibrate import calibrate  # noqa: PLC0415 - start-up stays light
    from hil.analysis.gyroscope.readings import implausible  # noqa: PLC0415 - start-up stays light
    from hil.cli.analyses import gyroscope_text  # noqa: PLC0415 - start-up stays light

    if uncertainties and uncertainty is not None:
        raise Refused("--uncertainties and --uncertainty exclude each other", "give one of them")
    names = _split(axes)
    columns = _Columns(
        temperature=temperature,
        means=_split(means),
        rates=_split(rates),
        uncertainties=_split(uncertainties),
        uncertainty=uncertainty,
    )
    readings, table = _readings(file, columns, names, unit)
    report = calibrate(readings, reference=reference, rate_uncertainty=rate_uncertainty, margin=margin, degree=degree)
    _checked(report)
    report = replace(report, remarks=(*table.remarks, *report.remarks))
    told = named_units(table.names[1 : 1 + len(names)], unit)
    gates = (*told, *_copied(table), *_gates(readings, table.names[0]), *implausible(report.responses))
    doubted = any(gate.ok is False for gate in gates)
    if not doubted:
        its = report.calibration
        write_exports((export, interchange.as_json(its)), (c_header, interchange.as_c_header(its)))
    if plot is not None:
        from hil.cli.analyses.gyroscope_plot import draw  # noqa: PLC0415 - matplotlib is slow to import

        draw(plot, report)
    text = gyroscope_text.as_json if as_json else gyroscope_text.as_text
    click.echo(text(str(file), len(readings), report, gates))
    return int(doubted)


def _split(text: str | None) -> tuple[str, ...]:
    return tuple(part.strip() for part in text.split(",")) if text else ()


def _readings(file: Path, columns: _Columns, names: tuple[str, ...], unit: str) -> tuple[list[Reading], Table]:
    """Return the rows of the table as readings, and the table."""
    from hil.analysis.gyroscope.readings import Reading  # noqa: PLC0415 - start-up stays light
    from hil.logs.columns import read  # noqa: PLC0415 - start-up stays light

    count = len(names)
    if len(set(names)) != count:
        raise Refused("two axes have the same name", "give each axis its own with --axes")
    for option, given in (
        ("--means", columns.means), ("--rates", columns.rates), ("--uncertainties", columns.uncertainties),
    ):  # fmt: skip
        if given and len(given) != count:
            raise Refused(f"{option} names {len(given)} columns for {count} axes", "name one column for each of --axes")
    wanted = [*columns.means, *columns.rates, *columns.uncertainties]
    readings = []
    table = read(file, wanted, first=columns.temperature)
    _finite(file, table)
    for row in table.values.tolist():
        rates = row[1 + count : 1 + 2 * count] if columns.rates else [0.0] * count
        spread = row[-count:] if columns.uncertainties else [columns.uncertainty] * count
        figures = _figures(row[1 : 1 + count], spread, unit)
        readings.append(
            Reading(
                temperature=row[0],
                means=dict(zip(names, figures, strict=True)),
                rates=dict(zip(names, rates, strict=True)),
            )
        )
    return readings, table


def _gates(readings: Sequence[Reading], title: str) -> tuple[Gate, ...]:
    """Return the gates on the temperatures and on each axis.

    Raises:
        Refused: a number of the table is none.
    """
    import numpy as np  # noqa: PLC0415 - start-up stays light

    from hil.analysis.gates import Gate, stuck  # noqa: PLC0415 - start-up stays light

    temperatures = np.array([each.temperature for each in readings])
    axes = {axis: np.array([each.means[axis].value for each in readings]) for axis in readings[0].means}
    still = [replace(stuck(axis, values), name="still") for axis, values in axes.items()]
    warm = in_celsius(title, temperatures, series=False)
    span = float(np.ptp(temperatures))
    told = f"the temperatures differ by {span:.3g} K"
    if span < _LEAST_SPAN:
        told += f", and {_LEAST_SPAN:g} K are needed: is this their column?"
    return (warm, Gate(name="span", channel="temperature", ok=span >= _LEAST_SPAN, reason=told), *still)


def in_celsius(title: str, temperatures: NDArray[np.float64], *, series: bool) -> Gate:
    """Return a gate that trips if a column does not hold degrees Celsius, judging by its numbers or its name.

    Args:
        title: the column's name.
        temperatures: its numbers, at least one of which is finite.
        series: whether they were sampled one after the other.
    """
    import numpy as np  # noqa: PLC0415 - start-up stays light

    from hil.analysis.gates import celsius  # noqa: PLC0415 - start-up stays light

    warm = celsius("temperature", temperatures, series=series)
    said = _OTHER_DEGREES.search(title)
    if said is not None and warm.ok is not False:
        warm = replace(warm, ok=False, reason=f"the name of column '{title}' says {said[1]}; not degrees Celsius")
    hottest = float(np.nanmax(temperatures))
    if warm.ok is not False and hottest > _HOTTEST and _DEGC.search(title) is None:
        celsius_then = (hottest - 32.0) / 1.8
        told = f"up to {hottest:g} in column '{title}', which names no unit: {celsius_then:.3g} degC if it holds °F"
        reason = f"{told}; name the unit, as in 'T [degC]'"
        warm = replace(warm, ok=False, reason=reason)
    return warm


def _copied(table: Table) -> tuple[Gate, ...]:
    """Return a gate that trips if the file holds the whole table several times."""
    from hil.analysis.gates import Gate, copies  # noqa: PLC0415 - start-up stays light

    times = copies(table.values.T)
    if times == 1:
        return ()
    counted = "twice" if times == 2 else "three times"
    reason = f"the same {len(table.values) // times} rows appear {counted}: repeated rows add no information"
    return (Gate(name="repeated", channel="", ok=False, reason=reason),)


def _finite(file: Path, table: Table) -> None:
    import numpy as np  # noqa: PLC0415 - start-up stays light

    rows, places = np.nonzero(~np.isfinite(table.values))
    if rows.size:
        raise Refused(
            f"{file}: row {rows[0] + 1} has no finite number in column {table.names[places[0]]}",
            "fix or remove the row",
        )
    rows, places = np.nonzero(np.abs(table.values) > _LARGEST)
    if rows.size:
        number = table.values[rows[0], places[0]]
        raise Refused(
            f"{file}: row {rows[0] + 1} has {number:.3g} in column {table.names[places[0]]}, which cannot be squared",
            "fix or remove the row",
        )


def _figures(values: Sequence[float], spread: Sequence[float | None], unit: str) -> list[Figure]:
    if any(each is not None and not each > 0.0 for each in spread):
        raise Refused("an uncertainty is not above zero", "correct the table, or leave the uncertainties out")
    return [Figure(value=value, unit=unit, uncertainty=each) for value, each in zip(values, spread, strict=True)]


def _checked(report: CalibrationReport) -> None:
    """Read the export back and recompute the table with it."""
    from hil.analysis.gyroscope.interchange import as_json, from_json  # noqa: PLC0415 - start-up stays light
    from hil.analysis.gyroscope.self_check import export_disagreements  # noqa: PLC0415 - start-up stays light

    rejected = export_disagreements(from_json(as_json(report.calibration)), report)
    if rejected:
        raise Refused("; ".join(map(str, rejected)), "do not use this calibration; report the table that shows it")
