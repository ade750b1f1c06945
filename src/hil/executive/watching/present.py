"""The present of a bench outside of this process: where it came without an operation, and where its replay does."""

from __future__ import annotations

from collections.abc import Callable

from hil.bench.bound import BoundBench
from hil.model.errors import HilError
from hil.wire.replay import BUSY, CLOCK, DISTRESS
from hil.wire.tap import LONGEST_TRANSACTION

__all__ = ["Present"]

_BENCH = "bench"
_BEHIND_NS = 50_000_000
"""Up to this, what a case computes between its calls is not told."""


class Present:
    """Lets bench time come to the present at scheduling points, and writes down that it did.

    Between operations the clock of such a bench stands. Where somebody is asked, or a case computes, it has to go on
    all the same, for monitors and turns. In the transcript that stands with the number of events before it, so that a
    replay comes there between the same two.

    Args:
        bench: the bench.

    Attributes:
        distress: tells why the bench cannot be driven any more, nothing while it can.
        course: tells how many events of the run's own course there are.
        held_up: is told where a case's own code let nobody look after the bench for too long; the present case.
    """

    def __init__(self, bench: BoundBench) -> None:
        self._bench = bench
        self.distress: Callable[[], str] = lambda: ""
        self.course: Callable[[], int] = lambda: 0
        self.held_up: Callable[[HilError], None] = lambda _: None

    def come(self) -> None:
        """Come to the present, if the bench is outside of this process and bench time is behind."""
        live = self._bench.live
        if live is not None and live.behind_ns() > _BEHIND_NS:
            began_ns, sent = live.now_ns(), str(self.course()).encode()
            self._bench.transcript.note(_BENCH, CLOCK, began_ns, live.look(), sent=sent)

    def in_distress(self) -> str:
        """Return why the bench cannot be driven any more, or in a replay could not be then; nothing while it can."""
        if self._bench.playback is not None:
            return self._of_record(DISTRESS).decode()
        if text := self.distress():
            now_ns = self._bench.clock.now_ns()
            sent = f"{self.course()} {text}".encode()
            self._bench.transcript.note(_BENCH, DISTRESS, now_ns, now_ns, sent=sent)
        return text

    def busy(self, seconds: float) -> None:
        """Note that a case's own code let nobody look after the bench for so many seconds of the wall, with outputs on.

        That is an error of the case, and so it is in a replay, which may compute faster.
        """
        if seconds > LONGEST_TRANSACTION:
            now_ns = self._bench.clock.now_ns()
            told = f"{seconds:.2f}"
            self._bench.transcript.note(_BENCH, BUSY, now_ns, now_ns, sent=f"{self.course()} {told}".encode())
            self.held_up(_held_up(told))

    def comes_in_record(self) -> bool:
        """Come to where the replayed bench came between the last event and the next one; return whether it did."""
        while told := self._of_record(BUSY):
            self.held_up(_held_up(told.decode()))
        return bool(self._of_record(CLOCK))

    def _of_record(self, name: str) -> bytes:
        """Take a mark that the record holds between the last event and the next one; return what it tells."""
        playback = self._bench.playback
        found = playback.next_if(name) if playback is not None else None
        if playback is None or found is None:
            return b""
        number, _, told = found.sent.partition(b" ")
        if int(number) > self.course():
            return b""
        began_ns = self._bench.clock.now_ns()
        playback.take(_BENCH, name, found.sent)
        self._bench.transcript.note(_BENCH, name, began_ns, self._bench.clock.now_ns(), sent=found.sent)
        return told or number


def _held_up(seconds: str) -> HilError:
    return HilError(
        f"its own code ran for {seconds} s without letting anybody look after the bench, with outputs on;"
        f" {LONGEST_TRANSACTION:g} s are allowed",
        "compute behind the last use of the outputs, or in smaller pieces",
    )
