"""Packages of other people, visible to a test as if they were installed."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

from hil.documents import offers

__all__ = ["INA226", "install", "uninstall"]

INA226 = Path(__file__).parent / "packages/hil_ina226"


def install(project: Path, into: Path) -> None:
    """Write the metadata that an installer would, and put it and the sources on the path of this process."""
    about = tomllib.loads((project / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    info = into / f"{about['name'].replace('-', '_')}-{about['version']}.dist-info"
    info.mkdir(parents=True)
    head = f"Metadata-Version: 2.1\nName: {about['name']}\nVersion: {about['version']}\n"
    (info / "METADATA").write_text(head, encoding="utf-8")
    groups = (
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in points.items())
        for group, points in about.get("entry-points", {}).items()
    )
    (info / "entry_points.txt").write_text("\n".join(groups), encoding="utf-8")
    sys.path[:0] = [str(into), str(project / "src")]
    offers._installed.cache_clear()


def uninstall(project: Path, into: Path) -> None:
    """Take it away again; modules that were imported stay, as in any process."""
    for path in (str(into), str(project / "src")):
        sys.path.remove(path)
    offers._installed.cache_clear()
