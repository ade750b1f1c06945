"""The ends of a served bench: its lines on pseudo-terminals and sockets, and how they are watched."""

from __future__ import annotations

import errno
import os
import select
import socket
import termios
import tty
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from hil.clock.port import NANOSECONDS
from hil.wire.peer import Openable, PeerClock, SerialPeer

__all__ = ["NetworkEnd", "SerialEnd", "ServedLine", "Watch", "look"]

_MILLISECONDS = 1000


@dataclass(frozen=True, slots=True)
class Watch:
    """One descriptor: whether bytes, or room for bytes, are awaited, and who is called when they are there."""

    descriptor: int
    look: Callable[[], None]
    reads: bool = True
    writes: bool = False


def look(watches: Iterable[Watch], seconds: float) -> list[Watch]:
    """Wait until something watched is ready, `seconds` at most, and return what is; a hang-up is ready, too."""
    poll = select.poll()
    wanted = {watch.descriptor: watch for watch in watches if watch.reads or watch.writes}
    for watch in wanted.values():
        poll.register(watch.descriptor, select.POLLIN * watch.reads | select.POLLOUT * watch.writes)
    # Rounded up, so that nothing is looked at just before it is due.
    return [wanted[descriptor] for descriptor, _ in poll.poll(int(seconds * _MILLISECONDS + 0.999))]


_BITS_PER_BYTE = 10
_BUFFER = 4096
_NETWORK_BUFFER = 1 << 20
"""A network drops nothing: what a client has not fetched waits in the instrument, whose replies are shorter."""

_PIECE = 256
_NETWORK_NS_PER_BYTE = 100_000
_NETWORK_AHEAD_NS = 100_000_000


class ServedLine:
    """The line between an open end and its peer, with the same speed as in the process of a run.

    Every byte takes the time of its bits, in both directions. A network takes no time, but no more than a kilobyte at
    once and ten kilobytes a second after that, as the processor of an instrument would. What a client writes ahead of
    that waits in the operating system; what it does not fetch overflows, on a network after a megabyte only.

    Args:
        device: the instrument's name.
        baud: bits per second, 0 for a network.

    Attributes:
        outbox: bytes that have arrived at the client's side; the code that gives them to the client removes them.
        lost: how many bytes overflowed.
        is_open: whether a client is there.
    """

    def __init__(self, device: str, baud: int) -> None:
        self.device = device
        self.outbox = bytearray()
        self.lost = 0
        self.is_open = False
        self._ns_per_byte = round(_BITS_PER_BYTE * NANOSECONDS / baud) if baud else 0
        self._to_peer: deque[tuple[int, bytes]] = deque()
        self._to_client: deque[tuple[int, bytes]] = deque()
        self._peer_free_ns = 0
        self._client_free_ns = 0
        self._peer: SerialPeer
        self._clock: PeerClock

    def connect(self, peer: SerialPeer, clock: PeerClock) -> None:
        """Belong to a peer, at first or in the place of an equal one; bytes on their way stay on it."""
        self._peer, self._clock = peer, clock
        for when_ns, _ in self._to_peer:
            clock.at(when_ns, self._reach_peer)
        for when_ns, _ in self._to_client:
            clock.at(when_ns, self._reach_client)

    def opened(self) -> None:
        """Start with an empty buffer, and let the peer notice where it can."""
        self.is_open = True
        self.outbox.clear()
        if isinstance(self._peer, Openable):
            self._peer.opened()

    def closed(self) -> None:
        """Drop what comes from now on."""
        self.is_open = False
        self.outbox.clear()

    @property
    def room(self) -> int:
        """How many bytes the line takes from the client now; 0 while it is still busy with earlier ones."""
        ahead_ns = self._peer_free_ns - self._clock.now_ns()
        return _PIECE if ahead_ns <= (0 if self._ns_per_byte else _NETWORK_AHEAD_NS) else 0

    @property
    def room_at_ns(self) -> int:
        """When the line takes bytes again."""
        return self._peer_free_ns - (0 if self._ns_per_byte else _NETWORK_AHEAD_NS)

    def take(self, data: bytes) -> None:
        """Take bytes from the client, at most `room`; the peer has them when their last bit has arrived."""
        now_ns = self._clock.now_ns()
        arrives_ns = max(now_ns, self._peer_free_ns) + len(data) * self._ns_per_byte if self._ns_per_byte else now_ns
        per_byte_ns = self._ns_per_byte or _NETWORK_NS_PER_BYTE
        self._peer_free_ns = max(now_ns, self._peer_free_ns) + len(data) * per_byte_ns
        self._to_peer.append((arrives_ns, data))
        self._clock.at(arrives_ns, self._reach_peer)

    def send(self, data: bytes, after_ns: int = 0) -> None:
        """Take bytes from the peer; the first leaves after `after_ns`, after what is still being sent."""
        start_ns = max(self._clock.now_ns() + after_ns, self._client_free_ns)
        self._client_free_ns = arrives_ns = start_ns + len(data) * self._ns_per_byte
        self._to_client.append((arrives_ns, data))
        self._clock.at(arrives_ns, self._reach_client)

    def _reach_peer(self) -> None:
        _, data = self._to_peer.popleft()
        self._peer.receive(data)

    def _reach_client(self) -> None:
        _, data = self._to_client.popleft()
        if self.is_open:
            room = max(0, (_BUFFER if self._ns_per_byte else _NETWORK_BUFFER) - len(self.outbox))
            self.lost += max(0, len(data) - room)
            self.outbox += data[:room]


