"""A brake on the ports of a bench: once it is to be driven no more, only operations pass that make it safe."""

from __future__ import annotations

import errno

import pytest

from hil.clock.virtual import VirtualClock
from hil.model.errors import NoReply
from hil.wire.exchange import Brake, Braked
from hil.wire.tap import TappedPort
from hil.wire.transcript import Transcript


class End:
    """A far end that keeps what it is sent, and always answers."""

    def __init__(self):
        self.sent = []
        self.closed = lambda: self.sent.append("closed")

    def write(self, data):
        """Keep it."""
        self.sent.append(data)

    def exchange(self, data, _timeout):
        """Keep it, and answer."""
        self.sent.append(data)
        return b"1\n"

    def read(self, size, _timeout):
        """Answer."""
        return b"1\n"[:size]

    def waiting(self):
        """Return how much there is."""
        return 2


class Opened:
    """A port that is open."""

    def __init__(self, end):
        self.end = end

    def close(self):
        """Close it."""
        self.end.closed()


@pytest.fixture
def end():
    """Return a far end."""
    return End()


@pytest.fixture
def brake():
    """Return a brake."""
    return Brake()


@pytest.fixture
def port(end, brake):
    """Return a port with a tap before a brake."""
    return TappedPort("psu1", Opened(Braked(end, brake)), VirtualClock(), Transcript(None))


OPERATIONS = {
    "write": lambda port: port.write(b"ON\n"),
    "exchange": lambda port: port.exchange(b"ON?\n"),
    "read": lambda port: port.read(1),
}


@pytest.mark.parametrize("operation", OPERATIONS)
def test_nothing_passes_once_somebody_asked_to_stop(end, brake, port, operation):
    """The driver hears of a device that was not asked, and sends nothing on the way to there."""
    asked = []
    with brake.applied(lambda: asked):
        OPERATIONS[operation](port)
        end.sent.clear()
        asked.append("SIGINT")
        with pytest.raises(NoReply, match="psu1: not asked, because somebody asked to stop"):
            OPERATIONS[operation](port)
        assert end.sent == []
        assert port.in_waiting == 2
    OPERATIONS[operation](port)


def test_nothing_passes_once_nobody_looks_after_the_bench(end, brake, port):
    """The driver hears of that, and not of somebody who asked to stop."""
    with (
        brake.applied(lambda: OSError(errno.ECANCELED, "the guardian is gone")),
        pytest.raises(NoReply, match="psu1: not asked, because nobody can look after the bench") as told,
    ):
        port.write(b"ON\n")
    assert not told.value.gone
    assert end.sent == []


def test_what_makes_safe_passes(end, brake, port):
    """While the brake is released it holds nothing, however often it was released; then it holds again."""
    with brake.applied(lambda: True):
        with brake.released():
            with brake.released():
                port.write(b"OFF\n")
            port.write(b"OFF?\n")
        with pytest.raises(NoReply):
            port.write(b"ON\n")
    assert end.sent == [b"OFF\n", b"OFF?\n"]


def test_a_port_that_was_not_asked_is_in_the_record(brake, end):
    """A replay of the record meets the same at the same place."""
    noted = []
    transcript = Transcript(None)
    transcript.note = lambda *told, **more: noted.append((told[1], more.get("error", "")))
    port = TappedPort("psu1", Opened(Braked(end, brake)), VirtualClock(), transcript)
    with brake.applied(lambda: True), pytest.raises(NoReply):
        port.write(b"ON\n")
    port.close()
    assert noted == [("write", "4")]
    assert end.sent == ["closed"]
