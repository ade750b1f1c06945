"""Channel between executive and guardian: JSON packets with descriptors, on a socket that keeps packet boundaries.

A packet is sent whole or not at all, so a process that stops or dies never leaves half of one, and sending never
waits for the other side. (`socket.send_fds` and `recv_fds` would wait: they take flags but do not pass them on.)
"""

from __future__ import annotations

import json
import socket
from array import array
from dataclasses import dataclass
from typing import Any

__all__ = ["MOST_DESCRIPTORS", "DrillResult", "HungUp", "pair", "receive", "send"]

MOST_DESCRIPTORS = 253  # what the kernel passes with one packet (SCM_MAX_FD)
_MOST_BYTES = 65_536


@dataclass(frozen=True, slots=True, kw_only=True)
class DrillResult:
    """Result of the guardian's drill of one output, or of the heartbeat.

    Attributes:
        output: dotted name of the role instance; `heartbeat` for the beats of the executive.
        ok: whether it passed.
        detail: what happened, in words.
        seconds: how long it took; for the heartbeat, the silence after which the guardian would have acted.
    """

    output: str
    ok: bool
    detail: str
    seconds: float


class HungUp(Exception):
    """The other side is gone or has closed its end."""


def pair() -> tuple[socket.socket, socket.socket]:
    """Return two connected ends."""
    return socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)


def send(end: socket.socket, kind: str, *descriptors: int, **fields: object) -> bool:
    """Send a packet; return False if the channel is full because the other side does not read.

    Raises:
        HungUp: if the other side is gone.
    """
    packet = json.dumps({"kind": kind, **fields}).encode()
    passed = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array("i", descriptors))] if descriptors else []
    try:
        end.sendmsg([packet], passed, socket.MSG_DONTWAIT | socket.MSG_NOSIGNAL)
    except BlockingIOError:
        return False
    except OSError as error:
        raise HungUp(str(error)) from error
    return True


def receive(end: socket.socket) -> tuple[dict[str, Any], list[int]] | None:
    """Return the next packet with its descriptors, None if none is there.

    Raises:
        HungUp: if the other side is gone.
        ValueError: if it is not JSON.
    """
    flags = socket.MSG_DONTWAIT | socket.MSG_CMSG_CLOEXEC
    try:
        packet, others, _, _ = end.recvmsg(_MOST_BYTES, socket.CMSG_SPACE(MOST_DESCRIPTORS * 4), flags)
    except BlockingIOError:
        return None
    except OSError as error:
        raise HungUp(str(error)) from error
    if not packet:
        raise HungUp("closed")
    descriptors = array("i")
    for _, _, data in others:
        descriptors.frombytes(data)
    return json.loads(packet), list(descriptors)
