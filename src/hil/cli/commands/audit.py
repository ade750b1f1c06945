"""`hil audit`: the status of every requirement over all packages."""

from __future__ import annotations

import gc
import hashlib
import os
import sys
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hil.cli.commands.ledger import require_head
from hil.cli.display import write_bytes
from hil.cli.options import name_option
from hil.cli.written import whole
from hil.clock import wall
from hil.clock.wall import is_date
from hil.documents.text import counted, visible
from hil.executive.setup.workspace import find_workspace
from hil.model.errors import Refused

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.audit.changes import Change
    from hil.audit.document import Document
    from hil.audit.inputs import World
    from hil.audit.reading import Folders

__all__ = ["command", "workspace_folders"]

_FORMATS = ("csv", "html", "json", "xlsx")
_OPEN, _DAMAGED = 1, 2
_DAMAGES = frozenset({"INTEGRITY", "MISSING_PACKAGE"})


@contextmanager
def _uncollected() -> Iterator[None]:
    """Suspend garbage collection: an audit holds large trees without cycles, and each collection walks all of them."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


@click.command(name="audit", epilog="Example: hil audit --strict --format json --output build")
@click.option("--as-of", metavar="DATE", help="Status at the end of a past day (UTC), from the ledger.")
@click.option(
    "--if", "supposed", metavar="FILE", help="Show only what a changed catalogue or register would reopen or close."
)
@click.option("--head", metavar="SHA256", help="A head published earlier; the ledger must still contain it.")
@click.option("--strict", is_flag=True, help="Exit with 1 if a requirement is open or the settings name no ledger.")
@click.option("--record", is_flag=True, help="Enter catalogue, registers and changes of status into the ledger.")
@click.option("--because", default="", metavar="TEXT", help="Why entries were removed from catalogue or registers.")
@name_option("--by", help="Who gives that reason.")
@click.option("--format", "formats", metavar="FORMAT", multiple=True, help=f"Write a file: {', '.join(_FORMATS)}.")
@click.option("--output", metavar="DIR", type=click.Path(path_type=Path), help="Folder for the files.")
@click.option("--no-cache", is_flag=True, help="Verify every package, even those unchanged since the last audit.")
@_uncollected()
def command(
    as_of: str | None,
    supposed: str | None,
    head: str | None,
    strict: bool,
    formats: tuple[str, ...],
    output: Path | None,
    no_cache: bool,
    **entered: Any,  # noqa: ANN401 - record: bool, because: str, by: str
) -> int:
    """Compute the status of every requirement over all packages.

    A requirement is closed while hardware evidence meets every condition: passed, eligible, intact, entered in the
    ledger, valid for the present text, unit and analysis, with no instrument in doubt. Otherwise it is open, and every
    reason is listed. No status is entered by hand.

    An entry removed from the catalogue or a register counts until --record --because TEXT --by NAME says why.

    --if takes a changed requirements.yaml, duts.yaml, instruments.yaml, nonconformances.yaml, waivers.yaml or
    verifications.yaml, or the word analysis.

    Exit code 0; 1 with --strict if a requirement is open or the settings name no ledger; 2 if a package or the ledger
    is damaged.
    """
    from hil.audit.cache import Cache  # noqa: PLC0415 - heavy
    from hil.audit.engine import audit  # noqa: PLC0415 - heavy
    from hil.audit.reading import read_world  # noqa: PLC0415 - heavy
    from hil.audit.recorded import past  # noqa: PLC0415 - heavy
    from hil.evidence.unchanged import cache_folder, product_key  # noqa: PLC0415 - heavy

    record, because, by = entered["record"], entered["because"], entered["by"]
    _require_reason(because, by, record=record)
    _require_sense(as_of=as_of, supposed=supposed, head=head, record=record, formats=formats, output=output)
    folders = workspace_folders()
    cache = Cache(None if no_cache or record else cache_folder("audit"), product_key())
    world = read_world(folders, cache, version=metadata.version("hil"), locked=supposed is None, published_head=head)
    if as_of:
        world = past(world, folders.reports, as_of)
    if supposed:
        return _suppose(world, folders, supposed)
    if because:
        world = _explain(world, folders, because.strip(), by)
    document = audit(world)
    if record:
        _record(world, document, folders)
    _tell(document, formats, output, folders)
    if pin := _missing_pin(world, folders):
        click.echo(f"\n{pin}", err=bool(formats and not output))
    if _is_damaged(document, world):
        return _DAMAGED
    return _OPEN if strict and (document.summary.open or pin) else 0


def _tell(document: Document, formats: Sequence[str], output: Path | None, folders: Folders) -> None:
    """Write the requested files, and what is open unless standard output is one of them."""
    if formats:
        _write(document, formats, output, folders.reports)
    if not formats or output:
        from hil.audit.pages.terminal import as_lines  # noqa: PLC0415 - heavy

        for line in as_lines(document):
            click.echo(visible(line))
        if not formats and document.summary.open:
            click.echo("\nEvery reason of every requirement: hil audit --format html --output DIR")


def _missing_pin(world: World, folders: Folders) -> str:
    """Return a warning if the settings name no ledger, with the line to add; empty if they name one."""
    from hil.evidence.ledger.book import ledger_file  # noqa: PLC0415 - heavy

    file = ledger_file(folders.reports)
    if folders.ledger or world.as_of or not file.exists():
        return ""
    with file.open("rb") as lines:
        first = hashlib.sha256(lines.readline()).hexdigest()
    return (
        "NOT PINNED: the settings of the workspace name no ledger, so a replaced one would go unnoticed; "
        f'add to hil.toml: ledger = "{first}"'
    )


def _require_sense(
    *,
    as_of: str | None,
    supposed: str | None,
    head: str | None,
    record: bool,
    formats: Sequence[str],
    output: Path | None,
) -> None:
    if head is not None:
        require_head(head)
    if as_of is not None and not is_date(as_of):
        raise Refused(f"--as-of {as_of} is not a day", "write it as 2026-11-22")
    if as_of is not None and as_of > (today := wall.utc_now()[:10]):
        raise Refused(f"--as-of {as_of} is not over yet: it is {today} (UTC)", "name a day up to now")
    if record and (as_of or supposed):
        raise Refused("--record enters the present state only", "leave out --as-of and --if")
    if supposed and formats:
        raise Refused("--if prints what would change, and writes no files", "leave out --format")
    for each in formats:
        if each not in _FORMATS:
            raise Refused(f"there is no format '{each}'", f"there are: {', '.join(_FORMATS)}")
    if output is None and "xlsx" in formats and sys.stdout.isatty():
        raise Refused("a workbook cannot be shown on a terminal", "add --output DIR")
    if output is None and len(formats) > 1:
        raise Refused(f"{len(formats)} formats cannot go to standard output together", "add --output DIR")


def _require_reason(because: str, by: str, *, record: bool) -> None:
    if because and not (because.strip() and because.isprintable()):
        raise Refused("--because must be one line", 'say why: --because "entered for the wrong unit"')
    if bool(because) != bool(by) or (because and not record):
        raise Refused(
            "--record, --because and --by belong together", "give the reason with --because, and your name with --by"
        )


def workspace_folders() -> Folders:
    """Return the folders of the workspace around the current folder."""
    from hil.audit.reading import Folders  # noqa: PLC0415 - heavy

    found = find_workspace(Path.cwd())
    return Folders(
        root=found.root,
        testplans=found.testplans,
        fixtures=found.fixtures,
        reports=found.reports,
        name=found.name,
        ledger=found.ledger,
    )


def _write(document: Document, formats: Sequence[str], output: Path | None, reports: Path) -> None:
    link = os.path.relpath(reports, output or Path.cwd())
    for each in dict.fromkeys(formats):
        pieces = _pieces(document, each, link)
        if output is None:
            for piece in pieces:
                write_bytes(piece)
            return
        path = output / f"audit.{each}"
        try:
            output.mkdir(parents=True, exist_ok=True)
            with whole(path) as stream:
                stream.writelines(pieces)
        except OSError as error:
            raise Refused(
                f"{path}: cannot be written: {error.strerror}", "name another folder with --output"
            ) from error


def _pieces(document: Document, form: str, link: str) -> Iterator[bytes]:
    """Yield a file in pieces; `link` leads from where it will lie to the packages."""
    from hil.audit.pages.page import as_html  # noqa: PLC0415 - heavy
    from hil.audit.pages.workbook import as_xlsx  # noqa: PLC0415 - heavy
    from hil.audit.tables import as_csv, as_json  # noqa: PLC0415 - heavy

    if form == "html":
        yield from map(str.encode, as_html(document, link))
    else:
        yield {"csv": as_csv, "json": as_json, "xlsx": as_xlsx}[form](document)


def _explain(world: World, folders: Folders, because: str, by: str) -> World:
    from hil.audit.recorded import explain  # noqa: PLC0415 - heavy
    from hil.audit.remembered import removed_from  # noqa: PLC0415 - heavy

    gone = removed_from(world.asked, world.register, world.remembered).told
    for each in gone:
        click.echo(visible(f"explained: {each.name}"), err=True)
    return explain(folders.reports, world, by=by, text=because) if gone else world


def _record(world: World, document: Document, folders: Folders) -> None:
    from hil.audit.recorded import record  # noqa: PLC0415 - heavy
    from hil.evidence.ledger.approvals import keep_signers  # noqa: PLC0415 - heavy
    from hil.registers.signers import SIGNERS, load_signers  # noqa: PLC0415 - heavy

    if (folders.fixtures / SIGNERS).exists():
        keep_signers(folders.reports, load_signers(folders.fixtures))
    baselines, changes = record(folders.reports, world, document)
    click.echo(f"recorded: {counted(baselines, 'baseline')}, {counted(changes, 'change')} of status", err=True)


def _suppose(world: World, folders: Folders, changed: str) -> int:
    from hil.audit.changes import changes  # noqa: PLC0415 - heavy
    from hil.audit.engine import audit  # noqa: PLC0415 - heavy
    from hil.audit.supposed import suppose  # noqa: PLC0415 - heavy

    before, after = map(audit, suppose(world, folders, changed))
    found = changes(before, after)
    if not found:
        click.echo("nothing would change")
    for line in _changed_lines(found, before) if found else ():
        click.echo(visible(line))
    return 0


def _is_damaged(document: Document, world: World) -> bool:
    return (
        bool(world.problems)
        or any(not each.known for each in world.packages)
        or "INTEGRITY" in document.summary.reasons
        or "MISSING_PACKAGE" in document.summary.reasons
    )


def _changed_lines(found: Sequence[Change], before: Document) -> Iterator[str]:
    reopened = sum(change.what == "reopened" for change in found)
    closed = counted(before.summary.closed, "closed requirement")
    yield f"{reopened} of {closed} would be reopened, {len(found) - reopened} more changed"
    for change in found:
        yield f"{change.what:9} {change.id}"
        for reason in change.gained:
            yield f"  + {reason.code}: {reason.text}"
        for reason in change.lost:
            yield f"  - {reason.code}: {reason.text}"
        for sentence in change.told:
            yield f"  * {sentence}"
