"""Who is behind a terminal, by a tree such as the kernel shows it."""

from __future__ import annotations

import os
import time

import pytest

from hil.guardian.ports.identity import found, identity_of, require_not_reused


@pytest.fixture
def terminal():
    """Return descriptor and path of a terminal."""
    far, near = os.openpty()
    yield near, os.ttyname(near)
    os.close(far)
    os.close(near)


def told(tmp_path, near, socket="1-1.4", **words):
    """Write a tree of the kernel in which that terminal is a USB device; return its root."""
    usb = tmp_path / "devices" / socket
    port = usb / f"{socket}:1.0" / "ttyUSB0"
    port.mkdir(parents=True, exist_ok=True)
    for name in ("idVendor", "idProduct", "serial"):
        (usb / name).unlink(missing_ok=True)
    for name, word in words.items():
        (usb / name).write_text(f"{word}\n")
    number = os.fstat(near).st_rdev
    at = tmp_path / "char" / f"{os.major(number)}:{os.minor(number)}"
    at.mkdir(parents=True, exist_ok=True)
    (at / "device").unlink(missing_ok=True)
    (at / "device").symlink_to(port)
    return tmp_path / "char"


def test_a_device_is_known_by_its_serial_number(tmp_path, terminal):
    """Vendor and product besides, by descriptor and by path alike."""
    near, path = terminal
    system = told(tmp_path, near, idVendor="0403", idProduct="6001", serial="A50285BK")
    assert identity_of(near, system) == identity_of(path, system) == ("0403", "6001", "A50285BK")
    assert found(("0403", "6001", "A50285BK"), path, (), system) == path


def test_a_device_without_a_serial_number_is_known_by_its_socket(tmp_path, terminal):
    """Two equal adapters in two sockets are not the same."""
    near, _ = terminal
    one = identity_of(near, told(tmp_path, near, "1-1.4", idVendor="1a86", idProduct="7523"))
    other = identity_of(near, told(tmp_path, near, "1-1.3", idVendor="1a86", idProduct="7523"))
    assert one == ("1a86", "7523", "at 1-1.4")
    assert other != one


def test_another_device_under_the_same_name_is_not_opened(tmp_path, terminal):
    """It may start something at the first byte."""
    near, path = terminal
    system = told(tmp_path, near, idVendor="2341", idProduct="0043", serial="X")
    with pytest.raises(OSError, match="is 2341 0043 X now, not 0403 6001 A"):
        found(("0403", "6001", "A"), path, (), system)


def test_what_is_no_usb_device_has_no_identity(tmp_path, terminal):
    """A pseudo-terminal, a pipe, and what the kernel does not tell of."""
    near, path = terminal
    assert identity_of(near) is None
    assert identity_of(path, tmp_path) is None
    reader, writer = os.pipe()
    assert identity_of(reader) is None
    os.close(reader)
    os.close(writer)
    with pytest.raises(OSError, match="is no USB device now"):
        found(("0403", "6001", "A"), path, (), tmp_path)
    with pytest.raises(OSError, match="/dev/no-such-port is no USB device now"):
        found(("0403", "6001", "A"), "/dev/no-such-port", ())


def test_a_device_that_has_another_name_now_is_found(tmp_path, terminal):
    """Names are given in the order in which devices come; one that is at two places is at none."""
    near, path = terminal
    system = told(tmp_path, near, idVendor="0403", idProduct="6001", serial="A50285BK")
    wanted = ("0403", "6001", "A50285BK")
    assert found(wanted, "/dev/no-such-port", ["/dev/null", path], system) == path
    with pytest.raises(OSError, match="6001 A50285BK is at"):
        found(wanted, "/dev/no-such-port", [path, path], system)
    with pytest.raises(OSError, match="is no USB device now"):
        found((*wanted, "interface 01"), "/dev/no-such-port", [path], system)


def test_each_port_of_one_adapter_is_known(tmp_path, terminal):
    """By interface and number of the port: another instrument is behind each."""
    near, _ = terminal
    system = told(tmp_path, near, idVendor="0403", idProduct="6011", serial="X")
    usb = tmp_path / "devices" / "1-1.4" / "1-1.4:1.0"
    (usb / "bInterfaceNumber").write_text("00\n")
    (usb / "ttyUSB0" / "port_number").write_text("1\n")
    assert identity_of(near, system) == ("0403", "6011", "X", "port 1", "interface 00")


def test_a_terminal_that_was_opened_after_its_link_belongs_to_another_program(tmp_path, terminal):
    """A killed server leaves its links, and the kernel gives their numbers to whoever asks next."""
    _, path = terminal
    link = tmp_path / "psu"
    link.symlink_to(path)
    require_not_reused(str(link))
    an_hour_ago = time.time() - 3600.0
    os.utime(link, (an_hour_ago, an_hour_ago), follow_symlinks=False)
    with pytest.raises(OSError, match="psu leads to a terminal that another program has opened since"):
        require_not_reused(str(link))
    require_not_reused(path)


def test_the_age_of_a_link_to_a_device_means_nothing(tmp_path):
    """Who may read a device is changed long after the system made its links."""
    link = tmp_path / "uart"
    link.symlink_to("/dev/null")
    os.utime(link, (0.0, 0.0), follow_symlinks=False)
    require_not_reused(str(link))
