"""`hil analyse table`: which cells of a published table follow from the tables that it was computed from."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.cli.options import JSON
from hil.model.errors import Refused

if TYPE_CHECKING:
    from hil.analysis.published.formula import Formula
    from hil.analysis.published.printed import Key, PrintedTable
    from hil.cli.analyses.table_text import CheckedTable
    from hil.documents.declared import Document
    from hil.documents.findings import Findings
    from hil.documents.node import Place
    from hil.logs.published import Job, Sheet, SheetCell, Source, Statement

__all__ = ["table"]

_JOBS = (".yaml", ".yml")


@click.command("table", short_help="Check a published table against its sources.")
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--from",
    "sources",
    multiple=True,
    metavar="NAME=CSV",
    help="A source table, and its name in formulas; can be repeated.",
)
@click.option("--formula", default="", metavar="FORMULA", help="Formula of every cell, such as 100*(b-a)/a.")
@click.option(
    "--column", "columns", multiple=True, metavar="NAME=FORMULA", help="Formula of one column; can be repeated."
)
@click.option("--all", "every", is_flag=True, help="Also print the cells that follow.")
@JSON
def table(
    *, file: Path, sources: tuple[str, ...], formula: str, columns: tuple[str, ...], every: bool, as_json: bool
) -> int:
    """Recompute the published table in FILE from its sources, and name the cells that do not follow.

    FILE is a CSV file with row names in its first column, or a YAML file that names several tables,
    their sources and formulas. A printed number stands for every number that rounds to it: 0.1234 is
    anything from 0.12335 to 0.12345. A cell follows if the formula can give a number that rounds to it.
    For a cell that does not follow, common slips are tried: sign, factor, a misprinted digit, a copied
    cell, another formula.

    \b
    Example:
      hil analyse table docs/data/imu-tables.yaml
    """  # noqa: D301 - click reads \b
    from hil.cli.analyses import table_text  # noqa: PLC0415 - start-up stays light
    from hil.documents.findings import Findings  # noqa: PLC0415 - start-up stays light
    from hil.logs.published import read_job  # noqa: PLC0415 - start-up stays light

    findings = Findings()
    if file.suffix in _JOBS:
        if sources or formula or columns:
            raise Refused("--from, --formula and --column are for a table in CSV", "write them into the YAML file")
        document = read_job(file, findings)
        job, folder = document.model, file.parent
    else:
        document, job, folder = (
            None,
            _job_of(file, _pairs("--from", sources), formula, _pairs("--column", columns)),
            Path(),
        )
    sheets = _sheets(job, folder, findings)
    findings.raise_if_any()
    tables = _Tables(sheets, findings)
    found = [_checked(number, each, tables, document) for number, each in enumerate(job.checks)]
    findings.raise_if_any()
    checked = [each for each in found if each is not None]
    text = (
        table_text.as_json(str(file), job, checked)
        if as_json
        else table_text.as_text(str(file), job, checked, every=every)
    )
    click.echo(text)
    return int(any(cell.verdict != "follows" for each in checked for cell in each.cells))


def _pairs(option: str, given: tuple[str, ...]) -> dict[str, str]:
    found: dict[str, str] = {}
    for each in given:
        name, equals, value = each.partition("=")
        if not (name.strip() and equals and value.strip()):
            raise Refused(f"{option} {each} has no '='", f"write {option} NAME=VALUE")
        if name.strip() in found:
            raise Refused(f"{option} names '{name.strip()}' twice", "give each a name of its own")
        found[name.strip()] = value.strip()
    return found


def _job_of(file: Path, sources: Mapping[str, str], formula: str, columns: Mapping[str, str]) -> Job:
    from hil.logs.published import Job, Source, Statement  # noqa: PLC0415 - start-up stays light

    if not sources:
        raise Refused("the tables that it was computed from are missing", "give --from NAME=CSV and --formula")
    if not (formula or columns):
        raise Refused("the formula is missing", "give --formula, such as --formula '100*(b-a)/a'")
    tables = tuple(Source(file=path, name=path) for path in dict.fromkeys((str(file), *sources.values())))
    statement = Statement(published=str(file), sources=dict(sources), formula=formula, columns=dict(columns))
    return Job(tables=tables, checks=(statement,))


def _sheets(job: Job, folder: Path, findings: Findings) -> dict[str, tuple[Sheet, Source]]:
    from hil.logs.published import read_sheets  # noqa: PLC0415 - start-up stays light

    found: dict[str, tuple[Sheet, Source]] = {}
    for source in job.tables:
        for sheet in read_sheets(source, folder, findings):
            if sheet.name in found:
                raise Refused(f"two tables are called '{sheet.name}'", "give one of them another name")
            found[sheet.name] = (sheet, source)
    return found


class _Tables:
    """The tables of a job by name, with every number read.

    Attributes:
        findings: what is wrong with them.
        sheets: their texts.
        printed: their numbers.
        remarks: by table what stands in columns of remarks.
    """

    def __init__(self, sheets: Mapping[str, tuple[Sheet, Source]], findings: Findings) -> None:
        self.findings = findings
        self.sheets = {name: sheet for name, (sheet, _) in sheets.items()}
        self.remarks: dict[str, dict[Key, SheetCell]] = {name: {} for name in sheets}
        self.printed = {name: self._printed(sheet, source) for name, (sheet, source) in sheets.items()}

    def _printed(self, sheet: Sheet, source: Source) -> PrintedTable:
        """Read the numbers; a column with more words than numbers is one of remarks."""
        from hil.analysis.published.printed import (  # noqa: PLC0415 - start-up stays light
            EXACT,
            NotANumber,
            Printed,
            PrintedTable,
            as_printed,
        )

        digits = EXACT if source.digits == "exact" else int(source.digits) if source.digits else None
        cells: dict[tuple[str, str], Printed] = {}
        for column in sheet.columns:
            numbers, words = {}, {}
            for key, cell in sheet.cells.items():
                if key[1] == column:
                    try:
                        numbers[key] = as_printed(cell.text, digits)
                    except NotANumber:
                        words[key] = cell
            if len(numbers) <= len(words):
                self.remarks[sheet.name] |= words
                continue
            cells |= numbers
            for cell in words.values():
                self.findings.add(cell.place, f"'{cell.text}' is not a number: correct it, or leave the cell blank")
        return PrintedTable(name=sheet.name, rows=sheet.rows, columns=sheet.columns, cells=cells)


def _checked(number: int, statement: Statement, tables: _Tables, document: Document[Job] | None) -> CheckedTable | None:
    """Check one table; None where the statement is wrong, which is noted."""
    from hil.analysis.published.check import check  # noqa: PLC0415 - start-up stays light
    from hil.cli.analyses.table_text import CheckedTable  # noqa: PLC0415 - start-up stays light

    asking = _Asking(number, statement, tables, document)
    published = tables.printed.get(statement.published)
    sources = asking.sources()
    if published is None:
        asking.unknown(("published",), statement.published)
    if published is None or sources is None:
        return None
    formulas = asking.formulas(published, sources)
    asking.require_numbers(published, formulas)
    cells = check(published, formulas, sources, tuple(tables.printed.values()))
    at = {key: cell.place for key, cell in tables.sheets[published.name].cells.items()}
    return CheckedTable(
        name=published.name,
        sources=dict(statement.sources),
        formulas={key: each.text for key, each in formulas.items()},
        cells=cells,
        places={key: f"{place.path}:{place.line}:{place.column}" for key, place in at.items()},
    )


class _Asking:
    """One statement of a job, whose parts are looked up, and noted at their places where they are wrong."""

    def __init__(self, number: int, statement: Statement, tables: _Tables, document: Document[Job] | None) -> None:
        self._path: tuple[str | int, ...] = ("checks", number)
        self._statement, self._tables, self._document = statement, tables, document

    def sources(self) -> dict[str, PrintedTable] | None:
        """Return the tables by their names in the formulas, None if one is not there."""
        found = {}
        for name, meant in self._statement.sources.items():
            if meant not in self._tables.printed:
                self.unknown(("from", name), meant)
            elif not name.isidentifier():
                self._note(("from", name), f"'{name}' cannot be a name in a formula: use letters, digits and '_'")
            else:
                found[name] = self._tables.printed[meant]
        return found if len(found) == len(self._statement.sources) else None

    def formulas(self, published: PrintedTable, sources: Mapping[str, PrintedTable]) -> dict[Key, Formula]:
        """Return the formula of each cell; the one of a cell goes before that of its column, and that before all."""
        statement = self._statement
        found: dict[Key, Formula] = {}
        if statement.formula and (whole := self._parsed(("formula",), statement.formula, sources)):
            found = {(row, column): whole for row in published.rows for column in published.columns}
        for column, text in statement.columns.items():
            if column not in published.columns:
                self._lacks(("columns", column), published, "column", column)
            elif formula := self._parsed(("columns", column), text, sources):
                found |= {(row, column): formula for row in published.rows}
        for number, cell in enumerate(statement.cells):
            if cell.row not in published.rows:
                self._lacks(("cells", number, "row"), published, "row", cell.row)
            elif cell.column not in published.columns:
                self._lacks(("cells", number, "column"), published, "column", cell.column)
            elif formula := self._parsed(("cells", number, "formula"), cell.formula, sources):
                found[cell.row, cell.column] = formula
        if not (statement.formula or statement.columns or statement.cells):
            self._note((), "no formula is given: add 'formula', 'columns' or 'cells'")
        return found

    def require_numbers(self, published: PrintedTable, formulas: Mapping[Key, Formula]) -> None:
        """Note the cells that have a formula and cannot be read, which would pass unchecked, and where none can.

        A column of remarks has no formula of its own, and nothing in it begins as a number.
        """
        from hil.analysis.published.printed import begins_as_number  # noqa: PLC0415 - start-up stays light

        own = {(each.row, each.column) for each in self._statement.cells}
        unread = [
            cell
            for key, cell in self._tables.remarks[published.name].items()
            if key in formulas and (key in own or key[1] in self._statement.columns or begins_as_number(cell.text))
        ]
        for cell in unread:
            told = "correct it, leave the cell blank, or give other columns formulas of their own"
            self._tables.findings.add(cell.place, f"'{cell.text}' is not a number: {told}")
        if formulas and not unread and not any(key in formulas for key in published.cells):
            self._note(("published",), f"{published.name} has no number that could be checked")

    def unknown(self, path: tuple[str | int, ...], name: str) -> None:
        """Note that there is no such table."""
        from hil.documents.suggest import did_you_mean  # noqa: PLC0415 - start-up stays light

        self._note(path, f"there is no table '{name}'{did_you_mean(name, self._tables.printed)}")

    def _lacks(self, path: tuple[str | int, ...], table: PrintedTable, what: str, name: str) -> None:
        from hil.documents.suggest import did_you_mean  # noqa: PLC0415 - start-up stays light

        names = table.rows if what == "row" else table.columns
        self._note(path, f"{table.name} has no {what} '{name}'{did_you_mean(name, names)}")

    def _parsed(self, path: tuple[str | int, ...], text: str, sources: Mapping[str, PrintedTable]) -> Formula | None:
        from hil.analysis.published.formula import FormulaError, parse  # noqa: PLC0415 - start-up stays light
        from hil.documents.suggest import did_you_mean  # noqa: PLC0415 - start-up stays light

        try:
            return parse(text, sources)
        except FormulaError as error:
            hint = did_you_mean(error.word, error.known) if error.word else ""
            self._note(path, f"{error.message}{hint} (at character {error.column} of the formula)")
            return None

    def _note(self, path: tuple[str | int, ...], message: str) -> None:
        self._tables.findings.add(self._place(path), message)

    def _place(self, path: tuple[str | int, ...]) -> Place:
        from hil.documents.node import Place  # noqa: PLC0415 - start-up stays light

        if self._document is not None:
            return self._document.place((*self._path, *path))
        option = {"formula": "--formula", "columns": "--column", "from": "--from"}.get(str(path[0]) if path else "", "")
        return Place(path=option or self._statement.published)
