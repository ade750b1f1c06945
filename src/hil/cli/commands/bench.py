"""`hil bench`: check a bench, make it safe, or set up its computer."""

from __future__ import annotations

import shutil
import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.cli.display import Unwritten
from hil.cli.options import SERVED
from hil.documents.text import fitting
from hil.model.identity import Source

if TYPE_CHECKING:
    from hil.bench.gate import Gate

__all__ = ["command"]

_INTERRUPTED = 2
_UNSAFE = 7
_SOURCES = click.Choice([Source.HARDWARE.value, Source.SIMULATED.value])


@click.group(name="bench")
def command() -> None:
    """Check a bench, make it safe, or set up its computer."""


@command.command(epilog="Example: hil bench check adcs --source simulated")
@click.argument("name")
@click.option(
    "--source", type=_SOURCES, default="hardware", show_default=True, help="Real instruments, or their simulated twins."
)
@SERVED
@click.option(
    "--energise",
    is_flag=True,
    help="Also make the bench safe, try every output at its reduced level, and test the envelope.",
)
def check(name: str, source: str, served: Path | None, *, energise: bool) -> int:
    """Read the bench file, identify every instrument without driving it, and show what is ready.

    With --energise, Ctrl-C, SIGTERM or SIGHUP ends the check: nothing more is switched on, and every output is made
    safe. Exit codes: 0 if every gate passes, 1 otherwise; with --energise also 2 if it was stopped, and 7 if an
    output could not be proven safe at the end.
    """
    from hil.executive.bench_visit import check_bench  # noqa: PLC0415 - heavy

    checked = check_bench(Path.cwd(), name, Source(source), energise=energise, served=served, tell=_tell)
    _say(f"stopped by {checked.stopped}" if checked.stopped else "ready" if checked.ready else "not ready")
    if not checked.safe:
        return _UNSAFE
    return _INTERRUPTED if checked.stopped else 0 if checked.ready else 1


@command.command(epilog="Example: hil bench safe adcs --source simulated")
@click.argument("name")
@click.option(
    "--source", type=_SOURCES, default="hardware", show_default=True, help="Real instruments, or their simulated twins."
)
@SERVED
def safe(name: str, source: str, served: Path | None) -> int:
    """Bring every output to its safe state, in order, and prove it.

    It works while another process has the bench, and continues past an instrument that cannot be reached.
    Exit code 0 if every output is proven safe, 7 otherwise.
    """
    from hil.executive.bench_visit import safe_bench  # noqa: PLC0415 - heavy

    proven = True
    for result in safe_bench(Path.cwd(), name, Source(source), served=served, tell=_tell_beside):
        proven = proven and result.ok
        _say(f"{'safe    ' if result.ok else 'NOT SAFE'}  {result.output} {result.state}: {result.detail}")
    return 0 if proven else _UNSAFE


def _tell(gate: Gate) -> None:
    _say(f"{'ok    ' if gate.ok else 'NOT OK'}  {gate.name}: {gate.detail}")


def _say(line: str) -> None:
    """Print a line; an output without a reader must not disturb a bench that is being driven."""
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else 0
    with suppress(Unwritten):
        for part in fitting([line], width):
            click.echo(part)


def _tell_beside(who: str) -> None:
    click.echo(f"hil: {who}", err=True)
    click.echo("     making it safe anyway; a network instrument may answer only that process", err=True)


@command.command(epilog="\b\nExample: hil bench setup adcs --print udev | sudo tee /etc/udev/rules.d/70-hil-adcs.rules")
@click.argument("name")
@click.option(
    "--print",
    "kind",
    type=click.Choice(["udev", "polkit", "systemd", "tmpfiles"]),
    required=True,
    help="udev: names and permissions of its devices; polkit: inhibiting sleep; systemd: a run that survives"
    " logout; tmpfiles: the folder for latches.",
)
@click.option("--group", default="dialout", show_default=True, metavar="GROUP", help="Who may use the bench.")
def setup(name: str, kind: str, group: str) -> int:
    """Print system configuration for the bench computer, derived from the bench file.

    Nothing is changed. The first lines of each text say where an administrator installs it.
    """
    from hil.bench.file.reading import load_bench  # noqa: PLC0415 - heavy
    from hil.bench.host_setup import Host, setup_text  # noqa: PLC0415 - heavy
    from hil.executive.setup.workspace import find_workspace  # noqa: PLC0415 - heavy

    workspace = find_workspace(Path.cwd())
    spec = load_bench(workspace.benches, name, workspace.root, driven=False)
    host = Host(group=group, workspace=workspace.root, program=Path(sys.executable).with_name("hil"))
    click.echo(setup_text(kind, spec, host), nl=False)
    return 0
