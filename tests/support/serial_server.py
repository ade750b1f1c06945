"""A server that offers a serial line on the network: pyserial's half of RFC 2217, on a line that echoes."""

from __future__ import annotations

import socket
import threading
from contextlib import suppress

import serial
from serial.rfc2217 import PortManager

__all__ = ["SerialServer"]


class SerialServer:
    """One line, one connection at a time; a new connection is taken when the last one has ended.

    Attributes:
        url: where it is.
        line: the line, with the settings that a client gave it; it gives back whatever it gets.
        levels: of DTR, in order.
    """

    def __init__(self):
        self.line = serial.serial_for_url("loop://", timeout=0.02)
        self.levels = []
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.url = f"rfc2217://127.0.0.1:{self._listening.getsockname()[1]}"
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._connection = None
        self._thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._ended.set()
        self.drop()
        self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()
        self._thread.join()
        self.line.close()

    def drop(self):
        """End the connection."""
        if self._connection is not None:
            with suppress(OSError):
                self._connection.shutdown(socket.SHUT_RDWR)

    def _serve(self):
        while not self._ended.is_set():
            try:
                self._connection, _ = self._listening.accept()
            except OSError:
                return
            with self._connection, suppress(OSError):
                self._talk(self._connection)

    def _talk(self, connection):
        self.write = connection.sendall  # as the manager calls it
        manager = PortManager(self.line, self)
        connection.settimeout(0.002)
        while True:
            with suppress(TimeoutError):
                data = connection.recv(4096)
                if not data:
                    return
                before = self.line.dtr
                self.line.write(b"".join(manager.filter(data)))
                if self.line.dtr != before:
                    self.levels.append(self.line.dtr)
            if waiting := self.line.in_waiting:
                connection.sendall(b"".join(manager.escape(self.line.read(waiting))))
