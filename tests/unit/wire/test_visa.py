"""Ports that PyVISA opens, with PyVISA-py over loopback, a pseudo-terminal, and the guardian beside it."""

from __future__ import annotations

import builtins
import os
import select
import termios
import threading
import time
import tty
from contextlib import contextmanager, suppress
from dataclasses import replace

import pytest
from message_servers import HiSlipServer, SocketServer, Supply, Vxi11Server

from hil.guardian.ports.dialogue import Patience
from hil.guardian.ports.worker import PortWorker
from hil.model.errors import NoReply
from hil.model.safing import Exchange, SafeBytes
from hil.wire.keys import keys_of_this_port
from hil.wire.line_stream import port_of
from hil.wire.opening import PortKind, kind_of, url_of_resource, why_not_opened
from hil.wire.visa import VisaStream, why_not_shared

IDENTITY = b"Keysight Technologies,E36312A,MY1,2.1\n"
OFF = SafeBytes(
    off=(Exchange(send=b"OUTP 0\n"),), proof=(Exchange(send=b"OUTP?\n", expect=rb"^0\n", within_s=0.5),), owed_s=0.05
)


@contextmanager
def _closing(stream):
    try:
        yield stream
    finally:
        stream.closed()


@pytest.fixture(params=["HiSLIP", "VXI-11", "socket"])
def instrument(request, monkeypatch):
    """Return a supply on the network, its server, and its VISA name."""
    supply = Supply()
    if request.param == "HiSLIP":
        with HiSlipServer(supply) as server:
            yield supply, server, f"TCPIP::127.0.0.1::hislip0,{server.port}::INSTR"
    elif request.param == "VXI-11":
        with Vxi11Server(supply) as server:
            monkeypatch.setattr("pyvisa_py.protocols.rpc.PMAP_PORT", server.port)
            monkeypatch.setattr("hil.guardian.ports.vxi11._PORTMAPPER_PORT", server.port)
            yield supply, server, "TCPIP::127.0.0.1::INSTR"
    else:
        with SocketServer(supply) as server:
            yield supply, server, f"TCPIP::127.0.0.1::{server.port}::SOCKET"


def test_an_instrument_is_asked_and_told(instrument):
    """Bytes in and out as of every stream; a lost session is an error, and hangs up."""
    supply, server, name = instrument
    with _closing(VisaStream("psu1", f"visa:{name}")) as stream:
        assert stream.exchange(b"*IDN?\n", 5.0) == IDENTITY
        stream.write(b"OUTP 0\n")
        assert stream.exchange(b"OUTP?\n", 5.0) == b"0\n"
        assert not supply.on
        server.drop()
        with pytest.raises(OSError, match="VISA session was lost"):
            for _ in range(3):  # a socket takes the first bytes after its end
                stream.exchange(b"*IDN?\n", 0.05)
        assert select.select([stream.fileno()], [], [], 0)[0]


@pytest.mark.parametrize("waits", [0.0, 0.2], ids=["comes during the clear", "is here"])
def test_a_late_reply_is_not_taken_for_the_next(waits):
    """PyVISA-py's clear of HiSLIP breaks off at one: it is fetched first, or a session of its own begins."""
    supply = Supply()
    with (
        HiSlipServer(supply) as server,
        _closing(VisaStream("psu1", f"visa:TCPIP::127.0.0.1::hislip0,{server.port}::INSTR")) as stream,
    ):
        supply.delay_s = 0.1
        assert stream.exchange(b"*IDN?\n", 0.03) == b""
        supply.delay_s = 0.0
        time.sleep(waits)
        stream.write(b"OUTP?\n")
        assert stream.read(2, 5.0) == b"1\n"


def test_a_serial_line_is_opened_at_its_speed():
    """A pseudo-terminal, by PyVISA-py's serial session."""
    supply = Supply()
    far, near = os.openpty()
    tty.setraw(near)

    def serve():
        with suppress(OSError):
            while data := os.read(far, 100):
                os.write(far, supply.reply(data))

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    with _closing(VisaStream("psu1", f"visa:ASRL{os.ttyname(near)}::INSTR", 115_200)) as stream:
        assert stream.exchange(b"*IDN?\n", 5.0) == IDENTITY
        assert stream.exchange(b"OUTP?\n", 5.0) == b"1\n"
        speed = termios.tcgetattr(near)[5]
    os.close(near)
    thread.join(5.0)
    os.close(far)
    assert speed == termios.B115200


