"""Inputs of a run: files of the workspace that are read once, frozen, and used as they were read."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from hil.documents.snapshot import Snapshot
from hil.executive.setup.reach import beyond, numbers_in, sleeps
from hil.executive.setup.workspace import Workspace
from hil.model.errors import HilError
from hil.requirements.lock import LOCK
from hil.requirements.parameters import PARAMETERS
from hil.requirements.schema import REQUIREMENTS

__all__ = ["PICTURE_ENDINGS", "CodeFromOutside", "Inputs", "SourceChanged", "SourceWritten"]

PICTURE_ENDINGS = frozenset({".png", ".jpg", ".jpeg", ".PNG", ".JPG", ".JPEG"})
"""File extensions of the pictures of plans that questions may show."""

_OF_PLANS = frozenset({".py", ".yaml", ".json"}) | PICTURE_ENDINGS
_SOURCES = "data/sources/"
_AROUND = frozenset({".py", ".yaml"})
_CATALOGUE_FILES = frozenset({REQUIREMENTS, LOCK, PARAMETERS})


class SourceChanged(HilError, OSError):
    """A file was opened whose content has changed since it was frozen."""


class SourceWritten(HilError, OSError):
    """Code of a run would change the files by which the run is judged."""


class CodeFromOutside(HilError, ImportError):
    """Code was loaded that is neither in the workspace nor installed."""


class Inputs:
    """Everything that a run reads from its workspace.

    Plans, fixtures, the bench's folder and the register are read when this is created, before any code of the workspace
    has run. Whatever else that code imports or opens is read when it first does.

    Args:
        workspace: the workspace.
        plans: the folders of the run's plans.
        bench: the bench's name.

    Attributes:
        snapshot: the contents.
        sources: plans and fixtures, sorted.
        bench_files: everything in the bench's folder, sorted.
        used: what code opened or imported, in that order.
    """

    def __init__(self, workspace: Workspace, plans: Sequence[Path], bench: str) -> None:
        self.snapshot = Snapshot()
        self.used: dict[Path, None] = {}
        self._workspace = workspace
        self._plans = tuple(plans)
        self._again: set[Path] = set()
        self._own: set[Path] = set()
        self._refused: list[HilError] = []
        self._listener: Callable[[Path], None] | None = None
        self.sources = tuple(sorted(dict.fromkeys(self._sources())))
        self.bench_files = tuple(sorted(path for path in (workspace.benches / bench).rglob("*") if path.is_file()))
        for path in (*self.sources, *self.bench_files, workspace.duts):
            with suppress(OSError):  # whatever needs it reports it
                self.snapshot.take(path)

    def _sources(self) -> Iterator[Path]:
        for plan in self._plans:
            for place, _, names in os.walk(plan):
                yield from (Path(place, name) for name in names if Path(name).suffix in _OF_PLANS)
        for folder, suffixes in ((self._workspace.testplans, _AROUND), (self._workspace.fixtures, {".py"})):
            if folder.is_dir():
                yield from (path for path in folder.iterdir() if path.suffix in suffixes and path.is_file())

    @property
    def root(self) -> Path:
        """The folder of the workspace."""
        return self._workspace.root

    @property
    def frozen(self) -> list[Path]:
        """Sources, and everything that code has used from the workspace, sorted."""
        return sorted({*self.sources, *self.used, *self._again})

    def below(self, folder: Path, suffix: str = ".py") -> list[Path]:
        """Return the sources in a folder, recursively."""
        return [path for path in self.sources if path.suffix == suffix and path.is_relative_to(folder)]

    @property
    def reaches(self) -> tuple[str, ...]:
        """What the code of sources and imported modules reaches for beyond what cases are given."""
        return tuple(sentence for path in self.frozen for sentence in self.reaches_of(path))

    def reaches_of(self, path: Path) -> tuple[str, ...]:
        """Return what the code of a file reaches for, see `beyond`; nothing if it is not a module."""
        if path.suffix != ".py" or path not in self.snapshot:
            return ()
        return beyond(self.snapshot.take(path), self.shown(path))

    @property
    def sleeps(self) -> tuple[str, ...]:
        """Where the code of plans and fixtures calls `time.sleep`, a sentence each."""
        modules = (path for path in self.sources if path.suffix == ".py" and path in self.snapshot)
        return tuple(text for path in modules for text in sleeps(self.snapshot.take(path), self.shown(path)))

    def stands(self, number: float) -> bool:
        """Return whether a number appears in the source of a module frozen by the run, for everybody to read."""
        modules = (path for path in self.frozen if path.suffix == ".py" and path in self.snapshot)
        return any(abs(number) in numbers_in(self.snapshot.take(path)) for path in modules)

    def name_of(self, path: Path) -> str:
        """Return the path of a file in the package."""
        if path.parent in self._plans and path.name in _CATALOGUE_FILES:
            return f"data/catalogue/{path.parent.name}/{path.name}"
        return f"{_SOURCES}{path.relative_to(self._workspace.root).as_posix()}"

    def shown(self, path: Path) -> str:
        """Return a path as people see it."""
        return self._workspace.shown(path)

    def code(self, path: Path) -> bytes:
        """Return the source of a module that code imports.

        Raises:
            OSError: if it cannot be read.
        """
        data = self.snapshot.take(path)
        self._use(path)
        return data

    def opened(self, path: Path) -> None:
        """Called before code reads a file of the workspace.

        Raises:
            SourceChanged: if the file on disk is no longer as frozen.
        """
        if path in self._own:
            return
        if path not in self.snapshot:
            try:
                self.snapshot.take(path)
            except OSError:
                return  # opening it reports why
        elif not self.snapshot.is_as_on_disk(path):
            raise SourceChanged(
                f"{self.shown(path)} changed on the disk after it was frozen, and code opens it again",
                "leave the files of a plan alone while it runs, and start a new run",
            )
        self._use(path)

    def written(self, path: Path) -> None:
        """Called before code changes, moves or removes a file of the workspace.

        Raises:
            SourceWritten: if it is in the plans or the fixtures.
        """
        folders = (self._workspace.testplans, self._workspace.fixtures)
        if any(path.is_relative_to(folder) for folder in folders):
            where = " or ".join(f"{self.shown(folder)}/" for folder in folders)
            error = SourceWritten(
                f"code of the run writes to {self.shown(path)}",
                f"nothing in {where} may change during a run: keep results with `artifact`, or use a temporary folder",
            )
            self._refused.append(error)
            raise error
        self._own.add(path)

    def use_again(self, names: Iterable[str]) -> None:
        """Read the files that code used in an earlier part of the run, by their paths in the package."""
        within = (name.removeprefix(_SOURCES) for name in names if name.startswith(_SOURCES))
        for path in (self._workspace.root / name for name in within):
            if path not in self.sources:
                with suppress(OSError):  # a missing file is reported as such
                    self.snapshot.take(path)
                    self._again.add(path)

    def take_refused(self) -> list[HilError]:
        """Return what was refused since the last call, even if the code suppressed it."""
        found, self._refused = self._refused, []
        return found

    def listen(self, listener: Callable[[Path], None] | None) -> None:
        """Report every further file that code uses, the first time it does."""
        self._listener = listener

    def changed(self) -> Iterator[Path]:
        """Yield every file used by the run that has changed on disk, sorted."""
        fixtures = (path for path in self.snapshot if path.is_relative_to(self._workspace.fixtures))
        held = (path for path in {*self.frozen, *fixtures} - self._own if path in self.snapshot)
        yield from sorted(path for path in held if not self.snapshot.is_as_on_disk(path))

    def _use(self, path: Path) -> None:
        if path not in self.used:
            self.used[path] = None
            if self._listener is not None:
                self._listener(path)
