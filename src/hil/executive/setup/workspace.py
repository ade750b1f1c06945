"""The workspace: the folder of a team's testplans, fixtures and reports."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from hil.documents.findings import Findings
from hil.documents.node import Place
from hil.documents.suggest import did_you_mean
from hil.documents.text import decoded, hidden_character, read_bytes
from hil.model.errors import Refused
from hil.model.notation import Complaint, Notation, matching
from hil.model.notation import Path as Keys

__all__ = ["Workspace", "find_workspace"]

_PACKED = "packages hold what is in it"
_TABLE: Keys = ("tool", "hil")
_TOML_ERROR = re.compile(
    r"(?P<what>.*) \(at (?:line (?P<line>\d+), column (?P<column>\d+)|end of document)\)", re.DOTALL
)
_TABLE_OR_KEY = re.compile(r"\s*(?:\[+(?P<table>[^\[\]]+)\]|(?P<key>[\w\"'.-]+)\s*=)")


def _file_name(value: object) -> str:
    if not isinstance(value, str) or not value.strip():
        raise Complaint("must be text that can be a file name")
    if found := hidden_character(value):
        raise Complaint(f"must be a name that people can read; U+{ord(found[0]):04X} is not allowed in it", found=False)
    return value


def _command(value: object) -> tuple[str, ...]:
    if not isinstance(value, list) or value[:1] == [""] or not all(isinstance(part, str) for part in value):
        raise Complaint("must be a list of texts: a program and its arguments")
    if any("\0" in part for part in value):
        raise Complaint("must be a list of texts without NUL: a program and its arguments")
    return tuple(value)


_FileName = Annotated[str, Notation(_file_name, "")]
_Command = Annotated[tuple[str, ...], Notation(_command, ())]
_Line = Annotated[str, matching("[0-9a-f]{64}", "a SHA-256: 64 digits of 0-9 and a-f, as hil ledger prints it")]


_NAMES = frozenset({"name", "testplans", "fixtures", "reports"})
"""The settings that are file names."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Hardware:
    """Settings for hardware benches only."""

    inhibitor: _Command = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Settings:
    """The settings in `hil.toml`, or in `[tool.hil]` of a `pyproject.toml`."""

    name: _FileName = ""
    testplans: _FileName = "testplans"
    fixtures: _FileName = "fixtures"
    reports: _FileName = "reports"
    ledger: _Line = ""
    notify: _Command = ()
    hardware: _Hardware = field(default_factory=_Hardware)


@dataclass(frozen=True, slots=True, kw_only=True)
class Workspace:
    """A workspace: its folders, absolute, and the commands for its runs.

    Attributes:
        root: its folder.
        name: its name for people.
        testplans: holds a folder per plan.
        fixtures: holds fixture modules and benches.
        reports: where packages go.
        ledger: SHA-256 of the first line of the ledger there; empty if any ledger will do.
        notify: notifies people of what happens to runs; program and arguments.
        inhibitor: inhibits sleep and shutdown in place of logind; program and arguments.
    """

    root: Path
    name: str
    testplans: Path
    fixtures: Path
    reports: Path
    ledger: str = ""
    notify: tuple[str, ...] = ()
    inhibitor: tuple[str, ...] = ()

    @property
    def benches(self) -> Path:
        """The folder with one folder per bench."""
        return self.fixtures / "benches"

    @property
    def duts(self) -> Path:
        """The register of devices under test."""
        from hil.registers.units import DUTS  # noqa: PLC0415 - the readers of documents are slow to load

        return self.fixtures / DUTS

    @property
    def instruments(self) -> Path:
        """The register of instruments; there need not be one."""
        from hil.registers.instruments import INSTRUMENTS  # noqa: PLC0415 - as above

        return self.fixtures / INSTRUMENTS

    def shown(self, path: Path) -> str:
        """Return a path as people see it: relative to the workspace if it is inside."""
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


def find_workspace(start: Path, findings: Findings | None = None, named: Sequence[Path] = ()) -> Workspace:
    """Return the nearest workspace upwards from `start`, otherwise from the first named folder.

    Args:
        start: the folder where the search begins.
        findings: collects what is wrong with its settings, for callers that look for other mistakes, too; unusable
            settings then have their defaults.
        named: folders given to a command, such as those of plans.

    Raises:
        Refused: if there is none.
        ConfigurationError: if its settings are wrong, and no `findings` are given.
    """
    noted = Findings() if findings is None else findings
    for folder in (above for each in (start, *named) for above in (each, *each.parents)):
        settings = _settings(folder, noted)
        if settings is not None:
            found = _workspace(folder, *settings, noted)
            if findings is None:
                noted.raise_if_any()
            return found
    raise Refused(
        f"no workspace at {start} or above it",
        "put a hil.toml (it may be empty) beside your testplans and fixtures, and start there",
    )


