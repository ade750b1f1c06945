"""`hil bench`: check a bench, or make it safe."""

from __future__ import annotations

from pathlib import Path

import click

from hil.cli.options import SERVED
from hil.model.identity import Source

__all__ = ["command"]

_SOURCES = click.Choice([Source.HARDWARE.value, Source.SIMULATED.value])


@click.group(name="bench")
def command() -> None:
    """Check a bench, or make it safe."""


@command.command(epilog="Example: hil bench check adcs --source simulated")
@click.argument("name")
@click.option("--source", type=_SOURCES, default="hardware", show_default=True, help="What the bench talks to.")
@SERVED
@click.option("--energise", is_flag=True, help="Also test every output at its reduced level.")
def check(name: str, source: str, served: Path | None, *, energise: bool) -> int:
    """Read the bench file, identify every instrument without driving it, and show what is ready.

    Exit code 0 if every gate passes, 1 otherwise.
    """
    from hil.executive.setup.bench_visit import check_bench  # noqa: PLC0415 - heavy

    ready = True
    for gate in check_bench(Path.cwd(), name, Source(source), energise=energise, served=served):
        ready = ready and gate.ok
        click.echo(f"{'ok    ' if gate.ok else 'NOT OK'}  {gate.name}: {gate.detail}")
    click.echo("ready" if ready else "not ready")
    return 0 if ready else 1


@command.command(epilog="Example: hil bench safe adcs --source simulated")
@click.argument("name")
@click.option("--source", type=_SOURCES, default="hardware", show_default=True, help="What the bench talks to.")
@SERVED
def safe(name: str, source: str, served: Path | None) -> int:
    """Bring every output to its safe state, in order, and prove it.

    It works while another process has the bench, and continues past an instrument that cannot be reached.
    Exit code 0 if every output is proven safe, 7 otherwise.
    """
    from hil.executive.setup.bench_visit import safe_bench  # noqa: PLC0415 - heavy

    proven = True
    for result in safe_bench(Path.cwd(), name, Source(source), served=served, tell=_tell_beside):
        proven = proven and result.ok
        click.echo(f"{'safe    ' if result.ok else 'NOT SAFE'}  {result.output} {result.state}: {result.detail}")
    return 0 if proven else 7


def _tell_beside(who: str) -> None:
    click.echo(f"hil: {who}", err=True)
    click.echo("     making it safe anyway; a network instrument may answer only that process", err=True)
