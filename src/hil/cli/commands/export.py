"""`hil export`: export the recordings of a package for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.cli.run_names import find_run, shown
from hil.documents.text import counted
from hil.model.errors import Refused

if TYPE_CHECKING:
    from hil.report.export.csv_table import TableFormat
    from hil.report.export.selection import Facts

__all__ = ["command"]

_SEPARATORS = {",": ",", ";": ";", "tab": "\t"}


@click.command(name="export", epilog="Example: hil export reports/reference --csv --output /tmp/reference-export")
@click.argument("run", metavar="RUN")
@click.option("--csv", "as_csv", is_flag=True, help="Write text tables.")
@click.option("--mat", "as_mat", is_flag=True, help="Write MATLAB 5 files.")
@click.option(
    "--recording",
    "recordings",
    metavar="NAME",
    multiple=True,
    help="Only this recording, by name or id; can be repeated.",
)
@click.option("--case", "cases", metavar="CASE", multiple=True, help="Only recordings of this case; can be repeated.")
@click.option("--separator", type=click.Choice([*_SEPARATORS]), help="Column separator of a table; ',' by default.")
@click.option("--decimal", type=click.Choice([".", ","]), help="Decimal mark of a table; '.' by default.")
@click.option(
    "--facts",
    type=click.Choice(["beside", "above"]),
    help="Facts in a JSON file beside the table, or above it in # lines.",
)
@click.option("--compress", is_flag=True, help="Compress MATLAB files.")
@click.option(
    "--output",
    type=click.Path(path_type=Path),
    metavar="DIRECTORY",
    help="Folder for the files; ./RUN-export by default.",
)
def command(  # noqa: PLR0913, PLR0917 - one argument per option
    run: str,
    as_csv: bool,
    as_mat: bool,
    recordings: tuple[str, ...],
    cases: tuple[str, ...],
    separator: str | None,
    decimal: str | None,
    facts: str | None,
    compress: bool,
    output: Path | None,
) -> None:
    """Write the recordings of a sealed package as text tables or MATLAB files.

    The package is verified first, and each export names its evidence digest. Nothing is overwritten. The last
    line of standard output is the folder.
    """
    from hil.report.export.package import ExportRequest, export_package  # noqa: PLC0415 - heavy

    if not (as_csv or as_mat):
        raise Refused("no format is given", "add --csv or --mat")
    if not as_csv and (separator or decimal or facts):
        raise Refused("--separator, --decimal and --facts apply to text tables only", "add --csv, or leave them out")
    if compress and not as_mat:
        raise Refused("--compress applies to MATLAB files only", "add --mat, or leave it out")
    if output is not None and not output.name:
        raise Refused("--output names no folder of its own", "name a new one")
    folder = find_run(run)
    place = Path.cwd() / (output or f"{folder.name}-export")
    request = ExportRequest(
        output=place,
        recordings=recordings,
        cases=cases,
        table=_table(separator, decimal, facts) if as_csv else None,
        mat=as_mat,
        compressed=compress,
    )
    for exported in export_package(folder, request):
        click.echo(f"{', '.join(exported.files)}: {_told(exported.facts)}")
    click.echo(shown(place))


def _table(separator: str | None, decimal: str | None, facts: str | None) -> TableFormat:
    from hil.report.export.csv_table import TableFormat  # noqa: PLC0415 - heavy

    return TableFormat(separator=_SEPARATORS[separator or ","], decimal=decimal or ".", commented=facts == "above")


def _told(facts: Facts) -> str:
    rows = facts["rows"]
    return f"{counted(rows, 'row')}{'' if facts['complete'] else ', INCOMPLETE'}"
