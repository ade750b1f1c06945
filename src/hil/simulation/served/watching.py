"""What a served bench watches: descriptors, what is awaited of them, and who looks then."""

from __future__ import annotations

import select
from collections.abc import Callable, Iterable
from dataclasses import dataclass

__all__ = ["Watch", "look"]

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
