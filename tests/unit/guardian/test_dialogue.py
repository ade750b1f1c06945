"""Bytes on real descriptors: silence, replies among other words, limits, and lines that are stuck or gone."""

from __future__ import annotations

import os
import socket
import termios
import threading
import time
import tty

import pytest

from hil.guardian.ports.dialogue import Dialogue, Patience
from hil.guardian.ports.line import Gone, Interrupted, Line
from hil.guardian.ports.opening import opened
from hil.model.safing import Exchange, GuardedPort


class Far:
    """The far end of a line."""

    def __init__(self, kind: str) -> None:
        self._sockets: tuple[socket.socket, ...] = ()
        if kind == "terminal":
            self.descriptor, self.near = os.openpty()
            tty.setraw(self.near)
        else:
            self._sockets = socket.socketpair()
            self.descriptor, self.near = (each.fileno() for each in self._sockets)
        self.closed = False

    def say(self, data: bytes) -> None:
        """Write."""
        assert os.write(self.descriptor, data) == len(data)

    def hear(self, count: int = 1) -> bytes:
        """Return what comes, at least so many bytes."""
        came = b""
        while len(came) < count:
            came += os.read(self.descriptor, 4096)
        return came

    def close(self) -> None:
        """Hang up."""
        if not self.closed:
            self.closed = True
            os.close(self.descriptor)

    def end(self) -> None:
        """Close everything."""
        self.close()
        if not self._sockets:
            os.close(self.near)
        else:
            self._sockets[0].detach()
            self._sockets[1].close()


@pytest.fixture(params=["terminal", "connection"])
def far(request):
    """Return the far end of a terminal or of a connection, with blocking descriptors as the kernel makes them."""
    end = Far(request.param)
    yield end
    end.end()


@pytest.fixture
def line(far):
    """Return the line to it."""
    made = Line(os.dup(far.near))
    yield made
    made.close()


@pytest.fixture
def talk(line):
    """Return who talks on the line."""
    return Dialogue(line)


def answering(far, reply):
    """Answer in a thread whatever comes first."""

    def answer():
        far.hear()
        far.say(reply)

    thread = threading.Thread(target=answer)
    thread.start()
    return thread


def test_a_reply_is_found_among_other_words(far, talk):
    """What the instrument says by itself stands before and after."""
    thread = answering(far, b"3.7;1.2\nOFF ok\n3.7;0.0\n")
    assert talk.make(Exchange(send=b"OFF\n", expect=rb"OFF ok\n", within_s=5.0), Patience()) == ""
    thread.join()


def test_a_reply_may_come_in_pieces(far, talk):
    """What came before a piece is kept."""
    far.say(b"stat")
    exchange = Exchange(send=b"", expect=rb"state (\d)\n", within_s=0.05)
    assert "said b'stat'" in talk.make(exchange, Patience())
    far.say(b"e 0\n")
    assert talk.make(exchange, Patience()) == ""


@pytest.mark.parametrize(
    ("expect", "told"),
    [
        (rb"(?:\A|\n)ID name=(\S+) serial=(\S+) boots=\d+\n", b"cycler C0001"),
        (rb"ID [^\n]+\n", b"ID name=cycler serial=C0001 boots=7\n3.7;0.0\n"),
        (rb"ID nobody\n", b""),
    ],
)
def test_who_it_is_is_what_the_groups_hold_or_the_whole_reply(far, talk, expect, told):
    """An instrument that has restarted, or talks unasked, is still the same one."""
    thread = answering(far, b"3.7;1.2\nID name=cycler serial=C0001 boots=7\n3.7;0.0\n")
    assert talk.told(Exchange(send=b"ID\n", expect=expect, within_s=0.3)) == told
    thread.join()


def test_words_from_before_the_bytes_are_no_reply(far, talk):
    """A stale line that looks like the reply proves nothing."""
    far.say(b"on 0\n")
    wrong = talk.make(Exchange(send=b"on?\n", expect=rb"on 0\n", within_s=0.05), Patience())
    assert wrong == r"said nothing, not b'on 0\\n'"
    assert far.hear(4) == b"on?\n"


def test_a_reply_is_used_once(far, talk):
    """Who waits for two lines does not take one for both."""
    far.say(b"S\nV\n")
    first, second = Exchange(send=b"", expect=rb"S\n"), Exchange(send=b"", expect=rb"V\n")
    assert talk.make(first, Patience()) == ""
    assert talk.make(first, Patience(0.0)).startswith(r"said b'V\n'")
    assert talk.make(second, Patience()) == ""


@pytest.mark.parametrize(
    ("said", "holds"), [("0.02", True), ("-0.02", True), ("0.2", False), ("nan", False), ("x", False)]
)
def test_a_number_must_be_between(far, talk, said, holds):
    """The first group of the reply is compared; what is no number is not."""
    far.say(b"I=%b\n" % said.encode())
    exchange = Exchange(send=b"", expect=rb"I=([^\n]*)\n", within_s=0.05, between=(-0.1, 0.1))
    assert (talk.make(exchange, Patience()) == "") is holds


def test_the_newest_number_counts(far, talk):
    """A reading of before that was good does not hide a present one that is not."""
    far.say(b"I=0.0\nI=1.5\n")
    exchange = Exchange(send=b"", expect=rb"I=([^\n]*)\n", within_s=0.05, between=(-0.1, 0.1))
    assert talk.make(exchange, Patience()) == r"said b'I=1.5\n', which is not from -0.1 to 0.1"
    far.say(b"I=0.0\n")
    assert talk.make(exchange, Patience()) == ""


