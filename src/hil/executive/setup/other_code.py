"""Third-party code in a run, neither the product's nor the workspace's: its package, and whether it was changed."""

from __future__ import annotations

import base64
import json
import os
import re
import site
import sys
import sysconfig
from collections.abc import Iterator, Mapping
from functools import cache, lru_cache
from importlib import metadata
from importlib.machinery import PathFinder
from importlib.metadata import Distribution, EntryPoint
from pathlib import Path
from urllib.parse import unquote, urlsplit

from hil.documents.offers import Offers
from hil.executive.setup.checkout import digest_of, status, tracked

__all__ = ["Installed", "OtherPackage", "at_start", "named", "needed", "of_no_package", "other_packages"]

_PRODUCT = "hil"
_LONGEST = 2000
_CUSTOMISING = ("sitecustomize", "usercustomize")
_VIRTUALENV = frozenset(
    {
        "0f20351ea7e90039c46d3fabdef991f28b1e3ff33eb13ee6f0d5cd21ea0e8b14",
        "69ac3d8f27e679c81b94ab30b3b56e9cd138219b1ba94a1fa3606d5a76a1433d",
    }
)
"""SHA-256 of `_virtualenv.py` and `_virtualenv.pth`, which virtualenv 20 writes into environments without a RECORD."""


_Owner = tuple[str, str]
"""The package that a file belongs to, and its hash in the RECORD (PEP 376), empty if it has none."""


class OtherPackage:
    """A third-party package that offers something the run uses.

    Args:
        distribution: the package as installed.
        points: the entry points that the run uses, each with what it is.
    """

    def __init__(self, distribution: Distribution, points: Mapping[EntryPoint, str]) -> None:
        self.name = f"{distribution.name} {distribution.version}"
        self._distribution = distribution
        self._points = points
        self._recorded = _recorded(distribution)
        self._root = Path(os.path.realpath(str(distribution.locate_file(""))))
        self._installed_from = _direct_url(distribution)
        self._folder = _folder(self._installed_from)

    @property
    def facts(self) -> dict[str, object]:
        """The entry of `data/software.json` about it."""
        files = {self._shown(path): digest_of(path) for path in self._files()}
        return {
            "name": self._distribution.name,
            "version": self._distribution.version,
            "offers": sorted(f"{what} {point.name}" for point, what in self._points.items()),
            "from": self._origin(),
            "commit": self._commit(),
            "recorded": bool(self._recorded),
            "files": files,
            "differing": sorted(self._differing()),
        }

    def digests(self) -> dict[Path, str]:
        """Return each of its files with its present SHA-256."""
        return {path: digest_of(path) for path in self._files()}

    def sources(self) -> Iterator[tuple[str, bytes]]:
        """Yield the path in the evidence package and the content of each of its Python files."""
        for path in self._files():
            if path.suffix == ".py":
                yield f"data/packages/{self._distribution.name}/{self._shown(path)}", path.read_bytes()

    def _origin(self) -> str:
        if self._folder is not None:
            return "folder"
        if "vcs_info" in self._installed_from:
            return "version control"
        return "archive" if self._installed_from else "index"

    def _commit(self) -> dict[str, object]:
        """Return the commit that holds all of its files, with an empty id if there is none."""
        vcs = self._installed_from.get("vcs_info")
        if isinstance(vcs, dict):
            return {"id": str(vcs.get("commit_id", "")), "changed": False}
        if self._folder is None:
            return {"id": "", "changed": False}
        commit, changed = status(self._folder, "--untracked-files=all", "--", ".")
        held = tracked(self._folder, ".py") if commit else set()
        strange = any(path.suffix == ".py" and digest_of(path) not in held for path in self._files())
        return {"id": commit, "changed": bool(commit) and (strange or bool(changed))}

    def _files(self) -> list[Path]:
        """Return the files in its RECORD, and the modules beside them in its code folders."""
        recorded = {path for path in map(Path, self._recorded) if not path.parent.name.endswith(".dist-info")}
        return sorted({path for path in recorded if path.exists()} | set(self._modules()))

    def _modules(self) -> Iterator[Path]:
        for place in self._places():
            yield from place.rglob("*.py") if place.is_dir() else [place]

    def _places(self) -> Iterator[Path]:
        """Yield its code folders, and its modules outside folders."""
        for top in {point.module.partition(".")[0] for point in self._points}:
            module = sys.modules.get(top)
            found = list(getattr(module, "__path__", ())) or [getattr(module, "__file__", None)]
            yield from (Path(os.path.realpath(each)) for each in found if each)

    def _differing(self) -> Iterator[str]:
        """Yield the files that were changed or added since installation; none for a package installed in place."""
        if not self._recorded or self._in_place:
            return
        for path in {*self._files(), *map(Path, self._recorded)}:
            due = self._recorded.get(str(path))
            if due is None or (_hexadecimal(due) not in {"", digest_of(path)}):
                yield self._shown(path)

    @property
    def _in_place(self) -> bool:
        info = self._installed_from.get("dir_info")
        return isinstance(info, dict) and bool(info.get("editable"))

    def _shown(self, path: Path) -> str:
        """Return a path without anything about this machine."""
        roots = (self._root, *(place.parent for place in self._places()))
        return next((path.relative_to(root).as_posix() for root in roots if path.is_relative_to(root)), path.name)


