"""Run plans under pytest, in this process, with nothing of anybody else's configuration."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from hil.executive.run.configuration import Configuration
from hil.executive.run.session import Session
from hil.model.errors import ConfigurationError, Finding
from hil.plugin.campaign import Campaign, Opener

__all__ = ["Launched", "launch"]

_INI = "[pytest]\naddopts =\nfilterwarnings = default\n"


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
    campaign = Campaign(configuration, opener)
    with tempfile.TemporaryDirectory(prefix="hil-") as folder, _own_environment():
        ini = Path(folder) / "pytest.ini"
        ini.write_text(_INI, encoding="ascii")
        code = pytest.main(_arguments(configuration, ini), plugins=[campaign])
    if campaign.error is not None:
        raise campaign.error
    if campaign.collection_errors:
        raise ConfigurationError(tuple(_finding(where, text) for where, text in campaign.collection_errors))
    return Launched(int(code), campaign.session)


def _arguments(configuration: Configuration, ini: Path) -> list[str]:
    workspace = configuration.workspace
    return [
        *("-c", str(ini)),
        *("--rootdir", str(workspace.root)),
        "--import-mode=importlib",
        "--strict-markers",
        *("-p", "no:terminal"),
        *("-p", "no:cacheprovider"),
        "--capture=no",
        *(str(plan) for plan in configuration.plans),
    ]


@contextmanager
def _own_environment() -> Iterator[None]:
    """Keep options and plugins of other projects out of the run; what was set is put back."""
    own = {"PYTEST_ADDOPTS": "", "PYTEST_PLUGINS": "", "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    before = {name: os.environ.get(name) for name in own}
    os.environ.update(own)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name)
            if value is not None:
                os.environ[name] = value


def _finding(where: str, text: str) -> Finding:
    """Return the sentence of a collection error: the last line that is no frame of a traceback."""
    lines = [line.removeprefix("E").strip() for line in text.splitlines() if line.startswith("E ")]
    return Finding(path=where, line=0, column=0, message="; ".join(lines) or text.strip())
