"""Names that a process holds for the whole host, in the kernel: nothing ages there, and nobody else can remove one.

A name is the address of a listening socket in Linux's abstract namespace (unix(7)). It is free again when the last
process that has the socket open is gone, however it ended. Every user of the host sees the same names; a container with
a network of its own does not. Other systems, which drive no hardware, have no such namespace: a locked file stands in.
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
_QUEUE = 4096  # whoever asks for the holder stays in the queue; the kernel takes as many as it allows
_TABLE = Path("/proc/net/unix")
_FILES = Path("/tmp/hil-names")  # noqa: S108 - on systems without the namespace only
_PROCESSES = Path("/proc")
_CREDENTIALS = struct.Struct("3i")


@dataclass(frozen=True, slots=True)
class Holder:
    """Who took a name, as the kernel wrote it down then.

    Attributes:
        pid: its process.
        uid: its user.
    """

    pid: int
    uid: int

    @property
    def user(self) -> str:
        """The user's name, or number where it has no name."""
        return user_name(self.uid)

    @property
    def lives(self) -> bool:
        """Whether there is such a process now; it may have passed the name to another one."""
        try:
            os.kill(self.pid, 0)
        except ProcessLookupError:
            return False
        except PermissionError:
            return True
        return True


def hold_name(name: str) -> int:
    """Take a name, until the descriptor is closed in every process that has it.

    Raises:
        OSError: EADDRINUSE if somebody has it.
    """
    if sys.platform != "linux":
        return _hold_file(name)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_CLOEXEC) as held:
        held.bind(f"\0{_FIRST}{name}")
        held.listen(_QUEUE)
        return held.detach()


def holder_of(name: str) -> Holder | None:
    """Return who took a name, None where nobody has it or the kernel does not say."""
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
    """Return all names that are held now and begin with some letters, none where the kernel does not say."""
    if sys.platform != "linux":
        return [path.name for path in _FILES.glob(f"{first}*") if _is_locked(path)]
    mark = f" @{_FIRST}"
    held: set[str] = set()
    with suppress(OSError), _TABLE.open(encoding="utf-8", errors="replace") as lines:
        held = {line.rpartition(mark)[2].rstrip() for line in lines if mark in line}
    return sorted(name for name in held if name.startswith(first))


def keepers_of(name: str, system: Path = _PROCESSES) -> dict[int, bool]:
    """Return the processes that have a name open, and whether each is stopped; those that this user may look at.

    The process that took the name may have ended, and have passed it to one that has not.

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
    """Return 24 letters for a text of any length; the same in every process."""
    return hashlib.sha256(text.encode()).hexdigest()[:24]


def user_name(uid: int) -> str:
    """Return a user's name, or number where it has no name."""
    try:
        return pwd.getpwuid(uid).pw_name
    except KeyError:
        return str(uid)
