"""An interrupted run as it is found: what a resumed run has to come to again."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile
from pathlib import Path
from typing import Any

from hil.bench.gate import Gate
from hil.clock import wall
from hil.clock.port import NANOSECONDS
from hil.evidence import events
from hil.evidence.events.codec import KINDS
from hil.evidence.folder import JOURNAL, hold, is_sealed
from hil.evidence.journal.reader import Body, JournalLine, cut_torn_tail, read_journal, require_known_format
from hil.evidence.journal.standing import Entry, entries, standing_bodies
from hil.executive.journaling.checkpoints import read_checkpoint
from hil.executive.watching.keeper import FIRST_ARMING
from hil.model.errors import EvidenceError, Refused
from hil.model.verdict import Verdict
from hil.wire.checkpoint import Checkpoint

__all__ = ["Boundary", "Earlier", "find_earlier", "not_opened"]

_HEAD = frozenset({"anomaly", "frozen", "orphan", "planned", "run"})
_AFTER = {"end": "has ended", "recovered": "is being sealed", "results": "has ended"}
"""Events after which there is nothing to go on with."""


@dataclass(frozen=True, slots=True)
class Boundary:
    """An event behind which a run can be entered again.

    Attributes:
        place: which event of the run's own course it is, from 1.
        sequence: its sequence number.
        at_ns: its instant.
        kept: the recording that it begins, and that goes on; empty where it begins none.
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
        lines: the journal's lines behind the head.
        size: bytes of its journal.
        torn: bytes of half a line that stood at the journal's end.
        checkpoint: where its simulated bench was, None where that was not written down yet.
        deviation: how this resume deviates from the plan, empty where it does not.
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
    def come_again(self) -> tuple[JournalLine, ...]:
        """The lines up to where it is entered again."""
        last = self.boundary.sequence if self.boundary else math.inf
        return tuple(line for line in self.lines if line.body["seq"] <= last)

    @property
    def entries(self) -> tuple[Entry, ...]:
        """Where it was entered before."""
        return entries(line.event for line in self.lines)

    @property
    def not_opened(self) -> Mapping[int, Gate]:
        """The gates of the host that ended its armings, see `BenchKeeper`."""
        return not_opened(line.body for line in self.lines)

    @property
    def next_recording(self) -> int:
        """A number that no recording has yet."""
        begun = (str(line.body["recording"]) for line in self.lines if line.body["kind"] == "recording")
        return max((int(name[:3]) for name in begun if name[:3].isdigit()), default=0) + 1

    @property
    def begun_behind(self) -> tuple[str, ...]:
        """The recordings of no case that were begun behind where it is entered: those of the watch behind its end."""
        begun = (line.body for line in self.lines if line.body["kind"] == "recording" and line.body["case"] is None)
        last = self.boundary.sequence if self.boundary else math.inf
        return tuple(dict.fromkeys(str(event["recording"]) for event in begun if event["seq"] > last))

    @property
    def run(self) -> Body:
        """The body of its first event."""
        return self.head[0].body

    @property
    def live(self) -> bool:
        """Whether its bench is outside of its process, and went on without it."""
        return "live" in self.run

    @property
    def last_wall(self) -> Body:
        """What the newest event says of its moment."""
        return (self.lines or self.head)[-1].wall

    @property
    def last_ns(self) -> int:
        """The latest instant of its bench that was written down."""
        return round(max((line.body["t"] for line in self.lines), default=0.0) * NANOSECONDS)

    @property
    def stood_s(self) -> float:
        """How long ago that was, in bench time: 0 of a bench that stood still with its process.

        By boot time, which nobody sets; by the time of day where the machine was started anew.
        """
        if not self.live:
            return 0.0
        last, now = self.last_wall, wall.stamp()
        same = last["boot_id"] == now.boot_id
        passed = now.boot - float(last["boot"]) if same else wall.seconds_since(str(last["utc"]))
        return max(0.0, passed) * float(self.run["live"]["speed"]) + self._behind_s

    @property
    def _behind_s(self) -> float:
        """How far bench time was behind the present at the newest event: as long as a suspend right before it."""
        speed = float(self.run["live"]["speed"])
        lags: list[float] = []
        for line in self.lines:
            if line.body["kind"] == "resumed":  # the clock began anew
                lags.clear()
            lags.append(float(line.wall["boot"]) * speed - line.body["t"])
        return lags[-1] - min(lags) if lags else 0.0

    @property
    def resumes(self) -> int:
        """How often it was resumed before."""
        return sum(line.body["kind"] == "resumed" for line in self.lines)

    def of_head(self, kind: str) -> JournalLine:
        """Return the first event of a kind in the head.

        Raises:
            Refused: where there is none.
        """
        found = next((line for line in self.head if line.body["kind"] == kind), None)
        if found is None:
            raise Refused(f"{self.folder.name}: the run had not begun", "delete the folder and start it anew")
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
        raise Refused(f"{folder.name}: {reading.findings[0]}", "a damaged journal is not gone on with; keep the folder")
    head = tuple(takewhile(lambda line: line.body["kind"] in _HEAD, reading.lines))
    earlier = Earlier(
        folder=folder,
        head=head,
        lines=reading.lines[len(head) :],
        size=(folder / JOURNAL).stat().st_size,
        torn=torn,
        checkpoint=read_checkpoint(folder),
    )
    earlier.of_head("planned")
    for line in earlier.lines:
        if (kind := line.body["kind"]) in _AFTER:
            raise Refused(f"{folder.name}: the run {_AFTER[kind]}", "seal it as it is with hil seal")
    return replace(earlier, boundary=_boundary(earlier))


