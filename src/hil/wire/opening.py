"""Opening of ports and buses by URL: hardware, simulated and replayed alike."""

from __future__ import annotations

import posixpath
import re
from enum import StrEnum

import serial

from hil.clock.port import Clock
from hil.documents.suggest import did_you_mean
from hil.model.errors import NoReply, Refused
from hil.wire.exchange import find_bus
from hil.wire.port import I2cBus
from hil.wire.protocols import UrlPort
from hil.wire.tap import LONGEST_TRANSACTION, TappedBus, TappedPort
from hil.wire.transcript import Transcript

__all__ = [
    "MESSAGES",
    "NETWORK",
    "VENDOR",
    "VISA_LAN",
    "VISA_USB",
    "PortKind",
    "bare",
    "hardware_bus",
    "kind_of",
    "open_bus",
    "open_port",
    "url_of_resource",
    "why_not_opened",
]

NETWORK = ("socket", "rfc2217")
"""Schemes of network ports, where only the reply shows which instrument answers."""

_PROTOCOLS = "hil.wire.protocols"
_NETWORK_PLACE = re.compile(r"(\[[0-9A-Fa-f:.]+(%\w+)?\]|[^\s:/?#@\[\]]+):\d{1,5}")
_VISA_SERIAL = re.compile(r"^ASRL(?P<port>.+?)(::INSTR)?$", re.IGNORECASE)
_VISA_SOCKET = re.compile(r"^TCPIP\d*::(?P<host>\[[^]]+\]|[^:]+)::(?P<port>\d+)::SOCKET$", re.IGNORECASE)
VISA_USB = re.compile(
    r"^USB\d*::(?P<vendor>\w+)::(?P<product>\w+)::(?P<serial>[^:]+)(::(?P<interface>\d+))?(::INSTR)?$",
    re.IGNORECASE,
)
"""VISA resource name of a USB instrument."""

VISA_LAN = re.compile(r"^TCPIP\d*::(?P<host>\[[^]]+\]|[^:]+)(::(?P<name>[a-z][^:]*))??(::INSTR)?$", re.IGNORECASE)
"""VISA resource name of a VXI-11 or HiSLIP instrument, with its name at the host."""


class PortKind(StrEnum):
    """Kind of a bench file's port."""

    SERIAL = "serial device"
    RFC2217 = "rfc2217"
    SOCKET = "socket"
    USBTMC = "usbtmc"
    VXI11 = "vxi-11"
    HISLIP = "hislip"
    VISA = "visa"
    VENDOR = "a vendor's driver"
    OTHER = "other"


MESSAGES = (PortKind.USBTMC, PortKind.HISLIP, PortKind.VXI11, PortKind.VISA)
"""Kinds of ports that carry whole messages, as SCPI instruments use."""

_BY_VISA = "visa:"
VENDOR = "vendor:"
"""Prefix of an address that only a vendor's driver understands."""


def bare(port: str) -> str:
    """Return a port without the `visa:` prefix that selects PyVISA.

    >>> bare("visa:GPIB0::5::INSTR")
    'GPIB0::5::INSTR'
    """
    return port[len(_BY_VISA) :] if port[: len(_BY_VISA)].lower() == _BY_VISA else port


def kind_of(port: str) -> PortKind:
    """Return the kind of a port, by its path, URL or VISA resource name.

    >>> kind_of("TCPIP::192.168.10.21::hislip0::INSTR")
    <PortKind.HISLIP: 'hislip'>
    """
    if bare(port) != port:
        return PortKind.VISA
    if port.startswith(VENDOR):
        return PortKind.VENDOR
    where = url_of_resource(port)
    scheme, separator, _ = where.partition("://")
    if separator:
        return {"socket": PortKind.SOCKET, "rfc2217": PortKind.RFC2217}.get(scheme.lower(), PortKind.OTHER)
    if where.startswith("/dev/usbtmc") or VISA_USB.match(where):
        return PortKind.USBTMC
    if match := VISA_LAN.match(where):
        return PortKind.HISLIP if (match["name"] or "").lower().startswith("hislip") else PortKind.VXI11
    return PortKind.SERIAL if where.startswith("/") else PortKind.OTHER


def url_of_resource(name: str) -> str:
    """Return the URL of a VISA resource name; anything else is returned unchanged.

    >>> url_of_resource("TCPIP::192.168.10.21::5025::SOCKET")
    'socket://192.168.10.21:5025'
    >>> url_of_resource("ASRL/dev/ttyUSB0::INSTR")
    '/dev/ttyUSB0'
    """
    name = bare(name)
    if match := _VISA_SOCKET.match(name):
        return f"socket://{match['host']}:{match['port']}"
    if match := _VISA_SERIAL.match(name):
        return match["port"]
    return name


