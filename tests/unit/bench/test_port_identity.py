"""Serial ports compared with what the operating system lists, before anything is opened."""

from __future__ import annotations

from dataclasses import dataclass, replace

import pytest
from adcs_bench import adcs

from hil.bench.port_identity import check_port, is_serial_device, listed_ports, port_gates, source_gates
from hil.model.bench import InstrumentSpec, UsbPort
from hil.model.identity import Source
from hil.wire.keys import LOOPBACK, SERVED

BY_ID = "/dev/serial/by-id/usb-FTDI_FT232R_A50285BI-if00-port0"
BY_PATH = "/dev/serial/by-path/"


@dataclass
class Listed:
    """A port as pyserial lists it."""

    device: str
    serial_number: str | None = None
    product: str | None = "FT232R USB UART"
    location: str | None = "1-2:1.0"


RELAYS = Listed("/dev/ttyUSB0", "A50285BI")
RELAYS_ARE = "/dev/ttyUSB0 is FT232R USB UART"
OTHER = Listed("/dev/ttyUSB1", "A50285BK", location="1-3:1.0")


def instrument(usb=None, port=BY_ID):
    """Return an instrument at a serial port."""
    return InstrumentSpec(name="relay1", driver="waveshare-relay", port=port, usb=usb)


def links(**to):
    """Return what follows links: those of by-id and by-path lead where they are said to lead."""
    known = {BY_ID: to.pop("by_id", "/dev/ttyUSB0"), **{BY_PATH + name: device for name, device in to.items()}}
    return lambda path: known.get(path, path)


def gate(usb, *ports, **to):
    """Return the gate of the port."""
    return check_port(instrument(usb), ports, links(**to))


def test_the_device_that_it_must_be_is_told():
    """Its serial number is the one of the bench file."""
    found = gate(UsbPort(serial="A50285BI"), RELAYS, OTHER)
    assert (found.name, found.ok) == ("port of relay1", True)
    assert found.detail == "/dev/ttyUSB0 is FT232R USB UART, serial A50285BI"


def test_a_link_that_leads_to_another_board_is_told():
    """The name says A50285BI, the board there is another one, and where the right one is, is told."""
    found = gate(UsbPort(serial="A50285BI"), RELAYS, OTHER, by_id="/dev/ttyUSB1")
    assert not found.ok
    assert found.detail == (
        "/dev/ttyUSB1 is FT232R USB UART, serial A50285BK, expected serial 'A50285BI'; that one is /dev/ttyUSB0"
    )


def test_a_pseudo_terminal_is_no_instrument():
    """A program behind it answers whatever it likes."""
    found = gate(None, OTHER, by_id="/dev/pts/7")
    assert (found.ok, "is a pseudo-terminal: a program answers there, and no instrument" in found.detail) == (
        False,
        True,
    )


@pytest.mark.parametrize(
    ("usb", "ports", "detail"),
    [
        (None, (OTHER,), f"{BY_ID} is not there; there is /dev/ttyUSB1: FT232R USB UART, serial A50285BK"),
        (UsbPort(serial="A50285BI"), (), f"{BY_ID} is not there"),
        (UsbPort(serial="A50285BK"), (OTHER,), f"{BY_ID} is not there; that one is /dev/ttyUSB1"),
        (
            None,
            (RELAYS,),
            f"{RELAYS_ARE}, serial A50285BI; write 'usb: {{serial: A50285BI}}' so that it is never taken for another",
        ),
        (
            None,
            (replace(RELAYS, serial_number=None),),
            f"{RELAYS_ARE}, no serial; write 'usb: {{path: its name in /dev/serial/by-path}}'",
        ),
        (
            UsbPort(serial="A50285BI"),
            (Listed("/dev/ttyUSB0", product=None, location=None),),
            "/dev/ttyUSB0 is no USB device, no serial, expected serial 'A50285BI'",
        ),
        (
            UsbPort(serial="A50285BI"),
            (RELAYS, replace(OTHER, serial_number="A50285BI")),
            "1-2 and 1-3 have the same serial 'A50285BI': tell them apart by 'usb: {path: …}'",
        ),
    ],
)
def test_what_is_not_proven_is_not_opened(usb, ports, detail):
    """Nothing there, no identity in the bench file, another device, or two that look alike."""
    found = gate(usb, *ports)
    assert not found.ok
    assert found.detail.startswith(detail)


