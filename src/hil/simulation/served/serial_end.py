"""The open end of a serial line: a pseudo-terminal under a name that stays."""

from __future__ import annotations

import errno
import os
import select
import termios
import tty
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from hil.simulation.served.line import ServedLine
from hil.simulation.served.watching import Watch

__all__ = ["SerialEnd"]


class SerialEnd:
    """One pseudo-terminal. Its far side is what clients open, by the link.

    The kernel tells whether a client has the far side open, but does not wake anybody when one opens it, so `look_up`
    has to be called now and then. A pseudo-terminal has no DTR: the first opening after a closing counts as its rise.
    Nor has it a speed: what a client sets is taken, and the line keeps the speed of the bench file.

    Args:
        line: behind it.
        link: where clients find it; a link that is there already is replaced.
    """

    def __init__(self, line: ServedLine, link: Path) -> None:
        self.line = line
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
        """Be there, under the same link, with another pseudo-terminal behind it; if it is already, stay."""
        if self._master >= 0:
            return
        self._master, far = os.openpty()
        tty.setraw(far)
        self._name = os.ttyname(far)
        os.close(far)
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
            self.line.outbox.clear()  # closed just now; reading tells so, too

    def _hung_up(self) -> None:
        self.line.closed()
        tty.setraw(self._master, termios.TCSANOW)
        termios.tcflush(self._master, termios.TCOFLUSH)  # what the client did not read is not for the next one
