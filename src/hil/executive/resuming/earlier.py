"""An interrupted run as it is found: what a resumed run has to come to again."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile
from pathlib import Path
from typing import TypeVar

from hil.bench.gate import Gate
from hil.clock import wall
from hil.clock.port import NANOSECONDS
from hil.evidence import events
from hil.evidence.folder import JOURNAL, hold, is_sealed
from hil.evidence.journal.past import entries
from hil.evidence.journal.reader import Body, JournalLine, cut_torn_tail, read_journal, require_known_format
from hil.evidence.journal.writer import is_gap
from hil.evidence.ledger.heads import require_uncut
from hil.evidence.state import RunState, fold, standing
from hil.executive.ending.stop import Stopped
from hil.executive.journaling.checkpoints import read_checkpoint
from hil.executive.watching.arming import FIRST_ARMING
from hil.model.errors import EvidenceError, Refused
from hil.model.verdict import Verdict
from hil.wire.checkpoint import Checkpoint

__all__ = ["Boundary", "Earlier", "find_earlier", "not_opened"]

_Event = TypeVar("_Event", bound=events.Event)

_HEAD = (events.Anomaly, events.Frozen, events.Orphan, events.Planned, events.Run)
_AFTER: Mapping[type[events.Event], str] = {
    events.End: "has ended",
    events.Recovered: "is being sealed",
    events.Results: "has ended",
}
"""Events after which there is nothing to go on with."""


@dataclass(frozen=True, slots=True)
class Boundary:
    """An event after which a run can be entered again.

    Attributes:
        place: which event of the run's own course it is, from 1.
        sequence: its sequence number.
        at_ns: its instant.
        kept: the recording that it begins, and that continues; empty if it begins none.
        over: whether every case has its outcome there, so that only the end of the run is missing.
    """

    place: int
    sequence: int
    at_ns: int
    kept: str = ""
    over: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Earlier:
    """An interrupted run.

    Attributes:
        folder: its folder.
        head: its first events, before the bench was touched.
        lines: the journal's lines after the head.
        size: bytes of its journal.
        torn: bytes of half a line that stood at the journal's end.
        checkpoint: where its simulated bench was, None if that was not written down yet.
        deviation: how this resume deviates from the plan, empty if it does not.
        boundary: where it is entered again, None for one that was killed, and goes on where it was.
    """

    folder: Path
    head: tuple[JournalLine, ...]
    lines: tuple[JournalLine, ...]
    size: int
    torn: int = 0
    checkpoint: Checkpoint | None = None
    deviation: str = ""
    boundary: Boundary | None = None

    @property
    def own_course(self) -> int:
        """How many events of the run's own course its head has."""
        return sum(line.event.recurs for line in self.head)

    @property
    def frozen_later(self) -> Mapping[str, str]:
        """Path and SHA-256 of the files that were frozen when a case first used them."""
        return {line.event.file: line.event.sha256 for line in self.lines if isinstance(line.event, events.FrozenLater)}

    @property
    def come_again(self) -> tuple[JournalLine, ...]:
        """The lines up to where it is entered again."""
        last = self.boundary.sequence if self.boundary else math.inf
        return tuple(line for line in self.lines if line.event.seq <= last)

    @property
    def entries(self) -> tuple[tuple[events.Entry, float], ...]:
        """Where it was entered before, and at which bench time in s."""
        return entries(line.event for line in self.lines)

    @property
    def not_opened(self) -> Mapping[int, Gate]:
        """The gates of the host that ended its armings, see `BenchKeeper`."""
        return not_opened(line.event for line in self.lines)

    @property
    def failed(self) -> tuple[events.Failed, ...]:
        """The checks that failed after the point of entry, and before what interrupted the run: no pause mends them.

        What was evaluated after that came from a bench that was lost, or being made safe.
        """
        found: list[events.Failed] = []
        heard = True
        for event in standing(line.event for line in self.lines):
            match event:
                case events.Lost() | events.Stop():
                    heard = False
                case events.Resumed():
                    heard = True
                case events.Check(verdict=Verdict.FAIL) if (
                    heard and self.boundary and event.seq > self.boundary.sequence
                ):
                    names = {
                        name: getattr(event, name) for name in ("case", "requirement", "parameter", "of", "reason")
                    }
                    found.append(events.Failed(**names))
        return tuple(found)

    @property
    def next_recording(self) -> int:
        """A number that no recording has yet."""
        return max((int(name[:3]) for name in self.state.recordings if name[:3].isdigit()), default=0) + 1

    @property
    def begun_behind(self) -> tuple[str, ...]:
        """Recordings of no case that began after the point of entry: those of the watch after its end."""
        last = self.boundary.sequence if self.boundary else math.inf
        begun = self.state.recordings.values()
        return tuple(event.recording for event in begun if event.case is None and event.seq > last)

    @property
    def broken_off(self) -> tuple[events.Recording, ...]:
        """Recordings of a case that began after the point of entry, and have no end: the process was killed in them.

        A case that is entered again begins others, so that nobody else ends these.
        """
        last = self.boundary.sequence if self.boundary else math.inf
        return tuple(event for event in self.state.left_open if event.case is not None and event.seq > last)

    @property
    def state(self) -> RunState:
        """What its events tell, void ones included."""
        return fold(line.event for line in (*self.head, *self.lines))

    @property
    def run(self) -> events.Run:
        """What it was asked for."""
        return self.of_head(events.Run)

    @property
    def live(self) -> bool:
        """Whether its bench is outside its process, and went on without it."""
        return self.run.live is not None

    @property
    def last_wall(self) -> Body:
        """What the newest event says of its moment."""
        return (self.lines or self.head)[-1].wall

    @property
    def last_ns(self) -> int:
        """The latest instant of its bench that was written down."""
        return round(max((line.event.t for line in self.lines), default=0.0) * NANOSECONDS)

    @property
    def stood_s(self) -> float:
        """How long ago that was, in bench time: 0 of a bench that stood still with its process.

        By boot time, which nobody sets; by the time of day where the machine was restarted.
        """
        if self.run.live is None:
            return 0.0
        last, now = self.last_wall, wall.stamp()
        same = last["boot_id"] == now.boot_id
        passed = now.boot - float(last["boot"]) if same else wall.seconds_since(str(last["utc"]))
        return max(0.0, passed) * self.run.live.speed + self._behind_s(self.run.live.speed)

    def _behind_s(self, speed: float) -> float:
        """Return how far bench time lagged at the newest event: as long as a suspend right before it."""
        lags: list[float] = []
        for line in self.lines:
            if isinstance(line.event, events.Resumed):  # the clock started again
                lags.clear()
            lags.append(float(line.wall["boot"]) * speed - line.event.t)
        return lags[-1] - min(lags) if lags else 0.0

    @property
    def resumes(self) -> int:
        """How often it was resumed before."""
        return len(self.state.resumptions)

    def of_head(self, kind: type[_Event]) -> _Event:
        """Return the event of a kind in the head.

        Raises:
            Refused: if there is none.
        """
        found = next((line.event for line in self.head if isinstance(line.event, kind)), None)
        if found is None:
            raise Refused(f"{self.folder.name}: the run had not begun", "delete the folder and start a new run")
        return found


