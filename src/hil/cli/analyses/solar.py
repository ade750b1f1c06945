"""`hil analyse solar`: reduce a current-voltage curve of a solar cell to its figures, at stated conditions."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import click

from hil.cli.analyses.exports import write_exports
from hil.cli.analyses.log import INCONCLUSIVE, gates_as_json, named_units, refuse_extremes
from hil.cli.options import ABOVE_ZERO, DEGC, FINITE, JSON, ZERO_OR_MORE, plot_option, unit_option
from hil.model.errors import HilError, Refused

if TYPE_CHECKING:
    from hil.analysis.gates import Gate
    from hil.analysis.solar.correction import IvConditions
    from hil.analysis.solar.curve import IvCurve
    from hil.analysis.solar.fits import Array

__all__ = ["solar"]

_COEFFICIENTS = {"alpha": "1/K", "beta": "1/K", "resistance": "ohm", "kappa": "ohm/K", "light": "1"}
_Columns: TypeAlias = "dict[str, Array]"
_UNITS = {"voltage": "V", "current": "A", "irradiance": "W/m^2", "temperature": "degC"}


@click.command("solar", short_help="Evaluate a current-voltage curve of a solar cell.")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--voltage", required=True, metavar="COLUMN", help="Column of voltages, by number or name.")
@click.option("--current", required=True, metavar="COLUMN", help="Column of currents out of the cell.")
@unit_option("--voltage-unit", required=True, help="Unit of the voltages, such as V or mV.")
@unit_option("--current-unit", required=True, help="Unit of the currents, such as A or mA.")
@click.option("--irradiance", metavar="COLUMN", help="Column of irradiances in W/m^2.")
@click.option("--temperature", metavar="COLUMN", help="Column of the cell's temperatures in degC.")
@click.option("--to", type=(ABOVE_ZERO, DEGC), metavar="W/M2 DEGC", help="Correct to these conditions, by IEC 60891.")
@click.option(
    "--procedure", type=click.Choice(["1", "2"]), default="2", help="Procedure of IEC 60891:2021; 2 by default."
)
@click.option(
    "--alpha",
    type=FINITE,
    default=0.0,
    metavar="CHANGE",
    help="Temperature coefficient of the current: A/K for procedure 1, 1/K for 2.",
)
@click.option(
    "--beta",
    type=FINITE,
    default=0.0,
    metavar="CHANGE",
    help="Temperature coefficient of the voltage: V/K for procedure 1, 1/K for 2.",
)
@click.option("--resistance", type=ZERO_OR_MORE, default=0.0, metavar="OHM", help="Internal series resistance.")
@click.option("--kappa", type=FINITE, default=0.0, metavar="OHM/K", help="Curve correction factor.")
@click.option("--light", type=FINITE, default=0.0, metavar="B1", help="Relative change of voltage over ln(irradiance).")
@click.option("--nominal-voltage", type=ABOVE_ZERO, metavar="V", help="Open-circuit voltage from the data sheet.")
@click.option("--nominal-current", type=ABOVE_ZERO, metavar="A", help="Short-circuit current from the data sheet.")
@plot_option("current and power")
@click.option("--export", type=click.Path(path_type=Path), metavar="FILE", help="Write the corrected points as CSV.")
@JSON
def solar(*, file: Path, plot: Path | None, export: Path | None, as_json: bool, **asked: Any) -> int:  # noqa: ANN401
    """Find short-circuit current, open-circuit voltage, maximum power and resistances of the curve in FILE.

    Uncertainties come from the scatter alone: they include no calibration of the instruments, and coefficients are
    taken as exact. If a gate trips, nothing is exported, and the exit code is 1.

    \b
    Example:
      hil analyse solar docs/data/solar-panel-simulated.csv --voltage 1 --voltage-unit V --current 2 --current-unit A
    """  # noqa: D301 - click reads \b
    from hil.analysis.solar.curve import IvSweep, iv_curve  # noqa: PLC0415 - start-up stays light
    from hil.analysis.solar.gates import IvFacts  # noqa: PLC0415 - start-up stays light
    from hil.analysis.tables import Column, as_csv  # noqa: PLC0415 - start-up stays light

    measured, gates, remarks = _read(file, asked)
    facts = IvFacts(current=asked["nominal_current"], voltage=asked["nominal_voltage"])
    try:
        curve = iv_curve(IvSweep(**measured), _conditions(asked), facts)
    except ValueError as error:
        raise Refused(f"{file}: {error}", "choose other columns") from None
    gates = (*gates, *(each for each in curve.gates if asked["irradiance"] or each.channel != "irradiance"))
    doubted = any(gate.ok is False for gate in gates)
    if not doubted:
        columns = (Column("voltage", "V", ".6g"), Column("current", "A", ".6g"))
        write_exports((export, as_csv(columns, zip(curve.voltage.tolist(), curve.current.tolist(), strict=True))))
    if plot is not None:
        _draw(plot, curve, measured, asked["to"])
    said = f"{file}: {len(curve.voltage)} points" + (
        ", corrected to {:g} W/m^2 and {:g} degC by procedure ".format(*asked["to"]) + asked["procedure"]
        if asked["to"]
        else ", not corrected"
    )
    if as_json:
        click.echo(_as_json(str(file), asked, curve, gates, remarks))
    else:
        click.echo("\n".join(_lines(said, curve, gates, remarks)))
    return int(doubted)


def _read(file: Path, asked: Mapping[str, Any]) -> tuple[_Columns, tuple[Gate, ...], tuple[str, ...]]:
    """Return the points in V, A, W/m^2 and degC, and gates about the columns' names; what is not known is 1."""
    import numpy as np  # noqa: PLC0415 - start-up stays light

    from hil.logs.columns import read  # noqa: PLC0415 - start-up stays light
    from hil.requirements.units import convert  # noqa: PLC0415 - slow to import

    if asked["to"] and not (asked["irradiance"] and asked["temperature"]):
        raise Refused("--to needs what the curve was measured at", "give --irradiance and --temperature, too")
    idle = [name for name in _COEFFICIENTS if asked[name] and not asked["to"]]
    if idle:
        raise Refused(
            f"--{idle[0]} corrects the curve, but the target conditions are missing", "give --to, or leave it out"
        )
    given = [name for name in _UNITS if asked[name]]
    table = read(file, [asked[name] for name in given])
    found = {name: np.ones(len(table.values)) for name in _UNITS}
    gates: list[Gate] = []
    for place, name in enumerate(given):
        unit = asked.get(f"{name}_unit") or _UNITS[name]
        gates += named_units(table.names[place : place + 1], unit)
        try:
            factor = 1.0 if name == "temperature" else convert(1.0, unit, _UNITS[name])
        except HilError as error:
            raise Refused(f"--{name}-unit: {error.message}", f"give a unit of {_UNITS[name]}") from None
        found[name] = np.ascontiguousarray(table.values[:, place]) * factor
        refuse_extremes(file, table.names[place], found[name])
    return found, tuple(gates), table.remarks


