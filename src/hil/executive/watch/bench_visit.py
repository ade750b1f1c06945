"""Visits to a bench outside runs: look at it, or make it safe."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hil.bench.binding import bind_simulated, check_twin
from hil.bench.bound import BoundBench
from hil.bench.file.reading import load_bench
from hil.bench.readiness import Gate, energised_gates, unpowered_gates
from hil.bench.safe_off import SafeResult, make_safe
from hil.bench.serving import ServedEnds, served
from hil.executive.setup.configuration import refuse_hardware
from hil.executive.setup.workspace import find_workspace
from hil.model.bench import BenchSpec
from hil.model.identity import Source
from hil.wire.transcript import Transcript

__all__ = ["check_bench", "safe_bench", "serve_bench"]


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
def serve_bench(start: Path, name: str, folder: Path, *, speed: float, first_port: int) -> Iterator[ServedEnds]:
    """Open the ends of a simulated bench for other processes, until the context is left.

    Raises:
        Refused: for an unknown bench, one without a simulated twin, or a folder or port that cannot be had.
        ConfigurationError: with everything that is wrong with the bench file.
    """
    with served(_simulated(start, name), folder, speed=speed, first_port=first_port) as ends:
        yield ends


@contextmanager
def _visit(start: Path, name: str, source: Source) -> Iterator[BoundBench]:
    bench = bind_simulated(_simulated(start, name, source), Transcript(None))
    try:
        yield bench
    finally:
        bench.close()


def _simulated(start: Path, name: str, source: Source = Source.SIMULATED) -> BenchSpec:
    """Return a bench file whose simulated twin was checked."""
    workspace = find_workspace(start)
    spec = load_bench(workspace.benches, name, workspace.root)
    refuse_hardware(source)
    path = workspace.benches / name / "bench.yaml"
    check_twin(spec, path, workspace.shown(path))
    return spec
