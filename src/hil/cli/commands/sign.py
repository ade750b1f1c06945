"""`hil sign`: sign a package with an SSH key."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.cli.run_names import find_run, fixtures_folder
from hil.model.errors import Refused

if TYPE_CHECKING:
    from hil.evidence.ledger.approvals import Subject

__all__ = ["KEY", "PRINCIPAL", "command", "subject_of"]

KEY = click.option(
    "--key",
    required=True,
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Private key, or public key of one in an agent or on a token.",
)
PRINCIPAL = click.option(
    "--as", "principal", required=True, metavar="PRINCIPAL", help="Principal that the key belongs to."
)


@click.command(name="sign", epilog="Example: hil sign latest --key ~/.ssh/id_ed25519 --as ada@example.org")
@click.argument("run", metavar="RUN")
@KEY
@PRINCIPAL
def command(run: str, key: Path, principal: str) -> int:
    """Sign a package with an SSH key: you vouch for the run as its author.

    The package is verified first. ssh-keygen makes the signature, so agents and hardware keys work; it prompts for
    passphrase, PIN or touch. The signature goes into the ledger; the package is not changed. hil verify shows it.
    """
    from hil.evidence.ledger.approvals import sign_package  # noqa: PLC0415 - heavy
    from hil.registers.signers import load_signers  # noqa: PLC0415 - heavy

    folder, subject = subject_of(run)
    said = sign_package(
        folder.parent, subject, load_signers(fixtures_folder()), principal=principal, key=key.expanduser()
    )
    click.echo(f"signed by {said}")
    return 0


def subject_of(run: str) -> tuple[Path, Subject]:
    """Return folder and facts of a package that is intact.

    Raises:
        Refused: if it is not.
    """
    from hil.evidence.ledger.approvals import Subject  # noqa: PLC0415 - heavy
    from hil.evidence.package.verification import State, verify  # noqa: PLC0415 - heavy

    folder = find_run(run).resolve()
    found = verify(folder)
    if found.state is not State.SEALED or not found.sure:
        raise Refused(
            f"{folder.name} is {found.state}: {found.problem or found.ledger}",
            "only a package that verifies can be signed",
        )
    return folder, Subject(run=found.run, evidence=found.evidence_digest, operator=found.operator)
