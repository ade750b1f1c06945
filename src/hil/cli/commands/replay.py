"""`hil replay`: run the cases of a package again on its recorded bytes."""

from __future__ import annotations

import click

from hil.cli.run_names import find_run
from hil.cli.starting import pin
from hil.model.errors import EvidenceError

__all__ = ["command"]


@click.command(name="replay", epilog="Example: hil replay reports/reference")
@click.argument("run", metavar="RUN")
def command(run: str) -> int:
    """Run the cases of a package again on its recorded bytes, and compare the verdicts.

    Cases, fixtures, bench file and limits are those frozen in the package. Exit code 0 if every verdict,
    value, recording and file of a case is the same, 1 otherwise.
    """
    pin()
    from hil.evidence.package.contents import Package  # noqa: PLC0415 - after the pins
    from hil.evidence.package.listing import list_folder  # noqa: PLC0415 - after the pins
    from hil.evidence.package.verification import State, verify  # noqa: PLC0415 - after the pins
    from hil.plugin.rehearsing import replay  # noqa: PLC0415 - after the pins
    from hil.report.sentences import counted  # noqa: PLC0415 - after the pins

    folder = find_run(run)
    if odd := list_folder(folder).odd:
        raise EvidenceError(f"{folder.name}: {odd[0]}", "nothing was replayed; hil verify shows what else is wrong")
    package = Package(folder)
    _ = package.events  # says so where the format is not known
    state = verify(folder).state
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
    return 1 if found.differences or state is State.DAMAGED else 0
