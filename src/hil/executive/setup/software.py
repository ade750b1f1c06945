"""What software made a run: product, workspace, packages, and how numbers are computed here."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
from functools import cache
from importlib import metadata
from pathlib import Path

from hil.executive.setup.pins import PINNED

__all__ = ["software_identity", "version"]

_GIT_TIMEOUT_S = 10


def version() -> str:
    """Return the product's version."""
    return metadata.version("hil")


def software_identity(workspace: Path) -> dict[str, object]:
    """Return what is frozen as `data/software.json`; the difference to the commit is kept whole."""
    return {
        "format": 1,
        "hil": {"version": version(), "commit": _commit(Path(__file__).parent)},
        "workspace": {"commit": _commit(workspace), "difference": _git(workspace, "diff", "HEAD")},
        "python": platform.python_version(),
        "platform": platform.platform(),
        "packages": dict(_packages()),
        "numeric": {name: os.environ.get(name, "") for name in PINNED},
        "byte_order": sys.byteorder,
    }


@cache  # a process does not outlive its packages, and reading what they say of themselves takes long
def _packages() -> tuple[tuple[str, str], ...]:
    told = [item.metadata for item in metadata.distributions()]
    return tuple(sorted((facts["Name"], facts["Version"]) for facts in told))


def _commit(folder: Path) -> dict[str, object]:
    commit = _git(folder, "rev-parse", "HEAD").strip()
    return {"id": commit, "changed": bool(commit and _git(folder, "status", "--porcelain").strip())}


def _git(folder: Path, *arguments: str) -> str:
    git = shutil.which("git")
    if git is None:
        return ""
    try:
        done = subprocess.run(  # noqa: S603 - git of this machine with fixed arguments
            [git, "-C", str(folder), *arguments], capture_output=True, text=True, timeout=_GIT_TIMEOUT_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired, UnicodeDecodeError):
        return ""
    return done.stdout if done.returncode == 0 else ""
