"""Host-wide locks by name, held in the kernel: they cannot go stale, and no other process can remove them.

A name is the address of a listening socket in Linux's abstract namespace (unix(7)). It is released when the last
process that has the socket open ends, however it ends. All users of the host share the names; a container with its own
network does not. Other systems, which drive no hardware, have no such namespace and use a locked file instead.
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import os
import pwd
import socket
import struct
import sys
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Holder", "hold_name", "holder_of", "keepers_of", "names_held", "short", "user_name"]

_FIRST = "hil-"
_QUEUE = 4096  # each query for the holder stays in the queue; the kernel caps the length
_TABLE = Path("/proc/net/unix")
_FILES = Path("/tmp/hil-names")  # noqa: S108 - on systems without the namespace only
_PROCESSES = Path("/proc")
_CREDENTIALS = struct.Struct("3i")


@dataclass(frozen=True, slots=True)
class Holder:
    """The process that took a name, as recorded by the kernel.

    Attributes:
        pid: process ID.
        uid: user ID.
    """

    pid: int
    uid: int

    @property
    def user(self) -> str:
        """The user's name, or ID if it has none."""
        return user_name(self.uid)

    @property
    def lives(self) -> bool:
        """Whether the process still exists; it may have passed the name on."""
        try:
            os.kill(self.pid, 0)
        except ProcessLookupError:
            return False
        except PermissionError:
            return True
        return True


def hold_name(name: str) -> int:
    """Take a name until the returned descriptor is closed in every process that has it.

    Raises:
        OSError: EADDRINUSE if the name is taken.
    """
    if sys.platform != "linux":
        return _hold_file(name)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_CLOEXEC) as held:
        held.bind(f"\0{_FIRST}{name}")
        held.listen(_QUEUE)
        return held.detach()


def holder_of(name: str) -> Holder | None:
    """Return the holder of a name, None if it is free or the kernel does not report it."""
    if sys.platform != "linux":
        return None
    with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_CLOEXEC) as asking:
        asking.setblocking(False)
        asking.connect(f"\0{_FIRST}{name}")
        told = asking.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
        pid, uid, _ = _CREDENTIALS.unpack(told)
        return Holder(pid, uid)
    return None


def names_held(first: str = "") -> list[str]:
    """Return all names held now that begin with `first`, empty if the kernel does not report them."""
    if sys.platform != "linux":
        return [path.name for path in _FILES.glob(f"{first}*") if _is_locked(path)]
    mark = f" @{_FIRST}"
    held: set[str] = set()
    with suppress(OSError), _TABLE.open(encoding="utf-8", errors="replace") as lines:
        held = {line.rpartition(mark)[2].rstrip() for line in lines if mark in line}
    return sorted(name for name in held if name.startswith(first))


def keepers_of(name: str, system: Path = _PROCESSES) -> dict[int, bool]:
    """Return the processes that have a name open, and whether each is stopped, as far as visible to this user.

    The process that took the name may have ended after passing it to another.

    Args:
        name: the name.
        system: where the kernel lists its processes.
    """
    found: dict[int, bool] = {}
    with suppress(OSError):
        lines = (system / "net/unix").read_text(encoding="utf-8", errors="replace").splitlines()
        sockets = {f"socket:[{line.split()[6]}]" for line in lines if line.endswith(f" @{_FIRST}{name}")}
        for process in system.glob("[0-9]*"):
            with suppress(OSError):
                if any(str(each.readlink()) in sockets for each in (process / "fd").iterdir()):
                    state = (process / "stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
                    found[int(process.name)] = state[:1] == ["T"]
    return found


def _hold_file(name: str) -> int:
    _FILES.mkdir(exist_ok=True)
    file = os.open(_FILES / name, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(file)
        raise OSError(errno.EADDRINUSE, os.strerror(errno.EADDRINUSE)) from error
    return file


def _is_locked(path: Path) -> bool:
    try:
        os.close(_hold_file(path.name))
    except OSError:
        return True
    return False


def short(text: str) -> str:
    """Return a 24-letter digest of a text, the same in every process."""
    return hashlib.sha256(text.encode()).hexdigest()[:24]


def user_name(uid: int) -> str:
    """Return a user's name, or ID if it has none."""
    try:
        return pwd.getpwuid(uid).pw_name
    except KeyError:
        return str(uid)
