"""Words between executive and guardian: packets of JSON on a socket that keeps them apart, with descriptors.

A packet is sent whole or not at all, so that a process that is stopped or dies never leaves half of one, and sending
never waits for the other side. (`socket.send_fds` and `recv_fds` would wait: they take flags and do not pass them on.)
"""

from __future__ import annotations

import json
import socket
from array import array
from dataclasses import dataclass
from typing import Any

__all__ = ["MOST_DESCRIPTORS", "Drilled", "HungUp", "pair", "receive", "send"]

MOST_DESCRIPTORS = 253  # what the kernel passes with one packet (SCM_MAX_FD)
_MOST_BYTES = 65_536


@dataclass(frozen=True, slots=True, kw_only=True)
class Drilled:
    """What the guardian found out about one output, or about the heartbeat.

    Attributes:
        output: dotted name of the role instance; `heartbeat` for the beats of the executive.
        ok: whether it did what it has to.
        detail: what happened, in words.
        seconds: how long it took; of the heartbeat, after how much silence the guardian would have acted.
    """

    output: str
    ok: bool
    detail: str
    seconds: float


class HungUp(Exception):
    """The other side is gone, or has closed its end."""


def pair() -> tuple[socket.socket, socket.socket]:
    """Return two ends that are connected."""
    return socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)


def send(end: socket.socket, kind: str, *descriptors: int, **told: object) -> bool:
    """Send a packet, and return whether there was room for it; the other side may be stopped.

    Raises:
        HungUp: if nobody will ever read it.
    """
    packet = json.dumps({"kind": kind, **told}).encode()
    passed = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array("i", descriptors))] if descriptors else []
    try:
        end.sendmsg([packet], passed, socket.MSG_DONTWAIT | socket.MSG_NOSIGNAL)
    except BlockingIOError:
        return False
    except OSError as error:
        raise HungUp(str(error)) from error
    return True


def receive(end: socket.socket) -> tuple[dict[str, Any], list[int]] | None:
    """Return the next packet that is there, with the descriptors that came with it; None if there is none.

    Raises:
        HungUp: if none will ever come.
        ValueError: if it is no JSON.
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
