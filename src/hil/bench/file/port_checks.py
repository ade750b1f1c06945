"""Checks of ports: their settings, what the driver's protocol fixes, and the identity of the device."""

from __future__ import annotations

from collections.abc import Iterator

from hil.bench.file.complaints import Complaints, named
from hil.instruments.driver import ANY_BYTE, TERMINATED, offers
from hil.instruments.registry import DRIVERS
from hil.instruments.wrapped import is_wrapped
from hil.model.bench import BenchSpec, InstrumentSpec
from hil.model.notation import Path
from hil.wire.opening import MESSAGES, PortKind, bare, kind_of
from hil.wire.tap import LONGEST_WAIT

__all__ = ["identities", "settings"]

_SERIAL = (PortKind.SERIAL, PortKind.RFC2217)


def identities(spec: BenchSpec) -> Complaints:
    """Check that only serial devices are declared USB or on board, and that no two are the same device."""
    seen: dict[str, InstrumentSpec] = {}
    for path, item in named(spec.instruments, "instruments"):
        is_device = bool(item.port) and kind_of(bare(item.port)) is PortKind.SERIAL
        if item.usb is not None and not is_device:
            yield (*path, "usb"), f"{item.name}: only a serial device of this computer has a USB identity"
        if item.onboard is not None and not is_device:
            yield (*path, "onboard"), f"{item.name}: only a serial device of this computer is on board"
        if item.usb is not None and item.onboard is not None:
            yield (*path, "onboard"), f"{item.name} is either a USB device or on board, not both"
        if item.usb is not None and bool(item.usb.serial) == bool(item.usb.path):
            yield (*path, "usb"), f"{item.name}: usb needs either a serial or a path"
        for key, place in _places(item):
            if place in seen:
                yield (*path, key), f"{item.name} and {seen[place].name} are both plugged in at '{place}'"
            seen.setdefault(place, item)


def _places(item: InstrumentSpec) -> Iterator[tuple[str, str]]:
    if item.usb and item.usb.path:
        yield "usb", item.usb.path
    if item.onboard and item.onboard.device:
        yield "onboard", item.onboard.device


def settings(spec: BenchSpec) -> Complaints:
    """Check that a port has the settings it is given, and that the driver's protocol leaves them open."""
    for path, item in named(spec.instruments, "instruments"):
        where = _described(item)
        if item.port and kind_of(item.port) is PortKind.OTHER:
            continue  # no such port is opened; reported where it is read
        yield from _wrapped(path, item)
        if not is_wrapped(item) and not (item.port and kind_of(item.port) in _SERIAL):
            by_visa = bool(item.port) and kind_of(bare(item.port)) is PortKind.SERIAL  # sets only the baud rate
            given = {"baud": item.baud != 0 and not by_visa, "serial_line": item.serial_line is not None}
            for key in (key for key, is_given in given.items() if is_given):
                yield (*path, key), f"{item.name} is at {where}, which has no {key}"
        if item.bus:
            given = {"terminator": bool(item.terminator), "timeout": item.timeout_s > 0}
            for key in (key for key, is_given in given.items() if is_given):
                yield (*path, key), f"{item.name} is on a bus, which has no {key}"
        if item.timeout_s > LONGEST_WAIT:
            why = "nothing else is looked at while a reply is waited for"
            yield (*path, "timeout"), f"{item.name}: timeout must be at most {LONGEST_WAIT:g} s: {why}"
        yield from _fixed(path, item)


def _wrapped(path: Path, item: InstrumentSpec) -> Complaints:
    """Complain about settings that a vendor's driver makes itself, and settings meant for such a driver only."""
    if is_wrapped(item):
        given = {"baud": item.baud != 0, "serial_line": item.serial_line is not None}
        for key in (key for key, is_given in given.items() if is_given):
            yield (*path, key), f"{item.name} is opened by its vendor's driver, which sets its {key} itself"
        return
    if item.bytes_unseen:
        yield (*path, "bytes_unseen"), f"the bytes of {item.name} are seen: {item.driver} is no wrapped driver"
    if item.port and kind_of(item.port) is PortKind.VENDOR:
        yield (*path, "port"), f"{item.driver} is no wrapped driver, and cannot open '{item.port}'"


def _fixed(path: Path, item: InstrumentSpec) -> Complaints:
    """Complain about settings that the driver's protocol fixes or rules out."""
    driver, line = DRIVERS.find(item.driver), item.serial_line
    if driver is None:
        return
    if item.terminator and not item.bus and not offers(driver, TERMINATED):
        yield (*path, "terminator"), f"the protocol of {item.driver} fixes what ends a message: leave terminator out"
    if item.port and kind_of(item.port) in MESSAGES and not (offers(driver, TERMINATED) or is_wrapped(item)):
        yield (
            (*path, "port"),
            f"{item.driver} does not talk in messages, as a port of kind {kind_of(item.port)} takes them",
        )
    if line is None:
        return
    at = (*path, "serial_line")
    if offers(driver, ANY_BYTE) and line.flow == "xon/xoff":
        yield (*at, "flow"), f"{item.driver} sends bytes of any value, and xon/xoff would take two of them out"
    if offers(driver, ANY_BYTE) and line.data_bits < 8:
        yield (*at, "data_bits"), f"{item.driver} sends bytes of any value, which need 8 data bits"
    if line.stop_bits == "1.5" and line.data_bits > 5:
        yield (*at, "stop_bits"), "a UART has 1.5 stop bits with 5 data bits only: write 2"
    if line.rs485 is not None and line.flow == "rts/cts":
        yield (*at, "flow"), "RTS switches the direction of this line, so that it cannot be its flow control too"
    if line.rs485 is not None and kind_of(item.port) is not PortKind.SERIAL:
        yield (*at, "rs485"), f"{item.name}: only the kernel of this computer switches the direction of a line"


def _described(item: InstrumentSpec) -> str:
    return "an I2C bus" if item.bus else f"a port of kind {kind_of(item.port)}"
