"""Stop requests: signals only set flags, and the run ends at the next scheduling point; forked copies hold nothing."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from types import FrameType
from typing import NoReturn, Protocol

from hil.clock import wall
from hil.evidence.events import NOTHING, Event, EventSink
from hil.model.errors import HilError

__all__ = ["Astray", "EndableRun", "IsOwn", "StopFlags", "Stopped", "Turn", "kept_from_copies", "leave_unsealed"]

_MOST_CUTS = 10
_INTERNAL = 3
IsOwn = Callable[[FrameType | None], bool]
"""Returns whether the frame that a signal interrupted belongs to a case's own code, or to what that called."""
Descriptors = Callable[[], Iterable[int]]
"""Returns the descriptors that belong to this process alone."""

_kept: list[Descriptors] = []


class Stopped(BaseException):
    """The run is to end. Not an Exception, so that a case's `except Exception` does not catch it."""


class Astray(HilError):
    """Code drives the bench, or writes evidence, from a thread, process or case other than the one whose turn it is."""


class EndableRun(Protocol):
    """A run, as seen by its stop requests."""

    def make_safe(self) -> None:
        """Make the bench safe; called before a case's own code is cut."""
        ...

    def give_up(self) -> None:
        """End the run from where it is; called for a case that was cut repeatedly and still continues."""
        ...


class StopFlags:
    """Stop requests: whether the run is to end, and why.

    The first request lets the present sample finish. A second one is urgent and ends a computing
    case at once, wherever in its own code it is. What the executive does for a case is never cut
    in two: no transaction on the wire, no line of the journal, and least of all the way to the safe state.
    All of that happens in the thread that created the flags; any other is refused.

    Attributes:
        reason: who or what made the first request, empty if there was none.
        leave_open: whether the run is left unsealed, so that it can be resumed.
        urgent: whether there was a second request.
        cuts: how many times a case's own code was cut.
        turns: how many cases have had a turn so far.
        astray: why another thread, process or case was refused, empty if none was.
        word_home: the descriptor at which a copy of this process reports why it was refused; -1 for none.
    """

    def __init__(self) -> None:
        self._home = os.getpid(), threading.get_ident()
        self._is_own: IsOwn | None = None
        self._undisturbed = 0
        self._shielded = 0
        self._alone_since = self._served_since = 0.0
        self.cuts = 0
        self.turns = 0
        self.reason = ""
        self.leave_open = False
        self.urgent = False
        self.astray = ""
        self.word_home = -1
        self._run: EndableRun | None = None

    @property
    def in_case(self) -> bool:
        """Whether a case's own code runs."""
        return self._is_own is not None

    @property
    def is_shielded(self) -> bool:
        """Whether interruptions are held off."""
        return self._shielded > 0

    @property
    def is_copy(self) -> bool:
        """Whether this process is a copy that a case forked."""
        return os.getpid() != self._home[0]

    def govern(self, run: EndableRun) -> None:
        """Govern this run from now on."""
        self._run = run

    def give_up(self) -> None:
        """End the run from where it is: the present case will not end."""
        if self._run is not None:
            self._run.give_up()

    def request(self, reason: str) -> None:
        """Ask the run to end; a second request is urgent. Safe to call from a signal handler."""
        self.urgent = bool(self.reason)
        self.reason = self.reason or reason

    def leave_off(self, reason: str) -> None:
        """Request that the run ends safely and stays open, so that it can be resumed once the reason is gone.

        Repeated calls make it no more urgent than a person's first request, and do not change that one. Before the
        first case there is nothing to resume, and the run ends for good.
        """
        if not self.reason:
            self.leave_open = self.turns > 0
            self.request(reason)

    def check(self) -> None:
        """Raise Stopped if the run is to end and nothing is shielded."""
        if (os.getpid(), threading.get_ident()) != self._home:
            self.stay_home()
        if self.reason and not self._shielded:
            raise Stopped(self.reason)

    def interrupt(self, frame: FrameType | None = None) -> None:
        """Raise Stopped for an urgent request if that is possible where the signal arrived."""
        if self.urgent and self._may_raise(frame):
            self.cuts += 1
            if self.cuts == 1 and self._run is not None:
                self._run.make_safe()
            if self.cuts > _MOST_CUTS:
                self.give_up()
            raise Stopped(self.reason)

    def interlude(self, attend: Callable[[float, float], None], frame: FrameType | None = None) -> None:
        """Attend to bench and case, if a case's own code can be interrupted here.

        Args:
            attend: called with the wall-clock seconds that the code has run since the executive last attended, and
                since it last passed a scheduling point.
            frame: where the signal arrived.
        """
        if self._may_raise(frame):
            now, served = wall.monotonic(), self._served_since
            attend(now - self._alone_since, now - served)
            self._alone_since, self._served_since = wall.monotonic(), served

    def _may_raise(self, frame: FrameType | None) -> bool:
        """Return whether an exception at this frame ends the case's own code, and nothing else."""
        return not self._undisturbed and not self._shielded and self._is_own is not None and self._is_own(frame)

    @contextmanager
    def case_code(self, is_own: IsOwn = lambda _: True) -> Iterator[None]:
        """Let an urgent request immediately end what runs in the context: a case's own code, and nothing else.

        A copy of the process forked by the case ends where the case's code does.

        Args:
            is_own: distinguishes a case's own code from its callers, where nothing would catch an exception.
        """
        self._is_own = is_own
        self._alone_since = self._served_since = wall.monotonic()
        try:
            yield
        finally:
            self._is_own = None
            if self.is_copy:
                os._exit(1)

    @contextmanager
    def undisturbed(self) -> Iterator[None]:
        """Defer requests to the next scheduling point: used while the executive serves a case."""
        self.stay_home()
        self._undisturbed += 1
        try:
            yield
        finally:
            self._undisturbed -= 1
            self._alone_since = self._served_since = wall.monotonic()

    @contextmanager
    def shielded(self) -> Iterator[None]:
        """Hold off all interruptions: used while the bench is made safe and the package is sealed."""
        self._shielded += 1
        try:
            yield
        finally:
            self._shielded -= 1

    def stay_home(self) -> None:
        """Refuse other threads and forked copies: two writers would break the chain, and two drivers the bench.

        Raises:
            Astray: in them.
        """
        process, thread = os.getpid(), threading.get_ident()
        if (process, thread) == self._home:
            return
        where = "another thread" if process == self._home[0] else "a forked process"
        hint = "call roles, record, check and step where the case runs; compute elsewhere"
        self.turn_away(f"the case uses the bench or writes evidence from {where}", hint)

    def turn_away(self, why: str, hint: str) -> NoReturn:
        """Keep why something was refused, for the running case, and raise it.

        Raises:
            Astray: always.
        """
        self.astray = why
        if self.is_copy and self.word_home >= 0:
            with suppress(OSError):  # a full pipe holds enough reports
                os.write(self.word_home, f"{why}\n".encode())
        raise Astray(why, hint)


