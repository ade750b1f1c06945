"""`hil report`: derive the report of a package again."""

from __future__ import annotations

from pathlib import Path

import click

from hil.cli.run_names import find_run
from hil.model.errors import EvidenceError, Refused

__all__ = ["command", "derived"]


@click.command(name="report", epilog="Example: hil report reports/reference --output /tmp/report")
@click.argument("run", metavar="RUN")
@click.option("--output", type=click.Path(path_type=Path, file_okay=False), help="Write the derived files there.")
def command(run: str, output: Path | None) -> int:
    """Derive the report of a package again, and compare it byte for byte with the one inside.

    A sealed package is never changed. Exit code 1 if the bytes differ.
    """
    folder = find_run(run)
    whole = True
    for name, (content, word, same) in derived(folder).items():
        whole = whole and same
        click.echo(f"{name}: {word}")
        if output:
            _write(output, name, content)
    return 0 if whole else 1


def derived(folder: Path) -> dict[str, tuple[bytes, str, bool]]:
    """Return, per file of the report, what it is now, how the one in the package compares, and whether that is right.

    Raises:
        EvidenceError: where the package does not hold what a report is made of.
    """
    from hil.evidence.folder import REPORT, is_sealed  # noqa: PLC0415 - heavy
    from hil.report.write import make_reports  # noqa: PLC0415 - heavy

    try:
        made = make_reports(folder)
    except (OSError, LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError) as error:
        what = f"{type(error).__name__}: {error}"
        raise EvidenceError(
            f"{folder.name}: no report can be derived: {what}", "hil verify shows what is wrong"
        ) from error
    found = {}
    for name, content in made.items():
        inside = _inside(folder / REPORT / name)
        if inside is None:
            found[name] = content, "not in the package", not is_sealed(folder)
        elif inside == content:
            found[name] = content, "identical to the one in the package", True
        else:
            found[name] = content, "DIFFERS from the one in the package", False
    return found


def _inside(path: Path) -> bytes | None:
    from hil.evidence.durable import read_plain  # noqa: PLC0415 - heavy

    try:
        return read_plain(path)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise EvidenceError(f"{path}: cannot be read: {error.strerror}", "hil verify shows what is wrong") from error


def _write(output: Path, name: str, content: bytes) -> None:
    try:
        output.mkdir(parents=True, exist_ok=True)
        (output / name).write_bytes(content)
    except OSError as error:
        raise Refused(f"{output / name}: cannot be written: {error.strerror}", "choose another --output") from error
    click.echo(f"  written to {output / name}")