class Installed:
    """Installed files: the package of each, and its entry in the RECORD."""

    def has(self, file: str) -> bool:
        """Return whether a file is recorded by a package, or belongs to Python."""
        return self._owner(file) is not None or self.is_python(file)

    def is_python(self, file: str) -> bool:
        """Return whether a file belongs to Python itself."""
        return _is_python(file) or _is_python(os.path.realpath(file))

    def package_of(self, file: str) -> str:
        """Return name and version of the package that records a file, empty if none does."""
        owner = self._owner(file)
        return owner[0] if owner else ""

    def name_of(self, file: str) -> str:
        """Return the normalised name of that package, empty if none does."""
        return _plain(self.package_of(file))

    def recorded(self, file: str) -> str | None:
        """Return the SHA-256 of a file in its RECORD, empty if it has none; None if no package records it."""
        owner = self._owner(file)
        return _hexadecimal(owner[1]) if owner else None

    def is_in_place(self, path: Path) -> bool:
        """Return whether a file is in the folder of a package installed in place."""
        return self._folder(path) is not None

    def is_committed(self, path: Path, digest: str) -> bool:
        """Return whether a file of a package in place is committed as it is."""
        folder = self._folder(path)
        if folder is None:
            return False
        commit, changed = status(folder, "--untracked-files=all", "--", str(path))
        return bool(commit) and not changed and digest in tracked(folder, path.suffix)

    def _folder(self, path: Path) -> Path | None:
        return next((Path(each) for each in _in_place() if path.is_relative_to(each)), None)

    def _owner(self, file: str) -> _Owner | None:
        owners = _owners()
        return owners.get(file) or owners.get(os.path.realpath(file))


def other_packages() -> tuple[OtherPackage, ...]:
    """Return the third-party packages that offer a driver, role, plant or the like loaded by this process."""
    found: dict[str, tuple[Distribution, dict[EntryPoint, str]]] = {}
    for what, point in Offers.in_use():
        if point.dist is not None and (name := named(point.dist)[0]) != _PRODUCT:
            found.setdefault(name, (point.dist, {}))[1][point] = what
    return tuple(OtherPackage(distribution, points) for _, (distribution, points) in sorted(found.items()))


def at_start(modules: Mapping[str, object] = sys.modules) -> list[dict[str, object]]:
    """Return what else Python executed at its start: import lines of `.pth` files, and customisation modules.

    Each has the package that it belongs to, empty if none, whether it is as in that package's RECORD, and whether hil
    needs that package; a `.pth` file also the lines that Python executed.
    """
    if sys.flags.no_site:
        return []
    users = [site.getusersitepackages()] if site.ENABLE_USER_SITE else []
    folders = dict.fromkeys(os.path.realpath(each) for each in (*site.getsitepackages(), *users))
    lines = [path for folder in folders for path in sorted(Path(folder).glob("*.pth")) if _lines(path)]
    files = {getattr(modules.get(each), "__file__", None) or _found(each) for each in _CUSTOMISING}
    strange = (each for each in files if each and not Installed().is_python(each))
    own = sorted(Path(os.path.realpath(each)) for each in strange)
    return [_started(path) for path in (*lines, *own)]


def of_no_package(workspace: Path, modules: Mapping[str, object] = sys.modules) -> list[str]:
    """Return the loaded modules that belong to no package, Python or the workspace, with their file's name."""
    inside = (f"{os.path.realpath(workspace)}{os.sep}", *(f"{each}{os.sep}" for each in _in_place()))
    folders = cache(os.path.realpath)  # some hundred modules are in some ten folders
    strays = []
    for name, module in sorted(modules.items()):
        file = getattr(module, "__file__", None)
        ours = type(getattr(module, "__loader__", None)).__module__.startswith("hil.")  # from a frozen source
        if not isinstance(file, str) or ours or file in _owners() or _is_python(file):
            continue
        folder, name_of_file = os.path.split(file)
        real = os.path.realpath(file) if os.path.islink(file) else os.path.join(folders(folder), name_of_file)  # noqa: PTH114, PTH118
        if real not in _owners() and not _is_python(real) and not real.startswith(inside):
            strays.append(f"{name} ({Path(real).name})")
    return strays


def _found(module: str) -> str:
    """Return the file of a customisation module that Python has executed without listing it, empty if none."""
    if module == "usercustomize" and not site.ENABLE_USER_SITE:
        return ""
    spec = PathFinder.find_spec(module)
    return (spec.origin or "") if spec else ""


