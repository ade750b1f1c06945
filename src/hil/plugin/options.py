"""The plugin's entry point: options only, so that other pytest runs pay nothing for it."""

from __future__ import annotations

import pytest

__all__ = ["pytest_addoption", "pytest_configure"]


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options; nothing else happens unless a bench is named."""
    group = parser.getgroup("hil", "hardware-in-the-loop benches")
    group.addoption("--bench", metavar="NAME", help="run the plans on this simulated bench of the workspace")
    group.addoption("--dut", metavar="SERIAL", default="", help="serial number of the device under test")
    group.addoption("--source", default="simulated", choices=["hardware", "simulated"], help="where bytes come from")
    group.addoption("--bench-output", metavar="DIR", default="", help="where the package goes (default: reports/)")


def pytest_configure(config: pytest.Config) -> None:
    """Register what drives a bench, if one is named."""
    if config.getoption("--bench", None):
        from hil.plugin.plain import configure_plain  # noqa: PLC0415 - costs nothing if no bench is named

        configure_plain(config)
