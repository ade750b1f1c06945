"""UARTs of this computer's own, by what sysfs says of them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from hil.bench.onboard import difference, uart_at
from hil.bench.port_identity import check_port
from hil.model.bench import InstrumentSpec, OnboardPort, UsbPort


class System:
    """A sysfs with terminals, as Linux 6.5 and later lay it out."""

    def __init__(self, root):
        self.root = root
        self.terminals = root / "class/tty"
        self.terminals.mkdir(parents=True)
        (root / "bus/serial-base").mkdir(parents=True)
        (root / "bus/platform").mkdir()

    def add(self, name, device, driver, *, number=0, port="0x0", iomem="0x0", kind="4", usb=False):
        """Add a terminal of a hardware device, below the two folders of the serial core."""
        hardware = self.root / "devices" / device
        for folder, bus in (
            (hardware, "platform"),
            (hardware / f"{device}:0", "serial-base"),
            (hardware / f"{device}:0" / f"{device}:0.{number}", "serial-base"),
        ):
            folder.mkdir(parents=True, exist_ok=True)
            (folder / "uevent").touch()
            if not (folder / "subsystem").exists():
                (folder / "subsystem").symlink_to(self.root / "bus" / bus)
        drivers = self.root / "drivers" / driver
        drivers.mkdir(parents=True, exist_ok=True)
        if not (hardware / "driver").exists():
            (hardware / "driver").symlink_to(drivers)
        if usb:
            (hardware / "idVendor").write_text("0403")
        terminal = self.terminals / name
        terminal.mkdir()
        (terminal / "device").symlink_to(folder)
        for file, text in (("port", port), ("iomem_base", iomem), ("type", kind)):
            (terminal / file).write_text(f"{text}\n")


@pytest.fixture
def system(tmp_path):
    """Return a sysfs with an on-board UART, a card with two ports, a USB adapter, and a place without a UART."""
    made = System(tmp_path)
    made.add("ttyAMA0", "fe201000.serial", "uart-pl011", iomem="0xFE201000")
    made.add("ttyS4", "0000:02:00.0", "serial", port="0xE000")
    made.add("ttyS5", "0000:02:00.0", "serial", number=1, port="0xE008")
    made.add("ttyUSB0", "1-2:1.0", "ftdi_sio", usb=True)
    made.add("ttyS9", "serial8250", "serial8250", kind="0")
    return made


def test_a_uart_is_what_the_kernel_says(system):
    """Its hardware, its driver and its address; the folders of the serial core itself say nothing."""
    uart = uart_at("/dev/ttyAMA0", system.terminals)
    assert (uart.devices, uart.driver, uart.at) == (("fe201000.serial",), "uart-pl011", "0xfe201000")
    assert uart.written == 'onboard: {device: "fe201000.serial", driver: uart-pl011}'


@pytest.mark.parametrize("device", ["/dev/ttyUSB0", "/dev/ttyS9", "/dev/nothing"])
def test_what_is_no_uart_of_this_computer(system, device):
    """A USB adapter, a place where a UART could be, and nothing at all."""
    assert uart_at(device, system.terminals) is None


@pytest.mark.parametrize(
    ("terminal", "expected", "problem"),
    [
        ("ttyAMA0", OnboardPort(device="fe201000.serial"), ""),
        ("ttyAMA0", OnboardPort(device="fe201000.serial", driver="uart-pl011", at="0xFE201000"), ""),
        ("ttyAMA0", OnboardPort(device="fe215040.serial"), "expected 'fe215040.serial'"),
        ("ttyAMA0", OnboardPort(device="fe201000.serial", driver="8250"), "uart-pl011, expected driver '8250'"),
        ("ttyS4", OnboardPort(device="0000:02:00.0", at="0xe000"), ""),
        ("ttyS4", OnboardPort(device="0000:02:00.0", at="0xe008"), "at 0xe000, expected at 0xe008"),
        (
            "ttyS4",
            OnboardPort(device="0000:02:00.0"),
            "and so is ttyS5: tell it apart by 'onboard: {…, at: \"0xe000\"}'",
        ),
    ],
)
def test_a_uart_is_compared(system, terminal, expected, problem):
    """With what the bench file says: another one, or one of two, is not opened."""
    found = difference(expected, uart_at(f"/dev/{terminal}", system.terminals), system.terminals)
    assert found == problem if not problem else problem in found


def gate_of(monkeypatch, system, port, **identity):
    """Return the gate of an instrument's port."""
    monkeypatch.setattr("hil.bench.onboard.uart_at.__defaults__", (system.terminals,))
    monkeypatch.setattr("hil.bench.onboard.difference.__defaults__", (system.terminals,))
    return check_port(InstrumentSpec(name="psu", driver="korad-ka3005p", port=port, **identity), ())


def test_a_uart_without_a_declared_identity_is_not_opened(monkeypatch, system):
    """What to write is told."""
    gate = gate_of(monkeypatch, system, "/dev/ttyAMA0")
    assert not gate.ok
    assert "write 'onboard: {device: \"fe201000.serial\", driver: uart-pl011}'" in gate.detail


def test_the_declared_uart_is_opened_and_no_other_kind(monkeypatch, system):
    """A USB adapter at the same path is none."""
    declared = OnboardPort(device="fe201000.serial", driver="uart-pl011")
    gate = gate_of(monkeypatch, system, "/dev/ttyAMA0", onboard=declared)
    assert (gate.ok, gate.detail) == (True, "/dev/ttyAMA0 is fe201000.serial, driver uart-pl011")
    assert not gate_of(monkeypatch, system, "/dev/ttyAMA0", onboard=replace(declared, driver="other")).ok
    other = gate_of(monkeypatch, system, "/dev/null", onboard=declared)
    assert (other.ok, other.detail) == (False, "/dev/null: what is there is no UART of this computer's own")
    gone = gate_of(monkeypatch, system, "/dev/ttyGONE0", onboard=declared)
    assert (gone.ok, gone.detail) == (False, "/dev/ttyGONE0: there is no such device")


def test_a_uart_is_no_usb_device(monkeypatch, system):
    """Who says so is told what it is."""
    assert "is no USB device" in gate_of(monkeypatch, system, "/dev/ttyAMA0", usb=UsbPort(serial="A1")).detail
