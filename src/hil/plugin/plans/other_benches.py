"""What is said of a role that this bench does not have, and others may."""

from __future__ import annotations

from hil.bench.file.reading import bench_names, load_bench
from hil.executive.setup.configuration import Configuration
from hil.instruments.registry import ROLES
from hil.model.errors import ConfigurationError, Refused

__all__ = ["unwired"]


def unwired(name: str, configuration: Configuration) -> str:
    """Return that no wire of the bench has this role, and which benches have one; empty where it is no role."""
    if name not in ROLES:
        return ""
    workspace = configuration.workspace
    others = [other for other in bench_names(workspace.benches) if _has(other, name, configuration)]
    where = f"; benches that have it: {', '.join(others)}" if others else ""
    return f"a role that no wire of the bench {configuration.bench.name} has: this plan cannot run there{where}"


def _has(bench: str, role: str, configuration: Configuration) -> bool:
    workspace = configuration.workspace
    try:
        found = load_bench(workspace.benches, bench, workspace.root, driven=False)
    except (ConfigurationError, Refused):
        return False  # a bench that cannot be read is not the one that was asked for
    return any(wire.role == role for wire in found.wiring)
