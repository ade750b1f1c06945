"""`hil runs`: list the runs of the workspace."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.cli.run_names import latch_word, reports_folder
from hil.documents.suggest import did_you_mean
from hil.model.errors import Refused

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.evidence.runs import RunSummary

__all__ = ["command"]

_ANY_WIDTH = 10_000


@click.command(name="runs", epilog="Example: hil runs --bench adcs --verdict PASS")
@click.option("--bench", metavar="NAME", help="Only runs on this bench.")
@click.option("--dut", metavar="SERIAL", help="Only runs of this device under test.")
@click.option("--plan", metavar="NAME", help="Only runs of this plan.")
@click.option("--verdict", metavar="VERDICT", help="Only runs with this verdict.")
@click.option("--no-cache", is_flag=True, help="Check every package, even those unchanged since the last look.")
def command(bench: str | None, dut: str | None, plan: str | None, verdict: str | None, *, no_cache: bool) -> int:
    """List the runs of the workspace, newest last.

    Sealed packages get a quick look that does not read their recordings, and is skipped while no file has changed.
    hil verify reads everything. A damaged package is listed with what is wrong and without a verdict, unless you
    filter.
    """
    from hil.evidence.index import Index  # noqa: PLC0415 - heavy
    from hil.evidence.runs import find_runs  # noqa: PLC0415 - heavy

    asked = None if verdict is None else _known(verdict)
    reports = reports_folder()
    everything = find_runs(reports, None if no_cache else Index.of(reports))
    chosen = [
        run
        for run in everything
        if bench in {None, run.bench}
        and dut in {None, run.dut}
        and (plan is None or plan in run.plans)
        and asked in {None, run.verdict}
    ]
    if chosen:
        click.echo("\n".join(_lines(chosen, _width())))
    if checked := next((run.checked for run in chosen if run.checked), ""):
        click.echo(f"checked: {checked}\nhil verify RUN reads everything", err=True)
    if not chosen:
        click.echo("no matching runs" if everything else "no runs yet")
        for line in _there(everything, bench=bench, dut=dut, plan=plan):
            click.echo(line)
    return 0


def _known(asked: str) -> str:
    """Return the requested verdict.

    Raises:
        Refused: if there is none of this name.
    """
    from hil.model.verdict import Verdict  # noqa: PLC0415 - only where one is asked for

    if asked.upper() in set(Verdict):
        return asked.upper()
    meant = did_you_mean(asked, Verdict)
    raise Refused(f"there is no verdict '{_printable(asked)}'{meant}", f"one of {', '.join(Verdict)}")


def _there(runs: Sequence[RunSummary], **asked: str | None) -> Iterator[str]:
    """Yield the known values for every filter that no run matches."""
    known = {
        "bench": {run.bench for run in runs},
        "dut": {run.dut for run in runs},
        "plan": {plan for run in runs for plan in run.plans},
    }
    for name, there in known.items():
        word, names = asked[name], sorted(filter(None, there))
        if word is not None and word not in there and names:
            yield f"  no run has --{name} {_printable(word)}; known: {', '.join(map(_printable, names))}"


def _width() -> int:
    """Return the maximum length of a line; unlimited if standard output is not a terminal."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else _ANY_WIDTH


def _lines(runs: Sequence[RunSummary], width: int) -> Iterator[str]:
    """Yield a line per run, in columns; if they do not fit, the name gets its own line."""
    from hil.guardian.latch import latch_files, read  # noqa: PLC0415 - heavy
    from hil.report.tables import aligned  # noqa: PLC0415 - heavy

    latched = {Path(latch.run).name for latch in map(read, latch_files()) if latch and latch.run}
    rows = [_cells(run) for run in runs]
    lines = aligned(rows)
    narrow = max(map(len, lines), default=0) > width
    for run, row, line in zip(runs, rows, lines, strict=True):
        if narrow:
            yield row[0]
            yield "  " + "  ".join(cell for cell in row[1:] if cell)
        else:
            yield line
        if run.problem:
            yield f"  {_printable(run.problem)}"
        if (run.folder.name in latched or run.state != "SEALED") and (latch := latch_word(run.folder)):
            yield f"  {_printable(latch)}"


def _cells(run: RunSummary) -> tuple[str, ...]:
    verdict = f"{run.verdict or '-'}{', deviates' if run.deviates else ''}"
    cases = f"{run.ended}/{run.planned} cases" if run.planned or not run.problem else "-"
    told = (run.folder.name, run.state, cases, verdict)
    return tuple(_printable(cell) for cell in (*told, run.source or "-", run.purpose or "-", run.dut or "-"))


def _printable(text: str) -> str:
    from hil.evidence.package.listing import shown  # noqa: PLC0415 - heavy

    return shown(text)
