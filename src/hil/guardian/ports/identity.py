"""Identity of what is behind a terminal: after a replug, another device or program may have its name."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

__all__ = ["Identity", "found", "identity_of", "is_pseudo_terminal", "require_not_reused"]

Identity = tuple[str, ...]

_PARTS = (("port", "port_number"), ("interface", "bInterfaceNumber"))
_SYSTEM = Path("/sys/dev/char")
_TERMINALS = Path("/sys/class/tty")
_PSEUDO_TERMINALS = range(136, 144)  # majors of their far sides, Documentation/admin-guide/devices.txt of Linux
_ROUNDED_S = 1.0  # by file systems that keep times in whole seconds


def identity_of(what: int | str, system: Path = _SYSTEM) -> Identity | None:
    """Return vendor, product and serial number of the USB device behind a terminal; None if there is none.

    A device without a serial number is identified by its USB socket. For an adapter with several ports, interface
    and port number are part of the identity.

    Args:
        what: a descriptor, or a path, which is not opened.
        system: where the kernel lists its devices.

    Raises:
        OSError: if there is no such file.
    """
    status = os.stat(what)  # noqa: PTH116 - a descriptor has no path
    if not stat.S_ISCHR(status.st_mode):
        return None
    device = (system / f"{os.major(status.st_rdev)}:{os.minor(status.st_rdev)}" / "device").resolve()
    parts: list[str] = []
    for folder in (device, *device.parents):
        if (folder / "idVendor").exists():
            told = [_read(folder / name) for name in ("idVendor", "idProduct", "serial")]
            return (*told[:2], told[2] or f"at {folder.name}", *parts)
        parts += [f"{kind} {number}" for kind, name in _PARTS if (number := _read(folder / name))]
    return None


def found(expected: Identity, path: str, others: Iterable[str] | None = None, system: Path = _SYSTEM) -> str:
    """Return the present path of a device that was at a path: the same, or the one other name that it has.

    Args:
        expected: its identity.
        path: where it was.
        others: paths where it may be; those of all terminals if None.
        system: where the kernel lists its devices.

    Raises:
        OSError: if it is nowhere, or in more than one place.
    """
    if (there := _identity_at(path, system)) == expected:
        return path
    places = [each for each in (_terminals() if others is None else others) if _identity_at(each, system) == expected]
    if len(places) == 1:
        return places[0]
    wanted = " ".join(expected)
    if places:
        raise OSError(errno.ENODEV, f"{wanted} is at {' and at '.join(places)}")
    raise OSError(errno.ENODEV, f"{path} is {' '.join(there or ('no USB device',))} now, not {wanted}")


def is_pseudo_terminal(status: os.stat_result) -> bool:
    """Return whether this is the state of a pseudo-terminal, which drives nothing real."""
    return os.major(status.st_rdev) in _PSEUDO_TERMINALS


def require_not_reused(path: str) -> None:
    """Refuse a pseudo-terminal that is younger than the link to it, which a killed program left behind.

    A served bench makes its links after its pseudo-terminals. Once it was killed, the kernel gives their numbers to
    others: another bench, or a person's shell.

    Raises:
        OSError: if it is younger, or there is none.
    """
    there, link = os.stat(path), os.lstat(path)  # noqa: PTH116 - given as text
    if is_pseudo_terminal(there) and there.st_ctime > link.st_mtime + _ROUNDED_S:
        raise OSError(errno.ENODEV, f"{path} leads to a terminal that another program has opened since")


def _identity_at(path: str, system: Path) -> Identity | None:
    with suppress(OSError):
        return identity_of(path, system)
    return None


def _terminals() -> list[str]:
    """Return the paths of all terminals that belong to a device."""
    with suppress(OSError):
        return [f"/dev/{each.name}" for each in _TERMINALS.iterdir() if (each / "device").exists()]
    return []


def _read(file: Path) -> str:
    with suppress(OSError):
        return file.read_text(encoding="utf-8", errors="replace").strip()
    return ""
