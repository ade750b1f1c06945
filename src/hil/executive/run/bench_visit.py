"""Visits to a bench outside runs: look at it, or make it safe."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hil.bench.binding import BoundBench, bind_simulated, check_twin
from hil.bench.file.reading import load_bench
from hil.bench.readiness import Gate, energised_gates, unpowered_gates
from hil.bench.safe_off import SafeResult, make_safe
from hil.executive.setup.configuration import refuse_hardware
from hil.executive.setup.workspace import find_workspace
from hil.model.identity import Source
from hil.wire.transcript import Transcript

__all__ = ["check_bench", "safe_bench"]


def check_bench(start: Path, name: str, source: Source, *, energise: bool) -> Iterator[Gate]:
    """Yield the readiness gates of a bench; without `energise`, or if one does not hold, nothing is driven.

    Raises:
        Refused: for hardware, or an unknown bench.
        ConfigurationError: with everything that is wrong with the bench file.
    """
    with _visit(start, name, source) as bench:
        ready = True
        for gate in unpowered_gates(bench, None):
            ready = ready and gate.ok
            yield gate
        if energise and ready:
            yield from energised_gates(bench, None)


def safe_bench(start: Path, name: str, source: Source) -> list[SafeResult]:
    """Take every line of a bench's safe-off and return what became of each.

    Raises:
        Refused: for hardware, or an unknown bench.
        ConfigurationError: with everything that is wrong with the bench file.
    """
    results: list[SafeResult] = []
    with _visit(start, name, source) as bench:
        make_safe(bench.spec.safe_off, bench.roles, bench.clock, results.append)
    return results


@contextmanager
def _visit(start: Path, name: str, source: Source) -> Iterator[BoundBench]:
    workspace = find_workspace(start)
    spec = load_bench(workspace.benches, name, workspace.root)
    refuse_hardware(source)
    path = workspace.benches / name / "bench.yaml"
    check_twin(spec, path, workspace.shown(path))
    bench = bind_simulated(spec, Transcript(None))
    try:
        yield bench
    finally:
        bench.close()
