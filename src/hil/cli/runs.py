"""`hil runs`: list the runs of the workspace."""

from __future__ import annotations

import click

from hil.cli.folders import reports_folder

__all__ = ["command"]


@click.command(name="runs", epilog="Example: hil runs")
def command() -> int:
    """List the runs of the workspace, oldest first; nothing is verified."""
    from hil.evidence.runs import find_runs  # noqa: PLC0415 - heavy

    found = find_runs(reports_folder())
    for run in found:
        cases = f"{run.ended}/{run.planned}"
        click.echo(f"{run.folder.name:<44} {run.state:<11} {cases:>7} cases  {run.verdict or '-':<13} {run.dut}")
    if not found:
        click.echo("no runs yet")
    return 0
