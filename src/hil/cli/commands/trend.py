"""`hil trend`: the checks of one parameter over all runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.cli.options import plot_option
from hil.cli.run_names import reports_folder
from hil.documents.suggest import did_you_mean
from hil.model.errors import Refused

if TYPE_CHECKING:
    from hil.audit.trend import Line, Point, Spread, Trend
    from hil.evidence.runs import RunSummary

__all__ = ["command"]

_HARDWARE = "hardware"
_EXACT = 1e-9  # of a number: a smaller scatter is rounding


@click.command(name="trend", epilog="Example: hil trend noise --requirement JIG-MAG-020 --plot noise.svg")
@click.argument("parameter")
@click.option("--requirement", metavar="ID", help="Only checks of this requirement.")
@click.option("--dut", "duts", metavar="SERIAL", multiple=True, help="Only runs of this unit; can be repeated.")
@click.option("--of", "member", metavar="NAME", help="Only this member of the limit, such as an axis.")
@click.option("--hardware", is_flag=True, help="Leave out runs that were simulated or replayed.")
@click.option("--csv", "as_csv", is_flag=True, help="Print CSV and nothing else.")
@plot_option("the values")
@click.option("--no-cache", is_flag=True, help="Check every package, even those unchanged since the last look.")
def command(
    *,
    parameter: str,
    requirement: str | None,
    duts: tuple[str, ...],
    member: str | None,
    hardware: bool,
    as_csv: bool,
    plot: Path | None,
    no_cache: bool,
) -> int:
    """Compare the checks of one parameter across the sealed runs of the workspace.

    Each check is a row: start and short id of the run, unit under test, value with expanded uncertainty, the limit at
    that time, verdict. A table holds the checks of one requirement, case and member; what all of its rows share is
    printed above it. Below it are mean and standard deviation for each unit, bench and source and, for three or more
    values over at least a day, the slope with its 95 % interval, which assumes independent scatter.

    Packages get only the quick look of hil runs; hil verify is the proof.
    """
    from hil.audit import trend  # noqa: PLC0415 - heavy
    from hil.evidence.index import Index  # noqa: PLC0415 - heavy
    from hil.evidence.runs import find_runs  # noqa: PLC0415 - heavy

    reports = reports_folder()
    runs = find_runs(reports, None if no_cache else Index.of(reports))
    sealed = [run for run in runs if run.verdict]
    asked = [run for run in sealed if (not duts or run.dut in duts) and (not hardware or run.source == _HARDWARE)]
    found = [
        point
        for point in trend.points(asked, parameter, lambda told: click.echo(told, err=True))
        if requirement in {None, point.requirement} and member in {None, point.of}
    ]
    _tell_left_out(runs, sealed)
    if not found:
        raise _nothing(sealed, parameter, requirement=requirement, duts=duts)
    series = trend.trends(found)
    if plot is not None:
        _draw(plot, parameter, series)
    if as_csv:
        click.echo(trend.as_csv(series), nl=False)
    else:
        click.echo("\n".join(_lines(parameter, series)))
    return 0


def _tell_left_out(runs: Sequence[RunSummary], sealed: Sequence[RunSummary]) -> None:
    if left_out := len(runs) - len(sealed):
        click.echo(f"{left_out} of {len(runs)} runs left out: not sealed, or damaged; hil runs shows them", err=True)


def _nothing(sealed: Sequence[RunSummary], parameter: str, *, requirement: str | None, duts: Sequence[str]) -> Refused:
    """Return the refusal for a query without results, with the known values."""
    from hil.audit import trend  # noqa: PLC0415 - heavy

    known = trend.parameters(sealed)
    if not sealed:
        return Refused("there is no sealed run yet", "hil run starts one")
    if parameter not in known:
        there = ", ".join(sorted(known)) or "none"
        return Refused(
            f"no run checked '{parameter}'{did_you_mean(parameter, known)}", f"parameters that were checked: {there}"
        )
    units = sorted({run.dut for run in sealed if run.dut})
    for serial in duts:
        if serial not in units:
            return Refused(
                f"no run tested unit '{serial}'{did_you_mean(serial, units)}", f"tested units: {', '.join(units)}"
            )
    where = f" for {requirement}" if requirement else ""
    return Refused(f"no check of '{parameter}'{where} meets all of these options", "leave one out")


def _lines(parameter: str, found: Sequence[Trend]) -> Iterator[str]:
    for place, each in enumerate(found):
        if place:
            yield ""
        yield from _table(parameter, each)


def _table(parameter: str, found: Trend) -> Iterator[str]:
    """Give the table of a series, 80 columns wide if serial numbers are short; shared values are printed above it."""
    from hil.report.tables import aligned  # noqa: PLC0415 - heavy

    unit = f" [{found.unit}]" if found.unit not in {"", "1"} else ""
    yield f"{found.requirement}  {parameter}{f' of {found.of}' if found.of else ''}{unit}"
    yield f"  {found.case}"
    columns = {name: [cell(point) for point in found.points] for name, cell in _COLUMNS.items()}
    same = [name for name in _MAY_BE_ABOVE if len(set(columns[name])) == 1]
    above = [f"{name} {columns[name][0]}" for name in same if columns[name][0]]
    if above:
        yield f"  {', '.join(above)}"
    shown = {name: cells for name, cells in columns.items() if name not in same}
    yield from aligned(zip(*shown.values(), strict=True), head=tuple(shown), indent="  ")
    yield from _statistics(found)


def _value(point: Point) -> str:
    from hil.report.numbers import measured  # noqa: PLC0415 - heavy

    return measured(point.value, point.expanded, "1")


def _limit(point: Point) -> str:
    import msgspec  # noqa: PLC0415 - heavy

    from hil.report.numbers import limit_text  # noqa: PLC0415 - heavy

    return limit_text(msgspec.structs.asdict(point.limit), "")


_COLUMNS: dict[str, Callable[[Point], str]] = {
    "began": lambda point: point.run.began[:16].replace("T", " "),
    "run": lambda point: point.run.folder.name.rpartition("-")[2],
    "DUT": lambda point: point.run.dut,
    "value": _value,
    "limit": _limit,
    "verdict": lambda point: point.verdict,
    "source": lambda point: point.run.source.upper() if point.run.source != _HARDWARE else _HARDWARE,
    "deviates": lambda point: "deviates" if point.run.deviates else "",
}
_MAY_BE_ABOVE = ("DUT", "limit", "source", "deviates")


def _statistics(found: Trend) -> Iterator[str]:
    """Yield a line for each unit, bench and source."""
    from hil.audit import trend  # noqa: PLC0415 - heavy
    from hil.report.numbers import number  # noqa: PLC0415 - heavy

    groups: dict[tuple[str, str, str], list[Point]] = {}
    for point in found.points:
        if isinstance(point.value, float):
            groups.setdefault((point.run.dut, point.run.bench, point.run.source), []).append(point)
    benches = {bench for _, bench, _ in groups}
    for (dut, bench, source), points in groups.items():
        if len(points) < 2:
            continue
        its = trend.spread([point.value for point in points if isinstance(point.value, float)])
        mark = (f", bench {bench}" if len(benches) > 1 else "") + ("" if source == _HARDWARE else f", {source.upper()}")
        yield f"  {dut}{mark}: n = {its.size}, mean {_mean(its)}, s {number(its.deviation, 2)}"
        if line := trend.line(points):
            yield f"    slope {_slope(line, found.unit)}, {trend.CONFIDENCE:.0%} interval"


def _mean(its: Spread) -> str:
    """Return a mean with the digits that its standard uncertainty, s / sqrt(n), allows."""
    from hil.report.numbers import number, rounded  # noqa: PLC0415 - heavy

    uncertainty = (its.deviation or 0.0) / its.size**0.5
    if uncertainty <= abs(its.mean) * _EXACT:
        return number(its.mean, 5)
    digits, _, exponent = rounded(its.mean, uncertainty)
    return number(its.mean, 5) if exponent else digits


def _slope(line: Line, unit: str) -> str:
    """Return a slope with its unit, and with the digits that its interval allows."""
    from hil.report.numbers import measured  # noqa: PLC0415 - heavy

    reach = (line.high - line.low) / 2
    known = reach if reach > abs(line.slope) * _EXACT else None
    return f"{measured(line.slope, known, {'degC': 'K'}.get(unit, unit))} per day"


def _draw(path: Path, parameter: str, found: Sequence[Trend]) -> None:
    from hil.cli.analyses.plots import draw_trend  # noqa: PLC0415 - heavy

    draw_trend(path, parameter, found)
