"""USB instruments (USBTMC) through the kernel's driver: `/dev/usbtmcN` is a file that carries messages."""

from __future__ import annotations

import errno
import fcntl
import os
import struct
from pathlib import Path

__all__ = ["UsbTmc", "device_of"]

# linux/usb/tmc.h
_CLEAR = 0x5B02
_SET_TIMEOUT = 0x40045B0A
_LEAST_MS = 100  # the kernel accepts no shorter one
_LONGEST = 65_536
_CLASS = Path("/sys/class/usbmisc")


def device_of(url: str, system: Path = _CLASS) -> str:
    """Return the device file of `usbtmc://vendor:product:serial`; a path is returned as it is.

    Raises:
        OSError: if there is no such instrument, or there are two.
    """
    scheme, separator, address = url.partition("://")
    if not separator or scheme != "usbtmc":
        return url
    vendor, product, serial = address.split(":", 2)
    wanted = (int(vendor, 0), int(product, 0), serial)
    found = [each.name for each in sorted(system.glob("usbtmc*")) if _identity_of(each / "device") == wanted]
    if len(found) == 1:
        return f"/dev/{found[0]}"
    there = ", ".join(f"{each.name}: {_described(each / 'device')}" for each in sorted(system.glob("usbtmc*")))
    many = "two such instruments are there" if found else f"no such instrument is there; there is {there or 'none'}"
    raise OSError(errno.ENODEV, many)


def _identity_of(interface: Path) -> tuple[int, int, str]:
    device = interface.resolve().parent
    try:
        ids = [int((device / name).read_text(encoding="ascii"), 16) for name in ("idVendor", "idProduct")]
        return ids[0], ids[1], (device / "serial").read_text(encoding="utf-8", errors="replace").strip()
    except (OSError, ValueError):
        return 0, 0, ""


def _described(interface: Path) -> str:
    vendor, product, serial = _identity_of(interface)
    return f"0x{vendor:04X}:0x{product:04X}:{serial}"


class UsbTmc:
    """One instrument by its device file. See `hil.guardian.ports.messages.Messenger`.

    Args:
        descriptor: of the device file, which blocks; closed by `close`.
    """

    def __init__(self, descriptor: int) -> None:
        self.descriptor = descriptor

    @classmethod
    def opened(cls, url: str) -> UsbTmc:
        """Open a device file by its path, or by the identity of its instrument.

        Raises:
            OSError: if that fails.
        """
        return cls(os.open(device_of(url), os.O_RDWR | os.O_CLOEXEC))

    def send(self, message: bytes, seconds: float) -> None:
        """Send a message; the kernel marks its end."""
        self._limit(seconds)
        os.write(self.descriptor, message)

    def receive(self, seconds: float) -> bytes:
        """Fetch the reply, empty if none comes in that time."""
        self._limit(seconds)
        try:
            return os.read(self.descriptor, _LONGEST)
        except OSError as error:
            if error.errno in {errno.ETIMEDOUT, errno.EAGAIN}:
                return b""
            raise

    def clear(self, seconds: float) -> None:
        """Clear the instrument's buffers; USBTMC 1.0, section 4.2.1.6. Some firmware does not support this request.

        Raises:
            OSError: with EOPNOTSUPP if it does not, any other if it is gone.
        """
        self._limit(seconds)
        try:
            fcntl.ioctl(self.descriptor, _CLEAR)
        except OSError as error:
            if error.errno in {errno.EPIPE, errno.EPROTO, errno.ETIMEDOUT, errno.EPERM, errno.EINVAL}:
                raise OSError(errno.EOPNOTSUPP, "it cannot be cleared") from error
            raise

    def close(self) -> None:
        """Close it."""
        os.close(self.descriptor)

    def _limit(self, seconds: float) -> None:
        fcntl.ioctl(self.descriptor, _SET_TIMEOUT, struct.pack("I", max(round(seconds * 1000), _LEAST_MS)))
