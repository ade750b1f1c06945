"""What watching a bench asks of others: a case, what takes turns beside it, its listeners, and the machine."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

from hil.bench.envelope import Trip
from hil.bench.gate import Gate
from hil.bench.lease import Lease
from hil.evidence.events import EventSink
from hil.model.bench import InstrumentSpec
from hil.model.errors import DeviceFault
from hil.model.figure import Figure

__all__ = ["Beside", "CaseAtWork", "Distress", "Freshness", "Machine", "NoMachine", "Reports", "Tenant"]


@dataclass(frozen=True, slots=True)
class Distress:
    """Why a bench outside this process cannot be driven any more.

    Attributes:
        text: the same in words.
        what: what was lost, see `hil.evidence.events.Lost`; empty for the end of the device under test, or of an
            earlier version's run, which nobody resumes.
        device: the instrument, empty if it is about none.
    """

    text: str
    what: Literal["", "arming", "guardian", "machine", "port", "reply"] = ""
    device: str = ""

    @property
    def reason(self) -> str:
        """Return what a run was stopped by, for what a person reads of it."""
        return f"{_LOST[self.what]}: {self.text}" if self.what else self.text


_LOST = {
    "arming": "a failed arming",
    "guardian": "a lost guardian",
    "machine": "a machine that may fall asleep",
    "port": "a lost port",
    "reply": "a silent instrument",
}


class Reports(Protocol):
    """What a scheduler reports to."""

    def reading(self, limit: str, t: float, figure: Figure) -> None:
        """Take one reading of a monitor."""
        ...

    def fed(self, limit: str, recording: str) -> None:
        """Note that every row of a recording is judged against a limit from now on."""
        ...

    def late(self, limit: str, seconds: float) -> None:
        """Note a monitor that took its turn so long after it was due."""
        ...

    def trip(self, trip: Trip) -> None:
        """Make the bench safe; called once, before the case learns of it."""
        ...

    def lost(self, distress: Distress) -> None:
        """Make the bench safe, and let the run stay open; called once, before the case learns of it."""
        ...

    def safe(self) -> None:
        """Make the bench safe."""
        ...

    def give_up(self) -> None:
        """End the run here: the present case never will."""
        ...

    def hold_as_recorded(self) -> None:
        """Hold the bench where what is retraced does."""
        ...

    def tick(self) -> None:
        """Do what has to be done every fraction of a wall second: flush, look into the inbox."""
        ...


class CaseAtWork(Protocol):
    """The case whose turn at the bench it is."""

    def fault(self, instrument: InstrumentSpec, fault: DeviceFault) -> None:
        """Note silence or nonsense of a device."""
        ...

    def raised(self, error: BaseException) -> None:
        """Note an error of the case."""
        ...


class Beside(Protocol):
    """Something that takes turns beside a case: a stream that has to be emptied, a role that is sampled.

    Attributes:
        what: what it is, for a sentence that begins with it.
    """

    what: str

    @property
    def due_ns(self) -> int:
        """The bench time of the next turn."""
        ...

    def take(self) -> None:
        """Take the turn; the next one is due later."""
        ...

    def begin_again(self) -> None:
        """Start again: the bench was made safe in the meantime."""
        ...


class Freshness(Protocol):
    """Tells how long what is known of a bench is good."""

    @property
    def fresh_until_ns(self) -> int | None:
        """Bench time up to which the last evaluation of the envelope is good, None while nothing watches."""
        ...


class Machine(Protocol):
    """The machine that drives a bench, as far as the bench depends on it, with the people that an arming needs."""

    def gates(self, freshness: Freshness) -> Iterable[Gate]:
        """Yield what has to hold before anything is driven."""
        ...

    def passed(self) -> None:
        """Let the guardian wait for the next gate of an arming, after one that passed."""
        ...

    def distress(self) -> Distress | None:
        """Return why the bench cannot be driven any more, None while it can."""
        ...

    def switch_off(self) -> None:
        """Send every output's command to be safe, before anything is waited for; prove nothing."""
        ...

    @property
    def proven(self) -> bool:
        """Whether the guardian has proven safe, and latched, what the run could not."""
        ...

    def end(self, *, proven: bool) -> list[str]:
        """Let go of it; return what is not safe.

        Args:
            proven: whether the run has just proven every output safe itself.
        """
        ...

    def latch(self, why: str) -> None:
        """Latch a bench that was not proven safe, so that a named person checks it before anybody drives it."""
        ...


class Tenant(Protocol):
    """Whoever has a bench outside this process for itself: a run, or a visit."""

    @property
    def folder(self) -> Path:
        """Where the guardian writes down what it did; its latches have this name."""
        ...

    @property
    def leases(self) -> Sequence[str]:
        """What is held alone."""
        ...

    @property
    def lease(self) -> Lease:
        """What holds it."""
        ...

    @property
    def events(self) -> EventSink:
        """Where it is written down what cannot be done."""
        ...


class NoMachine:
    """A bench that lives in this process needs nothing of its machine, and ends with it."""

    proven = False

    def gates(self, freshness: Freshness) -> Iterable[Gate]:
        """Return that nothing has to hold."""
        del freshness
        return ()

    def passed(self) -> None:
        """Do nothing: nobody waits."""

    def distress(self) -> None:
        """Return that the bench can be driven."""

    def switch_off(self) -> None:
        """Do nothing: no reply is late here."""

    def end(self, *, proven: bool) -> list[str]:
        """Return that nothing is unsafe."""
        del proven
        return []

    def latch(self, why: str) -> None:
        """Do nothing: the bench is gone with its process."""
