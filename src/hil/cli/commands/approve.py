"""`hil approve`: approve a package in a role."""

from __future__ import annotations

from pathlib import Path

import click

from hil.cli.commands.sign import KEY, PRINCIPAL, subject_of
from hil.cli.run_names import fixtures_folder

__all__ = ["command"]


@click.command(
    name="approve",
    epilog='Example: hil approve latest --role quality --meaning "results reviewed" --key qa.pub --as bo@example.org',
)
@click.argument("run", metavar="RUN")
@click.option("--role", required=True, metavar="ROLE", help="The role in which you approve it.")
@click.option("--meaning", required=True, metavar="TEXT", help="What your approval means, in one line.")
@KEY
@PRINCIPAL
def command(run: str, role: str, meaning: str, key: Path, principal: str) -> int:
    """Approve a package in a role, with an SSH key.

    An approval counts only if you hold the role that day, your key is valid, and you neither ran nor signed the
    package. If it would not count, nothing is entered. It is kept in the ledger; hil verify shows it.
    """
    from hil.evidence.ledger.approvals import approve  # noqa: PLC0415 - heavy
    from hil.registers.signers import load_signers  # noqa: PLC0415 - heavy

    folder, subject = subject_of(run)
    said = approve(
        folder.parent,
        subject,
        load_signers(fixtures_folder()),
        principal=principal,
        key=key.expanduser(),
        role=role,
        meaning=meaning,
    )
    click.echo(f"approved for {said}")
    return 0
