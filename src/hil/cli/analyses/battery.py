"""`hil analyse battery`: capacity, energy, efficiency and fade of a cell from the log of its cycles."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hil.cli.analyses.wanted import time_unit_option
from hil.cli.options import JSON, plot_option
from hil.model.errors import Refused

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from hil.analysis.battery.half_cycle import Limits
    from hil.analysis.battery.series import Series
    from hil.analysis.battery.steps import Segmentation
    from hil.analysis.battery.summary import Summary
    from hil.logs.battery import BatteryLog
    from hil.logs.mapping import Cell, Mapped, Mapping

__all__ = ["battery"]

_UPPER, _LOWER, _CUT_OFF = 4.2, 2.7, 0.05  # V, V, A


@click.command("battery", short_help="Compute capacity, energy and fade of a cell.")
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--format", "form", type=click.Choice(["auto", "novonix", "cycler", "table"]), default="auto", show_default=True,
    help="Format of the log.",
)  # fmt: skip
@click.option(
    "--mapping", type=click.Path(path_type=Path), metavar="YAML", help="Mapping file: what the columns of a table hold."
)
@click.option("--time", metavar="COLUMN", help="Column of the time since the test began, in a table.")
@time_unit_option
@click.option("--voltage", metavar="COLUMN", help="Column of the voltage, in a table.")
@click.option(
    "--voltage-unit",
    type=click.Choice(["V", "mV"]),
    help="Unit of the voltage; V, unless the column's name says otherwise.",
)
@click.option("--current", metavar="COLUMN", help="Column of the current, in a table.")
@click.option(
    "--current-unit",
    type=click.Choice(["A", "mA", "uA"]),
    help="Unit of the current; A, unless the column's name says otherwise.",
)
@click.option("--temperature", metavar="COLUMN", help="Column of the temperature in degC, in a table.")
@click.option("--cycle", metavar="COLUMN", help="Column of the cycle number, in a table.")
@click.option(
    "--time-restarts",
    type=click.Choice(["step", "run"]),
    help="Time restarts at zero with each step, or with each run after an unknown pause.",
)
@click.option("--discharge-positive", is_flag=True, help="Discharge current is positive in the log.")
@click.option(
    "--interval", type=float, default=5.0, show_default=True, metavar="S", help="Logging interval of a cycler."
)
@click.option("--upper", type=float, metavar="V", help="Voltage at which a charge ends; 4.2 by default.")
@click.option("--lower", type=float, metavar="V", help="Voltage at which a discharge ends; 2.7 by default.")
@click.option("--cut-off", type=float, metavar="A", help="Current at which a charge ends; 0.05 by default.")
@click.option(
    "--current-gain", type=float, metavar="FRACTION", help="Bound on the gain error of the current; 0.001 is 0.1 %."
)
@click.option("--current-offset", type=float, metavar="A", help="Bound on the offset of the current.")
@click.option("--capacity", type=float, metavar="AH", help="Nominal capacity.")
@click.option("--energy", type=float, metavar="WH", help="Nominal energy.")
@click.option(
    "--mean-voltage",
    default="3.4,3.95",
    show_default=True,
    metavar="V,V",
    help="Range of mean voltages for this chemistry.",
)
@click.option(
    "--rest-current",
    type=float,
    metavar="A",
    help="Current below which the cell is at rest; by default 1 % of the largest usual current.",
)
@click.option(
    "--counted", type=int, metavar="N", help="Number of cycles counted by hand, checked against the elapsed time."
)
@click.option(
    "--skip", type=int, default=0, show_default=True, metavar="N", help="Leave the first N cycles out of the fade."
)
@click.option(
    "--remaining",
    type=float,
    default=0.8,
    show_default=True,
    metavar="FRACTION",
    help="Fraction of the initial value at which life ends.",
)
@plot_option("the test")
@JSON
def battery(  # noqa: PLR0913 - one argument per option
    *,
    file: Path,
    form: str,
    mapping: Path | None,
    interval: float,
    mean_voltage: str,
    rest_current: float | None,
    counted: int | None,
    skip: int,
    remaining: float,
    plot: Path | None,
    as_json: bool,
    **told: Any,  # noqa: ANN401 - what stands in the place of something in the mapping, of many types
) -> int:
    """Compute capacity, energy, efficiency and fade of a cell from the log of its cycles in FILE.

    Novonix files and terminal logs of a cycler (voltage;current;energy;temperature) are detected; any other table
    needs its columns named. Gates show what casts doubt on the numbers; if one trips, the exit code is 1.

    \b
    Examples:
      hil analyse battery docs/data/battery-novonix.csv --upper 4.2 --lower 2.5
      hil analyse battery test.csv --time 1 --time-unit h --voltage U --current I --capacity 1.4
    """  # noqa: D301 - click reads \b
    from hil.analysis.battery.gates import Declared  # noqa: PLC0415 - start-up stays light
    from hil.analysis.battery.singles import judge_states  # noqa: PLC0415 - start-up stays light
    from hil.analysis.battery.steps import Segmentation  # noqa: PLC0415 - start-up stays light
    from hil.analysis.battery.summary import summarise  # noqa: PLC0415 - start-up stays light
    from hil.cli.analyses import battery_text  # noqa: PLC0415 - start-up stays light

    read = _understood(mapping, told)
    known = read.cell
    limits = _limits(known)
    positive = {"--interval": interval, "--capacity": known.capacity, "--energy": known.energy}
    positive |= {"--cut-off": known.cut_off, "--rest-current": rest_current}
    _refuse_impossible(positive=positive, limits=limits, skip=skip, counted=counted, remaining=remaining)
    log = _read(file, form, read, interval, named=str(mapping or "the mapping"))
    data = _series(file, log)
    how = Segmentation(rest_current=rest_current)
    capacity = log.capacity if known.capacity is None else known.capacity
    summary = summarise(
        data,
        limits=limits,
        declared=Declared(
            capacity=capacity, energy=known.energy, mean_voltage=_span_of(mean_voltage),
            runs=read.time_restarts == "run",
        ),
        how=how, skip=skip, remaining=remaining, counted=counted,
    )  # fmt: skip
    summary = replace(summary, gates=(*summary.gates, judge_states(log.contradicted)))
    _draw(plot, data, summary, how)
    result = battery_text.Result(
        file=str(file), log=log, data=data, summary=summary, capacity=capacity, how=how, accuracy=read.accuracy
    )
    click.echo(battery_text.as_json(result) if as_json else battery_text.as_text(result))
    return int(any(gate.ok is False for gate in summary.gates))


def _draw(plot: Path | None, data: Series, summary: Summary, how: Segmentation) -> None:
    if plot is not None:
        from hil.cli.analyses.plots import draw_battery  # noqa: PLC0415 - matplotlib is slow to import

        draw_battery(plot, data, summary, how)


def _limits(known: Cell) -> Limits:
    from hil.analysis.battery.half_cycle import Limits  # noqa: PLC0415 - start-up stays light

    return Limits(
        upper=_UPPER if known.upper is None else known.upper,
        lower=_LOWER if known.lower is None else known.lower,
        cut_off=_CUT_OFF if known.cut_off is None else known.cut_off,
    )


def _refuse_impossible(
    *,
    positive: dict[str, float | None],
    limits: Limits,
    skip: int,
    counted: int | None,
    remaining: float,
) -> None:
    """Refuse options that contradict each other or physics.

    Args:
        positive: by name of the option, values that have to be above zero; None where one was not given.
        limits: of the test.
        skip: cycles that the fade leaves out.
        counted: cycles counted by hand.
        remaining: fraction left at end of life.

    Raises:
        Refused: the first that is not possible.
    """
    for name, value in positive.items():
        if value is not None and not 0.0 < value < math.inf:
            raise Refused(f"{name} {value:g} is not possible", "give a number above zero")
    upper, lower = limits.upper or 0.0, limits.lower or 0.0
    if not 0.0 <= lower < upper < math.inf:
        raise Refused(
            f"--upper {upper:g} and --lower {lower:g} do not form a range",
            "give the higher voltage in V, at which a charge ends, as --upper",
        )
    if skip < 0:
        raise Refused(f"--skip {skip} is not possible", "give how many of the first cycles the fade leaves out, or 0")
    if counted is not None and counted < 1:
        raise Refused(f"--counted {counted} is not possible", "give how many cycles somebody counted")
    if not 0.0 < remaining < 1.0:
        raise Refused(f"--remaining {remaining:g} is not possible", "give a part between 0 and 1, such as 0.8")


def _span_of(text: str) -> tuple[float, float]:
    """Return the range of mean voltages that `--mean-voltage` gives, in V.

    Raises:
        Refused: not two numbers, or not the lower one first.
    """
    try:
        low, high = map(float, text.split(","))
    except ValueError:
        raise Refused(f"--mean-voltage {text} is not a range", "give two voltages as 3.4,3.95") from None
    if not 0.0 < low < high < math.inf:
        raise Refused(f"--mean-voltage {text} is not a range", "give the lower voltage first, as 3.4,3.95")
    return low, high


def _understood(file: Path | None, told: dict[str, Any]) -> Mapping:
    """Return a mapping, or an empty one, overridden by options."""
    from hil.logs import mapping as logs  # noqa: PLC0415 - start-up stays light

    columns = {name: told[name] for name in ("time", "voltage", "current", "temperature", "cycle")}
    units = {name: told[f"{name}_unit"] for name in ("time", "voltage", "current")}
    cell = {name: told[name] for name in ("capacity", "energy", "upper", "lower", "cut_off")}
    accuracy = {name: told[name] for name in ("current_gain", "current_offset")}
    for name, value in accuracy.items():
        if value is not None and not 0.0 <= value < math.inf:
            raise Refused(f"--{name.replace('_', '-')} {value:g} is not possible", "give a bound of zero or more")
    made: Mapping = _overridden(
        logs.load(file) if file else logs.Mapping(),
        columns=columns, units=units, cell=cell, accuracy=accuracy, time_restarts=told["time_restarts"],
        discharge_positive=told["discharge_positive"] or None,
    )  # fmt: skip
    return made


def _overridden(mapping: Any, **told: Any) -> Any:  # noqa: ANN401 - a mapping, or a part of one
    """Return a mapping, or a part of one, with what options say in place of its own; of a part, a mapping of these."""
    given = {
        name: _overridden(getattr(mapping, name), **value) if isinstance(value, dict) else value
        for name, value in told.items()
        if value is not None
    }
    return replace(mapping, **given)


def _read(file: Path, form: str, mapping: Mapping, interval: float, *, named: str) -> BatteryLog:
    from hil.logs import battery as logs  # noqa: PLC0415 - start-up stays light
    from hil.logs import cycler, novonix  # noqa: PLC0415 - start-up stays light

    columns = mapping.columns
    if form == "auto":
        form = "table" if any((columns.time, columns.voltage, columns.current)) else logs.made_by(logs.lines_of(file))
    if form == "table":
        return _table(file, mapping, named)
    found = novonix.read(file) if form == "novonix" else cycler.read(file, interval=interval)
    return _charging_positive(found, discharge_positive=mapping.discharge_positive)


def _table(file: Path, mapping: Mapping, named: str) -> BatteryLog:
    from hil.logs import battery as logs  # noqa: PLC0415 - start-up stays light
    from hil.logs.mapping import read  # noqa: PLC0415 - start-up stays light

    columns = mapping.columns
    if not (columns.time and columns.voltage and columns.current):
        name = "name them with --time, --voltage and --current, by number or name, or in a --mapping"
        if logs.holds_rows_of_cycler(logs.lines_of(file)):
            name += "; or read voltage;current;accumulated energy;temperature of a cycler with --format cycler"
        raise Refused(f"{file}: which columns hold time, voltage and current is not known", name)
    table = read(file, mapping, named=named)
    time, stretch, told = _timed(file, mapping, table)
    charge, own_charge = table.counted("charge", time)
    energy, own_energy = table.counted("energy", time)
    for name, found in (("charge", charge), ("energy", energy)):
        if found is None and getattr(columns, "charge" if name == "charge" else "charge_energy"):
            told = (*told, f"the counter of {name} never moves: left out")
    return logs.BatteryLog(
        maker="table",
        time=time,
        voltage=table.columns["voltage"],
        current=table.columns["current"],
        temperature=table.columns.get("temperature"),
        cycle=table.columns.get("cycle"),
        own_charge=own_charge,
        own_energy=own_energy,
        charge=charge,
        energy=energy,
        stretch=stretch,
        remarks=(*table.remarks, *told),
        contradicted=table.contradicted if columns.state else None,
    )


def _timed(
    file: Path, mapping: Mapping, table: Mapped
) -> tuple[NDArray[np.float64], NDArray[np.int64] | None, tuple[str, ...]]:
    """Return the time of a table in s, the number of each row's stretch, and remarks."""
    import numpy as np  # noqa: PLC0415 - start-up stays light

    from hil.analysis.timeline import TIME_UNITS, time_unit, unwrapped  # noqa: PLC0415 - start-up stays light
    from hil.logs.mapping import restarted  # noqa: PLC0415 - start-up stays light

    column = table.names["time"]
    unit, told = ("s", "") if table.clocked else time_unit(mapping.units.time or None, column, table.time)
    remarks = (told,) if told else ()
    if mapping.time_restarts:
        time, stretch, more = restarted(table.time * TIME_UNITS[unit], mapping.time_restarts, table.columns.get("step"))
        return time, stretch, (*remarks, *more)
    time, more = unwrapped(table.time)
    back = np.flatnonzero(np.diff(time) < 0.0)
    if back.size:
        often = "once" if back.size == 1 else f"{back.size} times"
        first, then = time[back[0] : back[0] + 2].tolist()
        raise Refused(
            f"{file}: the time, column {column}, goes back {often}, first at row {back[0] + 2}, "
            f"from {first:g} to {then:g}",
            "give --time-restarts step if it is the time of a step, --time-restarts run if it is that of a run, "
            "or a time that runs through the whole test",
        )
    return time * TIME_UNITS[unit], None, (*remarks, *more)


def _charging_positive(log: BatteryLog, *, discharge_positive: bool) -> BatteryLog:
    """Return a log whose current and counts are above zero where they charge."""
    if not discharge_positive:
        return log
    return replace(
        log,
        current=-log.current,
        charge=None if log.charge is None else -log.charge,
        energy=None if log.energy is None else -log.energy,
        own_charge=None if log.own_charge is None else -log.own_charge,
        own_energy=None if log.own_energy is None else -log.own_energy,
    )


def _series(file: Path, log: BatteryLog) -> Series:
    from hil.analysis.battery.series import series  # noqa: PLC0415 - start-up stays light

    try:
        return series(
            log.time, log.voltage, log.current,
            temperature=log.temperature, cycle=log.cycle, charge=log.charge, energy=log.energy,
            test=log.test, stretch=log.stretch,
        )  # fmt: skip
    except Refused as error:
        raise Refused(f"{file}: {error.message}", error.hint) from None
