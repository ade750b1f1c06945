"""A simulated byte stream behaves as a serial port does, on virtual time."""

from __future__ import annotations

import pytest
import serial
from echo import EchoPeer

from hil.clock.port import ClockError
from hil.clock.virtual import VirtualClock
from hil.model.errors import NoReply, Refused
from hil.wire.exchange import publish_stream, withdraw
from hil.wire.opening import open_port, url_of_resource
from hil.wire.simulated_line import SimulatedLine
from hil.wire.transcript import Transcript

URL = "sim://wire-test/echo"


@pytest.fixture
def bench():
    """A port to an echo that takes 2 ms, at 9600 baud."""
    clock = VirtualClock()
    peer = EchoPeer(delay_ns=2_000_000)
    line = SimulatedLine("echo", peer, clock, baud=9600, buffer=16)
    peer.attach(line, clock)
    publish_stream(URL, line)
    port = open_port("echo", URL, clock, Transcript(None), timeout=0.3)
    yield clock, peer, line, port
    port.close()
    withdraw("sim://wire-test/")


def test_bits_take_their_time_in_both_directions(bench):
    """Four bytes at 9600 baud take 4.17 ms each way, and the peer 2 ms."""
    clock, _, _, port = bench
    port.write(b"abcd")
    assert port.read(4) == b"abcd"
    assert clock.now() == pytest.approx(2 * 4 * 10 / 9600 + 0.002, abs=1e-6)


def test_a_read_without_an_answer_ends_at_its_timeout(bench):
    """Silence costs virtual time, not wall time, and gives what came."""
    clock, _, _, port = bench
    assert port.read(1) == b""
    assert clock.now() == pytest.approx(0.3)


def test_what_is_not_fetched_overflows(bench):
    """The buffer is finite, and what is lost is counted."""
    clock, _, line, port = bench
    port.write(b"x" * 20)
    clock.sleep(0.2)
    assert port.in_waiting == 16
    assert line.lost == 4


def test_lines_are_cut_at_their_terminator(bench):
    """What follows the terminator stays for the next read."""
    _, _, _, port = bench
    port.write(b"one\ntwo\nthr")
    assert [port.read_line(), port.read_line(), port.read_line()] == [b"one\n", b"two\n", b"thr"]


def test_polling_without_waiting_is_found(bench):
    """A loop that looks for ever and lets no time pass is an error that names the device."""
    _, _, _, port = bench
    with pytest.raises(ClockError, match="echo is polled for ever"):
        for _ in range(100_002):
            port._end.waiting()


def test_the_stream_is_an_ordinary_pyserial_port():
    """Once a port was opened, anything written for pyserial reaches the peer by its URL, read_until included."""
    clock = VirtualClock()
    peer = EchoPeer()
    line = SimulatedLine("echo", peer, clock)
    peer.attach(line, clock)
    publish_stream(URL, line)
    open_port("echo", URL, clock, Transcript(None)).close()
    with serial.serial_for_url(URL, timeout=1) as port:
        port.write(b"hello\n")
        assert port.read_until(b"\n") == b"hello\n"
        assert port.read_until(b"\n") == b""
        port.timeout = None
        with pytest.raises(serial.SerialException, match="without a timeout"):
            port.read(1)
    with pytest.raises(serial.PortNotOpenError):
        port.write(b"late")
    withdraw("sim://wire-test/")


def test_a_pulse_of_dtr_is_noticed_once_it_rises():
    """A peer that can notice is told as by opening; what was received stays, and one that cannot is not asked."""
    clock, at = VirtualClock(), []

    class Board(EchoPeer):
        def opened(self):
            """Note when."""
            at.append(clock.now())

    for peer in (Board(), EchoPeer()):
        line = SimulatedLine("board", peer, clock)
        peer.attach(line, clock)
        publish_stream(URL, line)
        port = open_port("board", URL, clock, Transcript(None))
        port.write(b"ab")
        port.pulse_dtr()
        assert port.read(2) == b"ab"
        port.close()
        withdraw("sim://wire-test/")
    assert at == [0.0, 0.1]


def test_a_url_without_a_world_is_a_dead_port():
    """A port that is not there is a fault that names the device."""
    with pytest.raises(NoReply, match="psu1: sim://nowhere/psu1 cannot be opened"):
        open_port("psu1", "sim://nowhere/psu1", VirtualClock(), Transcript(None))


def test_one_url_serves_one_world(bench):
    """Two benches of one name in a process are refused instead of mixed."""
    _, _, line, _ = bench
    with pytest.raises(Refused, match="in use"):
        publish_stream(URL, line)


def test_timeouts_longer_than_a_reply_may_take_are_refused(bench):
    """A reply is waited for in operations of half a second, and not for longer than 2 s."""
    _, _, _, port = bench
    with pytest.raises(ValueError, match="0 to 2 s"):
        port.timeout = 2.1


@pytest.mark.parametrize(
    ("name", "url"),
    [
        ("TCPIP::192.168.1.9::5025::SOCKET", "socket://192.168.1.9:5025"),
        ("tcpip0::psu.local::5555::socket", "socket://psu.local:5555"),
        ("ASRL/dev/ttyUSB0::INSTR", "/dev/ttyUSB0"),
        ("/dev/ttyACM0", "/dev/ttyACM0"),
        ("sim://adcs/psu1", "sim://adcs/psu1"),
    ],
)
def test_visa_names_become_urls(name, url):
    """The names in a lab's notebooks work in the bench file."""
    assert url_of_resource(name) == url
