"""Which run a person means."""

from __future__ import annotations

from pathlib import Path

from hil.documents.suggest import did_you_mean
from hil.model.errors import Refused

__all__ = ["find_run", "find_running", "reports_folder", "shown"]


def reports_folder() -> Path:
    """Return the reports folder of the workspace that holds the present folder."""
    from hil.executive.setup.workspace import find_workspace  # noqa: PLC0415 - only where a run is named

    return find_workspace(Path.cwd()).reports


def shown(path: Path) -> str:
    """Return a path as a person types it: relative to the present folder where it is inside."""
    return str(path.relative_to(Path.cwd())) if path.is_relative_to(Path.cwd()) else str(path)


def find_running(asked: str) -> Path:
    """Return the folder of a run that is going on, to which something can be said.

    Raises:
        Refused: if there is none, or nobody would listen any more.
    """
    from hil.evidence.folder import is_held, is_sealed  # noqa: PLC0415 - only where a run is spoken to

    folder = find_run(asked)
    if is_sealed(folder):
        raise Refused(f"{folder.name} is sealed", "a sealed run takes nothing any more")
    if not is_held(folder):
        raise Refused(f"{folder.name} is not going on, it was interrupted", "hil seal seals it as it is")
    return folder


def find_run(asked: str) -> Path:
    """Return the folder of a run, named by path, by name, or by an unambiguous part of its name.

    Raises:
        Refused: if there is none, or several.
    """
    path = Path(asked)
    if (path / "data").is_dir():
        return path.resolve()
    reports = reports_folder()
    names = (
        sorted(folder.name for folder in reports.iterdir() if (folder / "data").is_dir()) if reports.is_dir() else []
    )
    found = [name for name in names if asked.strip("/") in name]
    if len(found) == 1:
        return reports / found[0]
    if found:
        raise Refused(f"'{asked}' could be {', '.join(found)}", "name more of it")
    raise Refused(f"there is no run '{asked}'{did_you_mean(asked, names)}", "hil runs lists what there is")
