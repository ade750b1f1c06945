"""Visits to a bench outside runs: check it, or make it safe."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from itertools import chain
from pathlib import Path

from hil.bench.binding import bind_simulated, check_twin
from hil.bench.bound import BoundBench
from hil.bench.file.reading import load_bench
from hil.bench.gate import Gate
from hil.bench.lease import Lease, refuse_latched
from hil.bench.live import bind_live
from hil.bench.port_identity import WrongPort
from hil.bench.readiness import energised_gates, unpowered_gates
from hil.bench.safe_off import SafeResult, make_safe
from hil.bench.serving import ServedEnds, served
from hil.clock import wall
from hil.executive.setup.configuration import reach_of
from hil.executive.setup.workspace import find_workspace
from hil.model.bench import BenchSpec
from hil.model.errors import DeviceFault, Refused
from hil.model.identity import Source
from hil.wire.transcript import Transcript

__all__ = ["check_bench", "safe_bench", "serve_bench"]


def check_bench(
    start: Path, name: str, source: Source, *, energise: bool, served: Path | None = None
) -> Iterator[Gate]:
    """Yield the readiness gates of a bench; without `energise`, or if one does not hold, nothing is driven.

    Where a port is not there, or is another board's, nothing but that is told. A latch is a gate that does not hold.

    Args:
        start: the folder where the workspace is searched for.
        name: the bench's.
        source: hardware or simulated.
        energise: whether outputs are tried at their reduced level.
        served: the folder in which another process serves the bench.

    Raises:
        Refused: for an unknown bench, one that a run holds, or one to be driven that is latched.
        ConfigurationError: with everything that is wrong with the bench file.
    """
    with ExitStack() as stack:
        try:
            bench = stack.enter_context(_visit(start, name, source, served, driven=energise))
        except WrongPort as error:
            yield from error.gates
            return
        except DeviceFault as error:
            yield Gate(f"port of {error.device}", ok=False, detail=str(error))
            return
        ready = True
        for gate in chain(unpowered_gates(bench, None), _latch_gates(bench.spec, source, served)):
            ready = ready and gate.ok
            yield gate
        if energise and ready:
            yield from energised_gates(bench, None)


def _latch_gates(spec: BenchSpec, source: Source, served: Path | None) -> Iterator[Gate]:
    reach = reach_of(spec, source, served)
    try:
        refuse_latched(reach.leases if reach else ())
    except Refused as error:
        yield Gate("not latched", ok=False, detail=str(error))


def safe_bench(
    start: Path, name: str, source: Source, *, served: Path | None = None, tell: Callable[[str], None]
) -> list[SafeResult]:
    """Execute every line of a bench's safe-off and return the outcome of each; see `check_bench`.

    Anyone who holds the bench does not keep anybody from making it safe, nor does an instrument that cannot be reached:
    its lines are not proven. Who holds the bench is told.
    """
    results: list[SafeResult] = []
    with _visit(start, name, source, served, by_force=tell) as bench:
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
def _visit(
    start: Path,
    name: str,
    source: Source,
    served: Path | None,
    *,
    driven: bool = False,
    by_force: Callable[[str], None] | None = None,
) -> Iterator[BoundBench]:
    spec = _simulated(start, name) if source is Source.SIMULATED else _read(start, name)
    reach = reach_of(spec, source, served)
    with ExitStack() as stack:
        if reach is None:
            bench = bind_simulated(spec, Transcript(None))
        else:
            stack.callback(_leased(reach.leases, by_force).release)
            if driven:
                refuse_latched(reach.leases)
            bench = bind_live(spec, reach, wall.utc_now(), Transcript(None), by_force=by_force is not None)
        stack.callback(bench.close)
        yield bench


def _leased(keys: Sequence[str], by_force: Callable[[str], None] | None) -> Lease:
    """Take the bench's leases; by force it continues without them, and reports who has them."""
    try:
        return Lease(keys, "hil bench")
    except Refused as error:
        if by_force is None:
            raise
        by_force(str(error))
        return Lease((), "hil bench")


def _read(start: Path, name: str) -> BenchSpec:
    workspace = find_workspace(start)
    return load_bench(workspace.benches, name, workspace.root)


def _simulated(start: Path, name: str) -> BenchSpec:
    """Return a bench file whose simulated twin was checked."""
    workspace, spec = find_workspace(start), _read(start, name)
    path = workspace.benches / name / "bench.yaml"
    check_twin(spec, path, workspace.shown(path))
    return spec
