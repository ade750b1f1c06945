"""How the guardian's process is started, so that nothing of the executive's own surroundings matters to it."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

from hil.model.safing import GuardPlan

__all__ = ["started", "with_whole_paths"]

_STANDARD_ERROR = 2


def started(end: socket.socket) -> subprocess.Popen[bytes]:
    """Start the process in a session of its own, with nothing of this one but its end and standard error."""
    program = str(Path(__file__).with_name("__main__.py").resolve())
    return subprocess.Popen(  # noqa: S603 - ourselves
        [sys.executable, "-I", "-S", program, str(end.fileno())],
        pass_fds=(end.fileno(),),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=None if _is_open(_STANDARD_ERROR) else subprocess.DEVNULL,
        start_new_session=True,
    )


def with_whole_paths(plan: GuardPlan) -> GuardPlan:
    """Return the plan for a process whose present folder is another; links stay links."""
    ports = tuple(replace(port, url=port.url if "://" in port.url else _whole(port.url)) for port in plan.ports)
    latches = tuple(_whole(each) for each in plan.latches)
    return replace(plan, ports=ports, journal=_whole(plan.journal), latches=latches)


def _whole(path: str) -> str:
    return str(Path(path).absolute()) if path else ""


def _is_open(descriptor: int) -> bool:
    try:
        os.fstat(descriptor)
    except OSError:
        return False
    return True