def test_the_guardian_has_a_connection_of_its_own(instrument):
    """The run's session is open and mute: what is safe is proven beside it, without PyVISA."""
    supply, _, name = instrument
    with _closing(VisaStream("psu1", f"visa:{name}")) as stream:
        stream.exchange(b"*IDN?\n", 5.0)
        port = port_of("psu1", f"visa:{name}")
        assert port == replace(port_of("psu1", name), apart=True)
        worker = PortWorker(port, os.dup(stream.fileno()))
        try:
            begun = worker.begin(OFF, Patience(), reopen=True).result(5.0)
            assert begun.ok, begun.detail
            assert worker.off(OFF, Patience()).result(5.0).ok
            assert worker.prove(OFF).result(5.0).ok
        finally:
            worker.drop_everything()
            worker._lose("the test has ended")
        assert not supply.on


@pytest.mark.parametrize(
    ("port", "why"),
    [
        ("TCPIP::h::INSTR", ""),
        ("visa:TCPIP::h::INSTR", ""),
        ("visa:TCPIP::h::5025::SOCKET", ""),
        ("visa:ASRL/dev/ttyS0::INSTR", ""),
        ("visa:USB0::0x1AB1::0x0E11::DP8::INSTR", "keeps for the run alone: write its port without 'visa:'"),
        ("visa:GPIB0::5::INSTR", "a gateway is TCPIP::HOST::gpib0,5"),
        ("visa:ASRL1::INSTR", "only PyVISA"),
    ],
)
def test_what_the_guardian_cannot_reach_is_told(port, why):
    """Where a library of others keeps the only way, the bench is not armed."""
    told = why_not_shared(port)
    assert why in told
    assert bool(told) == bool(why)


@pytest.mark.parametrize(
    ("name", "same"),
    [
        ("TCPIP::192.0.2.7::5025::SOCKET", "socket://192.0.2.7:5025"),
        ("TCPIP::192.0.2.7::hislip0::INSTR", "socket://192.0.2.7:5025"),
        ("USB0::0x1AB1::0x0E11::DP8::INSTR", "USB1::6833::3601::DP8"),
        ("ASRL/dev/null::INSTR", "/dev/null"),
        ("GPIB0::5::INSTR", "visa:gpib0::5::instr"),
    ],
)
def test_the_lease_is_that_of_the_instrument(name, same):
    """Who opens it makes no other instrument of it."""
    assert set(keys_of_this_port(f"visa:{name}")) & set(keys_of_this_port(same))
    assert kind_of(f"VISA:{name}") is PortKind.VISA
    assert url_of_resource(f"visa:{name}") == url_of_resource(name)


@pytest.mark.parametrize("port", ["visa:", "visa:/dev/ttyS0", "visa:ASRLspy:///dev/ttyS0::INSTR", "visa:ASRL/dev/../x"])
def test_what_does_not_look_like_a_name_is_refused(port):
    """PyVISA-py would hand a URL on to pyserial, past every check of who is there."""
    assert "does not look like visa:" in why_not_opened(port)
    assert why_not_opened("visa:GPIB0::5::INSTR") == ""
    assert "visa:GPIB0::5::INSTR" in why_not_opened("GPIB0::5::INSTR")


def test_without_pyvisa_it_says_what_to_install(monkeypatch):
    """The extra."""
    there = builtins.__import__

    def absent(name, *more):
        if name == "pyvisa":
            raise ImportError(name)
        return there(name, *more)

    monkeypatch.setattr(builtins, "__import__", absent)
    with pytest.raises(NoReply, match=r"psu1: visa:GPIB0::5::INSTR needs PyVISA.*pip install 'hil\[visa\]'"):
        VisaStream("psu1", "visa:GPIB0::5::INSTR")


def test_what_pyvisa_cannot_open_is_told_in_a_line():
    """Its messages have several."""
    with pytest.raises(NoReply, match="visa:GPIB0::5::INSTR cannot be opened by PyVISA") as told:
        VisaStream("psu1", "visa:GPIB0::5::INSTR")
    assert "\n" not in str(told.value)
