"""What software made a run: product, workspace, packages, and the environment in which numbers are computed."""

from __future__ import annotations

import base64
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Mapping
from functools import cache
from importlib import metadata
from pathlib import Path

import hil
from hil.documents.canonical import JsonError, parse_strict
from hil.evidence.durable import sha256_of
from hil.evidence.results.judging_code import judging_digest
from hil.model.errors import Refused

__all__ = ["PINNED", "customised", "pinned_environment", "require_assertions", "software_identity", "version"]

PINNED = {
    "NPY_DISABLE_CPU_FEATURES": "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_CORETYPE": "Haswell",
    "OPENBLAS_NUM_THREADS": "1",
    "PYTHONHASHSEED": "0",
}
"""Variables of the environment; they have to be there before NumPy is imported."""


def pinned_environment() -> dict[str, str]:
    """Return this process' environment with the pins set, pytest's own variables removed."""
    kept = {key: value for key, value in os.environ.items() if not key.startswith("PYTEST_")}
    return {**kept, **PINNED}


_GIT_TIMEOUT_S = 10
_BUILT = "built.json"
"""What the wheel has beside the product's modules: the commit of its source, and whether it differed."""
_COMMIT = "# branch.oid "
_FIELDS = {"1": 8, "2": 9, "u": 10, "?": 1}
"""What `git status --porcelain=v2` writes before a path, by its line: changed, renamed, unmerged, untracked."""
_FLAGS = ("optimize", "dev_mode", "ignore_environment", "isolated", "no_site", "no_user_site", "safe_path")
"""Flags of the interpreter that are frozen; with the first one it leaves assertions out."""


def require_assertions(optimize: int = sys.flags.optimize) -> None:
    """Refuse an interpreter that leaves assertions out: what a plan or a fixture asserts would not be looked at.

    Raises:
        Refused: for `python -O` and PYTHONOPTIMIZE.
    """
    if optimize:
        raise Refused(
            "this Python leaves assertions out, so that a case that asserts judges nothing",
            "unset PYTHONOPTIMIZE, and start Python without -O",
        )


def customised(modules: Mapping[str, object] = sys.modules) -> tuple[str, ...]:
    """Return which code ran before the product that no package holds, and that is no part of this Python."""
    found = ((name, getattr(modules.get(name), "__file__", None)) for name in ("sitecustomize", "usercustomize"))
    inside = (f"{sys.prefix}{os.sep}", f"{sys.base_prefix}{os.sep}")
    return tuple(
        f"Python ran a {name}.py from outside of its installation, which no package holds"
        for name, file in found
        if file and not str(file).startswith(inside)
    )


def version() -> str:
    """Return the product's version."""
    return metadata.version("hil")


def software_identity(workspace: Path) -> dict[str, object]:
    """Return what is frozen as `data/software.json`; the workspace's difference to its commit is kept whole."""
    return {
        "format": 1,
        "hil": {"version": version(), "commit": _source(Path(hil.__file__).parent)},
        "workspace": _workspace(workspace),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "packages": dict(_packages()),
        "flags": {name: int(getattr(sys.flags, name)) for name in _FLAGS},
        "numeric": {name: os.environ.get(name, "") for name in PINNED},
        "byte_order": sys.byteorder,
        "analysis": judging_digest(),
    }


@cache  # a process does not outlive its packages, and reading what they say of themselves takes long
def _packages() -> tuple[tuple[str, str], ...]:
    told = [item.metadata for item in metadata.distributions()]
    return tuple(sorted((facts["Name"], facts["Version"]) for facts in told))


def _workspace(folder: Path) -> dict[str, object]:
    commit, changed = _status(folder)
    difference = _git(folder, "diff", "HEAD") if commit else ""
    return {"commit": {"id": commit, "changed": bool(commit and changed)}, "difference": difference}


def _source(package: Path) -> dict[str, object]:
    """Return the commit of the product's own source, and the files that differ from it, by their SHA-256.

    What else lies in its checkout cannot change a run: plans and fixtures have digests of their own. A package that was
    installed into somebody's checkout is not part of it; it has the commit that its wheel names.
    """
    if not _git(package, "ls-files", "--", "__init__.py"):
        return _installed(package)
    commit, names = _status(package, "--no-renames", "--untracked-files=all", "--", ".")
    top = Path(_git(package, "rev-parse", "--show-toplevel").removesuffix("\n")) if names else package
    return {"id": commit, "changed": bool(names), "files": {name: _digest(top / name) for name in names}}


def _status(folder: Path, *arguments: str) -> tuple[str, list[str]]:
    """Return the commit that is checked out, empty if there is none, and what differs, by its path in the checkout."""
    told = _git(folder, "status", "--porcelain=v2", "--branch", "-z", *arguments).split("\0")
    commit = next((entry.removeprefix(_COMMIT) for entry in told if entry.startswith(_COMMIT)), "")
    changed = [entry.split(" ", _FIELDS[entry[0]])[-1] for entry in told if entry and entry[0] in _FIELDS]
    return "" if commit == "(initial)" else commit, changed


def _installed(package: Path) -> dict[str, object]:
    """Return the commit from which an installed package was built, and the files that differ from its RECORD.

    A wheel names every file by its SHA-256 (PEP 376, PEP 427), and in `built.json` the commit of its source.
    """
    found: dict[str, object] = {"id": "", "changed": False, "files": {}}
    try:
        built = parse_strict((package / _BUILT).read_bytes())
        recorded = {Path(str(each.locate())): each.hash for each in metadata.distribution("hil").files or ()}
    except (OSError, JsonError, metadata.PackageNotFoundError):
        return found
    if not isinstance(built, dict) or recorded.get(package / "__init__.py") is None:
        return found
    there = {path for path in package.rglob("*") if path.is_file() and "__pycache__" not in path.parts}
    due = {path for path in recorded if path.is_relative_to(package) and "__pycache__" not in path.parts}
    files = {
        path.relative_to(package.parent).as_posix(): _digest(path)
        for path in sorted(there | due)
        if not _is_as_recorded(path, recorded.get(path))
    }
    return {"id": str(built.get("commit", "")), "changed": built.get("changed") is not False or bool(files),
            "files": files}  # fmt: skip


def _is_as_recorded(path: Path, recorded: metadata.FileHash | None) -> bool:
    if recorded is None or recorded.mode != "sha256":
        return False
    digest = base64.urlsafe_b64encode(bytes.fromhex(_digest(path))).rstrip(b"=").decode()
    return digest == recorded.value


def _digest(path: Path) -> str:
    """Return a file's SHA-256, empty if it is gone."""
    try:
        return sha256_of(path)
    except OSError:
        return ""


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