def _cut(folder: Path) -> int:
    try:
        return cut_torn_tail(folder)
    except OSError as error:
        raise EvidenceError(
            f"{folder}: the run's folder cannot be written: {error.strerror}", "let it be written, and resume the run"
        ) from error


def _boundary(earlier: Earlier) -> Boundary | None:
    """Return where a run can be entered again, None for one that was killed, and goes on where it was.

    A bench outside of its process was made safe when that was killed, as if the run had been stopped. The run is
    entered at the beginning of the recording that was going on, if it continues, else of the turn of a loop, else of
    the case, else at the end of the case before.
    """
    bodies = standing_bodies([line.body for line in (*earlier.head, *earlier.lines)])
    stop = next((event for event in bodies if event["kind"] == "stop"), None)
    if stop is None and not earlier.live:
        return None
    if stop is not None and not stop.get("resumable"):
        raise Refused(f"{earlier.folder.name}: the run was asked to stop for good", "seal it as it is with hil seal")
    own = [event for event in bodies if KINDS[event["kind"]].origin is events.Origin.COURSE]
    ended = {event["recording"] for event in own if event["kind"] == "recording-end" and event["complete"]}
    found = [(place, event) for place, event in enumerate(own, 1) if _can_be_entered(event, ended)]
    if not found:
        raise Refused(f"{earlier.folder.name}: no case had begun", "seal it as it is, and start a new run")
    place, event = found[-1]
    kept = event["recording"] if event["kind"] == "recording" else ""
    over = event["kind"] == "case-end" and not _left(earlier, own, stopped=stop is not None)
    return Boundary(place, event["seq"], round(event["t"] * NANOSECONDS), kept, over)


def _left(earlier: Earlier, own: Sequence[Body], *, stopped: bool) -> set[str]:
    """Return the planned cases that have no outcome; what a stop kept from running is still to be run."""
    ends = {"case-end"} if stopped else {"case-end", "not-run"}
    ended = {event["case"] for event in own if event["kind"] in ends and event.get("verdict") != Verdict.ABORTED}
    return {str(case["case"]) for case in earlier.of_head("planned").body["cases"]} - ended


def _can_be_entered(event: Body, ended: Collection[str]) -> bool:
    kind = event["kind"]
    if kind == "recording":
        return bool(event.get("continues")) and event["recording"] not in ended
    if kind == "case-end":
        return bool(event["verdict"] != Verdict.ABORTED)
    return kind == "case" or (kind == "step" and "turn" in event)


def not_opened(events: Iterable[Mapping[str, Any]]) -> dict[int, Gate]:
    """Return the gate of the host that ended an arming, per arming that one ended.

    An arming is told by the `void_to` of the entry at which it was done, the first one by `FIRST_ARMING`. What the
    guardian finds behind an arming, at its release, is no gate of it.
    """
    found: dict[int, Gate] = {}
    arming: int | None = FIRST_ARMING
    for event in events:
        kind = event["kind"]
        if kind == "resumed" and event.get("entry"):
            arming = event["entry"]["void_to"]
        elif kind == "armed" or (kind == "gate" and not event["ok"]):
            arming = None
        elif kind == "host-gate" and not event["ok"] and arming is not None:
            found[arming] = Gate(event["name"], ok=False, detail=event["detail"])
            arming = None
    return found
