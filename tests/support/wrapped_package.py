"""The package of the page on vendors' drivers, and the vendor's own, as an installer would leave them."""

from __future__ import annotations

import os
import re
from pathlib import Path

from other_packages import install, uninstall

__all__ = ["PAGE", "VENDOR", "paths_of", "written"]

PAGE = Path(__file__).parents[2] / "docs/how-to/wrap-a-vendor-driver.md"
VENDOR = Path(__file__).parent / "packages/acme_power"


def written(folder):
    """Write the files that the page shows, and the metadata of its package; return the folder."""
    text = PAGE.read_text(encoding="utf-8")
    files = re.findall(r"`((?:src|fixtures|pyproject)[\w/.]*)`:\n\n```\w+\n(.*?)```", text, re.DOTALL)
    for name, code in files:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(code, encoding="utf-8")
    (folder / "src/acme_hil/__init__.py").write_text("", encoding="utf-8")
    install(folder, folder / "site")
    uninstall(folder, folder / "site")
    return folder


def paths_of(folder, *, vendor=True):
    """Return the PYTHONPATH of processes that find them, the vendor's only if it is asked for."""
    there = [str(folder / "site"), str(folder / "src"), *([str(VENDOR)] if vendor else [])]
    return os.pathsep.join([*there, *filter(None, [os.environ.get("PYTHONPATH")])])
