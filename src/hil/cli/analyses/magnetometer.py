"""`hil analyse magnetometer`: calibrate a magnetometer from readings in many attitudes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.cli.analyses.exports import export_options, write_exports
from hil.cli.analyses.log import named_units, refuse_extremes
from hil.cli.options import ABOVE_ZERO, FINITE, JSON, plot_option, unit_option
from hil.model.errors import HilError, Refused

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from hil.analysis.gates import Gate
    from hil.analysis.magnetometer.calibrate import MagnetometerReport

__all__ = ["magnetometer"]

_METHODS = ("ellipsoid", "likelihood", "twostep")
_SHAPES = ("auto", "sphere", "aligned", "general")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Recorded:
    """Readings (n, 3) and, where they are known, magnitudes and temperatures (n,); gates and remarks about them."""

    readings: NDArray[np.float64]
    field: NDArray[np.float64] | None
    temperature: NDArray[np.float64] | None
    gates: tuple[Gate, ...]
    remarks: tuple[str, ...]


@click.command("magnetometer", short_help="Calibrate a magnetometer from many attitudes.")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--columns", required=True, metavar="A,B,C", help="Columns of x, y and z, by number or name.")
@unit_option("--unit", required=True, help="Unit of the numbers in the file, such as uT or LSB.")
@click.option("--scale", type=FINITE, metavar="FACTOR", help="Factor from --unit to --scaled-unit.")
@unit_option("--scaled-unit", help="Unit after scaling, such as uT.")
@click.option(
    "--field", type=ABOVE_ZERO, metavar="VALUE", help="Known magnitude of the field, the same for all readings."
)
@click.option("--field-column", metavar="COLUMN", help="Column of known magnitudes, by number or name.")
@unit_option("--field-unit", help="Unit of the known magnitudes; that of the readings by default.")
@click.option(
    "--noise", type=ABOVE_ZERO, metavar="VALUE", help="Known noise of each axis, as a standard deviation in --unit."
)
@click.option(
    "--temperature", metavar="COLUMN", help="Column of the sensor's temperature in degC; lets the bias depend on it."
)
@click.option(
    "--method",
    type=click.Choice(_METHODS),
    help="Fitting method; by default likelihood with a known field, otherwise ellipsoid.",
)
@click.option("--shape", type=click.Choice(_SHAPES), help="Form of the matrix; by default chosen from the data.")
@click.option("--full-scale", type=ABOVE_ZERO, metavar="VALUE", help="Full-scale reading of either sign, in --unit.")
@plot_option("the residuals")
@export_options
@JSON
def magnetometer(  # noqa: PLR0913 - one argument per option
    *,
    file: Path,
    columns: str,
    unit: str,
    scale: float | None,
    scaled_unit: str | None,
    field: float | None,
    field_column: str | None,
    field_unit: str | None,
    noise: float | None,
    temperature: str | None,
    method: str | None,
    shape: str | None,
    full_scale: float | None,
    plot: Path | None,
    export: Path | None,
    c_header: Path | None,
    as_json: bool,
) -> int:
    """Calibrate bias and matrix of the magnetometer whose readings are in FILE.

    Turn the sensor through as many attitudes as you can; they need not be known. If the magnitude of the field is
    known, give it as a number or as a column. The result is field = matrix * (measured - bias), with uncertainties,
    outliers and the part of the sphere that the readings cover. If the coverage is too small, or another gate trips,
    nothing is exported, and the exit code is 1.

    \b
    Example:
      hil analyse magnetometer docs/data/magnetometer-simulated.csv --columns x,y,z --unit uT --field-column field
    """  # noqa: D301 - click reads \b
    from hil.analysis.magnetometer.calibrate import calibrate_magnetometer  # noqa: PLC0415 - start-up stays light
    from hil.cli.analyses import magnetometer_text  # noqa: PLC0415 - start-up stays light

    names = _three(columns)
    _agree(scale, scaled_unit, field, field_column)
    found = scaled_unit or unit
    factor = _factor(field_unit, found)
    each = scale or 1.0
    full_scale, noise = (None if value is None else value * abs(each) for value in (full_scale, noise))
    recorded = _recorded(file, (names, field_column, temperature), unit, (each, factor), full_scale)
    known = recorded.field if field is None else field * factor
    report = calibrate_magnetometer(
        recorded.readings,
        found,
        field=known,
        method=method,  # type: ignore[arg-type]
        shape=shape,  # type: ignore[arg-type]
        noise=noise,
        temperature=recorded.temperature,
    )
    gates = (*recorded.gates, *report.gates)
    doubted = any(gate.ok is False for gate in gates)
    if not doubted:
        _exported(report, recorded, known, export, c_header)
    if plot is not None:
        from hil.cli.analyses.magnetometer_plot import draw  # noqa: PLC0415 - matplotlib is slow to import

        draw(plot, report, recorded.readings, recorded.temperature)
    text = magnetometer_text.as_json if as_json else magnetometer_text.as_text
    click.echo(text(str(file), report, gates, (*recorded.remarks, *magnetometer_text.likeness(report))))
    return int(doubted)


def _three(columns: str) -> list[str]:
    names = [name.strip() for name in columns.split(",")]
    if len(names) != 3:
        raise Refused(f"--columns names {len(names)} columns", "name those of x, y and z")
    return names


def _agree(scale: float | None, scaled_unit: str | None, field: float | None, field_column: str | None) -> None:
    if (scale is None) != (scaled_unit is None):
        raise Refused("--scale and --scaled-unit belong together", "give both, or neither")
    if scale == 0.0:
        raise Refused("--scale 0 is not possible", "give the factor from --unit to --scaled-unit")
    if field is not None and field_column is not None:
        raise Refused("--field and --field-column exclude each other", "give one of them")


def _factor(field_unit: str | None, unit: str) -> float:
    from hil.requirements.units import convert  # noqa: PLC0415 - slow to import

    if field_unit is None:
        return 1.0
    try:
        return convert(1.0, field_unit, unit)
    except HilError as error:
        raise Refused(
            f"--field-unit: {error.message}", f"give it in {unit}, or in a unit that converts to it"
        ) from None


def _recorded(
    file: Path,
    wanted: tuple[list[str], str | None, str | None],
    unit: str,
    factors: tuple[float, float],
    full_scale: float | None,
) -> _Recorded:
    """Return what the file holds without rows that are not numbers, and the gates on it."""
    import numpy as np  # noqa: PLC0415 - start-up stays light

    from hil.analysis.extremes import saturated  # noqa: PLC0415 - start-up stays light
    from hil.analysis.gates import Facts, repeated, stuck  # noqa: PLC0415 - start-up stays light
    from hil.logs.columns import read  # noqa: PLC0415 - start-up stays light

    names, field_column, temperature_column = wanted
    table = read(file, [*names, *filter(None, (field_column, temperature_column))])
    whole = np.isfinite(table.values).all(axis=1)
    if not whole.any():
        raise Refused(f"{file}: no row holds a finite number in every column", "choose other columns")
    remarks = list(table.remarks)
    if not whole.all():
        count = int((~whole).sum())
        told = "1 row holds" if count == 1 else f"{count} rows hold"
        remarks.append(f"{told} no finite number in a column, and {'is' if count == 1 else 'are'} left out")
    for title, column in zip(table.names, table.values[whole].T, strict=True):
        refuse_extremes(file, title, column)
    readings = np.ascontiguousarray(table.values[whole, :3]) * factors[0]
    channels = {name: readings[:, place] for place, name in enumerate(table.names[:3])}
    gates = [*named_units(table.names[:3], unit), repeated(channels)]
    for name, values in channels.items():
        gates.append(stuck(name, values))
        if full_scale is not None:
            gates.append(saturated(name, values, Facts(full_scale=full_scale)))
    return _Recorded(
        readings=readings,
        field=np.ascontiguousarray(table.values[whole, 3]) * factors[1] if field_column else None,
        temperature=np.ascontiguousarray(table.values[whole, -1]) if temperature_column else None,
        gates=tuple(gates),
        remarks=tuple(remarks),
    )


def _exported(
    report: MagnetometerReport,
    recorded: _Recorded,
    known: NDArray[np.float64] | float | None,
    export: Path | None,
    c_header: Path | None,
) -> None:
    """Write the calibration if it reproduces the readings that it was made from."""
    from hil.analysis.magnetometer import interchange  # noqa: PLC0415 - start-up stays light

    text = interchange.magnetometer_as_json(report.calibration)
    again = interchange.magnetometer_from_json(text)
    missed = interchange.sample_disagreement(again, report, recorded.readings, known, recorded.temperature)
    if missed:
        raise Refused(missed, "do not use this calibration; report the readings that show it")
    write_exports((export, text), (c_header, interchange.magnetometer_as_c_header(report.calibration)))