def test_bytes_wait_for_silence(far, talk):
    """The quiet gap counts from the last byte of either side."""
    exchange = Exchange(send=b"x", quiet_s=0.05)
    began = time.monotonic()
    talk.resync((exchange, exchange), Patience())
    assert time.monotonic() - began >= 0.1
    assert far.hear(2) == b"xx"


def test_what_nobody_has_fetched_yet_is_no_silence(far, talk, line):
    """Bytes that wait to be read may have come just now."""
    line.busy_until = 0.0
    far.say(b"late reply")
    began = time.monotonic()
    talk.make(Exchange(send=b"x", quiet_s=0.05), Patience())
    assert time.monotonic() - began >= 0.05


def test_a_line_that_is_never_silent_is_written_to_all_the_same(far):
    """What chatters without end must hear the command, too."""

    class Chattering(Line):
        def hear(self, until):
            self.busy_until = time.monotonic()
            return b"chatter"

    talk = Dialogue(Chattering(os.dup(far.near)))
    talk.resync((Exchange(send=b"off", quiet_s=0.02, within_s=0.02),), Patience())
    talk.line.close()
    assert far.hear(3) == b"off"


def test_a_resync_throws_away_what_came(far, talk):
    """After it nothing of before is taken for a reply."""
    far.say(b"on 0\n")
    talk.resync((Exchange(send=b"\n"),), Patience())
    assert talk.make(Exchange(send=b"", expect=rb"on 0", within_s=0.0), Patience()).startswith("said nothing")


def test_what_takes_no_bytes_is_waited_for_in_vain_only_so_long(talk, line):
    """A line whose far end reads nothing takes what fits, and nobody hangs in writing to it."""
    began = time.monotonic()
    while line.say(b"x" * 65_536, time.monotonic() + 0.05) > 0:
        assert time.monotonic() - began < 30.0
    wrong = talk.make(Exchange(send=b"off", within_s=0.05), Patience())
    assert wrong == "took 0 of 3 bytes"


def test_patience_is_shared():
    """What was waited in vain is not waited again."""
    patience = Patience(0.25)
    assert patience.of(0.2) == 0.2
    patience.spent(0.2)
    assert patience.of(0.2) == pytest.approx(0.05)
    patience.spent(0.2)
    assert patience.of(0.2) == 0.0


def test_without_patience_bytes_are_sent_and_nothing_is_awaited(far, talk):
    """The command goes out, whatever came of the exchange before it."""
    patience = Patience(0.0)
    assert talk.make(Exchange(send=b"off\n", expect=b"ok", within_s=60.0), patience).startswith("said nothing")
    assert far.hear(4) == b"off\n"


def test_a_hang_up_is_known(far, talk):
    """Neither reading nor writing waits for it."""
    far.close()
    with pytest.raises(Gone):
        talk.make(Exchange(send=b"", expect=b"x", within_s=5.0), Patience())
    with pytest.raises(Gone):
        talk.make(Exchange(send=b"off", within_s=5.0), Patience())


def test_a_wait_can_be_interrupted(far):
    """What is more urgent does not wait for a port that says nothing."""
    interrupt = threading.Event()
    line = Line(os.dup(far.near), 0, interrupt)
    interrupt.set()
    with pytest.raises(Interrupted):
        line.hear(time.monotonic() + 60.0)
    line.close()


def test_flags_and_settings_that_the_executive_shares_stay(far, talk):
    """The open file is the executive's, too: nothing of it is changed."""
    before = os.get_blocking(far.near)
    talk.make(Exchange(send=b"off", expect=b"x", within_s=0.0), Patience())
    assert os.get_blocking(far.near) is before


def test_the_speed_of_a_line_counts_as_noise():
    """Bytes that were written are on their way for a while: silence begins after them."""
    far = Far("terminal")
    line = Line(os.dup(far.near), 1200)
    line.say(b"0123456789ab", time.monotonic() + 5.0)
    assert line.busy_until - time.monotonic() > 0.05
    line.close()
    far.end()


def test_a_terminal_is_reopened_raw_and_without_hanging_up_later():
    """Speed, eight bits and no line editing; a closing must not drop DTR."""
    far = Far("terminal")
    line = opened(GuardedPort(device="psu", url=os.ttyname(far.near), baud=9600))
    input_flags, output_flags, control, local, speed, _, _ = termios.tcgetattr(line.descriptor)
    assert (input_flags, output_flags, local, speed) == (0, 0, 0, termios.B9600)
    assert not control & termios.HUPCL
    assert control & termios.CLOCAL
    line.close()
    far.end()


@pytest.mark.parametrize("url", ["/dev/no-such-port", "socket://127.0.0.1:1", "socket://nonsense"])
def test_what_cannot_be_opened_is_an_error_of_the_system(url):
    """Nothing else comes out of a failed opening."""
    with pytest.raises((OSError, ValueError)):
        opened(GuardedPort(device="psu", url=url))


def test_a_speed_that_the_system_lacks_opens_nothing():
    """A wrong speed would send noise."""
    far = Far("terminal")
    with pytest.raises(OSError, match="12345 baud"):
        opened(GuardedPort(device="psu", url=os.ttyname(far.near), baud=12345))
    far.end()
