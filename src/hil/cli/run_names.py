"""Runs by name: finding the one that is meant, what it waits for, and its reply."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from hil.documents.suggest import did_you_mean
from hil.model.errors import Refused

if TYPE_CHECKING:
    from hil.evidence.events import Event
    from hil.report.live.following import Follower

__all__ = [
    "LATEST",
    "answer_of",
    "find_run",
    "find_running",
    "fixtures_folder",
    "latch_word",
    "reports_folder",
    "shown",
]

_PATIENCE_S = 10.0
_LOOK_S = 0.1

LATEST = "latest"
"""The name of the newest run of the workspace."""


def reports_folder() -> Path:
    """Return the reports folder of the workspace around the current folder."""
    from hil.executive.setup.workspace import find_workspace  # noqa: PLC0415 - only where a run is named

    return find_workspace(Path.cwd()).reports


def fixtures_folder() -> Path:
    """Return the fixtures folder of the workspace around the current folder."""
    from hil.executive.setup.workspace import find_workspace  # noqa: PLC0415 - only where somebody signs

    return find_workspace(Path.cwd()).fixtures


def shown(path: Path) -> str:
    """Return a path as a person would type it: relative to the current folder if it is inside."""
    return str(path.relative_to(Path.cwd())) if path.is_relative_to(Path.cwd()) else str(path)


def find_running(asked: str) -> Path:
    """Return the folder of a run in progress, which reads its inbox.

    Raises:
        Refused: if there is none, or it reads its inbox no more.
    """
    from hil.evidence.folder import is_held, is_sealed  # noqa: PLC0415 - only where a run is spoken to

    folder = find_run(asked)
    if is_sealed(folder):
        raise Refused(f"{folder.name} is sealed", "a sealed run cannot be changed")
    if not is_held(folder):
        raise Refused(
            f"{folder.name} is not running; it was interrupted", "hil resume continues it, hil seal seals it as it is"
        )
    return folder


def find_run(asked: str) -> Path:
    """Return the folder of a run: by path, by name, by the beginning of its name or its short id, or the latest.

    Raises:
        Refused: if there is none, or several.
    """
    from hil.evidence.folder import is_run  # noqa: PLC0415 - only where a run is named
    from hil.evidence.package.listing import shown as printable  # noqa: PLC0415 - only where a run is named
    from hil.evidence.runs import run_folders  # noqa: PLC0415 - only where a run is named

    told = printable(asked)
    if not asked.strip() or "\0" in asked:
        raise Refused(f"'{told}' names no run", "name one by its path, its name or its short id, or say latest")
    if asked != LATEST and is_run(Path(asked)):
        return _absolute(Path(asked))
    folders = run_folders(reports_folder())
    if asked == LATEST:
        if not folders:
            raise Refused("there is no run yet", "hil run starts one")
        return folders[-1]
    found = _meant(asked.rstrip("/"), folders)
    if len(found) == 1:
        return found[0]
    names = [printable(folder.name) for folder in found or folders]
    if found:
        raise Refused(f"'{told}' could be {', '.join(sorted(names))}", "type more of the name")
    raise Refused(f"there is no run '{told}'{did_you_mean(asked, names)}", "hil runs lists the runs")


def latch_word(folder: Path) -> str:
    """Return what a run with a latched bench waits for; empty for any other."""
    from hil.executive.ending.acknowledging import waits_for_ack  # noqa: PLC0415 - heavy

    return f"latched until hil ack {folder.name}" if waits_for_ack(folder) else ""


def answer_of(follower: Follower, *awaited: type[Event]) -> Event | None:
    """Return the next event of one of these kinds, None at timeout or if the run ends."""
    from hil.clock import wall  # noqa: PLC0415 - only when it is used

    end = wall.monotonic() + _PATIENCE_S
    while wall.monotonic() < end and follower.goes_on():
        for line in follower.read():
            if isinstance(line.event, awaited):
                return line.event
        wall.pause(_LOOK_S)
    return None


def _meant(asked: str, folders: Sequence[Path]) -> list[Path]:
    """Return the runs with this name, else those whose name begins so or has this short id."""
    exact = [folder for folder in folders if folder.name == asked]
    return exact or [
        folder for folder in folders if folder.name.startswith(asked) or folder.name.rpartition("-")[2] == asked
    ]


def _absolute(path: Path) -> Path:
    try:
        return path.resolve(strict=True)
    except (OSError, RuntimeError) as error:
        raise Refused(f"{path}: cannot be opened: {error}", "hil runs lists the runs") from error
