"""`hil doctor`: check that this computer is ready for its benches, and print fixes."""

from __future__ import annotations

import getpass
import os
import re
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.cli.options import JSON
from hil.documents.text import visible
from hil.model.errors import HilError, Refused

if TYPE_CHECKING:
    from hil.bench.host_checks import Check
    from hil.executive.setup.workspace import Workspace
    from hil.model.bench import BenchSpec

__all__ = ["command"]

_WORDS = {True: "ok", False: "NOT OK", None: "-"}
_LABEL = 8
_PYTHON = (3, 11)
_LOCKED = re.compile(r"([A-Za-z0-9._-]+)==([^\s;\\]+)")
_MOST = 5


@click.command(name="doctor", epilog="Example: hil doctor --json")
@JSON
def command(*, as_json: bool) -> int:
    """Check that this computer is ready for the benches of the workspace, and print a fix for whatever is not.

    It checks Python, its environment and packages, permissions and ports, udev rules, sleep and power, clock, disk
    and the folder for latches. Nothing is changed and no port is opened. Outside a workspace it checks only the
    computer.

    Exit code 0 if nothing is wrong, 1 otherwise.
    """
    from hil.documents.canonical import canonical  # noqa: PLC0415 - heavy

    found = list(_checks())
    if as_json:
        told = [{"name": each.name, "ok": each.ok, "detail": each.detail, "todo": each.todo} for each in found]
        click.echo(canonical({"format": 1, "checks": told}).decode())
    else:
        _tell(found)
    return 1 if any(each.ok is False for each in found) else 0


def _tell(found: list[Check]) -> None:
    for each in found:
        click.echo(visible(f"{_WORDS[each.ok]:{_LABEL}}{each.name}: {each.detail}"))
        for line in each.todo.split(" && ") if each.todo else ():
            click.echo(visible(f"{'':{_LABEL}}  {line}"))
    wrong = sum(each.ok is False for each in found)
    click.echo(f"{wrong} of {len(found)} not ok" if wrong else "ready for hardware")


def _python(version: tuple[int, ...], optimize: int) -> Check:
    """Check the interpreter: its version, and that it evaluates assertions."""
    from hil.bench.host_checks import Check  # noqa: PLC0415 - heavy

    told = ".".join(map(str, version))
    if optimize:
        todo = "unset PYTHONOPTIMIZE, and start Python without -O"
        return Check(name="Python", ok=False, detail=f"{told} leaves assertions out", todo=todo)
    ok = version >= _PYTHON
    todo = "" if ok else "create the environment again with Python 3.11 or newer"
    return Check(name="Python", ok=ok, detail=f"{told} in {sys.prefix}", todo=todo)


def _environment(changing: list[str]) -> Check:
    """Look for anything that makes Python or its libraries execute code that is not installed: it keeps runs open."""
    from hil.bench.host_checks import Check  # noqa: PLC0415 - heavy

    if not changing:
        return Check(name="environment", ok=True, detail="nothing changes which code Python executes")
    variables = [each for each in changing if not each.startswith("/")]
    files = [f"take the libraries out of {each}" for each in changing if each.startswith("/")]
    return Check(
        name="environment",
        ok=False,
        detail=f"{', '.join(changing)}: a run made with this closes no requirement, since other code may have run",
        todo=" && ".join([*([f"unset {' '.join(variables)}"] if variables else []), *files]),
    )


Installed = Callable[[str], str | None]
"""Returns the version of an installed package, None if it is not installed."""


