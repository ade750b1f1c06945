"""Lock keys of instruments: the same for every process on this host, however bench files write the port.

An instrument may have several keys, such as a host name and its addresses; two ports with a key in common are the same
instrument. The port as written is always among them, to find what an earlier version stored under it.
"""

from __future__ import annotations

import ipaddress
import os
import re
import socket
import stat
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from threading import Thread

from hil.wire.held_names import hold_name, names_held, short
from hil.wire.opening import NETWORK, VENDOR, VISA_LAN, VISA_USB, bare, url_of_resource

__all__ = ["LOOPBACK", "SERVED", "announce_served", "keys_of", "keys_of_served", "keys_of_this_port"]

_RESOLVED_S = 2.0
_SYSTEM = Path("/sys")
_HERE = "localhost"
SERVED = "served bench "
"""Prefix of the keys of a served bench."""

LOOPBACK = f"socket://{_HERE}:"
"""Prefix of the keys of a network port on this host."""

_SCPI_PORTS = ("5024", "5025", "5555")
_ONE_OF_ITS_HOST = re.compile(r"(inst0|hislip0(,\d+)?)?", re.IGNORECASE)
"""Names of the only instrument of a host; a gateway or a mainframe has several."""


def keys_of(
    port: str,
    resolve: Callable[[str], Sequence[str]] | None = None,
    real_path: Callable[[str], str] = os.path.realpath,
    system: Path = _SYSTEM,
) -> tuple[str, ...]:
    """Return the keys of the instrument at a port.

    Args:
        port: port as in a bench file: a path, a URL, or a VISA resource name.
        resolve: returns the addresses of a host; if None, the system's resolver with a timeout of two seconds.
        real_path: resolves symbolic links.
        system: root of sysfs.
    """
    name, url = bare(port), url_of_resource(port)
    scheme, is_url, place = url.partition("://")
    if is_url and scheme.lower() in NETWORK:
        host, _, number = re.split(r"[/?#]", place)[0].rpartition(":")
        found = _network(host, [str(int(number))] if number.isdecimal() else [], resolve or _addresses)
    elif match := VISA_USB.match(name):
        found = iter([_usb(match["vendor"], match["product"], match["serial"], int(match["interface"] or 0))])
    elif (match := VISA_LAN.match(name)) and _ONE_OF_ITS_HOST.fullmatch(match["name"] or ""):
        # VXI-11 and HiSLIP reach the same instrument as its sockets.
        found = _network(match["host"], _SCPI_PORTS, resolve or _addresses)
    elif match:
        found = _network(match["host"], [match["name"].lower()], resolve or _addresses)
    elif "::" in url and not is_url:
        found = iter([url.upper()])
    elif is_url or port.startswith(VENDOR):
        found = iter([])
    else:
        found = _device(real_path(url), system)
    return tuple(dict.fromkeys([*found, port]))


def keys_of_this_port(port: str) -> tuple[str, ...]:
    """Return the keys of the port alone, without resolving hosts or looking for served benches."""
    return tuple(key for key in keys_of(port, resolve=lambda _: ()) if not key.startswith(SERVED))


def keys_of_served(folder: Path) -> tuple[str, ...]:
    """Return the keys of a bench served in a folder, which its network ports share."""
    return (f"{SERVED}{folder.resolve()}", _served(short(str(folder.resolve()))))


def announce_served(port: int | str, folder: Path) -> int:
    """Announce host-wide that a port belongs to a served bench, until the returned descriptor is closed.

    Args:
        port: network port, or path of a pseudo-terminal.
        folder: folder of the served bench.

    Raises:
        OSError: if that is not possible.
    """
    place = short(port) if isinstance(port, str) else port
    return hold_name(f"served-{place}-{short(str(folder.resolve()))}")


def _served(digest: str) -> str:
    return f"{SERVED}{digest}"


