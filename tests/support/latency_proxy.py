"""A served bench at the end of a long line: every reply of its instruments comes later, by as much as a test says."""

from __future__ import annotations

import json
import os
import selectors
import socket
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hil.simulation.served.folder import CONTROL, ask

__all__ = ["Distance", "at_a_distance"]

_AT_ONCE = 4096
_SLICE_S = 0.002


class Distance:
    """Proxies for all ends of a served bench, in a folder of their own that answers as that of the bench does.

    Args:
        bench: the folder of the bench.
        folder: where the proxies are asked for.
        latency_s: by how much every reply comes later; may be changed at any time.
    """

    def __init__(self, bench: Path, folder: Path, latency_s: float) -> None:
        self.latency_s = latency_s
        self._bench = bench
        self._selector = selectors.DefaultSelector()
        self._coming: list[tuple[float, int, bytes]] = []
        self._open: list[object] = []
        self._over = False
        folder.mkdir(mode=0o700)
        self._control = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._control.bind(str(folder / CONTROL))
        self._control.listen()
        self._ends = {name: self._proxied(url) for name, url in ask(bench, {"ends": None})["ends"].items()}
        self._threads = [threading.Thread(target=each, daemon=True) for each in (self._carry, self._answer)]
        for each in self._threads:
            each.start()

    def end(self) -> None:
        """Hang up."""
        self._over = True
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as last:
            last.connect(self._control.getsockname())
        for each in self._threads:
            each.join()
        self._control.close()
        for each in self._open:
            os.close(each) if isinstance(each, int) else each.close()

    def _proxied(self, url: str) -> str:
        if not url.startswith("socket://"):
            far = os.open(url, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
            tty.setraw(far)
            mine, near = os.openpty()
            tty.setraw(near)
            self._open += [far, mine, near]
            self._join(mine, far)
            return os.ttyname(near)
        listener = socket.create_server(("127.0.0.1", 0))
        self._open.append(listener)
        host, _, port = url.removeprefix("socket://").rpartition(":")
        self._selector.register(listener, selectors.EVENT_READ, (listener, (host, int(port))))
        return f"socket://127.0.0.1:{listener.getsockname()[1]}"

    def _join(self, near: int, far: int) -> None:
        self._selector.register(near, selectors.EVENT_READ, (near, far, 0.0))
        self._selector.register(far, selectors.EVENT_READ, (far, near, 1.0))

    def _accept(self, listener: socket.socket, place: tuple[str, int]) -> None:
        near, far = listener.accept()[0], socket.create_connection(place)
        self._open += [near, far]
        self._join(near.fileno(), far.fileno())

    def _carry(self) -> None:
        while not self._over:
            for key, _ in self._selector.select(_SLICE_S):
                if len(key.data) == 2:
                    self._accept(*key.data)
                    continue
                source, target, times = key.data
                data = self._read(source)
                if not data:
                    self._part(source, target)
                elif times:
                    self._coming.append((time.monotonic() + self.latency_s, target, data))
                else:
                    os.write(target, data)
            now = time.monotonic()
            while self._coming and self._coming[0][0] <= now:
                _, target, data = self._coming.pop(0)
                if target in self._selector.get_map():
                    os.write(target, data)

    def _read(self, source: int) -> bytes:
        try:
            return os.read(source, _AT_ONCE)
        except OSError:
            return b""

    def _part(self, *both: int) -> None:
        for each in both:
            self._selector.unregister(each)
            for end in [end for end in self._open if not isinstance(end, int) and end.fileno() == each]:
                self._open.remove(end)
                end.close()

    def _answer(self) -> None:
        while True:
            connection, _ = self._control.accept()
            with connection:
                if self._over:
                    return
                asked = json.loads(connection.makefile("rb").readline())
                told = {"ends": self._ends} if "ends" in asked else dict(ask(self._bench, asked))
                connection.sendall(json.dumps(told).encode() + b"\n")


@contextmanager
def at_a_distance(bench: Path, folder: Path, latency_s: float) -> Iterator[Distance]:
    """Give a bench that is served in a folder again in another one, at a distance, until the context is left."""
    distance = Distance(bench, folder, latency_s)
    try:
        yield distance
    finally:
        distance.end()
