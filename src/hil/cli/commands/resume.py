"""`hil resume`: resume a run that was interrupted."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path

import click

from hil.cli.options import ACKNOWLEDGE_WITHIN, SERVED
from hil.cli.run_names import find_run
from hil.cli.supervision import Invocation, supervise

__all__ = ["command"]


@click.command(name="resume", epilog="Example: hil resume latest")
@click.argument("run", metavar="RUN")
@click.option(
    "--answers",
    type=click.Path(path_type=Path, exists=True, dir_okay=False),
    help="File with answers to the plan's questions.",
)
@click.option("--ask", is_flag=True, help="Ask questions at the terminal, even on a simulated bench.")
@SERVED
@click.option(
    "--other-software",
    default="",
    metavar="REASON",
    help="Why the run resumes with different software than it started with; it then closes no requirement.",
)
@ACKNOWLEDGE_WITHIN
@click.option("-v", "--verbose", is_flag=True, help="Also show every step, driving call and gate.")
@click.pass_obj
def command(
    invocation: Invocation,
    *,
    run: str,
    answers: Path | None,
    ask: bool,
    served: Path | None,
    other_software: str,
    acknowledge_within: float,
    verbose: bool,
) -> int:
    """Resume a run whose process was killed, or whose machine lost power.

    Its cases rerun from their first line on the recorded bytes, and must reproduce the journal; after the last
    checkpoint the bench itself takes over. No question is asked twice, except for safety confirmations on hardware or
    a served bench. The run keeps its folder, and its evidence says when it was resumed. Exit codes and the last line
    of standard output are those of hil run.
    """
    folder = find_run(run)
    if invocation.word is None:
        from hil.executive.setup.pins import pinned_environment  # noqa: PLC0415 - the process that waits stays light

        return supervise(invocation, pinned_environment())
    from hil.executive.resuming.preconditions import resumed_request  # noqa: PLC0415 - after the pins
    from hil.plugin.running import resume  # noqa: PLC0415 - after the pins

    invocation.word.listen()
    request = partial(
        resumed_request,
        start=Path.cwd(),
        answers=answers.resolve() if answers else None,
        person=ask,
        served=served.resolve() if served else None,
        acknowledge_within_s=60 * acknowledge_within,
    )
    return resume(folder, request, sys.stdout, other_software=other_software, verbose=verbose, word=invocation.word)
