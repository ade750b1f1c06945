"""A served bench in this process, on a wall clock that nobody waits for, with clients that never wait."""

from __future__ import annotations

import os
import socket
import tty
from functools import cache
from pathlib import Path

from hil.bench.file.reading import load_bench
from hil.model.bench import BenchSpec
from hil.simulation.served.bench import ServedBench
from hil.simulation.served.ends import look
from hil.simulation.served.server import Server

__all__ = ["ROOT", "NetworkClient", "SerialClient", "Wall", "bench_of", "serving"]

ROOT = Path(__file__).parents[2]
_LOOKING_S = 1e-6
_KERNEL_S = 0.001  # a pseudo-terminal hands bytes over a little later


class Wall:
    """Seconds that pass when a test says so, and when a server waits and nobody says anything."""

    def __init__(self) -> None:
        self.seconds = 1000.0

    def __call__(self) -> float:
        """Return the seconds."""
        return self.seconds

    def wait(self, watches, seconds):
        """Return what is ready at once; else the seconds pass without anybody waiting for them."""
        ready = look(watches, _KERNEL_S)
        if not ready:
            self.seconds += max(seconds, _LOOKING_S)
        return ready


def bench_of(name: str) -> ServedBench:
    """Return a bench of this repository, ready to be served."""
    spec = _spec_of(name)
    return ServedBench(spec, spec.simulated)


@cache  # nobody can change it
def _spec_of(name: str) -> BenchSpec:
    return load_bench(ROOT / "fixtures" / "benches", name, ROOT)


def serving(folder: Path, name: str = "adcs", **options) -> Server:
    """Return a server that waits without waiting."""
    wall = Wall()
    return Server(bench_of(name), folder, wall, wait=wall.wait, **options)


class _Client:
    def until(self, server: Server, end: bytes, turns: int = 3000) -> bytes:
        """Let the server turn until what came ends so."""
        came = b""
        for _ in range(turns):
            server.turn()
            came += self.fetch()
            if came.endswith(end):
                return came
        raise AssertionError(came)


class SerialClient(_Client):
    """A program that opened a serial device."""

    def __init__(self, path: Path) -> None:
        self.descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(self.descriptor)

    def write(self, data: bytes) -> int:
        """Write what there is room for."""
        try:
            return os.write(self.descriptor, data)
        except BlockingIOError:
            return 0

    def fetch(self) -> bytes:
        """Return what is there."""
        try:
            return os.read(self.descriptor, 65_536)
        except BlockingIOError:
            return b""

    def close(self) -> None:
        """Close it."""
        os.close(self.descriptor)


class NetworkClient(_Client):
    """A program that connected to an address of a network or of this machine."""

    def __init__(self, address: str | Path) -> None:
        if isinstance(address, Path):
            self.socket = socket.socket(socket.AF_UNIX)
            self.socket.connect(str(address))
        else:
            host, _, port = address.removeprefix("socket://").partition(":")
            self.socket = socket.create_connection((host, int(port)))
        self.socket.setblocking(False)

    def write(self, data: bytes) -> int:
        """Write what there is room for."""
        try:
            return self.socket.send(data)
        except BlockingIOError:
            return 0

    def fetch(self) -> bytes:
        """Return what is there."""
        try:
            return self.socket.recv(65_536)
        except (BlockingIOError, ConnectionResetError):
            return b""

    def close(self) -> None:
        """Close it."""
        self.socket.close()
