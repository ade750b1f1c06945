"""Serial lines on the network (RFC 2217): the executive's stream and the guardian's line against pyserial's server."""

from __future__ import annotations

import os
import socket
import threading
import time
from contextlib import closing

import pytest
from hypothesis import given
from hypothesis import strategies as st
from serial_server import SerialServer

from hil.guardian.ports.dialogue import Patience
from hil.guardian.ports.opening import line_on, opened
from hil.guardian.ports.telnet import Telnet, TelnetLine
from hil.guardian.ports.worker import PortWorker
from hil.model.errors import NoReply
from hil.model.safing import Exchange, GuardedPort, SafeBytes
from hil.model.serial_line import SerialLine
from hil.wire.line_stream import LineStream, port_of

EVERY_BYTE = bytes(range(256))
LINE = SerialLine(parity="even", data_bits=7, stop_bits="2", flow="rts/cts")


@pytest.fixture
def server():
    """Return a server."""
    with SerialServer() as made:
        yield made


@pytest.fixture
def stream(server):
    """Return the executive's stream to it."""
    made = LineStream(port_of("psu", server.url, 19200))
    yield made
    made.closed()


def known(server, **more):
    """Return the port as the guardian knows it."""
    return GuardedPort(device="psu", url=server.url, baud=19200, speaks="telnet", **more)


def all_of(line, size):
    """Return what a line of the guardian hears."""
    heard, until = b"", time.monotonic() + 5.0
    while len(heard) < size and time.monotonic() < until:
        heard += line.hear(until)
    return heard


@pytest.mark.parametrize("by", ["executive", "guardian"])
def test_the_server_is_told_how_the_line_is_set(server, by):
    """Both sides set all of it, and wait until the server has said that it is done."""
    if by == "executive":
        LineStream(port_of("psu", server.url, 19200, LINE)).closed()
    else:
        opened(known(server, line=LINE)).close()
    line = server.line
    assert (line.baudrate, line.parity, line.bytesize, line.stopbits, line.rtscts) == (19200, "E", 7, 2, True)


def test_every_byte_arrives_as_it_was_sent(stream):
    """Also the one that begins a command of Telnet, in both directions."""
    stream.write(EVERY_BYTE + b"\xff\xff\xf0")
    assert stream.read(259, 5.0) == EVERY_BYTE + b"\xff\xff\xf0"
    assert stream.read(1, 0.0) == b""


def test_an_exchange_waits_and_what_is_there_can_be_discarded(stream):
    """As on every stream."""
    assert stream.exchange(b"\xffOFF", 5.0).startswith(b"\xff")
    stream.write(b"late")
    stream.read(1, 5.0)
    stream.discard()
    assert stream.waiting() == 0


def test_the_guardian_talks_on_the_executives_connection(server, stream):
    """Nobody else reads there; what the executive was in the middle of is discarded."""
    line = line_on(os.dup(stream.fileno()), known(server))
    assert isinstance(line, TelnetLine)
    line.say(EVERY_BYTE, time.monotonic() + 5.0)
    assert all_of(line, 256) == EVERY_BYTE
    line.close()
    stream.write(b"still open")
    assert stream.read(10, 5.0) == b"still open"


def test_the_guardian_reopens_a_lost_line_and_proves(server, stream):
    """The settings are given again, and the proof has the byte that must be escaped."""
    proof = SafeBytes(
        off=(Exchange(send=b"\x01\x05\x00\x00\xff\x00", expect=rb"\x01\x05\x00\x00\xff\x00", within_s=2.0),),
        proof=(Exchange(send=b"\xff?", expect=rb"\xff\?", within_s=2.0),),
    )
    worker = PortWorker(known(server, line=LINE), os.dup(stream.fileno()))
    server.drop()
    server.line.baudrate = 1200
    while not worker.begin(proof, Patience(), reopen=True).result(5.0).ok:
        pass
    assert worker.off(proof, Patience()).result(5.0).detail == ""
    assert worker.prove(proof).result(5.0).ok
    assert (server.line.baudrate, server.line.parity) == (19200, "E")
    worker._lose("the end")
    worker._thread.shutdown()