def find_earlier(folder: Path) -> Earlier:
    """Return an interrupted run; half a line at its journal's end is cut and kept.

    Raises:
        Refused: if there is nothing to go on with, or a process is going on with it.
        EvidenceError: if its journal is damaged.
    """
    if is_sealed(folder):
        raise Refused(f"{folder.name} is sealed", "a sealed run is not changed; start a new one")
    require_known_format(read_journal(folder / JOURNAL))
    with hold(folder):
        torn = _cut(folder)
    reading = read_journal(folder / JOURNAL)
    if reading.findings:
        raise Refused(
            f"{folder.name}: cannot resume: the journal is damaged: {reading.findings[0]}",
            "keep the folder; hil verify shows what is wrong",
        )
    require_uncut(folder, reading, "resume")
    head = tuple(takewhile(lambda line: isinstance(line.event, _HEAD), reading.lines))
    earlier = Earlier(
        folder=folder,
        head=head,
        lines=reading.lines[len(head) :],
        size=(folder / JOURNAL).stat().st_size,
        torn=torn,
        checkpoint=read_checkpoint(folder),
    )
    earlier.of_head(events.Planned)
    for line in earlier.lines:
        if (kind := type(line.event)) in _AFTER:
            raise Refused(f"{folder.name}: the run {_AFTER[kind]}", "seal it as it is with hil seal")
    return replace(earlier, boundary=_boundary(earlier))


