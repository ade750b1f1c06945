"""`hil report`: derive the report of a package again."""

from __future__ import annotations

from pathlib import Path

import click

from hil.cli.folders import find_run

__all__ = ["command"]


@click.command(name="report", epilog="Example: hil report reports/reference --output /tmp/report")
@click.argument("run", metavar="RUN")
@click.option("--output", type=click.Path(path_type=Path, file_okay=False), help="Write the derived files there.")
def command(run: str, output: Path | None) -> int:
    """Derive the report of a package again, and compare it byte for byte with the one inside.

    A sealed package is never changed. Exit code 1 if the bytes differ.
    """
    from hil.evidence.folder import REPORT  # noqa: PLC0415 - heavy
    from hil.report.write import make_reports  # noqa: PLC0415 - heavy

    folder = find_run(run)
    same = True
    for name, content in make_reports(folder).items():
        inside = folder / REPORT / name
        word = "not in the package yet"
        if inside.exists():
            equal = inside.read_bytes() == content
            same = same and equal
            word = "the same bytes as in the package" if equal else "OTHER bytes than in the package"
        click.echo(f"{name}: {word}")
        if output:
            output.mkdir(parents=True, exist_ok=True)
            (output / name).write_bytes(content)
            click.echo(f"  written to {output / name}")
    return 0 if same else 1
