"""The workspace: where a team's testplans, fixtures and reports are."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hil.documents.suggest import did_you_mean
from hil.model.errors import ConfigurationError, Finding, Refused

__all__ = ["Workspace", "find_workspace"]

_FOLDERS = {"testplans": "testplans", "fixtures": "fixtures", "reports": "reports"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Workspace:
    """A workspace's folders, absolute, and the commands that work for its runs.

    Attributes:
        root: its folder.
        name: as people call it.
        testplans: holds a folder per plan.
        fixtures: holds fixture modules and benches.
        reports: where packages go.
        notify: notifies people of what happens to runs; program and arguments.
        inhibitor: holds off sleep and shutdown in the place of logind; program and arguments.
    """

    root: Path
    name: str
    testplans: Path
    fixtures: Path
    reports: Path
    notify: tuple[str, ...] = ()
    inhibitor: tuple[str, ...] = ()

    @property
    def benches(self) -> Path:
        """The folder with one folder per bench."""
        return self.fixtures / "benches"

    @property
    def duts(self) -> Path:
        """The register of devices under test."""
        return self.fixtures / "duts.yaml"

    def shown(self, path: Path) -> str:
        """Return a path as people see it: relative to the workspace where it is inside."""
        return str(path.relative_to(self.root)) if path.is_relative_to(self.root) else str(path)

    def plan(self, asked: str, start: Path) -> Path:
        """Return the folder of a plan given as a path or by its name.

        Raises:
            Refused: if there is no such plan.
        """
        for path in ((start / asked).resolve(), self.testplans / asked):
            if path.is_dir() and path.parent == self.testplans:
                return path
        known = self.plans()
        raise Refused(
            f"there is no plan '{asked}'{did_you_mean(Path(asked).name, known)}",
            f"plans of this workspace are: {', '.join(known) or 'none'}",
        )

    def plans(self) -> tuple[str, ...]:
        """Return the names of all plans, sorted."""
        return tuple(sorted(path.parent.name for path in self.testplans.glob("*/requirements.yaml")))


def find_workspace(start: Path) -> Workspace:
    """Return the nearest workspace upwards from `start`.

    Raises:
        Refused: if there is none.
        ConfigurationError: if its settings are wrong.
    """
    for folder in (start, *start.parents):
        settings = _settings(folder)
        if settings is not None:
            return _workspace(folder, *settings)
    raise Refused(
        f"no workspace at {start} or above it",
        "put a hil.toml (it may be empty) beside your testplans and fixtures, and start there",
    )


def _settings(folder: Path) -> tuple[dict[str, Any], str] | None:
    own, project = folder / "hil.toml", folder / "pyproject.toml"
    if own.exists():
        return _toml(own), own.name
    if project.is_file():
        tools = _toml(project).get("tool")
        if isinstance(tools, dict) and "hil" in tools:
            return _table(tools["hil"], project), project.name
    return None


def _table(settings: object, path: Path) -> dict[str, Any]:
    if not isinstance(settings, dict):
        raise ConfigurationError((Finding(str(path), 0, 0, "'tool.hil' must be a table"),))
    return settings


def _toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:  # wrong TOML or UTF-8, endless digits, endless nesting
        raise ConfigurationError((Finding(str(path), 0, 0, str(error)),)) from error


def _workspace(root: Path, settings: dict[str, Any], file: str) -> Workspace:
    known = ["hardware", "name", "notify", *_FOLDERS]
    findings = [
        Finding(file, 0, 0, f"unknown key '{key}'{did_you_mean(key, known)}") for key in settings if key not in known
    ]
    findings += [
        Finding(file, 0, 0, f"'{key}' must be a text that can be a name of a file")
        for key, value in settings.items()
        if key in {"name", *_FOLDERS}
        if not isinstance(value, str) or not value.strip() or "\0" in value
    ]
    notify = _command(settings.get("notify", []), "notify", file, findings)
    inhibitor = _inhibitor(settings.get("hardware", {}), file, findings)
    if findings:
        raise ConfigurationError(tuple(findings))
    root = root.resolve()
    folders = {key: (root / settings.get(key, default)).resolve() for key, default in _FOLDERS.items()}
    findings += [
        Finding(file, 0, 0, f"'{key}' is {folder}, and must lie in the workspace, {root}: packages hold what is in it")
        for key, folder in folders.items()
        if key != "reports" and not folder.is_relative_to(root)
    ]
    if findings:
        raise ConfigurationError(tuple(findings))
    return Workspace(root=root, name=settings.get("name", root.name), notify=notify, inhibitor=inhibitor, **folders)


def _inhibitor(hardware: object, file: str, findings: list[Finding]) -> tuple[str, ...]:
    if not isinstance(hardware, dict):
        findings.append(Finding(file, 0, 0, "'hardware' must be a table"))
        return ()
    findings += [
        Finding(file, 0, 0, f"unknown key 'hardware.{key}'{did_you_mean(key, ['inhibitor'])}")
        for key in hardware
        if key != "inhibitor"
    ]
    return _command(hardware.get("inhibitor", []), "hardware.inhibitor", file, findings)


def _command(value: object, name: str, file: str, findings: list[Finding]) -> tuple[str, ...]:
    if not isinstance(value, list) or not all(_is_argument(part) for part in value) or value[:1] == [""]:
        findings.append(Finding(file, 0, 0, f"'{name}' must be a list of texts: a program and its arguments"))
        return ()
    return tuple(value)


def _is_argument(part: object) -> bool:
    return isinstance(part, str) and "\0" not in part
