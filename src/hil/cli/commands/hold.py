"""`hil hold`: bring the bench of a run to its hold state, or release it."""

from __future__ import annotations

import click

from hil.cli.options import name_option
from hil.cli.run_names import answer_of, find_running

__all__ = ["command"]


@click.command(name="hold", epilog='\b\nExample: hil hold 20261121T093100Z --reason "open the door" --by "A. Engineer"')
@click.argument("run", metavar="RUN")
@click.option("--release", is_flag=True, help="Restore the bench and continue the run.")
@click.option("--reason", default="", metavar="TEXT", help="Why the run is held or released.")
@name_option("--by", help="Who requests it.")
def command(run: str, *, release: bool, reason: str, by: str) -> int:
    """Hold a run at its next scheduling point: the bench goes to its hold state and stays there.

    Exit codes: 0 if the bench is held or released, or if the run does not answer in time; 1 if the run refuses.
    """
    from hil.evidence.events import Hold, HoldEnd, HoldRefused  # noqa: PLC0415 - only when it is used
    from hil.evidence.inbox import post  # noqa: PLC0415 - only when it is used
    from hil.evidence.package.listing import shown  # noqa: PLC0415 - only when it is used
    from hil.report.live.following import Follower  # noqa: PLC0415 - only when it is used

    folder = find_running(run)
    follower = Follower(folder)
    follower.read()
    post(folder, "release" if release else "hold", by=by, text=reason)
    answer = answer_of(follower, HoldEnd if release else Hold, HoldRefused)
    if answer is None:
        click.echo(
            f"the run will {'continue' if release else 'hold'} at its next scheduling point; hil status shows it"
        )
        return 0
    if isinstance(answer, HoldRefused):
        click.echo(f"refused: {shown(answer.text)}", err=True)
        return 1
    if isinstance(answer, HoldEnd):
        click.echo(
            "the bench is as it was before the hold, and the run continues"
            if answer.how == "released"
            else "the hold ended"
        )
        return 0 if answer.how == "released" else 1
    outputs = answer.outputs if isinstance(answer, Hold) else ()
    for each in outputs:
        click.echo(shown(f"{each.output} {'' if each.ok else 'NOT '}{each.state}, {each.detail}"))
    return 0 if all(each.ok for each in outputs) else 1
