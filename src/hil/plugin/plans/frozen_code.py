"""Modules of the workspace, compiled from their frozen source and not from what is on disk by then."""

from __future__ import annotations

import ast
import linecache
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.abc import MetaPathFinder
from importlib.machinery import ExtensionFileLoader, ModuleSpec, PathFinder, SourceFileLoader, SourcelessFileLoader
from importlib.util import spec_from_file_location
from pathlib import Path
from types import CodeType, ModuleType

import pytest
from _pytest.assertion.rewrite import rewrite_asserts  # pytest has no public way to it

from hil.executive.setup.auditing import watched
from hil.executive.setup.configuration import Configuration
from hil.executive.setup.ground import Ground
from hil.executive.setup.inputs import Inputs
from hil.plugin.plans.intact import Intact
from hil.plugin.plans.plan_sources import helper_modules

__all__ = ["FrozenCode", "frozen_code"]


@contextmanager
def frozen_code(configuration: Configuration) -> Iterator[FrozenCode]:
    """Load the workspace's modules from frozen source, and notice what they open, until the context is left."""
    inputs, ground = configuration.inputs, configuration.ground
    code = FrozenCode(inputs, ground, configuration.workspace.testplans, helper_modules(configuration))
    with watched(inputs, ground), code.first():
        yield code


class FrozenCode(MetaPathFinder):
    """Finds the workspace's modules before any other finder, and compiles them from their frozen source.

    Paths, tracebacks and sources that people see are those of the workspace. A module first imported in the middle of
    a case is read, and frozen, then. No compiled copy is read or written.

    Args:
        inputs: provides the source.
        ground: where modules are found.
        testplans: the folder whose modules hold cases.
        helpers: the modules beside cases, which the cases import by name.

    Attributes:
        intact: reports what the code replaced in the product.
    """

    def __init__(self, inputs: Inputs, ground: Ground, testplans: Path, helpers: Mapping[str, Path]) -> None:
        self.intact = Intact(ground.is_own)
        self._inputs = inputs
        self._ground = ground
        self._testplans = testplans
        self._helpers = helpers
        self._config: pytest.Config | None = None
        self._shown: list[str] = []

    @contextmanager
    def first(self) -> Iterator[None]:
        """Be the first finder for every module, until the context is left."""
        self._come_first()
        try:
            yield
        finally:
            if self in sys.meta_path:
                sys.meta_path.remove(self)
            for name in self._shown:
                linecache.cache.pop(name, None)

    def serve(self, config: pytest.Config) -> None:
        """Rewrite the assertions of cases as this pytest does, and come before it."""
        self._config = config if config.getoption("assertmode", "rewrite") == "rewrite" else None
        self._come_first()

    def _come_first(self) -> None:
        if self in sys.meta_path:
            sys.meta_path.remove(self)
        sys.meta_path.insert(0, self)

    def find_spec(
        self, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Find a module of the workspace; None for any other.

        Raises:
            ImportError: for one that has no source.
        """
        if path is None and fullname.partition(".")[0] in sys.builtin_module_names:
            return None
        if path is None and fullname in self._helpers:
            return self.spec_of(fullname, self._helpers[fullname])
        if not any(self._ground.folder(folder) for folder in (sys.path if path is None else path)):
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is None or spec.origin is None or not self._ground.place(spec.origin):
            return None
        if isinstance(spec.loader, SourcelessFileLoader):
            what = f"{self._inputs.shown(Path(spec.origin))} has no source that a package could hold"
            raise ImportError(what, name=fullname, path=spec.origin)  # noqa: TRY004 - of a module, not of a value
        if isinstance(spec.loader, ExtensionFileLoader):
            self._inputs.opened(Path(spec.origin))
        return self.spec_of(fullname, Path(spec.origin)) if type(spec.loader) is SourceFileLoader else None

    def spec_of(self, name: str, path: Path) -> ModuleSpec:
        """Return the spec by which a file of the workspace becomes the module of this name."""
        loader = _FrozenLoader(name, str(path), self)
        package = [str(path.parent)] if path.name == "__init__.py" else None
        spec = spec_from_file_location(name, path, loader=loader, submodule_search_locations=package)
        if spec is None:
            raise ImportError(f"{path} is not a Python module", name=name, path=str(path))
        return spec

    def source(self, path: str) -> bytes:
        """Return a module's frozen source, which tracebacks show, too."""
        data = self._inputs.code(Path(path))
        text = data.decode("utf-8", "replace")
        linecache.cache[path] = (len(data), None, text.splitlines(keepends=True), path)
        self._shown.append(path)
        return data

    def compiled(self, data: bytes, path: str) -> CodeType:
        """Return the code of a module, with rewritten assertions if it holds cases."""
        file = Path(path)
        if self._config is None or not file.is_relative_to(self._testplans) or not file.name.startswith("test_"):
            return compile(data, path, "exec", dont_inherit=True)
        tree = ast.parse(data, path)
        rewrite_asserts(tree, data, path, self._config)
        return compile(tree, path, "exec", dont_inherit=True)


class _FrozenLoader(SourceFileLoader):
    """Loads a module from its frozen source."""

    def __init__(self, name: str, path: str, frozen: FrozenCode) -> None:
        super().__init__(name, path)
        self._frozen = frozen

    def exec_module(self, module: ModuleType) -> None:
        """Execute the module, and restore the recursion limit, which could end the run itself."""
        limit = sys.getrecursionlimit()
        try:
            super().exec_module(module)
        finally:
            sys.setrecursionlimit(limit)

    def get_data(self, path: str) -> bytes:
        """Return the frozen source; any other data of a package is opened like any other file."""
        return self._frozen.source(path) if path == self.path else super().get_data(path)

    def path_stats(self, path: str) -> dict[str, object]:
        """Raise, because no modification time is known, so that no compiled copy is ever used."""
        raise OSError(path)

    def source_to_code(self, data: bytes, path: str, *, _optimize: int = -1) -> CodeType:  # type: ignore[override]
        """Return the code of the module."""
        return self._frozen.compiled(data, path)
