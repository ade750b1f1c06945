"""Control socket of a served bench, independent of its instruments: one JSON document per line."""

from __future__ import annotations

import json
import socket
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path

from hil.model.errors import HilError
from hil.simulation.served.ends import Watch

__all__ = ["Control"]

_MOST_CLIENTS = 16
_LONGEST_LINE = 65_536
_PIECE = 4096

Answer = Callable[[Mapping[str, object]], Mapping[str, object]]


class _Client:
    """One connection: what it has said of a line, and what it has not fetched of an answer."""

    def __init__(self, connection: socket.socket) -> None:
        self.connection = connection
        self.heard = bytearray()
        self.outbox = bytearray()


class Control:
    """Listens at a Unix socket and answers every line with one line, in order.

    A client that does not fetch its answers is not listened to until it does; one whose line has no end is hung up on.

    Args:
        path: of the socket; only this user can open it.
        answer: gives the answer to one document, or raises what the client is told.
    """

    def __init__(self, path: Path, answer: Answer) -> None:
        self._answer = answer
        self._clients: list[_Client] = []
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
        self._listener.bind(str(path))
        path.chmod(0o600)
        self._listener.listen(_MOST_CLIENTS)

    def watches(self) -> Iterable[Watch]:
        """Return what is awaited now."""
        if len(self._clients) < _MOST_CLIENTS:
            yield Watch(self._listener.fileno(), self._accept)
        for client in self._clients:
            waits = bool(client.outbox)
            yield Watch(client.connection.fileno(), partial(self._transfer, client), reads=not waits, writes=waits)

    def close(self) -> None:
        """Give what can be given at once, and hang up."""
        for client in list(self._clients):
            self._hang_up(client)
        self._listener.close()

    def _accept(self) -> None:
        with suppress(OSError):  # it has gone already
            connection, _ = self._listener.accept()
            connection.setblocking(False)
            self._clients.append(_Client(connection))

    def _transfer(self, client: _Client) -> None:
        try:
            if not client.outbox:
                heard = client.connection.recv(_PIECE)
                if not heard:
                    self._hang_up(client)
                    return
                client.heard += heard
            self._reply(client)
        except BlockingIOError:
            return
        except OSError:
            self._hang_up(client)

    def _reply(self, client: _Client) -> None:
        """Answer line by line as long as the answers are fetched."""
        while True:
            if client.outbox:
                del client.outbox[: client.connection.send(client.outbox)]
            if client.outbox or b"\n" not in client.heard:
                break
            line, _, rest = bytes(client.heard).partition(b"\n")
            client.heard[:] = rest
            client.outbox += json.dumps(self._to(line), default=str).encode() + b"\n"
        if len(client.heard) > _LONGEST_LINE:
            self._hang_up(client)

    def _to(self, line: bytes) -> Mapping[str, object]:
        try:
            document = json.loads(line)
        except (ValueError, RecursionError):
            return {"error": "not a JSON document", "hint": "write one object per line"}
        if not isinstance(document, dict):
            return {"error": "not a JSON object", "hint": 'write for example {"time": null}'}
        try:
            return self._answer(document)
        except HilError as error:
            return {"error": error.message, "hint": error.hint}

    def _hang_up(self, client: _Client) -> None:
        client.connection.close()
        self._clients.remove(client)
