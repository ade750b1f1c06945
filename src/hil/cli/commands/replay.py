"""`hil replay`: rerun the cases of a package on its recorded bytes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from hil.cli.run_names import find_run
from hil.cli.starting import pin
from hil.model.errors import EvidenceError

if TYPE_CHECKING:
    from hil.evidence.package.verification import Verification
    from hil.plugin.rehearsing import Replayed

__all__ = ["command"]


@click.command(name="replay", epilog="Example: hil replay reports/reference")
@click.argument("run", metavar="RUN")
def command(run: str) -> int:
    """Rerun the cases of a package on its recorded bytes, and compare the results.

    Cases, fixtures, bench file and limits are those frozen in the package. Exit code 0 if every verdict,
    value, recording and file of a case is the same, 1 otherwise. The result is entered in the ledger that has the
    package's seal: verdicts of an older analysis count again if the present one reaches the same verdicts.
    """
    pin()
    from hil.documents.text import counted  # noqa: PLC0415 - after the pins
    from hil.evidence.package.contents import Package  # noqa: PLC0415 - after the pins
    from hil.evidence.package.listing import list_folder  # noqa: PLC0415 - after the pins
    from hil.evidence.package.verification import State, verify  # noqa: PLC0415 - after the pins
    from hil.plugin.rehearsing import replay  # noqa: PLC0415 - after the pins

    folder = find_run(run)
    if odd := list_folder(folder).odd:
        raise EvidenceError(f"{folder.name}: {odd[0]}", "nothing was replayed; hil verify shows what else is wrong")
    package = Package(folder)
    _ = package.events  # says so where the format is not known
    verified = verify(folder)
    state = verified.state
    if state is State.DAMAGED:
        click.echo(f"{folder.name} is DAMAGED, so its replay proves nothing; hil verify shows what is wrong", err=True)
    elif state is not State.SEALED:
        click.echo(f"{folder.name} is {state}: only cases that had ended are compared", err=True)
    found = replay(package)
    for difference in found.differences:
        click.echo(difference, err=True)
    if found.following:
        click.echo(f"after that the record cannot answer: {counted(found.following, 'more difference')}", err=True)
    word = counted(len(found.differences), "difference") if found.differences else "no difference"
    amount = f"{counted(found.cases, 'case')} with {counted(found.checks, 'check')}"
    without = ((found.broken_off, "cut short"), (found.never_ran, "never run"))
    left = [f"{count} {what}" for count, what in without if count]
    if found.cases or not left:
        click.echo(f"{amount} replayed from their bytes: {word}")
    else:
        click.echo("no recorded case ran to its end, so none could be compared")
    if left:
        click.echo(f"not compared: {counted(found.broken_off + found.never_ran, 'case')} ({', '.join(left)})")
    if state is State.SEALED and found.cases:
        _enter(verified, found)
    return 1 if found.differences or state is State.DAMAGED else 0


def _enter(verified: Verification, found: Replayed) -> None:
    """Enter the result in the ledger that has the package; if that fails, say so: the replay is valid without it."""
    from hil.evidence.ledger.entries import Replayed as Entry  # noqa: PLC0415 - after the pins
    from hil.evidence.ledger.packages import enter_replay  # noqa: PLC0415 - after the pins
    from hil.evidence.package.contents import Package  # noqa: PLC0415 - after the pins
    from hil.evidence.results.judging_code import judging_digest  # noqa: PLC0415 - after the pins

    software = Package(verified.folder).json("data/software.json")
    judged_by = software.get("analysis") if isinstance(software, dict) else None
    by_the_same = judged_by == judging_digest()
    replayed = Entry(
        run=verified.run,
        evidence=verified.evidence_digest,
        analysis=judging_digest(),
        same=not found.differences if by_the_same else found.same_verdicts,
        differences=len(found.differences) + found.following,
    )
    try:
        entered = enter_replay(verified.folder.resolve().parent, replayed)
    except EvidenceError as error:
        click.echo(f"not entered in the ledger: {error}", err=True)
        return
    if entered is not None:
        click.echo(f"in the ledger as line {entered.seq + 1}")
