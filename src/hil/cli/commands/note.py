"""`hil note`: add a note to a run in progress."""

from __future__ import annotations

import click

from hil.cli.options import name_option
from hil.cli.run_names import find_running

__all__ = ["command"]


@click.command(name="note", epilog='Example: hil note 20261121T093100Z "door opened" --by "A. Engineer"')
@click.argument("run", metavar="RUN")
@click.argument("text")
@name_option("--by", help="Who writes it.")
def command(run: str, text: str, by: str) -> int:
    """Add a note to a run in progress; it becomes part of the evidence."""
    from hil.evidence.inbox import post  # noqa: PLC0415 - only when it is used

    post(find_running(run), "note", by=by, text=text)
    click.echo("the run will take the note at its next scheduling point")
    return 0
