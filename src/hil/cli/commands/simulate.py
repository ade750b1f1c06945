"""`hil simulate`: serve a simulated bench to other programs."""

from __future__ import annotations

import os
import signal
import tempfile
from pathlib import Path

import click

from hil.cli.options import Within

__all__ = ["command"]

_MOST_PORTS = 65_535


@click.command(name="simulate", epilog="Example: hil simulate adcs --speed 20")
@click.argument("bench", metavar="BENCH")
@click.option(
    "--folder",
    type=click.Path(path_type=Path),
    metavar="DIRECTORY",
    help="Folder for the links and the control socket.",
)
@click.option(
    "--speed",
    type=Within(0, 1e6, min_open=True),
    default=1.0,
    show_default=True,
    metavar="FACTOR",
    help="Seconds of bench time per second of wall time.",
)
@click.option(
    "--first-port",
    type=click.IntRange(0, _MOST_PORTS),
    default=0,
    metavar="PORT",
    help="First port for network instruments; 0 picks free ones.",
)
def command(bench: str, folder: Path | None, speed: float, first_port: int) -> int:
    """Serve the simulated twin of BENCH to other programs, until Ctrl-C.

    Serial instruments become pseudo-terminals, network instruments ports of 127.0.0.1. The socket `control` in the
    folder reports the true state, and accepts faults to inject.
    """
    from hil.executive.bench_visit import serve_bench  # noqa: PLC0415 - heavy
    from hil.report.tables import aligned  # noqa: PLC0415 - heavy

    place = folder or Path(tempfile.gettempdir()) / f"hil-{os.getuid()}-{bench.replace(os.sep, '-')}"
    with serve_bench(Path.cwd(), bench, place, speed=speed, first_port=first_port) as served:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, lambda *_: served.stop())
        click.echo(f"SIMULATED: bench {served.spec.name} at {speed:g} times real time; none of this is hardware")
        rows = {**served.where, "control": str(place.absolute() / "control")}
        for line in aligned(rows.items()):
            click.echo(line)
        click.echo("ready")
        served.run()
    return 0
