"""Software identity of a run: product, workspace, packages, and the numerical environment."""

from __future__ import annotations

import base64
import os
import platform
import sys
from collections.abc import Mapping
from functools import cache
from importlib import metadata
from pathlib import Path

import hil
from hil.documents.canonical import JsonError, parse_strict
from hil.evidence.results.judging_code import judging_digest
from hil.executive.setup.checkout import digest_of, git, status
from hil.executive.setup.pins import PINNED
from hil.model.errors import Refused

__all__ = [
    "changing",
    "customised",
    "product_source",
    "require_assertions",
    "software_identity",
    "version",
]

_BUILT = "built.json"
"""File in the wheel beside the product's modules: the commit of its source, and whether that differed."""
_FLAGS = ("optimize", "dev_mode", "ignore_environment", "isolated", "no_site", "no_user_site", "safe_path")
"""Interpreter flags that are frozen; the first one removes assertions."""


_CHANGING = frozenset(
    {
        "GCONV_PATH",
        "PYTHONBREAKPOINT",
        "PYTHONEXECUTABLE",
        "PYTHONHOME",
        "PYTHONINSPECT",
        "PYTHONPATH",
        "PYTHONPLATLIBDIR",
        "PYTHONPYCACHEPREFIX",
        "PYTHONSTARTUP",
        "PYTHONUSERBASE",
    }
)
"""Variables that make Python, or the C library, execute code other than what is installed."""
_OF_LOADER = ("LD_", "DYLD_")
"""Prefixes of the dynamic linker's variables (`man ld.so`): LD_PRELOAD, LD_AUDIT, LD_LIBRARY_PATH."""
_BEGAN = Path("/proc/self/environ")
_LOADS = Path("/etc/ld.so.preload")


def require_assertions(optimize: int = sys.flags.optimize) -> None:
    """Refuse an interpreter that removes assertions: those of plans and fixtures would not be checked.

    Raises:
        Refused: for `python -O` and PYTHONOPTIMIZE.
    """
    if optimize:
        raise Refused(
            "this Python leaves assertions out, so a case that asserts would judge nothing",
            "unset PYTHONOPTIMIZE, and start Python without -O",
        )


def customised(modules: Mapping[str, object] = sys.modules) -> tuple[str, ...]:
    """Return the code that ran before the product and belongs neither to a package nor to this Python."""
    found = ((name, getattr(modules.get(name), "__file__", None)) for name in ("sitecustomize", "usercustomize"))
    inside = (f"{sys.prefix}{os.sep}", f"{sys.base_prefix}{os.sep}")
    return tuple(
        f"Python ran a {name}.py from outside of its installation, which no package holds"
        for name, file in found
        if file and not str(file).startswith(inside)
    )


def changing(environment: Mapping[str, str] = os.environ, began: Path = _BEGAN, loads: Path = _LOADS) -> list[str]:
    """Return what changes which code an interpreter or its libraries execute: variables, and the loader's file.

    Args:
        environment: the present variables.
        began: holds those with which this process began, which code before hil may have removed.
        loads: lists libraries that the system loads into every process.
    """
    names = set(environment) | {
        each.partition(b"=")[0].decode(errors="replace") for each in _content(began).split(b"\0")
    }
    found = sorted(each for each in names if each in _CHANGING or each.startswith(_OF_LOADER))
    return [*found, str(loads)] if _content(loads).strip() else found


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError:
        return b""


def version() -> str:
    """Return the product's version."""
    return metadata.version("hil")


def software_identity(workspace: Path) -> dict[str, object]:
    """Return what is frozen as `data/software.json`; the workspace's diff to its commit is kept in full."""
    from hil.executive.setup.other_code import at_start, of_no_package, other_packages  # noqa: PLC0415 - in runs only

    return {
        "format": 4,
        "hil": {"version": version(), "commit": product_source()},
        "workspace": _workspace(workspace),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "packages": dict(_packages()),
        "others": [each.facts for each in other_packages()],
        "start": at_start(),
        "strays": of_no_package(workspace),
        "flags": {name: int(getattr(sys.flags, name)) for name in _FLAGS},
        "changing": changing(),
        "numeric": {name: os.environ.get(name, "") for name in PINNED},
        "byte_order": sys.byteorder,
        "analysis": judging_digest(),
    }


@cache  # a process does not outlive its packages, and reading their metadata is slow
def _packages() -> tuple[tuple[str, str], ...]:
    from hil.executive.setup.other_code import named  # noqa: PLC0415 - in runs only

    return tuple(sorted(map(named, metadata.distributions())))


def _workspace(folder: Path) -> dict[str, object]:
    commit, changed = status(folder)
    difference = git(folder, "diff", "HEAD") if commit else ""
    return {"commit": {"id": commit, "changed": bool(commit and changed)}, "difference": difference}


def product_source() -> dict[str, object]:
    """Return the present commit of the product's source, and the files that differ from it."""
    return _source(Path(hil.__file__).parent)


def _source(package: Path) -> dict[str, object]:
    """Return the commit of the product's own source, and the files that differ from it, by their SHA-256.

    Anything else in its checkout cannot change a run: plans and fixtures have digests of their own. A package installed
    into somebody's checkout is not part of it; its commit is the one named by its wheel.
    """
    if not git(package, "ls-files", "--", "__init__.py"):
        return _installed(package)
    commit, names = status(package, "--no-renames", "--untracked-files=all", "--", ".")
    top = Path(git(package, "rev-parse", "--show-toplevel").removesuffix("\n")) if names else package
    return {"id": commit, "changed": bool(names), "files": {name: digest_of(top / name) for name in names}}


def _installed(package: Path) -> dict[str, object]:
    """Return the commit from which an installed package was built, and the files that differ from its RECORD.

    A wheel records the SHA-256 of every file (PEP 376, PEP 427), and in `built.json` the commit of its source.
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
        path.relative_to(package.parent).as_posix(): digest_of(path)
        for path in sorted(there | due)
        if not _is_as_recorded(path, recorded.get(path))
    }
    return {"id": str(built.get("commit", "")), "changed": built.get("changed") is not False or bool(files),
            "files": files}  # fmt: skip


def _is_as_recorded(path: Path, recorded: metadata.FileHash | None) -> bool:
    if recorded is None or recorded.mode != "sha256":
        return False
    digest = base64.urlsafe_b64encode(bytes.fromhex(digest_of(path))).rstrip(b"=").decode()
    return digest == recorded.value
