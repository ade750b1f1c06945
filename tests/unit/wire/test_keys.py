"""Keys: one instrument is one for everyone, however it is written; two instruments stay two."""

from __future__ import annotations

import os
import socket
import threading
from pathlib import Path

import pytest

from hil.wire import keys
from hil.wire.keys import announce_served, keys_of, keys_of_served, keys_of_this_port

HOSTS = {"psu1.lab": ["192.0.2.7"], "psu1": ["192.0.2.7", "2001:db8::7"], "here.lab": ["127.0.1.1"]}


def of(port, **options):
    """Return the keys of a port, with names of hosts as above."""
    return set(keys_of(port, resolve=lambda host: HOSTS.get(host, []), **options))


@pytest.mark.parametrize(
    "names",
    [
        (
            "socket://127.0.0.1:5025",
            "socket://localhost:5025",
            "TCPIP::127.0.0.1::5025::SOCKET",
            "tcpip0::LOCALHOST::5025::socket",
            "socket://[::1]:5025",
            "TCPIP::[::1]::5025::SOCKET",
            "socket://[::ffff:127.0.0.1]:5025",
            "SOCKET://LocalHost.:5025",
            "socket://here.lab:5025",
            "rfc2217://127.0.0.1:5025",
        ),
        (
            "socket://192.0.2.7:5025",
            "TCPIP0::192.0.2.7::5025::SOCKET",
            "socket://PSU1.lab.:5025",
            "socket://psu1:5025",
            "rfc2217://192.0.2.7:5025?logging=debug",
            "TCPIP::192.0.2.7::INSTR",
            "TCPIP0::psu1::inst0::INSTR",
            "TCPIP0::psu1::hislip0",
        ),
        ("socket://[2001:DB8:0::7]:5025", "socket://[2001:db8::7]:5025", "socket://psu1:5025"),
        ("USB0::0x0957::0x1796::MY1::INSTR", "USB::2391::6038::MY1::0::INSTR", "usb0::0x957::0x1796::MY1"),
        ("GPIB0::5::INSTR", "gpib0::5::instr"),
        ("TCPIP0::192.0.2.7::gpib0,5::INSTR", "tcpip::psu1::GPIB0,5"),
    ],
)
def test_one_instrument_is_one_however_it_is_written(names):
    """Any two ways to write it have a key in common."""
    for one in names:
        for other in names:
            assert of(one) & of(other), (one, other)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("socket://192.0.2.7:5025", "socket://192.0.2.8:5025"),
        ("socket://192.0.2.7:2001", "socket://192.0.2.7:2002"),
        ("socket://unknown-a:5025", "socket://unknown-b:5025"),
        ("USB0::0x0957::0x1796::MY1::INSTR", "USB0::0x0957::0x1796::MY2::INSTR"),
        ("USB0::0x0957::0x1796::MY1::0::INSTR", "USB0::0x0957::0x1796::MY1::1::INSTR"),
        ("/dev/ttyS0", "/dev/ttyS1"),
        ("TCPIP::192.0.2.7::gpib0,5::INSTR", "TCPIP::192.0.2.7::gpib0,6::INSTR"),
        ("TCPIP::192.0.2.7::gpib0,5::INSTR", "TCPIP::192.0.2.7::5025::SOCKET"),
    ],
)
def test_two_instruments_are_two(one, other):
    """Such as two behind one serial server."""
    assert not of(one) & of(other)


def test_what_is_written_is_a_key_as_well():
    """Earlier versions had no other, and have left latches under it."""
    for port in ("TCPIP::192.0.2.7::5025::SOCKET", "/dev/serial/by-id/x", "socket://localhost:1", "/dev/i2c-1"):
        assert port in of(port)


def test_a_resolver_that_does_not_answer_is_not_waited_for(monkeypatch):
    """The name itself is the key then; what cannot be looked up cannot be opened either."""
    asked = threading.Event()

    def never(*_, **__):
        asked.wait(30.0)
        raise OSError

    monkeypatch.setattr(socket, "getaddrinfo", never)
    monkeypatch.setattr(keys, "_RESOLVED_S", 0.01)
    assert set(keys_of("socket://psu1:5025")) == {"socket://psu1:5025"}
    asked.set()


