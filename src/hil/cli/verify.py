"""`hil verify`: verify a package offline."""

from __future__ import annotations

import click

from hil.cli.folders import find_run

__all__ = ["command"]


@click.command(name="verify", epilog="Example: hil verify reports/reference")
@click.argument("run", metavar="RUN")
def command(run: str) -> int:
    """Verify a package, offline and from its own bytes.

    Checked are the manifests, the journal's chain, every row of every recording, the results, and every
    verdict against value, uncertainty and frozen limit. Exit code 0 for a whole package of a complete run, 1 otherwise.
    """
    from hil.evidence.package.verification import verify  # noqa: PLC0415 - heavy

    found = verify(find_run(run))
    for finding in found.findings:
        click.echo(str(finding), err=True)
    complete = "" if found.complete else ", the run did not go to its own end"
    click.echo(f"{found.folder.name}: {found.state}{complete}")
    if found.verdict:
        click.echo(f"verdict          {found.verdict}")
    if found.evidence_digest:
        click.echo(f"evidence digest  {found.evidence_digest}")
    if found.content_digest:
        click.echo(f"content digest   {found.content_digest}")
    return 0 if found.ok else 1
