"""What version control says of a folder: its commit, and what differs from it."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

from hil.evidence.durable import sha256_of

__all__ = ["digest_of", "git", "status", "tracked"]

_TIMEOUT_S = 10
_COMMIT = "# branch.oid "
_FIELDS = {"1": 8, "2": 9, "u": 10, "?": 1}
"""What `git status --porcelain=v2` writes before a path, by its line: changed, renamed, unmerged, untracked."""


def status(folder: Path, *arguments: str) -> tuple[str, list[str]]:
    """Return the commit that is checked out, empty if there is none, and what differs, by its path in the checkout."""
    told = git(folder, "status", "--porcelain=v2", "--branch", "-z", *arguments).split("\0")
    commit = next((entry.removeprefix(_COMMIT) for entry in told if entry.startswith(_COMMIT)), "")
    changed = [entry.split(" ", _FIELDS[entry[0]])[-1] for entry in told if entry and entry[0] in _FIELDS]
    return "" if commit == "(initial)" else commit, changed


def tracked(folder: Path, suffix: str) -> set[str]:
    """Return the SHA-256 of every file below a folder that version control has, as it is on the disk."""
    names = git(folder, "ls-files", "-z", "--", ".").split("\0")
    return {digest_of(folder / name) for name in names if name.endswith(suffix)}


def git(folder: Path, *arguments: str) -> str:
    """Return what git prints, nothing where it fails or is not there."""
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
