"""An interrupted run as found: what a resumed run has to retrace."""

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
    events.Recovered: "is sealed in part",
    events.Results: "has ended",
}
"""Events after which there is nothing to resume."""


@dataclass(frozen=True, slots=True)
class Boundary:
    """An event after which a run can be re-entered.

    Attributes:
        place: its number in the run's own course, from 1.
        sequence: its sequence number.
        at_ns: its instant.
        kept: the recording that it begins, and that continues; empty if it begins none.
        over: whether every case has its outcome by then, so that only the end of the run is missing.
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
        torn: bytes of an incomplete line at the journal's end.
        checkpoint: the last checkpoint of its simulated bench, None if there is none.
        deviation: how this resumption deviates from the plan, empty if it does not.
        boundary: its point of entry, None for a killed run, which continues where it was.
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
        """Path and SHA-256 of the files frozen when a case first used them."""
        return {line.event.file: line.event.sha256 for line in self.lines if isinstance(line.event, events.FrozenLater)}

    @property
    def come_again(self) -> tuple[JournalLine, ...]:
        """The lines up to its point of entry."""
        last = self.boundary.sequence if self.boundary else math.inf
        return tuple(line for line in self.lines if line.event.seq <= last)

    @property
    def entries(self) -> tuple[tuple[events.Entry, float], ...]:
        """Its earlier points of entry, each with the bench time in s."""
        return entries(line.event for line in self.lines)

    @property
    def not_opened(self) -> Mapping[int, Gate]:
        """The host gates that ended its armings, see `BenchKeeper`."""
        return not_opened(line.event for line in self.lines)

    @property
    def failed(self) -> tuple[events.Failed, ...]:
        """The checks that failed between the point of entry and the interruption: resuming does not undo them.

        Later checks came from a bench that was lost, or being made safe.
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
        """The first unused recording number."""
        return max((int(name[:3]) for name in self.state.recordings if name[:3].isdigit()), default=0) + 1

    @property
    def begun_after(self) -> tuple[str, ...]:
        """Recordings outside cases that began after the point of entry: those of the watch after its end."""
        last = self.boundary.sequence if self.boundary else math.inf
        begun = self.state.recordings.values()
        return tuple(event.recording for event in begun if event.case is None and event.seq > last)

    @property
    def broken_off(self) -> tuple[events.Recording, ...]:
        """Recordings of a case that began after the point of entry and never ended: the process was killed during them.

        A re-entered case begins new ones, so nothing else ends these.
        """
        last = self.boundary.sequence if self.boundary else math.inf
        return tuple(event for event in self.state.left_open if event.case is not None and event.seq > last)

    @property
    def state(self) -> RunState:
        """Its state after all events, void ones included."""
        return fold(line.event for line in (*self.head, *self.lines))

    @property
    def run(self) -> events.Run:
        """Its request."""
        return self.of_head(events.Run)

    @property
    def live(self) -> bool:
        """Whether its bench is outside its process, and continued without it."""
        return self.run.live is not None

    @property
    def last_wall(self) -> Body:
        """The wall half of the newest event."""
        return (self.lines or self.head)[-1].wall

    @property
    def last_ns(self) -> int:
        """The latest instant of its bench on record."""
        return round(max((line.event.t for line in self.lines), default=0.0) * NANOSECONDS)

    @property
    def stood_s(self) -> float:
        """How long ago that was, in bench time: 0 for a bench that stopped with its process.

        By boot time, which cannot be set; by the time of day if the machine was restarted.
        """
        if self.run.live is None:
            return 0.0
        last, now = self.last_wall, wall.stamp()
        same = last["boot_id"] == now.boot_id
        passed = now.boot - float(last["boot"]) if same else wall.seconds_since(str(last["utc"]))
        return max(0.0, passed) * self.run.live.speed + self._lag_s(self.run.live.speed)

    def _lag_s(self, speed: float) -> float:
        """Return how far bench time lagged at the newest event: the duration of a suspend right before it."""
        lags: list[float] = []
        for line in self.lines:
            if isinstance(line.event, events.Resumed):  # the clock was restarted
                lags.clear()
            lags.append(float(line.wall["boot"]) * speed - line.event.t)
        return lags[-1] - min(lags) if lags else 0.0

    @property
    def resumes(self) -> int:
        """How many times it was resumed before."""
        return len(self.state.resumptions)

    def of_head(self, kind: type[_Event]) -> _Event:
        """Return the event of this kind in the head.

        Raises:
            Refused: if there is none.
        """
        found = next((line.event for line in self.head if isinstance(line.event, kind)), None)
        if found is None:
            raise Refused(f"{self.folder.name}: the run had not begun", "delete the folder and start a new run")
        return found


def find_earlier(folder: Path) -> Earlier:
    """Return an interrupted run; an incomplete line at its journal's end is cut off and kept.

    Raises:
        Refused: if there is nothing to resume, or a process is running it.
        EvidenceError: if its journal is damaged.
    """
    if is_sealed(folder):
        raise Refused(f"{folder.name} is sealed", "a sealed run cannot be resumed; start a new one")
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
    """Return the point of entry of a run, None for a killed one, which continues where it was.

    A bench outside its process was made safe when that was killed, as if the run had been stopped. The run is
    entered at the beginning of the recording in progress, if it continues, otherwise of the turn of a loop,
    otherwise of the case, otherwise at the end of the previous case; but never after a sign that it was being stopped,
    or that a full disk left something out: that cannot be retraced.
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
    """Return the events before the first sign of a stop, or of something that a full disk left out.

    A case learns of a stop before the journal does: the event `stop` follows the end of the case, or found no space.
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
    """Return the planned cases without an outcome; those that a stop kept from running are still to be run."""
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
    """Return, by arming, the host gate that ended it.

    An arming is identified by the `void_to` of its entry, the first one by `FIRST_ARMING`. What the guardian finds
    after an arming, at its release, is not one of its gates.
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
