"""`hil requirements`: lock the meaning of a plan's requirements, and show what changed since."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.cli.written import write_whole_file
from hil.documents.findings import Findings
from hil.executive.setup.workspace import Workspace, find_workspace
from hil.model.errors import Refused
from hil.requirements.lock import LOCK

if TYPE_CHECKING:
    from hil.requirements.catalogue import Catalogue

__all__ = ["command"]


@click.group("requirements")
def command() -> None:
    """Lock the meaning of requirements, and show what has changed since.

    Every revision of a requirement has one meaning: its text, its limits, its records. The file
    requirements.lock.json in the plan's folder records it, and is committed with the plan.

    \b
    Example:
      hil requirements diff testplans/coil-field
      hil requirements lock testplans/coil-field
    """  # noqa: D301 - click reads \b


@command.command("lock")
@click.argument("plans", metavar="PLAN...", nargs=-1, required=True)
def lock(plans: tuple[str, ...]) -> None:
    """Write requirements.lock.json of each PLAN.

    Refused if a meaning changed without a new rev, if a rev changed without a new meaning, or if a
    requirement was removed instead of withdrawn.

    \b
    Example:
      hil requirements lock testplans/coil-field
    """  # noqa: D301 - click reads \b
    from hil.requirements.lock import check_lock, lock_text  # noqa: PLC0415 - start-up stays light

    workspace, folders, catalogue = _opened(plans)
    findings = Findings()
    for folder in folders:
        check_lock(folder, workspace.shown(folder), catalogue.of_plan(folder.name), findings, writing=True)
    findings.raise_if_any()
    for folder in folders:
        requirements = catalogue.of_plan(folder.name)
        _write(folder / LOCK, lock_text(requirements))
        noun = "requirement" if len(requirements) == 1 else "requirements"
        click.echo(f"{workspace.shown(folder / LOCK)}: {len(requirements)} {noun} locked")


@command.command("diff")
@click.argument("plans", metavar="PLAN...", nargs=-1, required=True)
def diff(plans: tuple[str, ...]) -> None:
    """Show what has changed in each PLAN since its lock was written.

    One line per requirement: added, removed, semantic (evidence for the older revision no longer counts)
    or editorial (explanations and spacing only); below it one line per field, with its old and new value.

    \b
    Example:
      hil requirements diff testplans/coil-field
    """  # noqa: D301 - click reads \b
    from hil.requirements.lock import changes, read_lock  # noqa: PLC0415 - start-up stays light

    workspace, folders, catalogue = _opened(plans)
    findings = Findings()
    locks = {folder: read_lock(folder, workspace.shown(folder), findings) for folder in folders}
    findings.raise_if_any()
    for folder, locked in locks.items():
        found = changes(locked or {}, catalogue.of_plan(folder.name))
        if not found:
            click.echo(f"{workspace.shown(folder)}: no changes")
        for change in found:
            click.echo(f"{workspace.shown(folder)}: {change.kind.value:9} {change.id} ({change.detail})")
            for field in change.fields:
                click.echo(f"  {field}")


def _write(path: Path, text: str) -> None:
    try:
        write_whole_file(path, text.encode())
    except OSError as error:
        raise Refused(f"{path}: cannot be written: {error.strerror}", "make it writable") from error


def _opened(plans: tuple[str, ...]) -> tuple[Workspace, list[Path], Catalogue]:
    from hil.requirements.catalogue import load_catalogue  # noqa: PLC0415 - start-up stays light

    workspace = find_workspace(Path.cwd())
    folders = list(dict.fromkeys(workspace.plan(plan, Path.cwd()) for plan in plans))
    return workspace, folders, load_catalogue(workspace.root, folders, locked=False)
