"""Port identity: of a device, what the operating system reports before it is opened; on a network, who answers."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from hil.bench.bound import BoundBench
from hil.bench.connections import server_of
from hil.bench.gate import Gate
from hil.bench.onboard import Uart, difference, uart_at
from hil.instruments.wrapped import is_wrapped
from hil.model.bench import BenchSpec, InstrumentSpec, OnboardPort, UsbPort
from hil.model.errors import Refused
from hil.model.identity import Identity, Source
from hil.wire.keys import LOOPBACK, SERVED, keys_of
from hil.wire.opening import MESSAGES, PortKind, bare, kind_of, url_of_resource

__all__ = [
    "ListedPort",
    "WrongPort",
    "check_port",
    "difference_of",
    "is_serial_device",
    "listed_ports",
    "port_gates",
    "source_gates",
    "strangers_on_network",
]

_BY_PATH = "/dev/serial/by-path"


class WrongPort(Refused):
    """Serial ports are missing, or belong to boards other than the bench file's; they are not opened.

    Args:
        gates: the gates that do not hold.
    """

    def __init__(self, *gates: Gate) -> None:
        super().__init__(
            "; ".join(f"{gate.name}: {gate.detail}" for gate in gates),
            "plug the boards in as the bench file says, or correct it; without them use --source simulated",
        )
        self.gates = gates


class ListedPort(Protocol):
    """A serial port as pyserial lists it (`serial.tools.list_ports_common.ListPortInfo`)."""

    device: str
    product: str | None
    serial_number: str | None
    location: str | None


def listed_ports() -> list[ListedPort]:
    """Return the serial ports of this computer; none of them is opened."""
    from serial.tools.list_ports import comports  # noqa: PLC0415 - only hardware needs it

    return list(comports())


def is_serial_device(instrument: InstrumentSpec) -> bool:
    """Return whether an instrument is at a serial device of this computer, which may be another one after a replug."""
    return bool(instrument.port) and kind_of(bare(instrument.port)) is PortKind.SERIAL


_PSEUDO = "/dev/pts/"


def port_gates(
    spec: BenchSpec,
    listing: Callable[[], Iterable[ListedPort]] = listed_ports,
    real_path: Callable[[str], str] = os.path.realpath,
) -> Iterator[Gate]:
    """Yield a gate for every serial device of a bench that is not served: pseudo-terminals have no such identity."""
    ports = list(listing())
    for instrument in spec.instruments:
        if is_serial_device(instrument):
            yield check_port(instrument, ports, real_path)


def check_port(
    instrument: InstrumentSpec,
    ports: Iterable[ListedPort] | None = None,
    real_path: Callable[[str], str] = os.path.realpath,
) -> Gate:
    """Compare the device at an instrument's serial port with the one it must be; nothing is opened.

    Args:
        instrument: at a serial device.
        ports: the ports that the operating system lists; listed here if not given.
        real_path: follows the links of a path, such as those of /dev/serial/by-id.
    """
    name = f"port of {instrument.name}"
    device = real_path(url_of_resource(instrument.port))
    uart = uart_at(device)
    if instrument.onboard is not None:
        return _onboard_gate(name, instrument.port, device, instrument.onboard, uart)
    if uart is not None:
        detail = f"{device} is no USB device; write '{uart.written}' so that it is never taken for another"
        return Gate(name, ok=False, detail=detail)
    ports = list(listed_ports() if ports is None else ports)
    found = next((port for port in ports if real_path(port.device) == device), None)
    if found is None:
        if device.startswith(_PSEUDO):
            detail = f"{instrument.port} is a pseudo-terminal: a program answers there, and no instrument"
            return Gate(name, ok=False, detail=detail)
        return Gate(name, ok=False, detail=f"{instrument.port} is not there{_instead(instrument.usb, ports)}")
    if instrument.usb is None:
        own = f"serial: {found.serial_number}" if found.serial_number else f"path: its name in {_BY_PATH}"
        detail = f"{device} is {_described(found)}; write 'usb: {{{own}}}' so that it is never taken for another"
        return Gate(name, ok=False, detail=detail)
    problem = _difference(instrument.usb, found, ports, real_path)
    return Gate(name, ok=not problem, detail=problem or f"{device} is {_described(found)}")


def _onboard_gate(name: str, port: str, device: str, expected: OnboardPort, found: Uart | None) -> Gate:
    if found is None:
        there = Path(device).exists()
        what = "what is there is no UART of this computer's own" if there else "there is no such device"
        return Gate(name, ok=False, detail=f"{port}: {what}")
    problem = difference(expected, found)
    return Gate(name, ok=not problem, detail=problem or f"{device} is {found.devices[0]}, driver {found.driver}")


def _difference(usb: UsbPort, found: ListedPort, ports: Iterable[ListedPort], real_path: Callable[[str], str]) -> str:
    if usb.path:
        expected = real_path(f"{_BY_PATH}/{usb.path}")
        if expected == real_path(found.device):
            return ""
        there = expected if any(real_path(port.device) == expected for port in ports) else "nothing"
        return f"{found.device} is {_described(found)}, and at '{usb.path}' is {there}: was it plugged in elsewhere?"
    if found.serial_number != usb.serial:
        return f"{found.device} is {_described(found)}, expected serial '{usb.serial}'{_elsewhere(usb, ports)}"
    places = sorted({_plug(port) for port in ports if port.serial_number == usb.serial})
    if len(places) > 1:
        return (
            f"{' and '.join(places)} have the same serial '{usb.serial}': tell them apart by 'usb: {{path: …}}', the"
            f" name in {_BY_PATH}"
        )
    return ""


def _elsewhere(usb: UsbPort | None, ports: Iterable[ListedPort]) -> str:
    there = [port.device for port in ports if usb and usb.serial and port.serial_number == usb.serial]
    return f"; that one is {' and '.join(there)}" if there else ""


def _instead(usb: UsbPort | None, ports: Sequence[ListedPort]) -> str:
    """Return what is present instead of a missing port: the expected device elsewhere, or else any others."""
    there = [f"{port.device}: {_described(port)}" for port in ports if port.serial_number]
    return _elsewhere(usb, ports) or (f"; there is {'; '.join(there)}" if there else "")


def _plug(port: ListedPort) -> str:
    """Return where a device is plugged in; the interfaces of one device are at one place."""
    return (port.location or port.device).partition(":")[0]


def _described(port: ListedPort) -> str:
    return f"{port.product or 'no USB device'}, {f'serial {port.serial_number}' if port.serial_number else 'no serial'}"


def source_gates(spec: BenchSpec, keys: Callable[[str], Iterable[str]] = keys_of) -> Iterator[Gate]:
    """Yield a gate for every instrument of a bench declared as hardware: where its bytes come from, and what it is.

    A port of a served bench, by whatever name of this host, is simulated whatever the bench file says. A port on
    this computer's own network may belong to any program: it is hardware only if the bench file says why.
    """
    for instrument in spec.instruments:
        port, reason = _way_to(spec, instrument)
        name, found = f"source of {instrument.name}", list(keys(port))
        source, detail, exception = Source.HARDWARE, port, ""
        if any(key.startswith(SERVED) for key in found):
            source, detail = Source.SIMULATED, f"{port} belongs to a bench that is served on this computer"
        elif any(key.startswith(LOOPBACK) for key in found):
            exception = f"{port} is on this computer and stands for hardware: {reason}" if reason else ""
            source = Source.HARDWARE if reason else Source.SIMULATED
            detail = exception or f"{port} is on this computer, and the bench file does not say why it is hardware"
        unseen, accepted = _unseen(instrument)
        told = "; ".join(filter(None, (exception, accepted)))
        yield Gate(
            name, ok=True, detail=detail, instrument=instrument.name, unproven=unseen, source=source, exception=told
        )


def _unseen(instrument: InstrumentSpec) -> tuple[str, str]:
    """Return what stays unproven because the bytes were not seen, or why the bench file accepts that."""
    if not is_wrapped(instrument):
        return "", ""
    fact = "its bytes were not seen, only the calls of its vendor's driver"
    if instrument.bytes_unseen:
        return "", f"{fact}: {instrument.bytes_unseen}"
    return f"{instrument.name}: {fact}, and the bench file does not say why that is accepted", ""


def _way_to(spec: BenchSpec, instrument: InstrumentSpec) -> tuple[str, str]:
    """Return the port that carries an instrument's bytes, and why it counts as hardware, if the file says so."""
    found = instrument
    while server := server_of(spec, found):
        found = server
    bus = next((each.port for each in spec.buses if each.name == found.bus), "")
    return found.port or bus, found.stands_for_hardware


def strangers_on_network(bench: BoundBench) -> dict[str, str]:
    """Return, by instrument, any other one that answers at its network port; nothing is driven, silence is ignored.

    A serial device is compared with its USB identity before it is opened; an address on a network may be anything.
    """
    found: dict[str, str] = {}
    for instrument in bench.spec.instruments:
        if is_wrapped(instrument) or kind_of(instrument.port) in {PortKind.SOCKET, PortKind.RFC2217, *MESSAGES}:
            with suppress(Exception):  # what a driver makes of nonsense is no other instrument's identity
                found[instrument.name] = difference_of(instrument.identity, bench.drivers[instrument.name].identify())
    return {name: detail for name, detail in found.items() if detail}


def difference_of(expected: Identity, found: Identity) -> str:
    """Return how an instrument differs from the one that the bench file expects, empty if it does not.

    A simulated one passes if it reports the same apart from its mark, which some have in place of the firmware.
    """
    for what in ("manufacturer", "model", "serial", "firmware"):
        wanted, got = getattr(expected, what), getattr(found.unmarked, what)
        if wanted and wanted != got and not (what == "firmware" and found.simulated and not got):
            return f"expected {what} '{wanted}', found '{got}'"
    return ""
