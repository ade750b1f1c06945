"""`hil init`: create a workspace that runs as it is, as a starting point."""

from __future__ import annotations

import os
import shlex
from contextlib import suppress
from pathlib import Path

import click

from hil.executive.setup.workspace import find_workspace
from hil.model.errors import Refused

__all__ = ["command"]

_FILES = {
    "hil.toml": "hil.toml",
    "fixtures/duts.yaml": "fixtures/duts.yaml",
    "fixtures/benches/load/bench.yaml": "fixtures/benches/load/bench.yaml",
    "fixtures/benches/load/certificates/psu1.txt": "fixtures/benches/load/certificates/psu1.txt",
    "testplans/load/requirements.yaml": "testplans/load/requirements.yaml",
    "testplans/load/parameters.yaml": "testplans/load/parameters.yaml",
    "testplans/load/test_load.py": "testplans/load/test_load.py.txt",
}
"""What a workspace consists of, and which file of the product it is a copy of."""

_BESIDE = {
    "README.md": "README.md",
    ".gitignore": "gitignore.txt",
    ".github/workflows/hil.yml": "ci/github.yml",
    ".gitlab-ci.yml": "ci/gitlab.yml",
}
"""What a repository may have already; existing files stay as they are."""


@click.command(name="init", epilog="Example: hil init bench && cd bench")
@click.argument("folder", type=click.Path(path_type=Path), default=Path())
def command(folder: Path) -> None:
    """Create a workspace in FOLDER, by default the current folder.

    It has one bench, one plan that passes on the simulated bench, and CI files for GitHub and GitLab; comments say what
    to change first. Nothing is overwritten: a folder that already is a workspace is refused, and an existing README.md,
    .gitignore or CI file stays as it is.
    """
    root = folder.absolute()
    _require_new(root, folder)
    try:
        for name, source in _FILES.items():
            _write(root / name, source)
        kept = [name for name, source in _BESIDE.items() if not _write(root / name, source)]
    except OSError as error:
        where = error.filename or folder
        raise Refused(f"{where}: cannot be written: {error.strerror}", "name a folder that you may write to") from error
    _lock(root)
    for name in (*_FILES, *_BESIDE):
        click.echo(f"{'kept' if name in kept else 'made'}  {name}")
    click.echo("made  testplans/load/requirements.lock.json")
    click.echo("next:")
    if root != Path.cwd():
        click.echo(f"  cd {shlex.quote(str(folder))}")
    if ".gitignore" in kept and not _leaves_packages_out(root / ".gitignore"):
        click.echo("  echo reports/ >> .gitignore")
    click.echo("  hil run load --bench load --source simulated --dut SIM-LOAD-1")


def _require_new(root: Path, folder: Path) -> None:
    """Require that no file of the workspace exists yet.

    Raises:
        Refused: with what is there.
    """
    hint = "name another folder: hil init FOLDER"
    for name in _FILES:
        if os.path.lexists(root / name):
            raise Refused(f"{folder / name} exists already", hint)
    around = None
    with suppress(Refused):
        around = find_workspace(root)
    if around is not None and around.root == root.resolve():
        raise Refused(f"{root} is a workspace already", hint)


def _write(path: Path, source: str) -> bool:
    """Copy a file of the product unless it exists; return whether it was copied."""
    content = (Path(__file__).parents[1] / "first_workspace" / source).read_bytes()
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        with path.open("xb") as stream:
            stream.write(content)
    except FileExistsError:
        return False
    return True


def _leaves_packages_out(ignored: Path) -> bool:
    """Return whether a .gitignore names the folder of packages: tracked, it would change with every run."""
    try:
        lines = ignored.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return False
    return any(line.strip().removeprefix("/").rstrip("/*") == "reports" for line in lines)


def _lock(root: Path) -> None:
    """Lock the requirement, as `hil requirements lock` does."""
    from hil.requirements.catalogue import load_catalogue  # noqa: PLC0415 - heavy
    from hil.requirements.lock import LOCK, lock_text  # noqa: PLC0415 - heavy

    plan = root / "testplans/load"
    requirements = load_catalogue(root, [plan], locked=False).of_plan(plan.name)
    (plan / LOCK).write_text(lock_text(requirements), encoding="utf-8")
