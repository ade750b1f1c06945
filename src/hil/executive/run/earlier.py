"""An interrupted run as it is found: what a resumed run has to come to again."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

from hil.clock import wall
from hil.clock.port import NANOSECONDS
from hil.evidence.folder import JOURNAL, is_held, is_sealed
from hil.evidence.journal.reader import Body, JournalLine, cut_torn_tail, read_journal, require_known_format
from hil.evidence.journal.writer import Journal
from hil.executive.case.operator import Answer, AnswerSource, Declined, Question
from hil.executive.run.answers import SIMULATED_PERSON
from hil.executive.run.checkpoints import read_checkpoint
from hil.model.errors import Diverged, Refused
from hil.wire.checkpoint import Checkpoint

__all__ = ["Answered", "Earlier", "find_earlier"]

_HEAD = frozenset({"anomaly", "frozen", "orphan", "planned", "run"})
_AFTER = {"end": "has ended", "recovered": "is being sealed", "results": "has ended", "stop": "was asked to stop"}
"""Events after which there is nothing to go on with."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Earlier:
    """An interrupted run.

    Attributes:
        folder: its folder.
        head: its first events, before the bench was touched.
        lines: the journal's lines behind the head.
        torn: bytes of half a line that stood at the journal's end.
        checkpoint: where its simulated bench was, None where that was not written down yet.
        deviation: how this resume deviates from the plan, empty where it does not.
    """

    folder: Path
    head: tuple[JournalLine, ...]
    lines: tuple[JournalLine, ...]
    torn: int = 0
    checkpoint: Checkpoint | None = None
    deviation: str = ""

    @property
    def run(self) -> Body:
        """The body of its first event."""
        return self.head[0].body

    @property
    def last_wall(self) -> Body:
        """What the newest event says of its moment."""
        return (self.lines or self.head)[-1].wall

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
    if is_held(folder):
        raise Refused(f"{folder.name}: the run is going on in another process", "see it with hil status")
    require_known_format(read_journal(folder / JOURNAL))
    torn = cut_torn_tail(folder)
    reading = read_journal(folder / JOURNAL)
    if reading.findings:
        raise Refused(f"{folder.name}: {reading.findings[0]}", "a damaged journal is not gone on with; keep the folder")
    head = tuple(takewhile(lambda line: line.body["kind"] in _HEAD, reading.lines))
    earlier = Earlier(
        folder=folder, head=head, lines=reading.lines[len(head) :], torn=torn, checkpoint=read_checkpoint(folder)
    )
    earlier.of_head("planned")
    for line in earlier.lines:
        if (kind := line.body["kind"]) in _AFTER:
            raise Refused(f"{folder.name}: the run {_AFTER[kind]}", "seal it as it is with hil seal")
    return earlier


def go_on_with(earlier: Earlier, journal: Journal, now: Callable[[], float]) -> None:
    """Write down that an interrupted run goes on, before its first new event.

    Args:
        earlier: the interrupted run.
        journal: its journal.
        now: bench time in s.
    """
    last = earlier.last_wall
    beside, seconds = {"interrupted": last}, round(wall.seconds_since(str(last["utc"])), 1)
    if last["boot_id"] != wall.stamp().boot_id:
        journal.write("reboot", now(), text="the machine was started anew meanwhile", seconds=seconds, beside=beside)
    journal.write(
        "resumed",
        now(),
        number=earlier.resumes + 1,
        checkpoint=earlier.checkpoint.at_ns / NANOSECONDS if earlier.checkpoint else 0.0,
        torn_bytes=earlier.torn,
        deviation=earlier.deviation,
        seconds=seconds,
        text="the run was interrupted here, and went on",
        beside=beside,
    )


class Answered:
    """The answers that persons gave before the interruption: nobody is asked a second time.

    The simulated person is: what it does with its hands belongs to a world that goes on from before it did it.

    Args:
        lines: the journal's lines.
        source: who answers what is new.
        goes_on: tells whether the simulated world goes on already.
    """

    def __init__(self, lines: Sequence[JournalLine], source: AnswerSource, goes_on: Callable[[], bool]) -> None:
        self._told = deque(line.body for line in lines if _is_answer(line.body))
        self._source = source
        self._goes_on = goes_on

    def answer(self, question: Question) -> Answer:
        """Answer as it was answered then."""
        if not self._told:
            return self._source.answer(question)
        told = self._told.popleft()
        if told["kind"] == "effect":
            raise Declined(f"'{question.name}' was declined before the run was interrupted")
        if told["name"] != question.name:
            raise Diverged(f"the case asks '{question.name}', but its journal holds an answer to '{told['name']}'")
        if told["by"] == SIMULATED_PERSON and self._goes_on():
            return self._source.answer(question)
        return Answer(told["value"], str(told["by"]))


def _is_answer(body: Body) -> bool:
    declined = body["kind"] == "effect" and body["effect"] == "asks" and body.get("raised") == Declined.__name__
    return declined or body["kind"] == "answer"
