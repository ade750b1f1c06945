"""State of a folder in version control: its commit, and what differs from it."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

from hil.evidence.durable import sha256_of

__all__ = ["digest_of", "git", "status", "tracked"]

_TIMEOUT_S = 10
_COMMIT = "# branch.oid "
_FIELDS = {"1": 8, "2": 9, "u": 10, "?": 1}
"""Number of fields before a path in `git status --porcelain=v2`: changed, renamed, unmerged, untracked."""


def status(folder: Path, *arguments: str) -> tuple[str, list[str]]:
    """Return the checked-out commit, empty if there is none, and what differs, by its path in the checkout."""
    entries = git(folder, "status", "--porcelain=v2", "--branch", "-z", *arguments).split("\0")
    commit = next((entry.removeprefix(_COMMIT) for entry in entries if entry.startswith(_COMMIT)), "")
    changed = [entry.split(" ", _FIELDS[entry[0]])[-1] for entry in entries if entry and entry[0] in _FIELDS]
    return "" if commit == "(initial)" else commit, changed


def tracked(folder: Path, suffix: str) -> set[str]:
    """Return the SHA-256, as on disk, of every file below a folder that is under version control."""
    names = git(folder, "ls-files", "-z", "--", ".").split("\0")
    return {digest_of(folder / name) for name in names if name.endswith(suffix)}


def git(folder: Path, *arguments: str) -> str:
    """Return what git prints, empty if it fails or is missing."""
    found = shutil.which("git")
    if found is None:
        return ""
    try:
        done = subprocess.run(  # noqa: S603 - git of this machine with fixed arguments
            [found, "-C", str(folder), *arguments], capture_output=True, text=True, timeout=_TIMEOUT_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired, UnicodeDecodeError):
        return ""
    return done.stdout if done.returncode == 0 else ""


def digest_of(path: Path) -> str:
    """Return a file's SHA-256, empty if it is gone."""
    try:
        return sha256_of(path)
    except OSError:
        return ""
