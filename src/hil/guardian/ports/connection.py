"""TCP connections that detect a dead peer within seconds."""

from __future__ import annotations

import os
import socket

__all__ = ["connected", "notice_its_end"]

_QUIET_S = 1
_ASKED_EVERY_S = 1
_ASKED_TIMES = 3
_UNANSWERED_MS = 4000


def connected(host: str, port: int, seconds: float) -> socket.socket:
    """Open a connection.

    Args:
        host: name or address of the host; IPv6 addresses also in brackets.
        port: its port.
        seconds: the timeout.

    Raises:
        OSError: if that fails.
    """
    made = socket.create_connection((host.strip("[]"), port), seconds)
    notice_its_end(made.fileno())
    return made


def notice_its_end(descriptor: int) -> None:
    """Let a connection send without delay, and end within some five seconds once its peer no longer answers.

    Otherwise an instrument that lost power, or a pulled cable, looks like one that has nothing to say: the system
    first probes after two hours. The options belong to the connection, whoever has its descriptor.
    """
    with socket.socket(fileno=os.dup(descriptor)) as connection:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for option, value in (
            ("TCP_KEEPIDLE", _QUIET_S),
            ("TCP_KEEPINTVL", _ASKED_EVERY_S),
            ("TCP_KEEPCNT", _ASKED_TIMES),
            ("TCP_USER_TIMEOUT", _UNANSWERED_MS),
        ):
            if (number := getattr(socket, option, None)) is not None:  # not every system knows all of them
                connection.setsockopt(socket.IPPROTO_TCP, number, value)