def _settings(folder: Path, findings: Findings) -> tuple[dict[str, Any], _Toml, Keys] | None:
    """Return a workspace's settings, their file, and their table in it; None if it is not a workspace."""
    own, project = folder / "hil.toml", folder / "pyproject.toml"
    if own.exists():
        file = _Toml(own, findings)
        return file.read(), file, ()
    if project.is_file():
        file = _Toml(project, findings)
        tools = file.read().get("tool")
        if isinstance(tools, dict) and "hil" in tools:
            settings = tools["hil"]
            if not isinstance(settings, dict):
                file.wrong(_TABLE, "'tool.hil' must be a table")
            return settings if isinstance(settings, dict) else {}, file, _TABLE
        findings.raise_if_any()  # it is unknown whether it is a workspace
    return None


class _Toml:
    """A settings file; errors are noted with line and column."""

    def __init__(self, file: Path, findings: Findings) -> None:
        self._name = file.name
        self._findings = findings
        data = read_bytes(file, file.name, findings)
        self._text = (None if data is None else decoded(data, file.name, findings)) or ""

    def read(self) -> dict[str, Any]:
        """Return the content of the file, empty if it is not TOML."""
        try:
            return tomllib.loads(self._text)
        except tomllib.TOMLDecodeError as error:
            match = _TOML_ERROR.fullmatch(str(error))
            lines = self._text.split("\n")
            end = (len(lines), len(lines[-1]) + 1)
            at = (int(match["line"]), int(match["column"])) if match and match["line"] else end
            self._note(*at, f"not readable as TOML: {match['what'] if match else error}")
        except RecursionError:
            self._note(0, 0, "not readable as TOML: nested too deeply")
        except ValueError:
            self._note(0, 0, "not readable as TOML: a number has too many digits")
        return {}

    def wrong(self, keys: Keys, message: str) -> None:
        """Note an error at the line of the value of these keys, or of the nearest table above."""
        places = _places(self._text)
        nearest = next((keys[:length] for length in range(len(keys), 0, -1) if keys[:length] in places), ())
        self._note(*places.get(nearest, (0, 0)), message)

    def _note(self, line: int, column: int, message: str) -> None:
        self._findings.add(Place(path=self._name, line=line, column=column), message)


def _workspace(root: Path, settings: dict[str, Any], file: _Toml, table: Keys, findings: Findings) -> Workspace:
    found = _declared(settings, file, table)
    root = root.resolve()
    folders = {key: (root / getattr(found, key)).resolve() for key in ("testplans", "fixtures", "reports")}
    outside = False
    for key, folder in folders.items():
        if key != "reports" and not folder.is_relative_to(root):
            file.wrong((*table, key), f"'{key}' is {folder}, and must lie in the workspace, {root}: {_PACKED}")
            outside = True
    if outside:
        findings.raise_if_any()  # otherwise no file in it could be shown by its path in the workspace
    name, inhibitor = found.name or root.name, found.hardware.inhibitor
    return Workspace(root=root, name=name, ledger=found.ledger, notify=found.notify, inhibitor=inhibitor, **folders)


def _declared(settings: dict[str, Any], file: _Toml, table: Keys) -> _Settings:
    with suppress(Complaint):
        if settings.keys() <= _NAMES:  # most workspaces: every command reads this, and need not load the reader
            names: dict[str, Any] = {key: _file_name(value) for key, value in settings.items()}
            return _Settings(**names)
    from hil.documents.declared import Invalid, validated  # noqa: PLC0415 - see above

    try:
        return validated(_Settings, settings, "workspace")
    except Invalid as error:
        for problem in error.problems:
            file.wrong((*table, *problem.path), problem.message)
        return _Settings()


def _places(text: str) -> dict[Keys, tuple[int, int]]:
    """Return line and column of every table and key of a TOML document, as far as lines show it."""
    table: Keys = ()
    places: dict[Keys, tuple[int, int]] = {}
    for number, line in enumerate(text.splitlines(), 1):
        match = _TABLE_OR_KEY.match(line)
        if match is None:
            continue
        keys = tuple(part.strip(" \"'") for part in (match["table"] or match["key"]).split("."))
        table, keys = (keys, keys) if match["table"] else (table, (*table, *keys))
        places.setdefault(keys, (number, match.start("table" if match["table"] else "key") + 1))
    return places
