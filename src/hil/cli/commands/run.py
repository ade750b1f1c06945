"""`hil run`: run plans on a bench and seal the evidence."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hil.cli.display import Display
from hil.cli.options import (
    ANSWERS,
    SERVED,
    attendance_of,
    attendance_options,
    deviation_options,
    name_option,
    only_of,
    overrides_of,
    skips_of,
)
from hil.cli.run_names import reports_folder
from hil.cli.supervision import ONLOOKER, Invocation, Word, supervise
from hil.model.errors import Refused
from hil.model.identity import Purpose, Source

if TYPE_CHECKING:
    from hil.executive.setup.configuration import Request

__all__ = ["command"]


class Place(click.Path):
    """A named folder; empty text, as from an unset variable in a script, would mean the current folder."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:  # noqa: ANN401 - click's
        """Return the path."""
        if not os.fspath(value):
            self.fail("no folder is named", param, ctx)
        return super().convert(value, param, ctx)


class NewFile(click.Path):
    """A file that is written at the end, in a folder that must exist beforehand."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:  # noqa: ANN401 - click's
        """Return the path."""
        folder = Path(os.fspath(value)).resolve().parent
        if not folder.is_dir():
            self.fail(f"there is no folder {folder}: make it first", param, ctx)
        return super().convert(value, param, ctx)


@click.command(
    name="run", epilog="\b\nExample: hil run testplans/magnetorquer --bench adcs --source simulated --dut SIM-ADCS-1"
)
@click.argument("plans", nargs=-1, required=True, metavar="PLAN...")
@click.option("--bench", required=True, metavar="NAME", help="The bench: fixtures/benches/NAME.")
@click.option("--dut", required=True, metavar="SERIAL", help="Serial number of the device under test.")
@click.option(
    "--source",
    type=click.Choice([Source.HARDWARE.value, Source.SIMULATED.value]),
    default="hardware",
    show_default=True,
    help="Real instruments, or their simulated twins.",
)
@SERVED
@click.option(
    "--purpose",
    type=click.Choice([purpose.value for purpose in Purpose]),
    default="development",
    show_default=True,
    help="Only qualification and acceptance can close requirements.",
)
@name_option("--operator", help="Who operates the bench; part of the evidence.")
@deviation_options
@ANSWERS
@click.option("--ask", is_flag=True, help="Ask questions at the terminal, even on a simulated bench.")
@click.option(
    "--output",
    type=Place(path_type=Path, file_okay=False),
    help="Folder for the package; reports/ of the workspace by default.",
)
@click.option(
    "--junit",
    type=NewFile(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="Also write the results to this file as JUnit XML.",
)
@click.option("--strict", is_flag=True, help="Exit with 1 if the run leaves a requirement of its plans uncovered.")
@click.option("--detach", is_flag=True, help="Detach from this terminal; return as soon as the run has started.")
@attendance_options
@click.option("-v", "--verbose", is_flag=True, help="Also show every step, driving call and gate.")
@click.pass_obj
def command(  # noqa: PLR0913 - one argument per option
    invocation: Invocation,
    /,
    *,
    plans: tuple[str, ...],
    bench: str,
    dut: str,
    source: str,
    served: Path | None,
    purpose: str,
    operator: str,
    only: tuple[str, ...],
    skips: tuple[str, ...],
    reasons: tuple[str, ...],
    overrides: tuple[str, ...],
    answers: Path | None,
    ask: bool,
    output: Path | None,
    junit: Path | None,
    strict: bool,
    detach: bool,
    verbose: bool,
    **attendance: Any,  # noqa: ANN401 - those of attendance_options
) -> int:
    """Run plans on a bench and seal the evidence.

    The last line of standard output is the package's path. Exit codes: 0 every case passed, 1 not
    every case passed, 2 interrupted, 3 internal error, 4 wrong usage or files, 5 no cases, 6 the
    envelope tripped, 7 the bench could not be proven safe.
    """
    given: dict[str, Any] = {"plans": plans, "bench": bench, "dut": dut, "only": only_of(only)}
    given |= {"skips": skips_of(skips, reasons), "overrides": overrides_of(overrides)}
    _require_text(bench=bench, dut=dut, reason="".join(reasons), parameter="".join(overrides))
    live = served is not None or Source(source) is Source.HARDWARE
    given |= attendance_of(attendance, left_alone=detach and live)
    if invocation.word is None:
        return _in_another_process(invocation, output, detach=detach, ask=ask)
    from hil.clock import wall  # noqa: PLC0415 - the process that waits stays light
    from hil.executive.setup.configuration import Request  # noqa: PLC0415 - after the pins

    invocation.word.listen()
    request = Request(
        start=Path.cwd(),
        source=Source(source),
        purpose=Purpose(purpose),
        operator=operator,
        answers=answers.resolve() if answers else None,
        person=ask,
        output=output.resolve() if output else None,
        junit=junit.resolve() if junit else None,
        strict=strict,
        served=served.resolve() if served else None,
        epoch=wall.utc_now() if live else "",
        **given,
    )
    return _run(request, invocation.word, verbose=verbose)


def _run(request: Request, word: Word, *, verbose: bool) -> int:
    from hil.plugin.running import run  # noqa: PLC0415 - after the pins

    code = run(request, sys.stdout, verbose=verbose, word=word)
    if isinstance(sys.stdout, Display) and not sys.stdout.finish() and word.folder:
        click.echo(f"hil: standard output could not be written; the package is {word.folder}", err=True)
    return code


def _in_another_process(invocation: Invocation, output: Path | None, *, detach: bool, ask: bool) -> int:
    """Wait for the process of the run, or detach from it; the waiting process stays light."""
    if detach and ask:
        raise Refused("--ask needs the terminal that --detach leaves", "give answers with --answers FILE")
    if detach and ONLOOKER not in os.environ:
        from hil.cli.starting import detach as start  # noqa: PLC0415 - only where it is asked for

        return start(invocation.arguments, output.resolve() if output else reports_folder())
    from hil.executive.setup.pins import pinned_environment  # noqa: PLC0415 - not where a run is let go

    return supervise(invocation, pinned_environment())


def _require_text(**options: str) -> None:
    """Refuse bytes that are not text in this terminal's encoding: no evidence could hold them."""
    for name, value in options.items():
        if any("\ud800" <= character <= "\udfff" for character in value):
            raise Refused(f"--{name} is not text in the encoding of this terminal", "type it again")
