"""Ports that carry messages: the executive's stream and the guardian's worker, against instruments of our own."""

from __future__ import annotations

import errno
import os
import socket
import struct
import threading
import time
from contextlib import ExitStack, suppress

import pytest
from message_servers import HiSlipServer, Supply, Vxi11Server

from hil.guardian.ports.dialogue import Patience
from hil.guardian.ports.messages import MessageLine
from hil.guardian.ports.opening import line_on, opened
from hil.guardian.ports.usbtmc import UsbTmc, device_of
from hil.guardian.ports.worker import PortWorker
from hil.instruments.driver import Clamps, Connection
from hil.instruments.keysight_e36300 import KeysightE36300
from hil.model.bench import Wire
from hil.model.errors import NoReply
from hil.model.safing import GuardedPort
from hil.wire.line_stream import LineStream, port_of

IDENTITY = b"Keysight Technologies,E36312A,MY1,2.1\n"
ASK = b"*IDN?;:OUTP? (@1)\n"


class UsbInstrument:
    """The kernel's file of a USB instrument, as two ends of a socket that keeps messages apart."""

    def __init__(self, supply, monkeypatch):
        self.supply = supply
        self._far, near = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.near = near
        self.asked_in_vain = 0
        monkeypatch.setattr("fcntl.ioctl", self._control)
        monkeypatch.setattr("hil.guardian.ports.usbtmc.UsbTmc.opened", lambda _: UsbTmc(os.dup(near.fileno())))
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.near.close()
        self._far.shutdown(socket.SHUT_RDWR)
        self._thread.join(5.0)
        self._far.close()

    def _control(self, descriptor, request, data=b""):
        if request == 0x40045B0A:  # the kernel's limit of a read, in ms
            (limit_ms,) = struct.unpack("I", data)
            assert limit_ms >= 100
            with socket.socket(fileno=os.dup(descriptor)) as it:
                it.setsockopt(
                    socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("ll", limit_ms // 1000, limit_ms % 1000 * 1000)
                )
        elif request != 0x5B02:
            raise OSError(errno.ENOTTY, "Inappropriate ioctl for device")
        elif not self.supply.clearable:
            raise OSError(errno.EPIPE, "Broken pipe")
        else:
            self.supply.clears += 1
            with socket.socket(fileno=os.dup(descriptor)) as it:
                it.setblocking(False)
                try:
                    while it.recv(4096):
                        pass
                except BlockingIOError:
                    it.setblocking(True)
        return 0

    def _serve(self):
        while message := self._far.recv(65536):
            reply = self.supply.reply(message)
            time.sleep(self.supply.delay_s)
            if reply:
                self._far.send(reply)


@pytest.fixture
def supply():
    """Return what is behind the port."""
    return Supply()


@pytest.fixture(params=["usbtmc", "hislip", "vxi11"])
def port(request, supply, monkeypatch):
    """Return a port of each kind, with its instrument."""
    with ExitStack() as stack:
        if request.param == "usbtmc":
            stack.enter_context(UsbInstrument(supply, monkeypatch))
            yield GuardedPort(device="psu", url="/dev/usbtmc0", speaks="usbtmc")
        elif request.param == "hislip":
            server = stack.enter_context(HiSlipServer(supply))
            yield port_of("psu", f"TCPIP::127.0.0.1::hislip0,{server.port}::INSTR")
        else:
            server = stack.enter_context(Vxi11Server(supply))
            monkeypatch.setattr("hil.guardian.ports.vxi11._PORTMAPPER_PORT", server.port)
            yield port_of("psu", "TCPIP::127.0.0.1::INSTR")


@pytest.fixture
def stream(port):
    """Return the executive's stream."""
    made = LineStream(port)
    yield made
    made.closed()


def test_a_question_gets_its_reply(supply, stream):
    """A message there, a message back; nothing is read that was not asked for."""
    assert stream.waiting() == 0
    stream.write(b"*IDN?\n")
    assert stream.read(8, 2.0) == IDENTITY[:8]
    assert stream.waiting() == len(IDENTITY) - 8
    assert stream.read(100, 0.0) == IDENTITY[8:]
    stream.write(b"OUTP 0,(@1)\n")
    assert stream.read(1, 0.05) == b""
    assert (supply.on, supply.heard[-1]) == (False, b"OUTP 0,(@1)\n")


def test_a_reply_that_comes_late_is_never_that_of_the_next_question(supply, stream):
    """The instrument is cleared before it is asked again."""
    stream.write(b"*IDN?\n")
    stream.read(1, 2.0)
    stream.discard()
    before, supply.delay_s = supply.clears, 0.3
    stream.write(b"*IDN?\n")
    assert stream.read(1, 0.1) == b""
    time.sleep(0.3)
    supply.delay_s = 0.0
    stream.write(b"OUTP?\n")
    assert stream.read(2, 2.0) == b"1\n"
    assert supply.clears == before + 1


@pytest.mark.parametrize("port", ["usbtmc", "vxi11"], indirect=True)
def test_a_late_reply_of_an_instrument_that_cannot_be_cleared_is_fetched_and_thrown_away(supply, port):
    """Some firmware refuses it; the port is no worse for that."""
    supply.clearable, supply.delay_s = False, 0.2
    line = opened(port)
    line.say(b"*IDN?\n", time.monotonic() + 2.0)
    assert line.hear(time.monotonic() + 0.1) == b""
    line.say(b"OUTP?\n", time.monotonic() + 2.0)
    assert line.hear(time.monotonic() + 2.0) == b"1\n"
    line.close()


class Clock:
    """The time on the wall."""

    now = staticmethod(time.monotonic)


def safe_bytes(port):
    """Return the bytes that switch a real driver's output off."""
    driver = KeysightE36300(Connection(device="psu", clock=Clock(), clamps=Clamps(), port=port, timeout=0.2))
    return driver.role(Wire(role="supply", instrument="psu", channel=1)).safe_bytes("off")


def test_the_guardian_switches_off_and_proves(supply, port, stream):
    """With the executive's port open beside it, and a question of the executive's unanswered."""
    code = safe_bytes(object())
    stream.write(b"*IDN?\n")
    worker = PortWorker(port, os.dup(stream.fileno()))
    assert worker.begin(code, Patience(), reopen=False).result(10.0).ok
    assert worker.off(code, Patience()).result(10.0).detail == ""
    proof = worker.prove(code).result(10.0)
    assert (proof.ok, supply.on) == (True, False), proof.detail
    supply.on = True
    assert not worker.prove(code).result(10.0).ok
    worker._lose("the end")
    worker._thread.shutdown()


def test_a_port_that_is_gone_is_told(supply):
    """The executive learns it as of every stream; the guardian opens a new session."""
    with HiSlipServer(supply) as server:
        port = port_of("psu", f"TCPIP::127.0.0.1::hislip0,{server.port}::INSTR")
        stream = LineStream(port)
        worker = PortWorker(port, os.dup(stream.fileno()))
        server.drop()
        with pytest.raises(OSError, match="hung up|reset|Broken pipe"):
            for _ in range(3):
                stream.exchange(b"*IDN?\n", 0.5)
        stream.closed()
        code = safe_bytes(object())
        while not worker.begin(code, Patience(), reopen=True).result(10.0).ok:
            pass
        worker.off(code, Patience()).result(10.0)
        assert worker.prove(code).result(10.0).ok
        worker._lose("the end")
        worker._thread.shutdown()


def test_hislip_takes_only_the_reply_with_the_number_of_its_question(supply):
    """In pieces too; one of an older question is passed over."""
    with HiSlipServer(supply) as server:
        server.split, server.stale = True, b"0\n"
        line = opened(port_of("psu", f"TCPIP::127.0.0.1::hislip0,{server.port}::INSTR"))
        line.say(b"OUTP?\n", time.monotonic() + 2.0)
        assert line.hear(time.monotonic() + 2.0) == b"1\n"
        line.close()


def test_what_a_vxi_11_instrument_refuses_is_told(supply):
    """In words, and a message longer than it takes at once arrives whole."""
    with Vxi11Server(supply) as server:
        line = opened(GuardedPort(device="psu", url=f"vxi11://127.0.0.1:{server.port}/inst0", speaks="vxi11"))
        line.say(ASK, time.monotonic() + 2.0)
        assert line.hear(time.monotonic() + 2.0) == IDENTITY[:-1] + b";1\n"
        assert supply.heard == [ASK]
        server.error = 11
        with pytest.raises(Exception, match="another session has locked it"):
            line.say(ASK, time.monotonic() + 2.0)
        line.close()


@pytest.mark.parametrize(("speaks", "why"), [("hislip", "HiSLIP"), ("vxi11", "ONC RPC")])
def test_what_speaks_something_else_is_told(speaks, why):
    """A SCPI socket at that port, say."""
    listening = socket.create_server(("127.0.0.1", 0))

    def serve():
        connection, _ = listening.accept()
        with listening, connection, suppress(OSError):
            connection.sendall(b"\x80\0\0\x10 not what was expected here\n")
            while connection.recv(4096):
                pass

    threading.Thread(target=serve, daemon=True).start()
    url = f"{speaks}://127.0.0.1:{listening.getsockname()[1]}/x"
    with pytest.raises(NoReply, match=f"psu: {url} cannot be opened: it does not speak {why}"):
        LineStream(GuardedPort(device="psu", url=url, speaks=speaks))


def test_nothing_is_read_that_was_not_asked_for():
    """Reading without a question is an error of a USB instrument, and some do not survive it."""

    class Untouched:
        descriptor = -1

        def __getattr__(self, name):
            raise AssertionError(name)

    line = MessageLine(Untouched())
    began = time.monotonic()
    assert line.hear(0.0) == b""
    assert line.hear(began + 0.02) == b""
    assert time.monotonic() >= began + 0.02


@pytest.fixture
def system(tmp_path):
    """Return a sysfs with two instruments."""
    for number, serial in enumerate(("DP8C1", "DP8C2")):
        device = tmp_path / f"device{number}"
        (device / "interface").mkdir(parents=True)
        for name, text in (("idVendor", "1ab1"), ("idProduct", "0e11"), ("serial", serial)):
            (device / name).write_text(f"{text}\n")
        (tmp_path / f"usbtmc{number}").mkdir()
        (tmp_path / f"usbtmc{number}" / "device").symlink_to(device / "interface")
    return tmp_path


def test_a_usb_instrument_is_found_by_who_it_is(system):
    """As VISA names it, whatever number the kernel gave it."""
    url = port_of("psu", "USB0::0x1AB1::0x0E11::DP8C2::INSTR").url
    assert device_of(url, system) == "/dev/usbtmc1"
    assert device_of("/dev/usbtmc7", system) == "/dev/usbtmc7"
    with pytest.raises(OSError, match="there is usbtmc0: 0x1AB1:0x0E11:DP8C1, usbtmc1: 0x1AB1:0x0E11:DP8C2"):
        device_of("usbtmc://0x1AB1:0x0E11:DP8C3", system)
    (system / "device0" / "serial").write_text("DP8C2")
    with pytest.raises(OSError, match="two such instruments"):
        device_of(url, system)


def test_a_usb_instrument_that_is_not_there_is_told():
    """With what there is instead."""
    with pytest.raises(NoReply, match="no such instrument is there; there is none"):
        LineStream(port_of("psu", "USB0::0x1AB1::0x0E11::DP8C2::INSTR"))


def test_a_read_that_fails_for_good_is_no_silence(monkeypatch):
    """An unplugged instrument is gone."""

    def fail(*_):
        raise OSError(errno.ENODEV, "No such device")

    monkeypatch.setattr("hil.guardian.ports.usbtmc.UsbTmc._limit", lambda *_: None)
    monkeypatch.setattr("os.read", fail)
    with pytest.raises(OSError, match="No such device"):
        UsbTmc(-1).receive(0.1)


@pytest.mark.parametrize(
    ("name", "url"),
    [
        ("TCPIP::psu.lab::INSTR", "vxi11://psu.lab/inst0"),
        ("TCPIP0::[fe80::1]::inst1::INSTR", "vxi11://[fe80::1]/inst1"),
        ("TCPIP::gateway::gpib0,5::INSTR", "vxi11://gateway/gpib0,5"),
        ("TCPIP::psu.lab::hislip0::INSTR", "hislip://psu.lab/hislip0"),
        ("TCPIP::psu.lab::hislip1,4881::INSTR", "hislip://psu.lab:4881/hislip1"),
        ("USB::0x1AB1::0x0E11::DP8C::0::INSTR", "usbtmc://0x1AB1:0x0E11:DP8C"),
    ],
)
def test_visa_names(name, url):
    """As an engineer finds them in the instrument's manual."""
    assert port_of("psu", name).url == url


def test_a_session_of_ones_own_is_opened_beside_the_executives(supply):
    """The descriptor that was passed is closed: its numbers are the executive's."""
    with HiSlipServer(supply) as server:
        port = port_of("psu", f"TCPIP::127.0.0.1::hislip0,{server.port}::INSTR")
        spare, other = socket.socketpair()
        with other:
            line = line_on(spare.detach(), port)
            assert other.recv(1) == b""
        line.close()