class Turn:
    """One case's turn at the bench and at the evidence; it is over when the next case's begins.

    Args:
        flags: count the turns.
        first: called before anything that the case requests: a record may hold something that comes first.
    """

    def __init__(self, flags: StopFlags, first: Callable[[], None] = lambda: None) -> None:
        self._flags = flags
        self._first = first
        flags.turns += 1
        self._number = flags.turns

    @contextmanager
    def undisturbed(self) -> Iterator[None]:
        """Serve the case undisturbed, if it is its turn.

        Raises:
            Astray: if the case has ended, and another one kept something that belongs to it.
        """
        self.require()
        with self._flags.undisturbed():
            self._first()
            yield

    def guarded(self, journal: EventSink) -> EventSink:
        """Return the journal for this case, which is valid as long as it is its turn."""
        return _Guarded(journal, self.require)

    def require(self) -> None:
        """Refuse whatever belongs to a case that has ended."""
        if self._number != self._flags.turns:
            hint = "let each case ask for its roles, record, check and step itself, and keep none of them for another"
            self._flags.turn_away("what belongs to a case that has ended is used in another case", hint)


class _Guarded:
    """A journal that is valid as long as a case has its turn."""

    def __init__(self, journal: EventSink, require: Callable[[], None]) -> None:
        self._journal = journal
        self._require = require

    def write(self, event: Event, *, beside: Mapping[str, object] = NOTHING) -> None:
        """Write an event, if it is the case's turn."""
        self._require()
        self._journal.write(event, beside=beside)


def leave_unsealed() -> None:
    """End the process without sealing the run."""
    sys.stderr.write("hil: a case let neither a stop nor a timeout end it, so the process ends here\n")
    sys.stderr.flush()
    os._exit(_INTERNAL)


@contextmanager
def kept_from_copies(descriptors: Descriptors) -> Iterator[None]:
    """Make every forked copy of this process release descriptors at once, until the context is left.

    A copy may live on, but holds nothing of the bench or of the run. A program that is executed inherits none of them:
    all are closed on exec.

    Args:
        descriptors: returns them, at the moment of a fork.
    """
    _kept.append(descriptors)
    try:
        yield
    finally:
        _kept.remove(descriptors)


def _release_descriptors() -> None:
    """Replace them with /dev/null: their numbers stay in use, so that no object of the copy closes another file."""
    with suppress(OSError):
        nothing = os.open(os.devnull, os.O_RDWR | os.O_CLOEXEC)
        for descriptors in _kept:
            for each in descriptors():
                os.dup2(nothing, each, inheritable=False)
        os.close(nothing)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_release_descriptors)
