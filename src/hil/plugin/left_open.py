"""Closing lines of a run that was stopped and is not sealed: why, and what to do next."""

from __future__ import annotations

import shutil
from pathlib import Path

from hil.bench.lease import ack_line, latches_of
from hil.executive.journaling.events import DISK_FULL

__all__ = ["left_open_lines", "lost_lines"]


def lost_lines(folder: Path, reason: str, *, unsafe: bool) -> list[str]:
    """Return why a run was stopped by a loss, and what to do next.

    Args:
        folder: the run's folder.
        reason: what was lost.
        unsafe: whether an output is not proven safe, so that the bench is latched.
    """
    state = "NOT PROVEN SAFE: look at it, and switch off by hand what is on" if unsafe else "safe"
    steps = ["put right what was lost", *([ack_line(folder.name)] if latches_of(folder.name) else [])]
    return [f"stopped by {reason}", f"the bench is {state}", f"{', then '.join(steps)}, then hil resume {folder.name}"]


def left_open_lines(folder: Path, reason: str) -> list[str]:
    """Return why a run was stopped and is not sealed, and what to do next.

    Args:
        folder: the run's folder.
        reason: why it was stopped; for a full disk, the lines also say which one and how much is free now.
    """
    if reason != DISK_FULL:
        return [f"stopped, and not sealed: resume it with hil resume {folder.name}"]
    ways = f"resume it with hil resume {folder}, or seal it as it is with hil seal {folder}"
    return [f"stopped by a full disk, and not sealed: {_disk(folder)}", f"free some space there, then {ways}"]


def _disk(folder: Path) -> str:
    """Return the mount point of the folder's file system, and the space free now that the reserve was released."""
    folder = folder.resolve()
    mounted = next((place for place in (folder, *folder.parents) if place.is_mount()), folder)
    try:
        free = shutil.disk_usage(folder).free
    except OSError:
        return f"{mounted}"
    return f"{mounted} has {free:,} bytes free".replace(",", " ")
