"""`hil approve`: approve a package in a role."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.cli.commands.sign import KEY, PRINCIPAL, subject_of
from hil.cli.run_names import fixtures_folder, reports_folder

if TYPE_CHECKING:
    from hil.evidence.ledger.approvals import Subject

__all__ = ["command"]

_NUMBERS = ("NCR-", "W-", "V-")


@click.command(
    name="approve",
    epilog="\b\nExample:\n  hil approve latest --role quality --meaning 'results reviewed' \\\n"
    "    --key qa.pub --as bo@example.org",
)
@click.argument("run", metavar="RUN|NUMBER")
@click.option("--role", required=True, metavar="ROLE", help="The role in which you approve it.")
@click.option("--meaning", required=True, metavar="TEXT", help="What your approval means, in one line.")
@KEY
@PRINCIPAL
def command(run: str, role: str, meaning: str, key: Path, principal: str) -> int:
    """Approve a package, a nonconformance report, a waiver or a verification in a role, with an SSH key.

    An approval counts only if you hold the role that day, your key is valid, and you neither ran nor signed the
    package, nor wrote the report or the waiver. If it would not count, nothing is entered. It is kept in the ledger;
    hil verify shows it for a package.

    NUMBER identifies a record of the workspace, such as NCR-0007 in the role nonconformance, W-0003 in the role
    waiver, or V-0012 in the role verification. You approve its present content: if that changes, it needs a new
    approval. The author of a verification may approve it, unless the requirement says independent.
    """
    from hil.evidence.ledger.approvals import approve  # noqa: PLC0415 - heavy
    from hil.registers.signers import load_signers  # noqa: PLC0415 - heavy

    reports, subject = _record(run) if run.startswith(_NUMBERS) else _package(run)
    said = approve(
        reports,
        subject,
        load_signers(fixtures_folder()),
        principal=principal,
        key=key.expanduser(),
        role=role,
        meaning=meaning,
    )
    click.echo(f"approved for {said}")
    return 0


def _package(run: str) -> tuple[Path, Subject]:
    folder, subject = subject_of(run)
    return folder.parent, subject


def _record(number: str) -> tuple[Path, Subject]:
    """Return the reports folder, and what is approved of a record of the workspace."""
    from hil.audit.reading import record_subject  # noqa: PLC0415 - heavy
    from hil.cli.commands.audit import workspace_folders  # noqa: PLC0415 - heavy

    return reports_folder(), record_subject(workspace_folders(), number)