def _started(path: Path) -> dict[str, object]:
    (package, recorded), digest = _owners().get(str(path), ("", "")), digest_of(path)
    whole = bool(digest) and _hexadecimal(recorded) == digest
    facts = {
        "file": f"{path.parent.name}/{path.name}",
        "sha256": digest,
        "of": package,
        "whole": whole,
        "needed": _plain(package) in needed(),
        "lines": [each[:_LONGEST] for each in _lines(path)] if path.suffix == ".pth" else [],
    }
    if digest in _VIRTUALENV and digest_of(path.with_name("_virtualenv.py")) in _VIRTUALENV:
        return {**facts, "of": "virtualenv", "whole": True, "needed": True}
    return facts


def _lines(path: Path) -> list[str]:
    """Return the lines of a `.pth` file that Python executes, see the documentation of `site`."""
    try:
        text = path.read_text(encoding="utf-8-sig", errors="replace")
    except OSError:
        return []
    return [line for line in text.splitlines() if line.startswith(("import ", "import\t"))]


@cache
def needed() -> frozenset[str]:
    """Return the names of hil and of all its dependencies, as returned by `Installed.name_of`."""
    found: set[str] = set()
    waiting = [_PRODUCT]
    while waiting:
        name = waiting.pop()
        if name in found:
            continue
        found.add(name)
        try:
            required = _required(metadata.distribution(name))
        except metadata.PackageNotFoundError:
            continue
        waiting += [_plain(each) for each in required if "extra ==" not in each]
    return frozenset(found)


def _plain(requirement: str) -> str:
    name = re.match(r"[A-Za-z0-9._-]+", requirement)
    return re.sub(r"[-_.]+", "-", name[0]).lower() if name else ""


@cache
def _owners() -> Mapping[str, _Owner]:
    """Return every file that an installed package records; cached, as reading the RECORDs takes some milliseconds."""
    found = {}
    for each in metadata.distributions():
        package = " ".join(named(each))
        found.update({path: (package, digest) for path, digest in _recorded(each).items()})
    return found


@lru_cache(maxsize=256)
def named(distribution: Distribution) -> tuple[str, str]:
    """Return name and version of an installed package; parsing all of its metadata would take many times as long."""
    fields = dict(line.split(": ", 1) for line in _head(distribution) if line.startswith(("Name: ", "Version: ")))
    if len(fields) < 2:
        return distribution.name, distribution.version
    return fields["Name"], fields["Version"]


def _required(distribution: Distribution) -> list[str]:
    """Return the dependencies of an installed package, with their conditions."""
    head = _head(distribution)
    if not head:  # of the older format, which has a file of its own for that
        return distribution.requires or []
    return [line.removeprefix("Requires-Dist: ") for line in head if line.startswith("Requires-Dist: ")]


def _head(distribution: Distribution) -> list[str]:
    """Return the lines of an installed package's metadata before its description."""
    return (distribution.read_text("METADATA") or "").partition("\n\n")[0].splitlines()


def _recorded(distribution: Distribution) -> dict[str, str]:
    """Return the files that a package records, each with its hash as recorded, empty if there is none."""
    root = os.path.realpath(str(distribution.locate_file("")))
    found = {}
    for line in (distribution.read_text("RECORD") or "").splitlines():
        if "__pycache__" in line:
            continue
        parts = line.rsplit(",", 2)
        if len(parts) > 2 and (name := parts[0]):
            plain = name[0] not in './"' and "/." not in name  # true for nearly all of some thousand files
            path = f"{root}{os.sep}{name}" if plain else os.path.normpath(os.path.join(root, name.strip('"')))  # noqa: PTH118
            found[path] = parts[1]
    return found


def _hexadecimal(recorded: str) -> str:
    """Return a file's SHA-256 in hexadecimal from its hash in a RECORD, empty for another kind of hash."""
    kind, _, digest = recorded.partition("=")
    return base64.urlsafe_b64decode(f"{digest}==").hex() if kind == "sha256" else ""


@cache
def _in_place() -> tuple[str, ...]:
    """Return the folders of packages installed in place, whose files are in no RECORD."""
    urls = (_direct_url(each) for each in metadata.distributions())
    folders = (_folder(each) for each in urls if isinstance(each.get("dir_info"), dict) and each["dir_info"])
    return tuple(os.path.realpath(each) for each in folders if each is not None)


def _direct_url(distribution: Distribution) -> dict[str, object]:
    """Return where a package was installed from, see PEP 610; empty for one from an index."""
    try:
        origin = json.loads(distribution.read_text("direct_url.json") or "{}")
    except ValueError:
        return {}
    return origin if isinstance(origin, dict) else {}


def _folder(origin: Mapping[str, object]) -> Path | None:
    """Return the folder that a package was installed from, None for one from elsewhere."""
    return Path(os.path.realpath(unquote(urlsplit(str(origin["url"])).path))) if "dir_info" in origin else None


@cache
def _library() -> tuple[str, ...]:
    paths = sysconfig.get_paths()
    return tuple(f"{os.path.realpath(paths[name])}{os.sep}" for name in ("stdlib", "platstdlib"))


def _is_python(file: str) -> bool:
    """Return whether a file belongs to Python itself, and not to what is installed beside it."""
    return file.startswith(_library()) and not any(f"{os.sep}{each}{os.sep}" in file for each in _PACKAGES)


_PACKAGES = ("site-packages", "dist-packages")
