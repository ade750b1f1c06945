"""Which USB device a terminal belongs to: after a replug, another device may have its name."""

from __future__ import annotations

import errno
import os
import stat
from contextlib import suppress
from pathlib import Path

__all__ = ["Identity", "identity_of", "require"]

Identity = tuple[str, ...]

_SYSTEM = Path("/sys/dev/char")


def identity_of(what: int | str, system: Path = _SYSTEM) -> Identity | None:
    """Return vendor, product and serial number of the USB device behind a terminal; None where there is none.

    A device without a serial number is identified by its USB socket.

    Args:
        what: a descriptor or a path; it is not opened.
        system: where the kernel lists its devices.

    Raises:
        OSError: if there is no such file.
    """
    status = os.stat(what)  # noqa: PTH116 - a descriptor has no path
    if not stat.S_ISCHR(status.st_mode):
        return None
    device = (system / f"{os.major(status.st_rdev)}:{os.minor(status.st_rdev)}" / "device").resolve()
    for folder in (device, *device.parents):
        if (folder / "idVendor").exists():
            told = [_read(folder / name) for name in ("idVendor", "idProduct", "serial")]
            return (*told[:2], told[2] or f"at {folder.name}")
    return None


def require(expected: Identity, path: str, system: Path = _SYSTEM) -> None:
    """Compare the device that is at a path now with the one that was there.

    Raises:
        OSError: if it is another device, or there is none.
    """
    found = identity_of(path, system)
    if found != expected:
        there = " ".join(found or ("no USB device",))
        raise OSError(errno.ENODEV, f"{path} is {there} now, not {' '.join(expected)}")


def _read(file: Path) -> str:
    with suppress(OSError):
        return file.read_text(encoding="utf-8", errors="replace").strip()
    return ""