def _installed(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def _packages(required: Iterable[str], installed: Installed) -> Check:
    """Check that the packages that hil needs are installed in supported versions."""
    from packaging.requirements import Requirement  # noqa: PLC0415 - heavy; pytest brings it

    from hil.bench.host_checks import Check  # noqa: PLC0415 - heavy

    needed = [each for each in map(Requirement, required) if each.marker is None or each.marker.evaluate({"extra": ""})]
    wrong = [
        f"{each.name} {found or 'is missing'} ({each.specifier})"
        for each in needed
        if (found := installed(each.name)) is None or not each.specifier.contains(found, prereleases=True)
    ]
    told = f"hil {installed('hil')} and {len(needed)} packages that it needs"
    names = " ".join(
        f"'{each.name}{each.specifier}'" for each in needed if any(w.startswith(f"{each.name} ") for w in wrong)
    )
    return Check(
        name="packages", ok=not wrong, detail=", ".join(wrong) or told, todo=f"pip install {names}" if wrong else ""
    )


def _locked(lock: str, installed: Installed) -> Check:
    """Compare the environment with the lock of the workspace."""
    from hil.bench.host_checks import Check  # noqa: PLC0415 - heavy

    pairs = [match.groups() for line in lock.splitlines() if (match := _LOCKED.match(line))]
    other = [
        f"{name} {found}, not {version}" for name, version in pairs if (found := installed(name)) not in {None, version}
    ]
    missing = [name for name, _ in pairs if installed(name) is None]
    wrong = [*other, *(f"{name} is missing" for name in missing)]
    few = ", ".join(wrong[:_MOST]) + (f" and {len(wrong) - _MOST} more" if len(wrong) > _MOST else "")
    return Check(
        name="lock",
        ok=not wrong,
        detail=few or f"all {len(pairs)} packages are as requirements.lock has them",
        todo="pip install --requirement requirements.lock" if wrong else "",
    )


def _visa(installed: Installed) -> Check:
    """Look for PyVISA, which a bench with ports of visa: needs."""
    from hil.bench.host_checks import Check  # noqa: PLC0415 - heavy

    found = installed("pyvisa")
    detail = f"PyVISA {found}" if found else "a bench has ports of visa:, and PyVISA is not installed"
    return Check(name="VISA", ok=found is not None, detail=detail, todo="" if found else "pip install 'hil[visa]'")


def _workspace() -> tuple[Workspace | None, list[BenchSpec], list[tuple[str, str]]]:
    """Return the workspace around the current folder, its benches, and the errors of those that cannot be read."""
    from hil.bench.file.reading import bench_names, load_bench  # noqa: PLC0415 - heavy
    from hil.executive.setup.workspace import find_workspace  # noqa: PLC0415 - heavy

    try:
        workspace = find_workspace(Path.cwd())
    except Refused:
        return None, [], []
    benches: list[BenchSpec] = []
    problems: list[tuple[str, str]] = []
    for name in bench_names(workspace.benches):
        try:
            benches.append(load_bench(workspace.benches, name, workspace.root, driven=False))
        except HilError as error:
            problems.append((name, str(error).splitlines()[0]))
    return workspace, benches, problems


def _checks() -> Iterator[Check]:
    from hil.bench.host_checks import Check, Computer, examine  # noqa: PLC0415 - heavy
    from hil.clock import wall  # noqa: PLC0415 - heavy
    from hil.executive.setup.software import changing  # noqa: PLC0415 - heavy

    workspace, benches, problems = _workspace()
    yield _python(sys.version_info[:3], sys.flags.optimize)
    yield _environment(changing())
    yield _packages(metadata.requires("hil") or (), _installed)
    if workspace is not None and (lock := workspace.root / "requirements.lock").is_file():
        yield _locked(lock.read_text(encoding="utf-8", errors="replace"), _installed)
    if any(item.port.lower().startswith("visa:") for bench in benches for item in bench.instruments):
        yield _visa(_installed)
    if sys.platform != "linux":
        yield Check(name="system", ok=False, detail=f"{sys.platform} only simulates", todo="drive hardware from Linux")
        return
    from hil.wire.obstacles import users_of  # noqa: PLC0415 - groups of users exist on Linux only

    for name, problem in problems:
        yield Check(name=f"bench {name}", ok=False, detail=problem, todo=f"hil bench check {name} --source simulated")
    reports = workspace.reports if workspace else Path.cwd()
    there = next(path for path in (reports, *reports.parents) if path.exists())
    yield from examine(
        Computer(
            root=Path("/"),
            user=getpass.getuser(),
            groups=frozenset(os.getgroups()),
            now=wall.seconds_of(wall.utc_now()),
            reports=reports,
            free=shutil.disk_usage(there).free,
            used_by=lambda path: users_of(str(path)),
            inhibitor=bool(workspace and workspace.inhibitor),
            benches=benches,
        )
    )
