"""A tapped port over a slow line: a reply is waited for in several operations, none of them longer than allowed."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from hil.clock.virtual import VirtualClock
from hil.wire.tap import LONGEST_TRANSACTION, TappedPort
from hil.wire.transcript import Transcript


class Slow:
    """A far end whose reply comes so many seconds after it was asked for."""

    def __init__(self, clock, reply, after_s):
        self._clock, self._reply, self._after_s = clock, reply, after_s
        self._due_s = 0.0
        self.waited = []

    def write(self, _data):
        """Begin to answer."""
        self._due_s = self._clock.now() + self._after_s

    def exchange(self, data, timeout):
        """Begin to answer, and wait."""
        self.write(data)
        return self.read(1, timeout)

    def read(self, size, timeout):
        """Wait for the reply, or until the timeout."""
        self.waited.append(timeout)
        left_s = self._due_s - self._clock.now()
        self._clock.sleep(max(0.0, min(left_s, timeout)))
        if left_s > timeout:
            return b""
        data, self._reply = self._reply[:size], self._reply[size:]
        return data

    def waiting(self):
        """Return how much has come."""
        return len(self._reply)


def slow(after_s, timeout):
    """Return a port with that timeout, and its far end."""
    clock = VirtualClock()
    end = Slow(clock, b"3.3\n", after_s)
    return TappedPort("psu1", SimpleNamespace(end=end), clock, Transcript(None), timeout), end, clock


def asked(port):
    """Write, and read a line."""
    port.write(b"VOLT?\n")
    return port.read_line()


@pytest.mark.parametrize("ask", [asked, lambda port: port.exchange(b"VOLT?\n")], ids=["line", "exchange"])
@pytest.mark.parametrize(("after_s", "timeout", "came"), [(0.6, 0.5, b""), (0.6, 0.9, b"3.3\n"), (1.9, 2.0, b"3.3\n")])
def test_a_late_reply_is_waited_for_in_operations_of_half_a_second(ask, after_s, timeout, came):
    """All of them together last as long as the timeout; a silence is counted."""
    port, end, clock = slow(after_s, timeout)
    assert ask(port) == came
    assert max(end.waited) <= LONGEST_TRANSACTION
    assert clock.now() == pytest.approx(min(after_s, timeout))
    assert port.silences == (0 if came else 1)


def test_a_moment_in_which_nothing_comes_is_no_silence():
    """A line is listened to in pieces, or until it is quiet, without that a reply is missing."""
    port, _, _ = slow(0.3, 0.1)
    assert asked(port) == b""
    assert port.silences == 0


def test_nothing_is_waited_for_longer_than_two_seconds():
    """Nor for less than none."""
    for seconds in (-0.1, 2.1):
        with pytest.raises(ValueError, match="a timeout is 0 to 2 s"):
            slow(0.1, seconds)
