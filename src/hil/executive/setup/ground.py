"""Where a run's files may be: in the workspace, except what is installed, cached or written there."""

from __future__ import annotations

import json
import os
import site
import sys
import sysconfig
from collections.abc import Iterable, Sequence
from contextlib import suppress
from functools import cache
from importlib import metadata
from pathlib import Path
from urllib.parse import unquote, urlsplit

import hil

__all__ = ["COMPILED", "PRODUCT", "Ground"]

COMPILED = f"{os.sep}__pycache__{os.sep}"
"""Part of the path of every compiled copy of a module."""

PRODUCT = f"{Path(hil.__file__).parent}{os.sep}"
"""Prefix of the path of every module of the product."""

_PACKAGES = f"{os.sep}site-packages{os.sep}"

_CACHES = frozenset(
    {".git", ".hypothesis", ".mypy_cache", ".pytest_cache", ".ruff_cache", "__pycache__", "site-packages"}
)


class Ground:
    """The workspace as far as its files can be inputs of a run.

    Args:
        root: the workspace.
        apart: folders in it that hold no inputs: those with packages.
    """

    def __init__(self, root: Path, apart: Sequence[Path]) -> None:
        self._root = f"{root}{os.sep}"
        installed = (prefix for prefix in _environment() if prefix.startswith(self._root) and prefix != self._root)
        self._apart = (*(f"{folder}{os.sep}" for folder in apart if not root.is_relative_to(folder)), *installed)
        self._folders: dict[str, str] = {}

    def place(self, path: object) -> str:
        """Return the place in the workspace to which a path leads, empty if it cannot be an input."""
        if not isinstance(path, str | bytes | os.PathLike):
            return ""
        text = os.fsdecode(path)
        folder, _, name = (text if text.startswith(os.sep) else f"{_here()}{os.sep}{text}").rpartition(os.sep)
        real = self.folder(folder)
        return f"{real}{name}" if real else ""

    def folder(self, path: str) -> str:
        """Return the place of a folder, with a trailing slash; empty if no file in it can be an input."""
        real = self._folders.get(path)
        if real is None:
            real = self._folders[path] = self._real(path)
        return real

    def is_own(self, file: str) -> bool:
        """Return whether code belongs to the workspace, by the path with which it was compiled."""
        return file.startswith(self._root) and not file.startswith((*self._apart, PRODUCT)) and _PACKAGES not in file

    def knows(self, file: str) -> bool:
        """Return whether code belongs to the workspace, or is installed, by the path with which it was compiled."""
        known = file.startswith((self._root, *_environment(), *_named()))
        return known or file.startswith(_editable())  # last, because it takes a second

    def _real(self, folder: str) -> str:
        real = f"{os.path.realpath(folder)}{os.sep}"
        if not real.startswith(self._root) or real.startswith(self._apart):
            return ""
        inside = Path(real.removeprefix(self._root)).parts
        return real if real.endswith(COMPILED) or _CACHES.isdisjoint(inside) else ""


def _here() -> str:
    with suppress(OSError):
        return os.getcwd()  # noqa: PTH109 - on every open
    return ""


@cache
def _environment() -> tuple[str, ...]:
    """Return the folders of the standard library, of installed packages, and of the product."""
    library = [path for name, path in sysconfig.get_paths().items() if name != "data"]
    packages = [*site.getsitepackages(), site.getusersitepackages()]
    own = [sys.prefix] if sys.prefix != sys.base_prefix else []
    return _prefixes([*library, *packages, *own, PRODUCT])


@cache
def _named() -> tuple[str, ...]:
    """Return the folders that installed packages add to the path."""
    files = [file for folder in map(Path, _environment()) if folder.is_dir() for file in folder.glob("*.pth")]
    lines = [line for file in files for line in file.read_text(encoding="utf-8", errors="replace").splitlines()]
    return _prefixes([line for line in lines if line.startswith(os.sep)])


@cache
def _editable() -> tuple[str, ...]:
    """Return the folders of packages installed in place."""
    found = []
    for item in metadata.distributions():
        with suppress(ValueError):
            origin = json.loads(item.read_text("direct_url.json") or "{}")
            if origin.get("dir_info", {}).get("editable"):
                found.append(unquote(urlsplit(origin["url"]).path))
    return _prefixes(found)


def _prefixes(folders: Iterable[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(f"{os.path.realpath(folder)}{os.sep}" for folder in folders))
