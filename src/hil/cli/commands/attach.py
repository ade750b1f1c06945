"""`hil attach`: attach a file to a run in progress."""

from __future__ import annotations

from pathlib import Path

import click

from hil.cli.options import name_option
from hil.cli.run_names import find_running

__all__ = ["command"]


@click.command(name="attach", epilog="Example: hil attach 20261121T093100Z photo.jpg --text 'jig, from above'")
@click.argument("run", metavar="RUN")
@click.argument("file", type=click.Path(path_type=Path, exists=True, dir_okay=False))
@click.option("--text", default="", metavar="TEXT", help="What it shows.")
@name_option("--by", help="Who attaches it.")
def command(run: str, file: Path, text: str, by: str) -> int:
    """Attach a file to a run in progress; it becomes part of the evidence, with its hash."""
    from hil.evidence.inbox import post  # noqa: PLC0415 - only when it is used

    post(find_running(run), "attachment", by=by, text=text, attach=file)
    click.echo("the run will take the file at its next scheduling point")
    return 0
