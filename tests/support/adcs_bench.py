"""The magnetorquer jig of the bench `adcs`, changed a little: as a file for its reader, or as data for its twin.

It is the committed bench without the gyroscope's part, so that its tests stay small and quick.
"""

from __future__ import annotations

import importlib.util
import py_compile
import shutil
import tempfile
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from pathlib import Path

from hil.bench.binding import bind_simulated
from hil.bench.file.reading import load_bench
from hil.model.errors import ConfigurationError
from hil.wire.transcript import Transcript

__all__ = ["ADCS", "adcs", "bound", "changed", "copy_fixtures", "found", "with_peer"]

ADCS = Path(__file__).parent / "benches" / "adcs"


def adcs():
    """Return the bench."""
    return load_bench(ADCS.parent, "adcs", ADCS.parents[2])


def copy_fixtures(root: Path) -> None:
    """Copy the workspace's fixtures into another one, with this bench for its bench `adcs`.

    Their byte code comes with them, as in a workspace that was used before: hundreds of runs compile it once.
    """
    fixtures = Path(__file__).parents[2] / "fixtures"
    shutil.copytree(fixtures, root / "fixtures", ignore=shutil.ignore_patterns("__pycache__", "benches"))
    (root / "fixtures/__pycache__").mkdir()
    for module in fixtures.glob("*.py"):
        place = importlib.util.cache_from_source(str(root / "fixtures" / module.name))
        Path(place).write_bytes(_byte_code(module))
    shutil.copytree(ADCS, root / "fixtures/benches/adcs")


@cache
def _byte_code(module: Path) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        return Path(py_compile.compile(str(module), f"{folder}/code", doraise=True)).read_bytes()


def changed(root: Path, *changes: tuple[str, str]) -> str:
    """Lay a copy of the bench with changed text into the workspace `root`, and return the text."""
    folder = root / "fixtures" / "benches" / "adcs"
    shutil.copytree(ADCS, folder, dirs_exist_ok=True)
    text = (ADCS / "bench.yaml").read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    (folder / "bench.yaml").write_text(text, encoding="utf-8")
    return text


def found(root: Path) -> list[str]:
    """Return the findings of the bench in the workspace `root`, as a person reads them."""
    try:
        load_bench(root / "fixtures" / "benches", "adcs", root)
    except ConfigurationError as error:
        return [str(finding) for finding in error.findings]
    return []


def with_peer(spec, device: str, **parts):
    """Return the bench with parts of one peer replaced: `truth`, `connects`, `faults`."""
    peers = tuple(replace(peer, **parts) if peer.device == device else peer for peer in spec.simulated.peers)
    return replace(spec, simulated=replace(spec.simulated, peers=peers))


@contextmanager
def bound(spec):
    """Yield the simulated bench, and close it."""
    bench = bind_simulated(spec, Transcript(None))
    try:
        yield bench
    finally:
        bench.close()