_SCHEMES = (*NETWORK, "sim", "replay")
_BY_PYVISA = re.compile(
    r"^((GPIB|USB|TCPIP)\d*::[^:].*|ASRL(\d+|/dev/(?!.*\.\.)[^:]+))::(INSTR|SOCKET|RAW)$", re.IGNORECASE
)
_VISA_NAMES = (
    "visa:GPIB0::5::INSTR, visa:TCPIP::HOST::INSTR, visa:TCPIP::HOST::5025::SOCKET or visa:ASRL/dev/ttyS0::INSTR"
)
_WRITE = "write a device below /dev, socket://HOST:PORT, rfc2217://HOST:PORT, or a VISA name"


def why_not_opened(port: str) -> str:
    """Return why a bench file's port is never opened, empty if it may be.

    pyserial knows more schemes, which bypass every check of a port's identity: `alt://`, `hwgrep://` and `spy://` reach
    serial devices by another name, `spy://` writes files, and `loop://` has no instrument.
    """
    if kind_of(port) in {PortKind.VENDOR, PortKind.VISA}:
        known = port.startswith(VENDOR) or _BY_PYVISA.match(bare(port))
        return "" if known else f"'{port}' does not look like visa:USB0::…::INSTR, {_VISA_NAMES}"
    url = url_of_resource(port)
    scheme, is_url, place = url.partition("://")
    if not is_url and "::" in port:
        by_ourselves = "USB and TCPIP are, and GPIB by a gateway: TCPIP::HOST::gpib0,5"
        told = f"'{port}' is no VISA name that is opened; {by_ourselves}; PyVISA may open others: {_BY_VISA}{port}"
        return "" if kind_of(port) in MESSAGES else told
    if not is_url:
        inside = posixpath.normpath(url).startswith("/dev/")  # including USBTMC files
        return "" if inside else f"'{port}' is no serial device below /dev; {_WRITE}"
    if scheme not in _SCHEMES:
        return f"'{scheme}://' is never opened{did_you_mean(scheme, _SCHEMES)}; {_WRITE}"
    if scheme in NETWORK and not _NETWORK_PLACE.fullmatch(place):
        return f"'{port}' does not look like {scheme}://HOST:PORT"
    return ""


def open_port(
    device: str, url: str, clock: Clock, transcript: Transcript, *, baud: int = 0, timeout: float = LONGEST_TRANSACTION
) -> TappedPort:
    """Open a byte stream with its tap.

    Raises:
        NoReply: if nothing is there.
        Refused: if it is not a stream of this process.
    """
    if _PROTOCOLS not in serial.protocol_handler_packages:
        serial.protocol_handler_packages.append(_PROTOCOLS)
    try:
        opened: object = serial.serial_for_url(url_of_resource(url), baudrate=baud or 9600, timeout=timeout)
    except (serial.SerialException, OSError, ValueError) as error:
        raise NoReply(device, f"{url} cannot be opened ({error})", "check cable, power and the bench file") from error
    if not isinstance(opened, UrlPort):
        raise Refused(f"{device}: {url} has no tap", "open it as live://, sim:// or replay://")
    return TappedPort(device, opened, clock, transcript, timeout)


def open_bus(device: str, url: str, clock: Clock, transcript: Transcript) -> TappedBus:
    """Open one device's view of an I2C bus, with its tap.

    Raises:
        NoReply: if no such bus is there.
    """
    bus = find_bus(url) or hardware_bus(device, url)
    return TappedBus(device, bus, clock, transcript)


def hardware_bus(device: str, path: str) -> I2cBus:
    """Open an I2C bus of this machine.

    Raises:
        NoReply: if it does not exist.
    """
    try:
        from smbus2 import SMBus  # noqa: PLC0415 - fcntl exists on Linux only, and so does the bus
    except ImportError as error:
        raise NoReply(device, f"the bus {path} needs the module smbus2", "pip install smbus2, on Linux") from error
    try:
        bus: I2cBus = SMBus(path)
    except OSError as error:
        from hil.wire.obstacles import obstacle  # noqa: PLC0415 - groups of users exist on Linux only

        why, hint = obstacle(path, error)
        raise NoReply(device, f"the bus {path} cannot be opened: {why}", hint) from error
    return bus
