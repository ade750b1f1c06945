"""`hil select`: which of several sensors is best by which criterion, from their packages."""

from __future__ import annotations

import hashlib
from collections.abc import Container, Iterator, Sequence
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.cli.display import write_bytes
from hil.cli.run_names import find_run
from hil.cli.written import write_whole_file
from hil.documents.text import visible
from hil.model.errors import Refused

if TYPE_CHECKING:
    from hil.selection.document import Cell, Document

__all__ = ["command"]

_FORMATS = ("csv", "html", "json")
_WIDTH = 100


@click.command(
    name="select", epilog="\b\nExample: hil select testplans/imu_selection.yaml --format html --output build"
)
@click.argument("criteria", metavar="CRITERIA", type=click.Path(path_type=Path))
@click.argument("runs", metavar="[RUN]...", nargs=-1)
@click.option(
    "--format",
    "formats",
    multiple=True,
    type=click.Choice(_FORMATS),
    help="Write a file in this format; can be repeated.",
)
@click.option("--output", metavar="DIR", type=click.Path(path_type=Path), help="Folder for the files.")
def command(criteria: Path, runs: tuple[str, ...], formats: tuple[str, ...], output: Path | None) -> int:
    """Select the best of several sensors from their packages.

    CRITERIA is a YAML file that names the candidates and the criteria: a parameter with its unit and axes. The smallest
    magnitude is the best. Without RUN, every package of the workspace that has such figures takes part.

    Each package is verified first. Figures do not count if their package fails verification, or if they are
    INCONCLUSIVE, in doubt, not measured, aliased, in a unit that does not convert, or measured for another revision of
    their requirement; each is listed with the reason. Candidates that cannot be told apart share a place.

    Exit code 0; 1 if a package fails verification, or a candidate could not be judged in a criterion.
    """
    if output is None and len(formats) > 1:
        raise Refused(f"{len(formats)} formats cannot go to standard output together", "add --output DIR")
    document = _document(criteria, runs)
    if formats:
        _write(document, formats, output)
    if not formats or output:
        for line in _lines(document):
            click.echo(visible(line))
    whole = all(each.digest for each in document.packages) and not any(cell.unjudged for cell in document.cells)
    return 0 if whole else 1


def _document(file: Path, runs: Sequence[str]) -> Document:
    from hil.evidence.runs import run_folders  # noqa: PLC0415 - heavy
    from hil.selection.choosing import choose  # noqa: PLC0415 - heavy
    from hil.selection.criteria import load_criteria  # noqa: PLC0415 - heavy
    from hil.selection.figures import gives, read_input  # noqa: PLC0415 - heavy

    criteria = load_criteria(file, str(file))
    given = [find_run(each).resolve() for each in runs]
    reports = _reports(needed=not runs)
    inside = run_folders(reports) if reports else []
    known = [each for each in inside if gives(each, criteria.wanted)]
    if not (given or known):
        asked = sorted({each.parameter for each in criteria.criteria})
        raise Refused(
            f"no package of the workspace has figures of {', '.join(asked)}",
            "hil run makes packages; name the runs to compare, if they are elsewhere",
        )
    inputs = [read_input(each, criteria.wanted) for each in given or known]
    taken = {each.name for each in given or known} | {each.run for each in inputs}
    return choose(
        criteria,
        inputs,
        content=hashlib.sha256(file.read_bytes()).hexdigest(),
        version=metadata.version("hil"),
        left_out=sorted({each.name for each in known} - taken),
        missing=_missing(reports, {each.bench for each in inputs}, taken | {each.name for each in inside}),
    )


def _reports(*, needed: bool) -> Path | None:
    """Return the folder of reports of the workspace; outside of all workspaces None, unless it is needed."""
    from hil.executive.setup.workspace import find_workspace  # noqa: PLC0415 - heavy

    try:
        return find_workspace(Path.cwd()).reports
    except Refused:
        if needed:
            raise
        return None


def _missing(reports: Path | None, benches: Container[str], there: Container[str]) -> list[str]:
    """Return the runs on these benches that the ledger names but that are missing."""
    from hil.evidence.ledger.book import read  # noqa: PLC0415 - heavy
    from hil.evidence.ledger.entries import Sealed  # noqa: PLC0415 - heavy

    sealed = read(reports).of(Sealed) if reports else ()
    return sorted({each.run for each in sealed if each.bench in benches and each.run not in there})


def _write(document: Document, formats: Sequence[str], output: Path | None) -> None:
    from hil.selection.page import as_html  # noqa: PLC0415 - heavy
    from hil.selection.tables import as_csv, as_json  # noqa: PLC0415 - heavy

    for each in dict.fromkeys(formats):
        data = {"html": lambda its: as_html(its).encode(), "csv": as_csv, "json": as_json}[each](document)
        if output is None:
            write_bytes(data)
            return
        path = output / f"selection.{each}"
        try:
            output.mkdir(parents=True, exist_ok=True)
            write_whole_file(path, data)
        except OSError as error:
            problem = f"{path}: cannot be written: {error.strerror}"
            raise Refused(problem, "name another folder with --output") from error


def _lines(document: Document) -> Iterator[str]:
    """Yield the trade table, and how many figures did not count."""
    from hil.documents.text import fitting  # noqa: PLC0415 - heavy
    from hil.report.tables import aligned  # noqa: PLC0415 - heavy

    yield from fitting(document.warnings, _WIDTH)
    for role in document.candidates:
        yield f"{role}:"
        yield from aligned([_row(cell) for cell in document.cells if cell.role == role], indent="  ")
        shares = [f"{each.candidate} {each.share:.0%}" for each in document.shares if each.role == role]
        yield from fitting([f"  overall: {', '.join(shares)}"], _WIDTH)
        for cell in document.cells:
            if cell.role == role:
                told = [f"{cell.criterion}: {each.candidate}: {'; '.join(each.reasons)}" for each in cell.unjudged]
                yield from fitting([f"  not judged: {each}" for each in told], _WIDTH)
                yield from fitting([f"  {cell.criterion}: {note}" for note in cell.notes], _WIDTH)
    if count := len(document.excluded):
        yield f"{count} did not count; --format html --output DIR lists each with its reason"


def _row(cell: Cell) -> tuple[str, ...]:
    from hil.report.numbers import measured  # noqa: PLC0415 - heavy

    if not cell.standings:
        return cell.criterion, "none", "", "", ""
    first = cell.standings[0]
    value = measured(first.value, first.expanded, cell.unit)
    of_all = f"{len(cell.standings)} of {len(cell.standings) + len(cell.unjudged)} judged" if cell.unjudged else ""
    return cell.criterion, " or ".join(cell.best), value, f"{first.probability:.1%}", of_all
