"""The open end of a network instrument: a TCP port of this machine, for one client at a time."""

from __future__ import annotations

import socket
from collections.abc import Iterable
from contextlib import suppress

from hil.simulation.served.line import ServedLine
from hil.simulation.served.watching import Watch

__all__ = ["NetworkEnd"]

_HOST = "127.0.0.1"
_BACKLOG = 4


class NetworkEnd:
    """One listening port. A second client is hung up on, as instruments with one socket do.

    Args:
        line: behind it.
        port: where it listens, 0 for any free port.

    Raises:
        OSError: if the port is in use.
    """

    def __init__(self, line: ServedLine, port: int = 0) -> None:
        self.line = line
        self._client: socket.socket | None = None
        self._listener: socket.socket | None = None
        self._port = port
        self.plug()
        self.url = f"socket://{_HOST}:{self._port}"

    def plug(self) -> None:
        """Listen, always at the same port; if it does already, go on.

        Raises:
            OSError: if somebody else has the port by now.
        """
        if self._listener is None:
            self._listener = socket.create_server((_HOST, self._port), backlog=_BACKLOG)
            self._listener.setblocking(False)
            self._port = self._listener.getsockname()[1]

    def unplug(self) -> None:
        """Hang up, and listen no more."""
        self._hang_up()
        if self._listener is not None:
            self._listener.close()
            self._listener = None

    def watches(self) -> Iterable[Watch]:
        """Return what is awaited now."""
        if self._listener is not None:
            yield Watch(self._listener.fileno(), self._accept)
        if self._client is not None:
            yield Watch(
                self._client.fileno(), self._transfer, reads=bool(self.line.room), writes=bool(self.line.outbox)
            )

    def _accept(self) -> None:
        if self._listener is None:
            return
        with suppress(OSError):  # it has gone already
            client, _ = self._listener.accept()
            if self._client is not None:
                client.close()
                return
            client.setblocking(False)
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._client = client
            self.line.opened()

    def _transfer(self) -> None:
        client, room = self._client, self.line.room
        if client is None:
            return
        try:
            if room:
                with suppress(BlockingIOError):
                    data = client.recv(room)
                    if not data:
                        self._hang_up()
                        return
                    self.line.take(data)
            if self.line.outbox:
                with suppress(BlockingIOError):
                    del self.line.outbox[: client.send(self.line.outbox)]
        except OSError:
            self._hang_up()

    def _hang_up(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None
            self.line.closed()
