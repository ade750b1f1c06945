"""Interfaces required for watching a bench: the case, what takes turns beside it, listeners, and the machine."""

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
    """Why a bench outside this process can no longer be driven.

    Attributes:
        text: the same in words.
        what: what was lost, see `hil.evidence.events.Lost`; empty for the loss of the device under test, or in an
            earlier version's run, which cannot be resumed.
        device: the instrument concerned, empty if none is.
    """

    text: str
    what: Literal["", "arming", "guardian", "machine", "port", "reply"] = ""
    device: str = ""

    @property
    def reason(self) -> str:
        """Return what stopped a run, in words for people."""
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
        """Note a monitor that took its turn this long after it was due."""
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
        """End the run here: the present case will not end."""
        ...

    def hold_as_recorded(self) -> None:
        """Hold the bench where the retraced record does."""
        ...

    def tick(self) -> None:
        """Do the tasks that are done several times a second: flush, poll the inbox."""
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
    """Something that takes turns beside a case, such as draining a stream or sampling a role.

    Attributes:
        what: what it is, as the beginning of a sentence.
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
        """Restart: the bench was made safe in the meantime."""
        ...


class Freshness(Protocol):
    """Freshness of what is known of a bench."""

    @property
    def fresh_until_ns(self) -> int | None:
        """Bench time until which the last evaluation of the envelope is valid, None while nothing watches."""
        ...


class Machine(Protocol):
    """The machine that drives a bench, and the people that an arming needs, as far as the bench depends on them."""

    def gates(self, freshness: Freshness) -> Iterable[Gate]:
        """Yield the gates that must hold before anything is driven."""
        ...

    def passed(self) -> None:
        """After a gate of an arming, have the guardian wait for the next one."""
        ...

    def distress(self) -> Distress | None:
        """Return why the bench can no longer be driven, None while it can."""
        ...

    def switch_off(self) -> None:
        """Send every output's safe command before waiting for anything; prove nothing."""
        ...

    @property
    def proven(self) -> bool:
        """Whether the guardian has proven safe, and latched, what the run could not prove."""
        ...

    def end(self, *, proven: bool) -> list[str]:
        """Release it; return what is not safe.

        Args:
            proven: whether the run itself has just proven every output safe.
        """
        ...

    def latch(self, why: str) -> None:
        """Latch a bench that was not proven safe, so that a named person checks it before anybody drives it."""
        ...


class Tenant(Protocol):
    """Whoever has a bench outside this process for itself: a run, or a visit."""

    @property
    def folder(self) -> Path:
        """Where the guardian logs what it did; its latches have this name."""
        ...

    @property
    def leases(self) -> Sequence[str]:
        """What is held exclusively."""
        ...

    @property
    def lease(self) -> Lease:
        """The lease that holds it."""
        ...

    @property
    def events(self) -> EventSink:
        """Where failures are recorded."""
        ...


class NoMachine:
    """The machine of a bench in this process, which needs nothing of it, and ends with it."""

    proven = False

    def gates(self, freshness: Freshness) -> Iterable[Gate]:
        """Return no gates."""
        del freshness
        return ()

    def passed(self) -> None:
        """Do nothing: nobody waits."""

    def distress(self) -> None:
        """Return None: the bench can be driven."""

    def switch_off(self) -> None:
        """Do nothing: no reply is ever late here."""

    def end(self, *, proven: bool) -> list[str]:
        """Return that everything is safe."""
        del proven
        return []

    def latch(self, why: str) -> None:
        """Do nothing: the bench is gone with its process."""