def _network(host: str, ports: Sequence[str], resolve: Callable[[str], Sequence[str]]) -> Iterator[str]:
    name = host.strip("[]").lower().rstrip(".")
    literal = _literal(name)
    if literal is not None:
        places = [literal]
    elif name == _HERE or name.endswith(f".{_HERE}"):
        places = [_HERE]
    else:
        places = [name, *(each for address in resolve(name) if (each := _literal(address)) is not None)]
    for place in dict.fromkeys(places):
        for port in ports:
            yield f"socket://{place}:{port}"
            if place == _HERE:
                announced = names_held(f"served-{port}-")
                yield from (_served(each.rpartition("-")[2]) for each in announced)


def _literal(text: str) -> str | None:
    """Return an address in canonical form, this host's as its name; None if the text is not an address."""
    try:
        address = ipaddress.ip_address(text.partition("%")[0])
    except ValueError:
        return None
    if isinstance(address, ipaddress.IPv6Address) and address.ipv4_mapped is not None:
        address = address.ipv4_mapped
    if address.is_loopback or address.is_unspecified or _is_own(address):
        return _HERE
    return f"[{address}]" if address.version == 6 else str(address)


def _is_own(address: ipaddress.IPv4Address | ipaddress.IPv6Address) -> bool:
    """Return whether an address belongs to this host, by its source-address selection; nothing is sent."""
    family = socket.AF_INET if address.version == 4 else socket.AF_INET6
    with suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as asking:
        asking.connect((str(address), 9))
        source: str = asking.getsockname()[0]
        return source.partition("%")[0] == str(address)
    return False


def _addresses(host: str) -> list[str]:
    """Query the system's resolver, which cannot be interrupted; a late answer is ignored."""
    found: list[str] = []

    def ask() -> None:
        with suppress(OSError, UnicodeError):
            found.extend(str(each[4][0]) for each in socket.getaddrinfo(host, None, type=socket.SOCK_STREAM))

    asking = Thread(target=ask, name=f"resolve {host}", daemon=True)
    asking.start()
    asking.join(_RESOLVED_S)
    return sorted(set(found))


def _device(path: str, system: Path) -> Iterator[str]:
    """Yield the names of a device: for USB by serial number and topology, otherwise by path."""
    yield from (_served(each.rpartition("-")[2]) for each in names_held(f"served-{short(path)}-"))
    try:
        status = os.stat(path)  # noqa: PTH116 - given as text
    except OSError:
        yield path
        return
    node = system / "dev/char" / f"{os.major(status.st_rdev)}:{os.minor(status.st_rdev)}" / "device"
    folders = [node.resolve(), *node.resolve().parents] if stat.S_ISCHR(status.st_mode) else []
    usb = next((folder for folder in folders if (folder / "idVendor").exists()), None)
    if usb is None:
        yield path
        return
    interface = next((text for folder in folders if (text := _text(folder / "bInterfaceNumber"))), "0")
    line = next((text for folder in folders if (text := _text(folder / "port_number"))), "0")
    vendor, product, serial = (_text(usb / name) for name in ("idVendor", "idProduct", "serial"))
    channel = int(interface, 16), int(line)
    yield f"usb at {usb.name}{_spoken(*channel)}"
    if serial and not _has_twin(usb, (vendor, product, serial), system):
        yield _usb(f"0x{vendor}", f"0x{product}", serial, *channel)


def _usb(vendor: str, product: str, serial: str, interface: int, line: int = 0) -> str:
    try:
        what = f"{int(vendor, 0):04x}:{int(product, 0):04x}"
    except ValueError:
        what = f"{vendor}:{product}".lower()
    return f"usb {what} {serial}{_spoken(interface, line)}"


def _spoken(interface: int, line: int) -> str:
    return f" interface {interface}" + (f" port {line}" if line else "")


def _has_twin(usb: Path, who: tuple[str, str, str], system: Path) -> bool:
    """Return whether another device reports the same identity, such as makes with one serial number for all."""
    for other in (system / "bus/usb/devices").glob("*/serial"):
        told = tuple(_text(other.parent / name) for name in ("idVendor", "idProduct", "serial"))
        if told == who and other.parent.name != usb.name:
            return True
    return False


def _text(file: Path) -> str:
    with suppress(OSError):
        return file.read_text(encoding="utf-8", errors="replace").strip()
    return ""
