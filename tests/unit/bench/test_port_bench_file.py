"""Settings of ports in a bench file: what a kind of port has, and what a protocol leaves open."""

from __future__ import annotations

from contextlib import closing

import pytest
from changed_benches import found, loaded, place

from hil.bench.binding import bind_simulated
from hil.model.serial_line import Rs485, SerialLine
from hil.wire.opening import PortKind, kind_of
from hil.wire.transcript import Transcript

TEC = 'usb: {serial: A50285BK}\n    baud: "19200"'
PSU1 = "port: TCPIP::192.168.10.22::5555::SOCKET"
PSU2 = 'usb: {path: "pci-0000:00:14.0-usb-0:4:1.0"}'


def of_tec(text):
    """Return what changes the line of the temperature controller, which speaks Modbus."""
    return {TEC: f"{TEC}\n    {text}"}


MISTAKES = [
    (
        of_tec("serial_line: {parity: evn}"),
        "evn",
        "must be one of none, even, odd, mark, space, found `evn`, did you mean 'even'?",
    ),
    (of_tec("serial_line: {paritty: even}"), "paritty", "unknown key 'paritty', did you mean 'parity'?"),
    (of_tec('serial_line: {data_bits: "9"}'), '"9"}', "must be at most 8"),
    (
        of_tec('serial_line: {data_bits: "7"}'),
        '"7"}',
        "eurotherm-3216 sends bytes of any value, which need 8 data bits",
    ),
    (of_tec('serial_line: {stop_bits: "1.5"}'), '"1.5"', "1.5 stop bits with 5 data bits only: write 2"),
    (of_tec("serial_line: {flow: xon/xoff}"), "xon/xoff}", "eurotherm-3216 sends bytes of any value, and xon/xoff"),
    (of_tec("serial_line: {flow: dsr/dtr}"), "dsr/dtr}", "wire the instrument's DTR to CTS, and write rts/cts"),
    (of_tec("serial_line: {flow: rts/cts, rs485: {}}"), "rts/cts,", "RTS switches the direction of this line"),
    (of_tec("serial_line: {rs485: {before: 3}}"), "3}}", "must be a duration such as 10 ms"),
    (
        of_tec("terminator: CR"),
        "CR\n",
        "the protocol of eurotherm-3216 fixes what ends a message: leave terminator out",
    ),
    (of_tec("timeout: 2001 ms"), "2001 ms", "timeout must be at most 2 s"),
    (of_tec("timeout: 0 ms"), "0 ms\n", "must be longer than 0 s"),
    ({PSU1: f"{PSU1}\n    serial_line: {{}}"}, "{}\n", "psu1 is at a port of kind socket, which has no serial_line"),
    ({PSU1: f'{PSU1}\n    baud: "9600"'}, '"9600"\n    identity: {man', "a port of kind socket, which has no baud"),
    ({PSU1: f"{PSU1}\n    terminator: LFCR"}, "LFCR", "must be one of LF, CR, CR LF"),
    (
        {PSU1: f'{PSU1}\n    onboard: {{device: "00:00"}}'},
        '{device: "00:00"',
        "psu1: only a serial device of this computer is on board",
    ),
    (
        {
            PSU1: "port: TCPIP::192.168.10.22::INSTR",
            "manufacturer: RIGOL TECHNOLOGIES, model: DP832, serial": "firmware",
        },
        "TCPIP::192.168.10.22::INSTR",
        "psu1 is on a network, where anything may answer: give it an identity with model or serial",
    ),
    (
        {PSU1: "port: /dev/usbtmc0", "manufacturer: RIGOL TECHNOLOGIES, model: DP832, serial": "firmware"},
        "/dev/usbtmc0",
        "psu1 is at USB, where anything may answer",
    ),
    ({PSU1: "port: GPIB0::5::INSTR"}, "GPIB0::5::INSTR", "USB and TCPIP are, and GPIB by a gateway"),
    (
        {PSU1: "port: USB0::0x1AB1::0x0E11::DP8C::INSTR", "driver: rigol-dp832": "driver: korad-ka3005p"},
        "USB0::0x1AB1::0x0E11::DP8C::INSTR",
        "korad-ka3005p does not talk in messages, as a port of kind usbtmc takes them",
    ),
    (of_tec('onboard: {device: "00:00"}'), '{device: "00:00"', "tec1 is either a USB device or on board, not both"),
    (
        {"usb: {serial: A50285BK}": 'onboard: {device: "00:00"}', PSU2: 'onboard: {device: "00:00"}'},
        '{device: "00:00"}\n    baud: "9600"',
        "psu2 and tec1 are both plugged in at '00:00'",
    ),
]


