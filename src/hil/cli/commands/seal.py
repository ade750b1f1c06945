"""`hil seal`: seal an interrupted run as it is."""

from __future__ import annotations

import click

from hil.cli.run_names import find_run, shown

__all__ = ["command"]


@click.command(name="seal", epilog="Example: hil seal 20261121T093100Z")
@click.argument("run", metavar="RUN")
def command(run: str) -> int:
    """Seal an interrupted run as it is; its verdict is never better than ABORTED.

    The last line of standard output is the package's path. Exit code 1 if what was left of the run is damaged: it is
    sealed all the same, and the damage is listed. A package that is already sealed is verified instead; exit code 1 if
    it is damaged.
    """
    from hil.cli.commands.verify import damage_of_transcript  # noqa: PLC0415 - heavy
    from hil.evidence.folder import is_sealed  # noqa: PLC0415 - heavy
    from hil.evidence.package.listing import shown as printable  # noqa: PLC0415 - heavy
    from hil.evidence.package.sealing import recover  # noqa: PLC0415 - heavy
    from hil.evidence.package.verification import State, verify  # noqa: PLC0415 - heavy
    from hil.report.write import write_reports  # noqa: PLC0415 - heavy

    folder = find_run(run)
    damage: list[str] = []
    if is_sealed(folder):
        found, name = verify(folder), printable(folder.name)
        if found.state is not State.SEALED:
            click.echo(f"{name} is already sealed, and is {found.state}: {found.problem}", err=True)
            click.echo(f"     nothing was changed; hil verify {name} shows everything that is wrong", err=True)
            return 1
        click.echo(f"{name} is already sealed, and stays as it is")
        digest = recover(folder, write_reports=write_reports)
    else:
        damage += damage_of_transcript(folder)
        digest = recover(folder, write_reports=write_reports)
        damage += (printable(str(each)) for each in verify(folder).findings)
    if damage:
        click.echo("\n".join((*damage, "it is sealed as it is, with this damage")), err=True)
    else:
        click.echo(f"evidence digest {digest}")
    click.echo(shown(folder))
    return 1 if damage else 0