def _cut(folder: Path) -> int:
    try:
        return cut_torn_tail(folder)
    except OSError as error:
        raise EvidenceError(
            f"{folder}: the run's folder cannot be written: {error.strerror}", "make it writable, and resume the run"
        ) from error


def _boundary(earlier: Earlier) -> Boundary | None:
    """Return where a run can be entered again, None for one that was killed, and goes on where it was.

    A bench outside its process was made safe when that was killed, as if the run had been stopped. The run is
    entered at the beginning of the recording that was going on, if it continues, else of the turn of a loop, else of
    the case, else at the end of the case before. It is never entered past what shows that it was being stopped, or
    that a full disk left something out: nothing can come to that again.
    """
    stands = standing(line.event for line in (*earlier.head, *earlier.lines))
    stop = next((event for event in stands if isinstance(event, events.Stop)), None)
    whole = _before_the_end(stands)
    if stop is None and not earlier.live and len(whole) == len(stands):
        return None
    if stop is not None and not stop.resumable:
        raise Refused(f"{earlier.folder.name}: the run was asked to stop for good", "seal it as it is with hil seal")
    own = [event for event in whole if event.recurs]
    ended = {event.recording for event in own if isinstance(event, events.RecordingEnd) and event.complete}
    found = [(place, event) for place, event in enumerate(own, 1) if _can_be_entered(event, ended)]
    if not found:
        raise Refused(f"{earlier.folder.name}: no case had begun", "seal it as it is, and start a new run")
    place, event = found[-1]
    kept = event.recording if isinstance(event, events.Recording) else ""
    over = isinstance(event, events.CaseEnd) and not _left(earlier, own, stopped=stop is not None)
    return Boundary(place, event.seq, round(event.t * NANOSECONDS), kept, over)


def _before_the_end(stands: Sequence[events.Event]) -> list[events.Event]:
    """Return the events before the first that shows a stop on its way, or something that a full disk left out.

    A case hears of a stop before the journal does: the event `stop` follows the end of the case, or found no space.
    """
    entered = max((event.seq for event in stands if isinstance(event, events.Resumed)), default=-1)
    return list(takewhile(lambda event: event.seq <= entered or not _is_end(event), stands))


def _is_end(event: events.Event) -> bool:
    match event:
        case events.Effect():
            return event.raised == Stopped.__name__
        case events.CaseEnd():
            return event.verdict is Verdict.ABORTED and "".join(event.reasons[:1]).startswith("stopped by ")
    return is_gap(event)


def _left(earlier: Earlier, own: Sequence[events.Event], *, stopped: bool) -> set[str]:
    """Return the planned cases that have no outcome; what a stop kept from running is still to be run."""
    ended = {each.case for each in own if isinstance(each, events.CaseEnd) and each.verdict is not Verdict.ABORTED}
    left_out = {each.case for each in own if isinstance(each, events.NotRun)}
    return {case.case for case in earlier.of_head(events.Planned).cases} - ended - (set() if stopped else left_out)


def _can_be_entered(event: events.Event, ended: Collection[str]) -> bool:
    match event:
        case events.Recording():
            return event.continues and event.recording not in ended
        case events.CaseEnd():
            return event.verdict is not Verdict.ABORTED
        case events.Step():
            return event.turn is not None
    return isinstance(event, events.Case)


def not_opened(happened: Iterable[events.Event]) -> dict[int, Gate]:
    """Return the gate of the host that ended an arming, per arming that one ended.

    An arming is told by the `void_to` of the entry at which it was done, the first one by `FIRST_ARMING`. What the
    guardian finds after an arming, at its release, is not a gate of it.
    """
    found: dict[int, Gate] = {}
    arming: int | None = FIRST_ARMING
    for event in happened:
        if isinstance(event, events.Resumed):
            arming = event.entry.void_to if event.entry else arming
        elif isinstance(event, events.HostGate):
            if not event.ok and arming is not None:
                found[arming] = Gate(event.name, ok=False, detail=event.detail)
                arming = None
        elif isinstance(event, events.Armed) or (isinstance(event, events.Gate) and not event.ok):
            arming = None
    return found
