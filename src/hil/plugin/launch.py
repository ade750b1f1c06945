"""Launches pytest on plans, in this process, isolated from any other pytest configuration."""

from __future__ import annotations

import bdb
import os
import re
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from hil.documents.suggest import did_you_mean
from hil.executive.session import Session
from hil.executive.setup.configuration import Configuration
from hil.executive.setup.ground import Ground
from hil.model.errors import ConfigurationError, Finding, Refused
from hil.plugin.campaign import Campaign, Opener
from hil.plugin.plans.frozen_code import frozen_code
from hil.plugin.plans.markers import KNOWN

__all__ = ["Launched", "launch"]

_INI = """\
[pytest]
addopts =
norecursedirs =
filterwarnings =
    default
"""


@dataclass(frozen=True, slots=True)
class Launched:
    """What pytest returned, and the session if one was opened."""

    code: int
    session: Session | None


def launch(configuration: Configuration, opener: Opener) -> Launched:
    """Collect and run the cases of the configured plans; the package is not sealed yet.

    Raises:
        ConfigurationError: if cases cannot be collected or do not fit the catalogue.
    """
    workspace = configuration.workspace
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="hil-"))
        stack.enter_context(_own_environment())
        stack.enter_context(_own_modules(configuration.ground))
        stack.enter_context(_no_debugger())
        campaign = Campaign(configuration, opener, stack.enter_context(frozen_code(configuration)))
        ini = Path(folder) / "pytest.ini"
        ini.write_text(_INI, encoding="ascii")
        code = _outcome(campaign, _arguments(configuration, ini))
    if campaign.error is not None:
        raise campaign.error
    if campaign.collection_errors:
        root = workspace.root
        raise ConfigurationError(tuple(_finding(where, text, root) for where, text in campaign.collection_errors))
    if campaign.session is None and code == pytest.ExitCode.USAGE_ERROR:
        raise Refused("the plans could not be collected, see above", "correct what pytest names there")
    return Launched(code, campaign.session)


def _outcome(campaign: Campaign, arguments: list[str]) -> int:
    """Return pytest's exit code; once there is a session no exception escapes, because a run has to be sealed."""
    try:
        return int(pytest.main(arguments, plugins=[campaign]))
    except SystemExit as error:
        if campaign.session is None:
            what = f"a module of the plans ended the process (sys.exit({error.code!r}))"
            raise Refused(what, "remove it: a run ends by itself") from error
    except BaseException as error:
        if campaign.session is None:
            raise
        sys.stderr.write(f"hil: pytest was ended by {type(error).__name__}: {error}\n")
    return int(pytest.ExitCode.INTERNAL_ERROR)


def _arguments(configuration: Configuration, ini: Path) -> list[str]:
    workspace = configuration.workspace
    return [
        *("-c", str(ini)),
        *("--rootdir", str(workspace.root)),
        *("--confcutdir", str(workspace.testplans)),
        "--import-mode=importlib",
        "--strict-markers",
        *("-p", "no:terminal"),
        *("-p", "no:cacheprovider"),
        *("-p", "no:debugging"),
        *("-p", "no:unraisableexception"),  # it hides them without a terminal, and forces two full garbage collections
        "--capture=no",
        *(str(plan) for plan in configuration.plans),
    ]


@contextmanager
def _own_environment() -> Iterator[None]:
    """Keep options and plugins of other projects out of the run; the settings are restored afterwards."""
    own = {"PYTEST_ADDOPTS": "", "PYTEST_PLUGINS": "", "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    before = {name: os.environ.get(name) for name in own}
    os.environ.update(own)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name, None)  # a case may have cleared them all
            if value is not None:
                os.environ[name] = value


@contextmanager
def _own_modules(ground: Ground) -> Iterator[None]:
    """Unload the workspace's modules afterwards: those of another workspace have the same names.

    Only its own: an environment with installed packages is often in the workspace, too, and compiled modules cannot
    be loaded twice.
    """
    before = set(sys.modules)
    try:
        yield
    finally:
        # All of them are checked before one goes: a namespace package asks its parent where it is.
        for name in [name for name in set(sys.modules) - before if _is_inside(sys.modules[name], ground)]:
            del sys.modules[name]


@contextmanager
def _no_debugger() -> Iterator[None]:
    """Refuse `breakpoint()` and every debugger based on Python's; the hooks are restored afterwards."""
    before = sys.breakpointhook, bdb.Bdb.set_trace
    sys.breakpointhook = _refuse_debugger
    _replace_set_trace(_refuse_debugger)
    try:
        yield
    finally:
        sys.breakpointhook = before[0]
        _replace_set_trace(before[1])


def _replace_set_trace(function: Callable[..., None]) -> None:
    bdb.Bdb.set_trace = function  # type: ignore[method-assign]


def _refuse_debugger(*_: object, **__: object) -> None:
    """Replacement for a debugger.

    Raises:
        Refused: always.
    """
    what = "a debugger would hold the case while outputs are on, and nobody would watch the limits"
    raise Refused(what, "debug with plain pytest on the simulated bench: pytest PLAN --bench NAME --dut SERIAL")


def _is_inside(module: object, ground: Ground) -> bool:
    places = [getattr(module, "__file__", None) or "", *getattr(module, "__path__", ())]
    return any(place and ground.is_own(place) for place in places)


def _finding(where: str, text: str, root: Path) -> Finding:
    """Return the message and line of a collection error; the rest of a traceback is not for people."""
    if unknown := re.fullmatch(r"'(\w+)' not found in `markers` configuration option", text.strip()):
        return _unknown_marker(where, unknown[1], root)
    message_lines = [line[1:].strip() for line in text.splitlines() if line.startswith("E ")]
    frames = re.findall(rf"^.*{re.escape(where)}:(\d+): ", text, re.MULTILINE)
    quoted = re.search(r'^File ".*", line (\d+)$', message_lines[0]) if message_lines else None
    if quoted:  # a syntax error: the line, its text, a mark below it, and last the error
        return Finding(path=where, line=int(quoted[1]), column=1, message=message_lines[-1])
    message = "; ".join(message_lines) or text.strip()
    return Finding(path=where, line=int(frames[-1]) if frames else 0, column=1 if frames else 0, message=message)


def _unknown_marker(where: str, name: str, root: Path) -> Finding:
    """Return a finding for an unknown marker with its first line; pytest reports only the name."""
    try:
        lines = (root / where).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        lines = []
    line = next((number for number, text in enumerate(lines, 1) if re.search(rf"\bmark\.{name}\b", text)), 0)
    hint = did_you_mean(name, KNOWN) or f"; a case can have {', '.join(KNOWN)}"
    return Finding(path=where, line=line, column=min(line, 1), message=f"unknown marker '{name}'{hint}")
