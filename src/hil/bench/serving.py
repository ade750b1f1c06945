"""Serves the simulated twin of a bench file: world and open ends, without drivers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import cast

from hil.bench.binding import simulated_twin
from hil.bench.connections import server_of
from hil.clock import wall
from hil.model.bench import BenchSpec
from hil.simulation.served.bench import ServedBench
from hil.simulation.served.folder import ask
from hil.simulation.served.server import Server

__all__ = ["ServedEnds", "ends_of", "served"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ServedEnds:
    """A bench that other processes can open.

    Attributes:
        spec: the bench file.
        where: by instrument, the URL at which it is open, or why it has none.
        run: serves until stopped.
        stop: makes `run` return soon; may be called from a signal handler.
    """

    spec: BenchSpec
    where: dict[str, str]
    run: Callable[[], None]
    stop: Callable[[], None]


@contextmanager
def served(spec: BenchSpec, folder: Path, *, speed: float = 1.0, first_port: int = 0) -> Iterator[ServedEnds]:
    """Open the ends of a bench in a folder, and remove them at the end.

    Args:
        spec: the bench file, with a simulated twin whose truths were checked.
        folder: where links and control socket are.
        speed: bench seconds per second of real time.
        first_port: of the network instruments, 0 for any free ports.

    Raises:
        Refused: if the bench has no simulated twin, or the folder or a port is not available.
    """
    bench = ServedBench(spec, simulated_twin(spec))
    with Server(bench, folder, wall.monotonic, speed=speed, first_port=first_port) as server:
        yield ServedEnds(spec=spec, where=_where(spec, server), run=server.run, stop=server.stop)


def ends_of(folder: Path, bench: str) -> tuple[dict[str, str], float]:
    """Return where the instruments of a bench served in a folder are, and its speed.

    Args:
        folder: where it is served.
        bench: its name, for the advice to a person if nobody serves it.

    Raises:
        Refused: if none is served there.
    """
    ends = cast("dict[str, str]", ask(folder, {"ends": None}, bench=bench)["ends"])
    return ends, cast("dict[str, float]", ask(folder, {"time": None}, bench=bench)["time"])["speed"]


def _where(spec: BenchSpec, server: Server) -> dict[str, str]:
    found: dict[str, str] = {}
    for instrument in spec.instruments:
        if not instrument.bus:
            found[instrument.name] = server.ends[instrument.name].url
        elif (through := server_of(spec, instrument)) is not None:
            found[instrument.name] = f"on bus {instrument.bus}, through {through.name}"
        else:
            found[instrument.name] = f"not served: bus {instrument.bus} is the host's own, not a stream of bytes"
    return found