@pytest.mark.parametrize(("changes", "at", "message"), MISTAKES)
def test_every_mistake_is_told_where_it_is(tmp_path, changes, at, message):
    """One thing changed in a committed bench is told at its place, with what to write instead."""
    text, told = found(tmp_path, changes)
    assert any(line.startswith(place(text, at, "battery")) and message in line for line in told), told


def test_what_is_not_said_of_a_line_is_8n1():
    """A bench file that says nothing of it is one of most instruments."""
    assert SerialLine() == SerialLine(parity="none", data_bits=8, stop_bits="1", flow="none", rs485=None)


def test_settings_are_read(tmp_path):
    """Every key arrives."""
    line = 'serial_line: {parity: odd, stop_bits: "2", rs485: {rts_on_send: false, before: 2 ms, after: 1 ms}}'
    bench = loaded(tmp_path, of_tec(f"timeout: 450 ms\n    {line}"))
    tec = bench.instrument("tec1")
    rs485 = Rs485(rts_on_send=False, before_s=0.002, after_s=0.001)
    assert (tec.timeout_s, tec.serial_line) == (0.45, SerialLine(parity="odd", stop_bits="2", rs485=rs485))


@pytest.mark.parametrize(
    ("port", "kind"),
    [
        ("/dev/ttyUSB0", PortKind.SERIAL),
        ("ASRL/dev/ttyS0::INSTR", PortKind.SERIAL),
        ("TCPIP::192.168.10.22::5555::SOCKET", PortKind.SOCKET),
        ("socket://psu:5025", PortKind.SOCKET),
        ("rfc2217://server:2000", PortKind.RFC2217),
        ("/dev/usbtmc0", PortKind.USBTMC),
        ("USB0::0x1AB1::0x0E11::DP8C231402017::INSTR", PortKind.USBTMC),
        ("TCPIP::192.168.10.22::INSTR", PortKind.VXI11),
        ("TCPIP0::psu.lab::inst0::INSTR", PortKind.VXI11),
        ("TCPIP::psu.lab::hislip0::INSTR", PortKind.HISLIP),
        ("TCPIP::psu.lab::hislip0,4881::INSTR", PortKind.HISLIP),
        ("GPIB0::5::INSTR", PortKind.OTHER),
        ("spy:///dev/ttyUSB0", PortKind.OTHER),
    ],
)
def test_the_kind_of_a_port(port, kind):
    """By its path, URL or VISA resource name."""
    assert kind_of(port) is kind


@pytest.mark.parametrize(("given", "seconds"), [("timeout: 123 ms", 0.123), ("", 0.5)])
def test_driver_and_guardian_wait_for_a_reply_as_long_as_the_bench_file_says(tmp_path, given, seconds):
    """A bench file that says nothing allows as long as one transaction may take."""
    spec = loaded(tmp_path, of_tec(given) if given else {})
    with closing(bind_simulated(spec, Transcript(None))) as bench:
        bench.roles["thermal"].temperature()
        assert bench.roles["thermal"].safe_bytes("standby").off[0].within_s == seconds
        assert next(port for port in bench.ports if port.device == "tec1").timeout == pytest.approx(seconds, abs=1e-6)
