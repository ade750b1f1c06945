"""Diagnosis of a device file that cannot be opened: missing group, other users, existing alternatives."""

from __future__ import annotations

import errno
import getpass
import grp
import os
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

__all__ = ["obstacle", "users_of"]

_DEVICES = Path("/dev")
_ELSE = "check cable, power and the bench file"
_FAMILIES = ("ttyUSB", "ttyACM", "ttyAMA", "ttyS", "ttyO", "usbtmc", "i2c-")
_MOST_SHOWN = 8
_SAID = re.compile(r"^Could not open port .+?: (?:\[Errno \d+\] )?")
"""Prefix of pyserial's error messages."""


def obstacle(path: str, error: Exception, processes: Path = Path("/proc")) -> tuple[str, str]:
    """Return why a path could not be opened, and a hint.

    Args:
        path: a device file, or a URL.
        error: the exception of the attempt.
        processes: root of procfs.
    """
    number = getattr(error, "errno", None)
    if not path.startswith("/"):
        return getattr(error, "strerror", None) or _SAID.sub("", str(error)), _ELSE
    if number == errno.EACCES:
        return _no_permission(path)
    if number in {errno.EBUSY, errno.EWOULDBLOCK}:
        found = ", ".join(users_of(path, processes))
        return f"it is in use{f' by {found}' if found else ''}", "end that program, or wait for it"
    if number in {errno.ENOENT, errno.ENODEV, errno.ENXIO}:
        return _not_there(path)
    return str(getattr(error, "strerror", None) or error), _ELSE


def users_of(path: str, processes: Path = Path("/proc")) -> Iterator[str]:
    """Yield the processes that have a device file open, as far as visible to this user."""
    with suppress(OSError):
        device = Path(path).stat().st_rdev
        for process in sorted(processes.glob("[0-9]*"), key=lambda each: int(each.name)):
            with suppress(OSError):
                if process.name != str(os.getpid()) and _has_open(process, device):
                    name = (process / "comm").read_text(encoding="utf-8", errors="replace").strip()
                    yield f"{name} (process {process.name})"


def _has_open(process: Path, device: int) -> bool:
    for each in (process / "fd").iterdir():
        with suppress(OSError):
            if device and each.stat().st_rdev == device:
                return True
    return False


def _no_permission(path: str) -> tuple[str, str]:
    try:
        status = Path(path).stat()
        group = grp.getgrgid(status.st_gid).gr_name
    except (OSError, KeyError):
        return "permission denied", "let its group be one of yours: a udev rule does, see 'hil bench setup'"
    if status.st_gid in os.getgroups() or not status.st_mode & 0o060 or group == "root":
        return (
            f"permission denied: it belongs to group {group}, mode {status.st_mode & 0o777:o}",
            "install the udev rules that 'hil bench setup NAME --print udev' prints",
        )
    return (
        f"permission denied: you are not in group {group}",
        f"sudo usermod -aG {group} {_user()}, then log out and in again",
    )


def _user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError):
        return "$USER"


def _not_there(path: str) -> tuple[str, str]:
    family = next((each for each in _FAMILIES if Path(path).name.startswith(each)), "")
    if family == "i2c-" and not any(_DEVICES.glob("i2c-*")):
        return "there is no I2C bus", "load the module: sudo modprobe i2c-dev; on a Raspberry Pi enable I2C first"
    kin = [family] if family in {"i2c-", "usbtmc"} else ["ttyUSB", "ttyACM", "ttyAMA"]
    there = sorted(str(each) for name in kin for each in _DEVICES.glob(f"{name}*"))
    shown = ", ".join(there[:_MOST_SHOWN]) or "none of its kind"
    return f"it does not exist; there is {shown}", "plug it in, switch it on, or correct the bench file"
