"""The files of a plan, and how they are shown to a person."""

from __future__ import annotations

from pathlib import Path

__all__ = ["LOCK", "PARAMETERS", "REQUIREMENTS", "shown"]

REQUIREMENTS = "requirements.yaml"
LOCK = "requirements.lock.json"
PARAMETERS = "parameters.yaml"


def shown(file: Path, root: Path) -> str:
    """Return a path as shown to a person: relative to the workspace where it is inside."""
    return file.relative_to(root).as_posix() if file.is_relative_to(root) else str(file)
