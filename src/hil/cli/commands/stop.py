"""`hil stop`: stop a run and leave the bench safe."""

from __future__ import annotations

import click

from hil.cli.options import name_option
from hil.cli.run_names import find_running

__all__ = ["command"]


@click.command(name="stop", epilog='Example: hil stop 20261121T093100Z --reason "smell" --by "A. Engineer"')
@click.argument("run", metavar="RUN")
@click.option("--reason", default="", metavar="TEXT", help="Why the run is stopped.")
@click.option("--to-resume", is_flag=True, help="Leave the package unsealed, so that hil resume can continue the run.")
@name_option("--by", help="Who requests it.")
def command(run: str, reason: str, by: str, *, to_resume: bool) -> int:
    """Stop a run at its next scheduling point: the bench is made safe, and the package sealed.

    With --to-resume the package stays open. When the run is resumed, its bench is armed again, and the interrupted
    loop turn or case starts over.
    """
    from hil.evidence.inbox import post  # noqa: PLC0415 - only when it is used

    post(find_running(run), "interrupt" if to_resume else "stop", by=by, text=reason)
    click.echo("the run will stop at its next scheduling point")
    return 0
