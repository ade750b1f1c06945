"""`hil analyse battery`: capacity, energy, efficiency and fade of a cell from the log of its cycles."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click

from hil.cli.analyses.log import time_unit_option
from hil.model.errors import Refused

if TYPE_CHECKING:
    from hil.analysis.battery.series import Series
    from hil.analysis.battery.steps import Segmentation
    from hil.analysis.battery.summary import Summary
    from hil.logs.battery import BatteryLog

__all__ = ["battery"]


class _Mapping(NamedTuple):
    """Which columns of a table hold what, by number or name."""

    time: str | None
    time_unit: str | None
    voltage: str | None
    current: str | None
    temperature: str | None
    cycle: str | None


@click.command("battery")
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--format", "form", type=click.Choice(["auto", "novonix", "cycler", "table"]), default="auto", show_default=True,
    help="Who wrote the log.",
)  # fmt: skip
@click.option("--time", metavar="COLUMN", help="Column of the time since the test began, in a table.")
@time_unit_option
@click.option("--voltage", metavar="COLUMN", help="Column of the voltage in V, in a table.")
@click.option("--current", metavar="COLUMN", help="Column of the current in A, in a table.")
@click.option("--temperature", metavar="COLUMN", help="Column of the temperature in degC, in a table.")
@click.option("--cycle", metavar="COLUMN", help="Column of the cycle number, in a table.")
@click.option("--discharge-positive", is_flag=True, help="The log counts discharge current as positive.")
@click.option(
    "--interval", type=float, default=5.0, show_default=True, metavar="S", help="Between two rows of a cycler's log."
)
@click.option(
    "--upper", type=float, default=4.2, show_default=True, metavar="V", help="Voltage at which a charge ends."
)
@click.option(
    "--lower", type=float, default=2.7, show_default=True, metavar="V", help="Voltage at which a discharge ends."
)
@click.option("--cut-off", type=float, default=0.05, show_default=True, metavar="A", help="Current that ends a charge.")
@click.option("--capacity", type=float, metavar="AH", help="Nominal capacity.")
@click.option("--energy", type=float, metavar="WH", help="Nominal energy.")
@click.option(
    "--mean-voltage",
    default="3.4,3.95",
    show_default=True,
    metavar="V,V",
    help="Range in which this chemistry's mean voltage lies.",
)
@click.option(
    "--rest-current",
    type=float,
    metavar="A",
    help="Below it the cell rests; default: 1 % of the largest usual current.",
)
@click.option(
    "--counted", type=int, metavar="N", help="Cycles that somebody counted, checked against the elapsed time."
)
@click.option(
    "--skip", type=int, default=0, show_default=True, metavar="N", help="Leave the first N cycles out of the fade."
)
@click.option(
    "--remaining",
    type=float,
    default=0.8,
    show_default=True,
    metavar="PART",
    help="Part of the capacity that is left at end of life.",
)
@click.option("--plot", type=click.Path(path_type=Path), metavar="FILE", help="Draw the test: .svg or .png.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document and nothing else.")
def battery(  # noqa: PLR0913 - one argument per option
    *,
    file: Path,
    form: str,
    time: str | None,
    time_unit: str | None,
    voltage: str | None,
    current: str | None,
    temperature: str | None,
    cycle: str | None,
    discharge_positive: bool,
    interval: float,
    upper: float,
    lower: float,
    cut_off: float,
    capacity: float | None,
    energy: float | None,
    mean_voltage: str,
    rest_current: float | None,
    counted: int | None,
    skip: int,
    remaining: float,
    plot: Path | None,
    as_json: bool,
) -> int:
    """Compute capacity, energy, efficiency and fade of a cell from the log of its cycles in FILE.

    Novonix files and terminal logs of a cycler (voltage;current;energy;temperature) are recognised; any
    other table needs its columns named. Gates show what casts doubt on the numbers; the exit code is then 1.

    \b
    Examples:
      hil analyse battery docs/data/battery-novonix.csv --upper 4.2 --lower 2.5
      hil analyse battery test.csv --time 1 --time-unit h --voltage U --current I --capacity 1.4
    """  # noqa: D301 - click reads \b
    from hil.analysis.battery.gates import Declared  # noqa: PLC0415 - start-up stays light
    from hil.analysis.battery.half_cycle import Limits  # noqa: PLC0415 - start-up stays light
    from hil.analysis.battery.steps import Segmentation  # noqa: PLC0415 - start-up stays light
    from hil.analysis.battery.summary import summarise  # noqa: PLC0415 - start-up stays light
    from hil.cli.analyses import battery_text  # noqa: PLC0415 - start-up stays light

    positive = {"--interval": interval, "--capacity": capacity, "--energy": energy, "--cut-off": cut_off}
    _refuse_impossible(
        positive=positive | {"--rest-current": rest_current},
        upper=upper, lower=lower, skip=skip, counted=counted, remaining=remaining,
    )  # fmt: skip
    columns = _Mapping(time, time_unit, voltage, current, temperature, cycle)
    log = _charging_positive(_read(file, form, columns, interval), discharge_positive=discharge_positive)
    data = _series(file, log)
    how = Segmentation(rest_current=rest_current)
    capacity = log.capacity if capacity is None else capacity
    summary = summarise(
        data,
        limits=Limits(upper=upper, lower=lower, cut_off=cut_off),
        declared=Declared(capacity=capacity, energy=energy, mean_voltage=_span_of(mean_voltage)),
        how=how, skip=skip, remaining=remaining, counted=counted,
    )  # fmt: skip
    _draw(plot, data, summary, how)
    result = battery_text.Result(file=str(file), log=log, data=data, summary=summary, capacity=capacity, how=how)
    click.echo(battery_text.as_json(result) if as_json else battery_text.as_text(result))
    return int(any(gate.ok is False for gate in summary.gates))


def _draw(plot: Path | None, data: Series, summary: Summary, how: Segmentation) -> None:
    if plot is not None:
        from hil.cli.analyses.plots import draw_battery  # noqa: PLC0415 - matplotlib is slow to import

        draw_battery(plot, data, summary, how)


def _refuse_impossible(
    *,
    positive: dict[str, float | None],
    upper: float,
    lower: float,
    skip: int,
    counted: int | None,
    remaining: float,
) -> None:
    """Refuse options that contradict each other or physics.

    Args:
        positive: by name of the option, values that have to be above zero; None where one was not given.
        upper: end of charge, in V.
        lower: end of discharge, in V.
        skip: cycles that the fade leaves out.
        counted: cycles that somebody counted.
        remaining: part that is left at the end of life.

    Raises:
        Refused: the first that is not possible.
    """
    for name, value in positive.items():
        if value is not None and not 0.0 < value < math.inf:
            raise Refused(f"{name} {value:g} is not possible", "give a number above zero")
    if not 0.0 <= lower < upper < math.inf:
        raise Refused(
            f"--upper {upper:g} and --lower {lower:g} are no range",
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
        raise Refused(f"--mean-voltage {text} is no range", "give two voltages as 3.4,3.95") from None
    if not 0.0 < low < high < math.inf:
        raise Refused(f"--mean-voltage {text} is no range", "give the lower voltage first, as 3.4,3.95")
    return low, high


def _read(file: Path, form: str, columns: _Mapping, interval: float) -> BatteryLog:
    from hil.logs import battery as logs  # noqa: PLC0415 - start-up stays light
    from hil.logs import cycler, novonix  # noqa: PLC0415 - start-up stays light

    named = (columns.time, columns.voltage, columns.current)
    if form == "auto":
        form = "table" if any(named) else logs.made_by(logs.lines_of(file))
    if form == "novonix":
        return novonix.read(file)
    if form == "cycler":
        return cycler.read(file, interval=interval)
    return _table(file, columns)


def _table(file: Path, columns: _Mapping) -> BatteryLog:
    from hil.analysis.timeline import TIME_UNITS, time_unit, unwrapped  # noqa: PLC0415 - start-up stays light
    from hil.logs import battery as logs  # noqa: PLC0415 - start-up stays light
    from hil.logs.columns import read  # noqa: PLC0415 - start-up stays light

    if columns.time is None or columns.voltage is None or columns.current is None:
        name = "name them with --time, --voltage and --current, by number or name"
        if logs.holds_rows_of_cycler(logs.lines_of(file)):
            name += "; or read voltage;current;accumulated energy;temperature of a cycler with --format cycler"
        raise Refused(f"{file}: which columns hold time, voltage and current is not known", name)
    wanted = [columns.time, columns.voltage, columns.current]
    others = [column for column in (columns.temperature, columns.cycle) if column is not None]
    table = read(file, [*wanted[1:], *others], first=columns.time, clock=True)
    unit, told = time_unit(columns.time_unit, table.names[0], table.values[:, 0])
    time, continued = unwrapped(table.values[:, 0])
    rest = iter(table.values.T[len(wanted) :])
    return logs.BatteryLog(
        maker="table",
        time=time * TIME_UNITS[unit],
        voltage=table.values[:, 1],
        current=table.values[:, 2],
        temperature=None if columns.temperature is None else next(rest),
        cycle=None if columns.cycle is None else next(rest),
        remarks=(*table.remarks, *((told,) if told else ()), *continued),
    )


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
