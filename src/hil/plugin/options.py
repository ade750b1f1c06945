"""The plugin's entry point: options, markers and a hint only, so that other pytest runs pay nothing for it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import pytest

__all__ = [
    "pytest_addoption",
    "pytest_collection_finish",
    "pytest_configure",
    "pytest_ignore_collect",
    "pytest_runtest_setup",
]

_TABLE = re.compile(r"^\[tool\.hil[.\]]", re.MULTILINE)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options, which cases of plans need; other tests are not affected."""
    group = parser.getgroup("hil", "hardware-in-the-loop benches")
    group.addoption("--bench", metavar="NAME", help="run the plans on this simulated bench of the workspace")
    group.addoption("--dut", metavar="SERIAL", default="", help="serial number of the device under test")
    group.addoption("--source", default="simulated", choices=["hardware", "simulated"], help="where bytes come from")
    group.addoption("--bench-output", metavar="DIR", default="", help="where the package goes (default: reports/)")


def pytest_configure(config: pytest.Config) -> None:
    """Register what drives a bench, if one is named; in any workspace, register the markers."""
    if config.getoption("--bench", None):
        from hil.plugin.plain import configure_plain  # noqa: PLC0415 - only if a bench is named

        configure_plain(config)
    elif _is_workspace(config.rootpath):
        from hil.plugin.plans.markers import MARKERS  # noqa: PLC0415 - only in a workspace

        for marker in MARKERS:
            config.addinivalue_line("markers", marker)


def pytest_ignore_collect(collection_path: Path) -> bool | None:
    """Leave out the sources in packages: they are evidence, not cases."""
    inside = collection_path.name == "data" and (collection_path / "sources").is_dir()
    return True if inside and (collection_path / "journal.jsonl").is_file() else None


def pytest_collection_finish(session: pytest.Session) -> None:
    """Fail with a hint if there are only cases of plans, and no bench is named.

    Raises:
        pytest.UsageError: with the options to add.
    """
    if session.items and not session.config.option.collectonly and all(map(_lacks_bench, session.items)):
        raise pytest.UsageError(_hint(session.config, session.items))


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Fail a case of a plan among other tests with a hint, before its fixtures are not found."""
    if _lacks_bench(item):
        pytest.fail(_hint(item.config, [item]), pytrace=False)


def _lacks_bench(item: pytest.Item) -> bool:
    if item.config.getoption("--bench", None) or item.get_closest_marker("requirement") is None:
        return False
    return (item.path.parent / "requirements.yaml").is_file()


def _hint(config: pytest.Config, items: Sequence[pytest.Item]) -> str:
    """Return which options a case needs, with the names of the benches."""
    plan = items[0].path.parent
    roots = [folder for folder in plan.parents if _is_workspace(folder)]
    benches = sorted(path.parent.name for path in roots[0].glob("*/benches/*/bench.yaml")) if roots else []
    named = f" ({', '.join(benches)})" if benches else ""
    shown = plan.relative_to(config.rootpath) if plan.is_relative_to(config.rootpath) else plan
    return f"the cases of {shown} need a bench: add --bench NAME{named} and --dut SERIAL, or use hil run"


def _is_workspace(folder: Path) -> bool:
    """Return whether a folder is a workspace, without parsing its settings."""
    if (folder / "hil.toml").is_file():
        return True
    try:
        return _TABLE.search((folder / "pyproject.toml").read_text(encoding="utf-8", errors="replace")) is not None
    except OSError:
        return False