def test_a_name_is_looked_up(monkeypatch):
    """By the system's resolver, all of its addresses."""
    told = [(2, 1, 6, "", ("192.0.2.7", 0)), (10, 1, 6, "", ("2001:db8::7", 0, 0, 0))]
    monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: told)
    assert {"socket://192.0.2.7:5025", "socket://[2001:db8::7]:5025"} < set(keys_of("socket://psu1:5025"))


def test_a_device_is_one_by_every_link(tmp_path):
    """A bus of this machine, or a UART on its board, is known by its path."""
    link = tmp_path / "bus"
    link.symlink_to("/dev/null")
    assert of(str(link)) & of("/dev/null") == {"/dev/null"}


class Tree:
    """A tree of devices as the kernel shows it, in which every USB device is a file of the name of a real one."""

    def __init__(self, root: Path) -> None:
        self.root = root
        status = Path("/dev/null").stat()
        self._node = root / "dev/char" / f"{os.major(status.st_rdev)}:{os.minor(status.st_rdev)}"
        self._node.mkdir(parents=True)
        (root / "bus/usb/devices").mkdir(parents=True)

    def plug(self, place, serial, interface="00", line=""):
        """Plug a device in at a place, and let /dev/null be its terminal."""
        device = self.root / "devices/pci0/usb1" / place
        terminal = device / f"{place}:1.{int(interface)}" / "ttyUSB0"
        terminal.mkdir(parents=True, exist_ok=True)
        for path, text in (
            (device / "idVendor", "0416"),
            (device / "idProduct", "5011"),
            (device / "serial", serial),
            (terminal.parent / "bInterfaceNumber", interface),
            (terminal / "port_number", line),
        ):
            path.write_text(f"{text}\n")
        link = self.root / "bus/usb/devices" / place
        link.unlink(missing_ok=True)
        link.symlink_to(device)
        (self._node / "device").unlink(missing_ok=True)
        (self._node / "device").symlink_to(terminal)
        return set(keys_of("/dev/null", system=self.root)) - {"/dev/null"}


def test_a_usb_device_is_known_by_its_serial_number_and_by_where_it_is_plugged_in(tmp_path):
    """After a reboot it has another path; as a VISA resource it is the same one."""
    found = Tree(tmp_path).plug("1-2.4", "MY1")
    assert found == {"usb at 1-2.4 interface 0", "usb 0416:5011 MY1 interface 0"}
    assert found & of("USB0::0x0416::0x5011::MY1::INSTR")


def test_two_lines_of_one_adapter_are_two(tmp_path):
    """By interface, or by the number that its driver gives."""
    tree = Tree(tmp_path)
    lines = [tree.plug("1-2", "FT4", "00"), tree.plug("1-2", "FT4", "01"), tree.plug("1-2", "FT4", "01", "3")]
    assert all(not one & other for one in lines for other in lines if one is not other)


def test_devices_that_all_have_one_serial_number_are_told_apart_by_their_places(tmp_path):
    """As supplies of some makers are. The first one was known by its number before the second one came."""
    tree = Tree(tmp_path)
    first = tree.plug("1-1", "A02")
    second = tree.plug("1-2", "A02")
    assert second == {"usb at 1-2 interface 0"}
    assert first & tree.plug("1-1", "A02") == {"usb at 1-1 interface 0"}


def test_a_port_of_a_served_bench_is_that_bench(tmp_path):
    """Whoever reaches it through loopback has a key in common with whoever names its folder while it is served."""
    announced = announce_served(49_151, tmp_path)
    try:
        reached = of("TCPIP::127.0.0.1::49151::SOCKET")
        assert reached & set(keys_of_served(tmp_path))
        assert not reached & set(keys_of_served(tmp_path / "other"))
        assert keys_of_this_port("socket://127.0.0.1:49151") == ("socket://localhost:49151", "socket://127.0.0.1:49151")
    finally:
        os.close(announced)
    assert not of("socket://127.0.0.1:49151") & set(keys_of_served(tmp_path))
    assert f"served bench {tmp_path}" in keys_of_served(tmp_path)
