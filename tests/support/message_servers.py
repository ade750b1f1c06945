"""Instruments on the network: HiSLIP and VXI-11 from the other end, written from the standards, and a plain socket.

All hold a little SCPI supply: `OUTP 0` and `OUTP 1` switch, `OUTP?` and `*IDN?` ask.
"""

from __future__ import annotations

import socket
import struct
import threading
import time
from contextlib import suppress

__all__ = ["HiSlipServer", "SocketServer", "Supply", "Vxi11Server"]


class Supply:
    """What is asked and told: one message in, one message out.

    Attributes:
        on: whether its output is on.
        delay_s: how long a reply takes.
        heard: every message.
        clears: how often it was cleared.
        clearable: whether it can be.
    """

    def __init__(self):
        self.on = True
        self.delay_s = 0.0
        self.heard = []
        self.clears = 0
        self.clearable = True

    def reply(self, message):
        """Take a message, and return the reply, empty if none is due."""
        self.heard.append(message)
        told = []
        for unit in message.decode("ascii").strip().split(";"):
            if unit.lstrip(":") == "*IDN?":
                told.append("Keysight Technologies,E36312A,MY1,2.1")
            elif unit.lstrip(":").startswith("OUTP?"):
                told.append(f"{self.on:d}")
            elif unit.lstrip(":").startswith("SYST:ERR?"):
                told.append('+0,"No error"')
            elif unit.startswith("OUTP "):
                self.on = unit.split()[1].split(",")[0] in {"1", "ON"}
        return ";".join(told).encode("ascii") + b"\n" if told else b""


class _Server:
    def __init__(self, supply):
        self.supply = supply
        self.connections = []
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = self._listening.getsockname()[1]
        self._threads = [threading.Thread(target=self._accept, daemon=True)]
        self._threads[0].start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()
        self.drop()
        for each in self._threads:
            each.join(5.0)

    def drop(self):
        """End every connection."""
        for each in self.connections:
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)

    def _accept(self):
        while True:
            try:
                connection, _ = self._listening.accept()
            except OSError:
                return
            self.connections.append(connection)
            thread = threading.Thread(target=self._serve, args=(connection,), daemon=True)
            self._threads.append(thread)
            thread.start()

    def _serve(self, connection):
        with connection, suppress(OSError, EOFError):
            self.talk(connection)


def _all(connection, size):
    data = b""
    while len(data) < size:
        came = connection.recv(size - len(data))
        if not came:
            raise EOFError
        data += came
    return data


class SocketServer(_Server):
    """The supply at a plain socket."""

    def talk(self, connection):
        """Serve one connection."""
        while data := connection.recv(4096):
            connection.sendall(self.supply.reply(data))


class HiSlipServer(_Server):
    """A HiSLIP server in synchronised mode (IVI-6.1).

    Attributes:
        split: whether a reply comes as two messages.
        stale: a reply that is sent before the right one, with the number of an older question.
    """

    split = False
    stale = b""

    def talk(self, connection):
        """Serve one channel of a session."""
        while True:
            prologue, kind, _, parameter, length = struct.unpack(">2sBBIQ", _all(connection, 16))
            assert prologue == b"HS"
            payload = _all(connection, length)
            answer = {
                0: lambda: self._send(connection, 1, 0, 0x0100 << 16 | 7),
                17: lambda: self._send(connection, 18, 0, 0),
                15: lambda: self._send(connection, 16, 0, 0, struct.pack(">Q", 65536)),
                19: lambda: self._clear(connection),
                8: lambda: self._send(connection, 9, 0, 0),
                6: lambda payload=payload: self._pieces.append(payload),
                7: lambda payload=payload, number=parameter: self._message(connection, payload, number),
                10: lambda: self._send(connection, 11, 0, 0),
                24: lambda: self._send(connection, 25, 0, 0),
                4: lambda: self._send(connection, 5, 1, 0),
            }[kind]
            answer()

    _pieces: list = []  # noqa: RUF012 - replaced by every message

    def _message(self, connection, payload, number):
        reply = self.supply.reply(b"".join(self._pieces) + payload)
        self._pieces = []
        time.sleep(self.supply.delay_s)
        if self.stale:
            self._send(connection, 7, 0, number - 2, self.stale)
        if reply and self.split:
            self._send(connection, 6, 0, number, reply[:1])
            reply = reply[1:]
        if reply:
            self._send(connection, 7, 0, number, reply)

    def _clear(self, connection):
        self.supply.clears += 1
        self._send(connection, 23, 0, 0)

    @staticmethod
    def _send(connection, kind, control, parameter, payload=b""):
        connection.sendall(struct.pack(">2sBBIQ", b"HS", kind, control, parameter, len(payload)) + payload)


class Vxi11Server(_Server):
    """The core channel of a VXI-11 instrument, and a portmapper on the same port.

    Attributes:
        most: how many bytes a message may have in one call.
        error: what every call but those of links answers, 0 if all is well.
    """

    most = 8
    error = 0

    def talk(self, connection):
        """Serve one connection."""
        waiting = collected = b""
        while True:
            (mark,) = struct.unpack(">I", _all(connection, 4))
            call = _all(connection, mark & 0x7FFFFFFF)
            number, _, _, program, _, procedure = struct.unpack(">6I", call[:24])
            body = call[40:]
            if program == 100_000:
                found = struct.unpack(">I", body[:4])[0] == 0x0607AF
                result = struct.pack(">I", self.port if found else 0)
            elif procedure == 10:
                result = struct.pack(">4I", 0, 5, 0, self.most)
            elif procedure == 11:
                _, _, _, flags, size = struct.unpack(">5I", body[:20])
                collected += body[20 : 20 + size]
                if flags & 8:
                    waiting, collected = self.supply.reply(collected), b""
                result = struct.pack(">2I", self.error, size)
            elif procedure == 12:
                result, waiting = self._read(body, waiting)
            elif procedure == 15:
                if self.supply.clearable:
                    waiting = collected = b""
                    self.supply.clears += 1
                result = struct.pack(">I", self.error if self.supply.clearable else 8)
            else:
                result = struct.pack(">I", 0)
            reply = struct.pack(">6I", number, 1, 0, 0, 0, 0) + result
            connection.sendall(struct.pack(">I", 0x80000000 | len(reply)) + reply)

    def _read(self, body, waiting):
        _, most, limit_ms, _, _, _ = struct.unpack(">6I", body[:24])
        if not waiting or self.supply.delay_s * 1000 > limit_ms:
            time.sleep(limit_ms / 1000)
            return struct.pack(">3I", 15, 0, 0), waiting
        time.sleep(self.supply.delay_s)
        piece, rest = waiting[: min(most, 20)], waiting[min(most, 20) :]
        reason = 0 if rest else 4
        return struct.pack(">3I", self.error, reason, len(piece)) + piece + bytes(-len(piece) % 4), rest
