"""`hil plan`: print the procedure of plans."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import click

from hil.cli.options import ANSWERS, deviation_options, only_of, overrides_of, skips_of
from hil.cli.starting import pin
from hil.model.identity import Source

__all__ = ["command"]


@click.command(name="plan", epilog="Example: hil plan testplans/magnetorquer --bench adcs --dut SIM-ADCS-1")
@click.argument("plans", nargs=-1, required=True, metavar="PLAN...")
@click.option("--bench", required=True, metavar="NAME", help="The bench: fixtures/benches/NAME.")
@click.option("--dut", required=True, metavar="SERIAL", help="Serial number of the device under test.")
@deviation_options
@ANSWERS
def command(
    *,
    plans: tuple[str, ...],
    bench: str,
    dut: str,
    only: tuple[str, ...],
    skips: tuple[str, ...],
    reasons: tuple[str, ...],
    overrides: tuple[str, ...],
    answers: Path | None,
) -> int:
    """Print the procedure of plans: limits, steps, what each step drives, records and asks, and durations.

    The cases run from start to end on the simulated bench; no hardware is driven, and no package is kept.
    """
    pin()
    from hil.documents.text import fitting  # noqa: PLC0415 - after the pins
    from hil.executive.setup.configuration import Request  # noqa: PLC0415 - after the pins
    from hil.plugin.rehearsing import procedure  # noqa: PLC0415 - after the pins

    request = Request(
        start=Path.cwd(),
        plans=plans,
        bench=bench,
        dut=dut,
        source=Source.SIMULATED,
        only=only_of(only),
        skips=skips_of(skips, reasons),
        overrides=overrides_of(overrides),
        answers=answers.resolve() if answers else None,
    )
    columns = shutil.get_terminal_size().columns if sys.stdout.isatty() else 0
    for line in fitting(procedure(request), columns):
        click.echo(line)
    return 0