class SerialEnd:
    """One pseudo-terminal. Its far side is what clients open, by the link.

    The kernel returns whether a client has the far side open, but does not wake anybody when one opens it, so `look_up`
    has to be called now and then. A pseudo-terminal has no DTR: the first opening after a closing counts as its rise.
    Nor has it a speed: what a client sets is taken, and the line keeps the speed of the bench file.

    Args:
        line: the line that it belongs to.
        link: where clients find it; a link that is there already is replaced.
        announce: lets the host know that the pseudo-terminal of this name is served, until the descriptor is closed.
    """

    def __init__(self, line: ServedLine, link: Path, announce: Callable[[str], int] | None = None) -> None:
        self.line = line
        self._announce = announce
        self._announced = -1
        self.url = str(link)
        self._link = link
        self._master = -1
        self._name = ""
        self._poll: select.poll
        self.plug()

    @property
    def waits_for_client(self) -> bool:
        """Whether `look_up` has to be called, because nobody is woken."""
        return self._master >= 0 and not self.line.is_open

    def plug(self) -> None:
        """Be there, under the same link, leading to another pseudo-terminal; if it is already, stay."""
        if self._master >= 0:
            return
        self._master, far = os.openpty()
        tty.setraw(far)
        self._name = os.ttyname(far)
        os.close(far)
        if self._announce is not None:
            self._announced = self._announce(self._name)
        os.set_blocking(self._master, False)
        self._poll = select.poll()
        self._poll.register(self._master, select.POLLIN)
        self._link.unlink(missing_ok=True)
        self._link.symlink_to(self._name)

    def unplug(self) -> None:
        """Be away: a client sees a hang-up, and the link is gone."""
        if self._master < 0:
            return
        with suppress(OSError):
            if self._link.readlink() == Path(self._name):
                self._link.unlink()
        os.close(self._master)
        self._master = -1
        if self._announced >= 0:
            os.close(self._announced)
            self._announced = -1
        self.line.closed()

    def look_up(self) -> None:
        """Notice that a client has opened it, also one that wrote and has closed it again."""
        events = sum(event for _, event in self._poll.poll(0))
        if not self.line.is_open and (events & select.POLLIN or not events & select.POLLHUP):
            self.line.opened()

    def watches(self) -> Iterable[Watch]:
        """Return what is awaited now."""
        if self.line.is_open:
            yield Watch(self._master, self._transfer, reads=bool(self.line.room), writes=bool(self.line.outbox))

    def _transfer(self) -> None:
        if self._master < 0:
            return
        try:
            if room := self.line.room:
                self.line.take(os.read(self._master, room))
        except BlockingIOError:
            pass
        except OSError as error:
            if error.errno != errno.EIO:  # what the kernel says once the far side is closed and all of it was read
                raise
            self._hung_up()
        self._give()

    def _give(self) -> None:
        try:
            if self.line.outbox:
                del self.line.outbox[: os.write(self._master, self.line.outbox)]
        except BlockingIOError:
            pass
        except OSError:
            self.line.outbox.clear()  # closed just now; reading shows it, too

    def _hung_up(self) -> None:
        self.line.closed()
        tty.setraw(self._master, termios.TCSANOW)
        termios.tcflush(self._master, termios.TCOFLUSH)  # what the client did not read is not for the next one


_HOST = "127.0.0.1"
_BACKLOG = 4


class NetworkEnd:
    """One listening port. A second client is hung up on, as instruments with one socket do.

    Args:
        line: the line that it belongs to.
        port: where it listens, 0 for any free port.

    Raises:
        OSError: if the port is in use.
    """

    def __init__(self, line: ServedLine, port: int = 0) -> None:
        self.line = line
        self._client: socket.socket | None = None
        self._listener: socket.socket | None = None
        self._port = port
        self.plug()
        self.url = f"socket://{_HOST}:{self._port}"

    def plug(self) -> None:
        """Listen, always at the same port; if it does already, continue.

        Raises:
            OSError: if somebody else has the port by now.
        """
        if self._listener is None:
            self._listener = socket.create_server((_HOST, self._port), backlog=_BACKLOG)
            self._listener.setblocking(False)
            self._port = self._listener.getsockname()[1]

    def unplug(self) -> None:
        """Hang up, and listen no more."""
        self._hang_up()
        if self._listener is not None:
            self._listener.close()
            self._listener = None

    def watches(self) -> Iterable[Watch]:
        """Return what is awaited now."""
        if self._listener is not None:
            yield Watch(self._listener.fileno(), self._accept)
        if self._client is not None:
            yield Watch(
                self._client.fileno(), self._transfer, reads=bool(self.line.room), writes=bool(self.line.outbox)
            )

    def _accept(self) -> None:
        if self._listener is None:
            return
        with suppress(OSError):  # it has gone already
            client, _ = self._listener.accept()
            if self._client is not None:
                client.close()
                return
            client.setblocking(False)
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._client = client
            self.line.opened()

    def _transfer(self) -> None:
        client, room = self._client, self.line.room
        if client is None:
            return
        try:
            if room:
                with suppress(BlockingIOError):
                    data = client.recv(room)
                    if not data:
                        self._hang_up()
                        return
                    self.line.take(data)
            if self.line.outbox:
                with suppress(BlockingIOError):
                    del self.line.outbox[: client.send(self.line.outbox)]
        except OSError:
            self._hang_up()

    def _hang_up(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None
            self.line.closed()
