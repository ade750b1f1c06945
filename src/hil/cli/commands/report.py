"""`hil report`: regenerate the report of a package."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.cli.run_names import find_run
from hil.cli.written import write_whole_file
from hil.model.errors import EvidenceError, Refused

if TYPE_CHECKING:
    from hil.evidence.package.verification import Verification

__all__ = ["command", "derived"]


@click.command(name="report", epilog="Example: hil report reports/reference --output /tmp/report")
@click.argument("run", metavar="RUN")
@click.option("--output", type=click.Path(path_type=Path, file_okay=False), help="Write the regenerated files there.")
@click.option(
    "--pdf", type=click.Path(path_type=Path, dir_okay=False), help="Print the page to this PDF file, with a browser."
)
def command(run: str, output: Path | None, pdf: Path | None) -> int:
    """Regenerate the report of a package, and compare it byte for byte with the one in the package.

    A sealed package is never changed. It is verified first: the report of a damaged one says DAMAGED on every page and
    has no verdict. Exit code 1 if the package is damaged, or the bytes differ.
    """
    from hil.evidence.package.listing import shown as printable  # noqa: PLC0415 - heavy
    from hil.evidence.package.verification import State, verify  # noqa: PLC0415 - heavy

    folder = find_run(run)
    found, whole = verify(folder), True
    if found.state is State.DAMAGED:
        name = printable(folder.name)
        click.echo(f"{name} is DAMAGED, so this report proves nothing: {found.problem}", err=True)
        click.echo(f"     hil verify {printable(run)} shows everything that is wrong", err=True)
    for name, (content, word, same) in derived(folder, found).items():
        whole = whole and same
        click.echo(f"{name}: {word}")
        if output:
            _write(output, name, content)
        if pdf and name == "report.html":
            _print(content, pdf)
    return 0 if whole else 1


def derived(folder: Path, found: Verification) -> dict[str, tuple[bytes, str, bool]]:
    """Return each file of the report as regenerated, how the packaged one compares, and whether that is right.

    Args:
        folder: the run's folder.
        found: what its verification found.

    Raises:
        EvidenceError: where the package does not hold what a report is made of.
    """
    from hil.evidence.folder import REPORT, is_sealed  # noqa: PLC0415 - heavy
    from hil.evidence.package.verification import State  # noqa: PLC0415 - heavy
    from hil.report.write import make_reports  # noqa: PLC0415 - heavy

    try:
        made = make_reports(folder, found)
    except (OSError, LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError) as error:
        what = f"{type(error).__name__}: {error}"
        raise EvidenceError(
            f"{folder.name}: no report can be derived: {what}", "hil verify shows what is wrong"
        ) from error
    compared = {}
    for name, content in made.items():
        inside = _inside(folder / REPORT / name)
        if found.state is State.DAMAGED:
            compared[name] = content, "not compared, because the package is damaged", False
        elif inside is None:
            compared[name] = content, "not in the package", not is_sealed(folder)
        elif inside == content:
            compared[name] = content, "identical to the one in the package", True
        else:
            compared[name] = content, "DIFFERS from the one in the package", False
    return compared


def _inside(path: Path) -> bytes | None:
    from hil.evidence.durable import read_plain  # noqa: PLC0415 - heavy

    try:
        return read_plain(path)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise EvidenceError(f"{path}: cannot be read: {error.strerror}", "hil verify shows what is wrong") from error


def _print(page: bytes, pdf: Path) -> None:
    from hil.report.printing import print_page  # noqa: PLC0415 - heavy

    print_page(page, pdf)
    click.echo(f"  printed to {pdf}")


def _write(output: Path, name: str, content: bytes) -> None:
    try:
        output.mkdir(parents=True, exist_ok=True)
        write_whole_file(output / name, content)
    except OSError as error:
        raise Refused(f"{output / name}: cannot be written: {error.strerror}", "choose another --output") from error
    click.echo(f"  written to {output / name}")
