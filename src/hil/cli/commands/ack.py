"""`hil ack`: acknowledge what was done to a bench by force, or that the person on call was reached."""

from __future__ import annotations

from pathlib import Path

import click

from hil.cli.run_names import answer_of, find_run, find_running, reports_folder, shown
from hil.model.errors import Refused

__all__ = ["command"]


@click.command(name="ack", epilog='Example: hil ack latest --by "A. Engineer" --text "fuse F2 blown, replaced"')
@click.argument("run", metavar="RUN")
@click.option("--by", default="", metavar="NAME", help="Who acknowledges.")
@click.option("--text", default="", metavar="TEXT", help="What was seen and done.")
@click.option("--code", default="", metavar="CODE", help="The code that the person on call was sent.")
def command(run: str, by: str, text: str, code: str) -> int:
    """Tell what the guardian did to the bench of a run, and acknowledge it by name.

    Until then the bench is latched: it is driven by no run and no check. With --code it says instead that whoever is
    on call was reached by an unattended run that waits for it. Exit codes: 0, and 1 for a code that is not the one
    that the run waits for.
    """
    if code.strip():
        return _reached(run, by, code)
    from hil.evidence.package.listing import shown as printable  # noqa: PLC0415 - heavy
    from hil.executive.ending.acknowledging import acknowledge  # noqa: PLC0415 - heavy

    folder = _run_or_latched(run)
    _tell(folder)
    done = acknowledge(folder, reports_folder(), by=by, text=text)
    if done.entry is not None:
        click.echo(f"written into {shown(done.entry)}")
    else:
        click.echo("the run takes it into its journal when it is resumed or sealed")
    for bench in done.benches:
        click.echo(f"bench {printable(bench)} is not latched any more")
    return 0


def _tell(folder: Path) -> None:
    """Print when what happened, in the order of time, and where it is written down in full."""
    from hil.evidence.package.listing import shown as printable  # noqa: PLC0415 - heavy
    from hil.executive.ending.incidents import moment, what_happened, written_down  # noqa: PLC0415 - heavy
    from hil.report.tables import aligned  # noqa: PLC0415 - heavy

    told = [(printable(moment(each.at)), printable(each.text)) for each in what_happened(folder)]
    for line in aligned(told):
        click.echo(line)
    if files := [printable(shown(path)) for path in written_down(folder)]:
        click.echo(f"in full: {', '.join(files)}")


def _run_or_latched(asked: str) -> Path:
    """Return the folder of a run, also of one that is gone and has left a latch."""
    from hil.bench.latching import latches_of  # noqa: PLC0415 - only where something is latched

    try:
        return find_run(asked)
    except Refused:
        if asked.strip() and latches_of(asked):
            return reports_folder() / Path(asked).name
        raise


def _reached(run: str, by: str, code: str) -> int:
    from hil.evidence.inbox import post  # noqa: PLC0415 - only when it is used
    from hil.report.live.following import Follower  # noqa: PLC0415 - only when it is used

    if not by.strip():
        raise Refused("whoever was reached gives a name", "say it with --by NAME")
    folder = find_running(run)
    follower = Follower(folder)
    follower.read()
    post(folder, "reached", by=by.strip(), text=code.strip())
    answer = answer_of(follower, {"reached"})
    if answer is None:
        click.echo("the run has not looked at the code yet; hil status tells whether it goes on")
        return 0
    if not answer["ok"]:
        click.echo("refused: this is not the code that the run waits for", err=True)
        return 1
    click.echo("the code is right, and the bench will be armed")
    return 0