def _conditions(asked: Mapping[str, Any]) -> IvConditions | None:
    from hil.analysis.solar.correction import IvConditions  # noqa: PLC0415 - start-up stays light
    from hil.model.figure import Figure  # noqa: PLC0415 - start-up stays light

    if not asked["to"]:
        return None
    told = {name: Figure(value=asked[name], unit=unit, uncertainty=0.0) for name, unit in _COEFFICIENTS.items()}
    irradiance, temperature = asked["to"]
    procedure: Any = int(asked["procedure"])
    return IvConditions(irradiance=irradiance, temperature=temperature, procedure=procedure, **told)


def _as_json(
    file: str, asked: Mapping[str, Any], curve: IvCurve, gates: tuple[Gate, ...], remarks: tuple[str, ...]
) -> str:
    from hil.model.figure import encoded  # noqa: PLC0415 - start-up stays light

    document = {
        "format": 1,
        "file": file,
        "points": len(curve.voltage),
        "status": INCONCLUSIVE if any(gate.ok is False for gate in gates) else "conclusive",
        "reasons": [str(gate) for gate in gates if gate.ok is False],
        "gates": gates_as_json(gates),
        "remarks": list(remarks),
        "corrected_to": list(asked["to"]) if asked["to"] else None,
        "procedure": int(asked["procedure"]) if asked["to"] else None,
        **{name: encoded(figure) for name, figure in curve.figures.items()},
        "reach": encoded(curve.reach),
        "extrapolated": encoded(curve.extrapolated),
    }
    return json.dumps(document, allow_nan=False, indent=2)


def _lines(said: str, curve: IvCurve, gates: tuple[Gate, ...], remarks: tuple[str, ...]) -> list[str]:
    from hil.cli.analyses.allan_text import stated  # noqa: PLC0415 - start-up stays light
    from hil.documents.text import fitting  # noqa: PLC0415 - start-up stays light
    from hil.report.tables import aligned  # noqa: PLC0415 - start-up stays light

    doubts = [f"INCONCLUSIVE: {gate}; nothing is exported" for gate in gates if gate.ok is False]
    lines = [said, *fitting([*doubts, *(f"note: {remark}" for remark in remarks)], 80), ""]
    rows = [(name.replace("_", " "), stated(figure)) for name, figure in curve.figures.items()]
    lines += aligned(rows, indent="  ")
    if math.isfinite(curve.reach):
        lines += ["", f"extrapolated to short circuit: {max(curve.reach, 0.0):.1%} of the open-circuit voltage"]
    return lines


def _draw(path: Path, curve: IvCurve, measured: _Columns, to: tuple[float, float] | None) -> None:
    from matplotlib.figure import Figure  # noqa: PLC0415 - slow to import

    from hil.cli.analyses.plots import COLOURS, save  # noqa: PLC0415 - slow to import

    def drawn() -> Figure:
        figure = Figure(figsize=(7.0, 7.0), dpi=120, layout="constrained")
        panels = figure.subplots(2, 1, sharex=True)
        shown = "corrected to {:g} W/m^2, {:g} degC".format(*to) if to else "used"
        volts, amperes = (curve.figures[f"{name}_at_maximum"].value for name in ("voltage", "current"))
        for axes, powered in zip(panels, (0, 1), strict=True):
            for voltage, current, mark, colour, label in (
                (measured["voltage"], measured["current"], "x", COLOURS[1], "measured"),
                (curve.voltage, curve.current, ".-", COLOURS[0], shown),
                (volts, amperes, "o", COLOURS[2], "maximum power"),
            ):
                axes.plot(voltage, current * voltage**powered, mark, color=colour, markersize=4, label=label)
            axes.grid(visible=True, color="#dddddd", linewidth=0.5)
        panels[0].set_ylabel("current [A]")
        panels[0].legend()
        panels[1].set(xlabel="voltage [V]", ylabel="power [W]")
        return figure

    save(path, drawn)