def test_dtr_falls_and_rises_at_the_server(server, stream):
    """A board that is reset by it hangs there."""
    stream.dtr_rose()
    stream.write(b".")
    stream.read(1, 5.0)
    assert server.levels == [False, True]


def answering(*answers):
    """Return the URL of a server that answers the first bytes of one connection, then the next, and reads on."""
    listening = socket.create_server(("127.0.0.1", 0))

    def serve():
        connection, _ = listening.accept()
        with listening, connection:
            for answer in answers:
                connection.recv(4096)
                connection.sendall(answer)
            while connection.recv(4096):
                pass

    threading.Thread(target=serve, daemon=True).start()
    return f"rfc2217://127.0.0.1:{listening.getsockname()[1]}"


AGREED = bytes((255, 253, 44, 255, 253, 0, 255, 251, 0))


@pytest.mark.parametrize(
    ("answers", "why"),
    [
        ((bytes((255, 254, 44)),), "does not set lines"),
        ((bytes((255, 252, 0)),), "does not pass every byte"),
        ((AGREED, bytes((255, 250, 44, 101, 0, 0, 4, 176, 255, 240))), "it set 000004b0 where 00004b00 was asked for"),
        ((b'+0,"No error"\n',), "does not speak RFC 2217"),
        ((AGREED,), "has not confirmed the settings"),
    ],
)
def test_a_server_that_does_not_set_the_line_is_not_used(monkeypatch, answers, why):
    """At another speed nothing, or something else, would be understood."""
    monkeypatch.setattr("hil.guardian.ports.opening._AGREE_S", 0.1)
    with pytest.raises(NoReply, match=f"psu: rfc2217://.* cannot be opened: .*{why}"):
        LineStream(port_of("psu", answering(*answers), 19200))


def test_a_server_that_is_not_there_is_told():
    """With where it was looked for."""
    with pytest.raises(NoReply, match="rfc2217://127.0.0.1:1 cannot be opened: Connection refused"):
        LineStream(port_of("psu", "rfc2217://127.0.0.1:1"))


def test_a_connection_that_ended_is_an_error(server, stream):
    """Not silence: the executive makes safe what it can reach."""
    server.drop()
    with pytest.raises(OSError, match="hung up"):
        stream.read(1, 5.0)


@given(data=st.binary(max_size=64), cuts=st.lists(st.integers(0, 128), max_size=4))
def test_whatever_is_escaped_comes_out_again_however_it_is_cut(data, cuts):
    """A command between the pieces says nothing of the data."""
    sent, telnet, heard, begin = Telnet.escaped(data), Telnet(), b"", 0
    for cut in sorted({min(cut, len(sent)) for cut in cuts} | {len(sent)}):
        heard += telnet.plain(sent[begin:cut])
        begin = cut
    heard += telnet.plain(bytes((255, 241, 255, 250, 44, 107, 255, 255, 255, 240)))
    assert heard == data
    assert telnet.answers == b""


def test_what_the_server_asks_for_is_refused():
    """It gets an answer to each, once."""
    telnet = Telnet()
    assert telnet.plain(bytes((255, 253, 24, 255, 251, 31, 255, 251, 1))) == b""
    assert telnet.answers == bytes((255, 252, 24, 255, 254, 31, 255, 253, 1))


def test_half_an_escape_is_completed_before_anything_else():
    """A full buffer may take the first half only; the next byte must not become a command."""
    far, near = socket.socketpair()
    with closing(far):
        near.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1)
        line = TelnetLine(near.detach())
        while line.say(b"\xff" * 999, time.monotonic() + 0.01) == 999:
            pass
        far.settimeout(0.05)
        heard = bytearray()

        def drain():
            try:
                while data := far.recv(65536):
                    heard.extend(data)
            except TimeoutError:
                pass

        drain()
        line.say(b"OFF", time.monotonic() + 1.0)
        drain()
        line.close()
    assert Telnet().plain(bytes(heard)).endswith(b"\xffOFF")
