"""Loads the workspace's own fixtures by path, with a plain sentence if that fails."""

from __future__ import annotations

import importlib.util
import sys
import traceback
from pathlib import Path
from types import ModuleType

import pytest

from hil.executive.setup.configuration import Configuration
from hil.model.errors import ConfigurationError, Finding
from hil.plugin.plans.frozen_code import FrozenCode
from hil.plugin.plans.plan_sources import hook_findings, imported_hooks

__all__ = ["load_fixture_modules"]

_ANYTHING = (Exception, SystemExit, pytest.skip.Exception)
"""What importing a workspace's module can raise."""


def load_fixture_modules(configuration: Configuration, code: FrozenCode) -> dict[str, ModuleType]:
    """Return every module of the workspace's fixtures by its name, from its frozen source.

    Raises:
        ConfigurationError: with every module that cannot be loaded, or that brings hooks, and why.
    """
    modules: dict[str, ModuleType] = {}
    findings: list[Finding] = []
    workspace, inputs = configuration.workspace, configuration.inputs
    for path in (path for path in inputs.below(workspace.fixtures) if path.parent == workspace.fixtures):
        shown = workspace.shown(path)
        if hooks := list(hook_findings(path, inputs)):
            findings += hooks
            continue
        try:
            modules[path.stem] = _load(path, code)
            findings += imported_hooks(modules[path.stem], shown)
        except _ANYTHING as error:
            findings.append(_finding(shown, path, error))
    if findings:
        raise ConfigurationError(tuple(findings))
    return modules


def _load(path: Path, code: FrozenCode) -> ModuleType:
    name = f"hil_workspace_fixtures.{path.stem}"
    spec = code.spec_of(name, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    if spec.loader is not None:
        spec.loader.exec_module(module)
    return module


def _finding(shown: str, path: Path, error: BaseException) -> Finding:
    message = f"{type(error).__name__}: {error}"
    if isinstance(error, SyntaxError) and error.filename == str(path):
        return Finding(shown, error.lineno or 0, error.offset or 1, f"{type(error).__name__}: {error.msg}")
    own = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
    return Finding(shown, (own[-1] if own else 0) or 0, 1, message)
