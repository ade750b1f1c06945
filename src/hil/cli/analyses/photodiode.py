"""`hil analyse photodiode`: calibrate a photodiode from readings over temperature."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hil.cli.analyses.exports import export_options, write_exports
from hil.cli.analyses.log import INCONCLUSIVE, gates_as_json, named_units, refuse_extremes
from hil.cli.options import ABOVE_ZERO, DEGC, JSON, ZERO_OR_MORE, plot_option, unit_option
from hil.model.errors import HilError, Refused

if TYPE_CHECKING:
    from hil.analysis.gates import Gate
    from hil.analysis.photodiode.calibrate import PhotodiodeReport
    from hil.analysis.photodiode.diode import Array

__all__ = ["photodiode"]


@click.command("photodiode", short_help="Calibrate a photodiode over temperature.")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--reading", required=True, metavar="COLUMN", help="Column of readings at the load, by number or name.")
@unit_option("--unit", required=True, help="Unit of the readings: V, mV, or LSB with --reference.")
@click.option("--temperature", required=True, metavar="COLUMN", help="Column of temperatures in degC.")
@click.option("--load", type=ABOVE_ZERO, metavar="OHM", help="Load resistance of all readings.")
@click.option("--load-column", metavar="COLUMN", help="Column of load resistances in ohm.")
@click.option("--light", metavar="COLUMN", help="Column of a light monitor, in any unit.")
@click.option("--reference", type=ABOVE_ZERO, metavar="V", help="Voltage at full scale of the converter, as measured.")
@click.option("--full-scale", type=ABOVE_ZERO, default=4095.0, metavar="LSB", help="Full-scale count; 4095 by default.")
@click.option(
    "--nominal",
    type=DEGC,
    default=25.0,
    metavar="DEGC",
    help="Temperature at which figures are stated; 25 by default.",
)
@click.option("--series", type=ZERO_OR_MORE, default=0.0, metavar="OHM", help="Series resistance from the data sheet.")
@click.option(
    "--reference-uncertainty",
    type=ZERO_OR_MORE,
    default=0.0,
    metavar="FRACTION",
    help="Relative standard uncertainty of the reference voltage.",
)
@click.option(
    "--offset-uncertainty",
    type=ZERO_OR_MORE,
    default=0.0,
    metavar="V",
    help="Standard uncertainty of the converter's offset.",
)
@click.option(
    "--load-uncertainty",
    type=ZERO_OR_MORE,
    default=0.0,
    metavar="FRACTION",
    help="Relative standard uncertainty of each load.",
)
@click.option(
    "--temperature-uncertainty",
    type=ZERO_OR_MORE,
    default=0.0,
    metavar="K",
    help="Standard uncertainty of the thermometer.",
)
@plot_option("readings and residuals")
@export_options
@JSON
def photodiode(
    *,
    file: Path,
    plot: Path | None,
    export: Path | None,
    c_header: Path | None,
    as_json: bool,
    **asked: Any,  # noqa: ANN401
) -> int:
    """Find photocurrent, saturation current, ideality factor and temperature coefficient from the readings in FILE.

    Read at several loads, or in light that a monitor measures, over 10 K or more. Uncertainties are standard
    uncertainties. If the readings do not separate the parameters, or a gate trips, nothing is exported, and the exit
    code is 1.

    \b
    Example:
      hil analyse photodiode docs/data/photodiode-simulated.csv --reading photodiode --unit LSB --reference 3.3 \\
        --temperature temperature --load-column load --light monitor --series 20
    """  # noqa: D301 - click reads \b
    from hil.analysis.photodiode.calibrate import calibrate_photodiode  # noqa: PLC0415 - start-up stays light
    from hil.analysis.photodiode.interchange import (  # noqa: PLC0415 - start-up stays light
        photodiode_as_c_header,
        photodiode_as_json,
        photodiode_from_json,
        photodiode_reproduction,
    )
    from hil.analysis.photodiode.readings import Known  # noqa: PLC0415 - start-up stays light

    readings, light, gates, remarks = _read(file, asked)
    uncertain = {name: asked[f"{name}_uncertainty"] for name in ("reference", "offset", "load", "temperature")}
    top = {"full_scale": asked["reference"]} if asked["reference"] else {}
    known = Known(nominal=asked["nominal"], series=asked["series"], **uncertain, **top)
    report = calibrate_photodiode(*readings, light=light, known=known)
    gates = (*gates, *report.gates)
    doubted = any(gate.ok is False for gate in gates)
    if not doubted:
        text = photodiode_as_json(report)
        told = photodiode_reproduction(photodiode_from_json(text), report, *readings)
        if told != "reproduced":
            raise Refused(told, "do not use this calibration; report the readings that show it")
        write_exports((export, text), (c_header, photodiode_as_c_header(report)))
    if plot is not None:
        _draw(plot, readings, report)
    said = _as_json if as_json else _as_text
    click.echo(said(str(file), report, gates, remarks))
    return int(doubted)


def _read(
    file: Path, asked: dict[str, Any]
) -> tuple[tuple[Array, Array, Array], Array, tuple[Gate, ...], tuple[str, ...]]:
    """Return voltages [V], temperatures [degC] and loads [ohm], light, gates about names and rows, and remarks."""
    import numpy as np  # noqa: PLC0415 - start-up stays light

    from hil.analysis.gates import repeated  # noqa: PLC0415 - start-up stays light
    from hil.logs.columns import read  # noqa: PLC0415 - start-up stays light

    if (asked["load"] is None) == (asked["load_column"] is None):
        raise Refused("the load resistance is needed, exactly once", "give --load or --load-column")
    factor = _volts(asked)
    columns = {name: asked[name] for name in ("reading", "temperature", "load_column", "light") if asked[name]}
    table = read(file, list(columns.values()))
    found = {name: np.ascontiguousarray(table.values[:, place]) for place, name in enumerate(columns)}
    for title, values in zip(table.names, found.values(), strict=True):
        refuse_extremes(file, title, values)
    gates = (*named_units(table.names[:1], asked["unit"]), *named_units(table.names[1:2], "degC"))
    if not asked["light"]:
        gates = (*gates, repeated({name: found[name] for name in ("reading", "temperature")}))
    loads = found.get("load_column", np.full(len(table.values), asked["load"] or 0.0))
    light = found.get("light", np.ones(len(table.values)))
    return (found["reading"] * factor, found["temperature"], loads), light, gates, table.remarks


def _volts(asked: dict[str, Any]) -> float:
    """Return what one unit of the readings is in V."""
    from hil.requirements.units import convert, same  # noqa: PLC0415 - slow to import

    counts = same(asked["unit"], "LSB")
    if counts and not asked["reference"]:
        raise Refused("readings in LSB need the reference of the converter", "measure it, and give --reference in V")
    if counts:
        return float(asked["reference"] / asked["full_scale"])
    try:
        return convert(1.0, asked["unit"], "V")
    except HilError as error:
        raise Refused(f"--unit: {error.message}", "give V, mV or LSB") from None


def _as_json(file: str, report: PhotodiodeReport, gates: tuple[Gate, ...], remarks: tuple[str, ...]) -> str:
    from hil.analysis.photodiode.interchange import as_document  # noqa: PLC0415 - start-up stays light
    from hil.model.figure import encoded  # noqa: PLC0415 - start-up stays light

    doubts = [str(gate) for gate in gates if gate.ok is False]
    document = {
        "format": 1,
        "file": file,
        "readings": len(report.residual),
        "status": INCONCLUSIVE if doubts else "conclusive",
        "reasons": doubts,
        "gates": gates_as_json(gates),
        "remarks": list(remarks),
        **{name: encoded(figure) for name, figure in report.figures.items()},
        "noise": encoded(report.noise),
        "identifiability": report.identifiability,
        "calibration": None if doubts else as_document(report),
    }
    return json.dumps(document, allow_nan=False, indent=2)


def _as_text(file: str, report: PhotodiodeReport, gates: tuple[Gate, ...], remarks: tuple[str, ...]) -> str:
    from hil.analysis.photodiode.interchange import as_document  # noqa: PLC0415 - start-up stays light
    from hil.cli.analyses.allan_text import stated  # noqa: PLC0415 - start-up stays light
    from hil.documents.text import fitting  # noqa: PLC0415 - start-up stays light
    from hil.report.tables import aligned  # noqa: PLC0415 - start-up stays light

    doubts = [f"INCONCLUSIVE: {gate}; nothing is exported" for gate in gates if gate.ok is False]
    lines = [f"{file}: {len(report.residual)} readings"]
    lines += fitting([*doubts, *(f"note: {remark}" for remark in remarks)], 80)
    rows = [(name, stated(figure)) for name, figure in (*report.figures.items(), ("noise", report.noise))]
    lines += [
        "",
        *aligned([(name, f"{told}, {_status(report, name)}".removesuffix(", ")) for name, told in rows], indent="  "),
        "",
    ]
    lines += fitting([report.identifiability], 80)
    if not doubts:
        lines.append("self-check: the exported numbers give the same light for every reading")
        lines.append(f"fingerprint {as_document(report)['fingerprint']}")
    return "\n".join(lines)


def _status(report: PhotodiodeReport, name: str) -> str:
    """Return the remark for a figure that is not measured."""
    figure = report.figures.get(name, report.noise)
    return "" if figure.status.value == "measured" else figure.status.value


def _draw(path: Path, readings: tuple[Array, Array, Array], report: PhotodiodeReport) -> None:
    import numpy as np  # noqa: PLC0415 - start-up stays light
    from matplotlib.figure import Figure  # noqa: PLC0415 - slow to import

    from hil.cli.analyses.plots import COLOURS, save  # noqa: PLC0415 - slow to import

    volts, degrees, ohms = readings
    grid = np.linspace(degrees.min(), degrees.max(), 101)

    def drawn() -> Figure:
        figure = Figure(figsize=(7.0, 6.0), dpi=120, layout="constrained")
        above, below = figure.subplots(2, 1, sharex=True)
        for place, load in enumerate(np.unique(ohms).tolist()):
            here, colour = ohms == load, COLOURS[place % len(COLOURS)]
            above.plot(degrees[here], volts[here] * 1e3, ".", color=colour, markersize=3, label=f"{load:.6g} ohm")
            if report.conclusive:
                model = report.diode.voltage_of(1.0, grid, load)
                above.plot(grid, model * 1e3, color=colour, linewidth=0.8)
            below.plot(degrees[here], report.residual[here] * 1e3, ".", color=colour, markersize=2)
        above.set(ylabel="reading [mV]", title="readings; lines are the model in the mean light")
        below.set(xlabel="temperature [degC]", ylabel="residual [mV]")
        for axes in (above, below):
            axes.grid(visible=True, color="#dddddd", linewidth=0.5)
        figure.legend(*above.get_legend_handles_labels(), loc="outside upper center", ncols=4)
        return figure

    save(path, drawn)