def test_the_interfaces_of_one_device_are_one():
    """A device with four ports has one serial number and is no two devices."""
    second = Listed("/dev/ttyUSB1", "A50285BI", location="1-2:1.1")
    assert gate(UsbPort(serial="A50285BI"), RELAYS, second).ok


def test_a_place_stands_for_a_device_without_a_serial_number():
    """The port must be what is plugged in there."""
    usb, nameless = UsbPort(path="pci-0-usb-0:4"), replace(RELAYS, serial_number=None)
    assert gate(usb, nameless, **{"pci-0-usb-0:4": "/dev/ttyUSB0"}).ok
    moved = gate(usb, nameless, OTHER, **{"pci-0-usb-0:4": "/dev/ttyUSB1"})
    assert (moved.ok, moved.detail) == (
        False,
        f"{RELAYS_ARE}, no serial, and at 'pci-0-usb-0:4' is /dev/ttyUSB1: was it plugged in elsewhere?",
    )
    assert gate(usb, nameless).detail.endswith("and at 'pci-0-usb-0:4' is nothing: was it plugged in elsewhere?")


def test_only_serial_devices_have_an_identity():
    """Sockets, buses and other URLs are not asked; a VISA name of a serial line is."""
    assert is_serial_device(instrument(port="ASRL/dev/ttyUSB0::INSTR"))
    assert not is_serial_device(instrument(port="TCPIP::192.168.10.22::5555::SOCKET"))
    assert not is_serial_device(InstrumentSpec(name="mag1", driver="lis3mdl", bus="i2c1", address=0x1C))


def test_every_serial_device_of_a_bench_has_its_gate():
    """The bench of the tests has one."""
    assert [found.name for found in port_gates(adcs(), lambda: [RELAYS], links())] == ["port of relay1"]
    assert all(found.ok for found in port_gates(adcs(), lambda: [RELAYS], links()))


def test_the_listing_opens_nothing():
    """It can be asked on any machine, whatever is plugged in."""
    assert isinstance(listed_ports(), list)


def gate_of(port, keys, reason=""):
    """Return source, detail and exception of the gate for an instrument at a port that has these keys."""
    spec = replace(
        adcs(),
        instruments=(InstrumentSpec(name="psu1", driver="none", port=port, stands_for_hardware=reason),),
        buses=(),
    )
    (gate,) = source_gates(spec, lambda _port: keys)
    assert (gate.ok, gate.instrument) == (True, "psu1")
    return gate.source, gate.detail, gate.exception


def test_a_port_of_this_computer_is_hardware_only_with_a_reason():
    """Without one it counts as simulated; with one it is an exception, which the gate tells."""
    port, key = "socket://127.0.0.1:5025", f"{LOOPBACK}:5025"
    without = f"{port} is on this computer, and the bench file does not say why it is hardware"
    assert gate_of(port, [key]) == (Source.SIMULATED, without, "")
    told = f"{port} is on this computer and stands for hardware: a bridge"
    assert gate_of(port, [key], "a bridge") == (Source.HARDWARE, told, told)
    assert gate_of("socket://192.168.10.21:5025", ["x"], "a bridge")[::2] == (Source.HARDWARE, "")


def test_no_reason_makes_hardware_of_a_port_that_is_served():
    """A socket or a pseudo-terminal of a served bench is simulated, whatever the bench file says."""
    port = "/dev/pts/7"
    told = f"{port} belongs to a bench that is served on this computer"
    assert gate_of(port, [f"{SERVED}x"], "a bridge") == (Source.SIMULATED, told, "")
