"""Identity of this computer's own UARTs, on board or on an RS-232 card, as sysfs describes them."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from hil.model.bench import OnboardPort

__all__ = ["Uart", "difference", "uart_at"]

_TERMINALS = Path("/sys/class/tty")
_SERIAL_BASE = "serial-base"
_ABSENT = "0"


@dataclass(frozen=True, slots=True)
class Uart:
    """A UART as the kernel knows it.

    Attributes:
        terminal: its name below /dev.
        devices: the hardware that it belongs to, nearest first: names of folders in sysfs.
        driver: its kernel driver.
        at: its first address, `0x3f8` or `0xfe201000`; empty where sysfs does not say it.
    """

    terminal: str
    devices: tuple[str, ...]
    driver: str
    at: str

    @property
    def written(self) -> str:
        """The entry by which a bench file names this UART."""
        told = [f'device: "{self.devices[0]}"', *([f"driver: {self.driver}"] if self.driver else [])]
        return f"onboard: {{{', '.join(told)}}}"


def uart_at(device: str, terminals: Path = _TERMINALS) -> Uart | None:
    """Return the UART at a device file; None if there is none, or it belongs to a USB device.

    Args:
        device: path of the device file, links followed.
        terminals: where the kernel lists terminals.
    """
    terminal = terminals / Path(device).name
    if not (terminal / "device").exists() or _read(terminal / "type") == _ABSENT:
        return None
    folders = _above((terminal / "device").resolve())
    if not folders or any((folder / "idVendor").exists() for folder in folders):
        return None
    drivers = ((folder / "driver").resolve().name for folder in folders if (folder / "driver").exists())
    at = next((found for name in ("port", "iomem_base") if int(found := _read(terminal / name) or "0", 16)), "")
    return Uart(terminal.name, tuple(folder.name for folder in folders), next(drivers, ""), at.lower())


def difference(expected: OnboardPort, found: Uart, terminals: Path = _TERMINALS) -> str:
    """Return how a UART differs from the one that it must be, nothing if it does not."""
    if expected.device not in found.devices:
        return f"{_named(found)}, expected '{expected.device}'"
    if expected.driver and expected.driver != found.driver:
        return f"{_named(found)}, expected driver '{expected.driver}'"
    if expected.at and int(expected.at, 16) != int(found.at or "0", 16):
        return f"{_named(found)} at {found.at or 'an address that sysfs does not tell'}, expected at {expected.at}"
    if not expected.at and (others := _others(expected, found, terminals)):
        return (
            f"{_named(found)}, and so is {' and '.join(others)}: tell it apart by 'onboard: {{…, at: \"{found.at}\"}}'"
        )
    return ""


def _others(expected: OnboardPort, found: Uart, terminals: Path) -> list[str]:
    every = (uart_at(each.name, terminals) for each in sorted(terminals.iterdir()) if each.name != found.terminal)
    return [each.terminal for each in every if each and expected.device in each.devices]


def _above(port: Path) -> list[Path]:
    """Return the folders of the hardware, nearest first; the serial core puts two of its own below them (Linux 6.5)."""
    folders = []
    for folder in (port, *port.parents):
        if folder.name == "devices" or not (folder / "uevent").exists():
            break
        if (folder / "subsystem").resolve().name != _SERIAL_BASE:
            folders.append(folder)
    return folders


def _named(uart: Uart) -> str:
    return f"{uart.terminal} is {uart.devices[0]}{f', driver {uart.driver}' if uart.driver else ''}"


def _read(file: Path) -> str:
    with suppress(OSError):
        return file.read_text(encoding="ascii", errors="replace").strip()
    return ""
