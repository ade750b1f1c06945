"""State of a run: the one fold over its events."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import takewhile
from typing import Generic, TypeAlias, TypeVar

import msgspec

from hil.evidence.attempts import Abandoned
from hil.evidence.events import (
    Anomaly,
    Answer,
    Armed,
    Attachment,
    Case,
    CaseEnd,
    Check,
    End,
    Event,
    Executed,
    Fault,
    FrozenLater,
    Gate,
    GivenFile,
    Hold,
    HoldEnd,
    HostGate,
    Note,
    NotRun,
    Origin,
    Planned,
    PlannedCase,
    Question,
    Recording,
    RecordingEnd,
    Recovered,
    Results,
    Resumed,
    Rows,
    Run,
    SafeEnd,
    Step,
    StepEnd,
    Stop,
    Trip,
)
from hil.model.verdict import Verdict

__all__ = ["CaseState", "RunState", "Span", "before_results", "fold", "standing"]

_OfCase: TypeAlias = Question | Answer | Step | StepEnd | Check | Fault | Case | CaseEnd | NotRun

_Begun = TypeVar("_Begun", bound=Event)
_Ended = TypeVar("_Ended", bound=Event)


@dataclass(slots=True)
class Span(Generic[_Begun, _Ended]):
    """Something that has begun, and has ended unless `ended` is None."""

    begun: _Begun
    ended: _Ended | None = None


@dataclass(slots=True)
class CaseState:
    """State of one planned case after its events; checks and steps are those of the last attempt.

    No attempt replaces another: `earlier` keeps the verdicts of the attempts before the last one, and what had failed
    before the run was interrupted; `given_up` are attempts that the interruption ended without a verdict, which only
    a case declared repeatable by its plan survives; `times` is how many times the case was planned,
    and `seen_by` pairs the witness asked for with who it was.
    """

    planned: PlannedCase
    times: int = 1
    earlier: dict[str, list[Verdict]] = field(default_factory=dict)
    given_up: list[Abandoned] = field(default_factory=list)
    attempts: list[Span[Case, CaseEnd]] = field(default_factory=list)
    end: CaseEnd | None = None
    checks: list[Check] = field(default_factory=list)
    steps: list[Span[Step, StepEnd]] = field(default_factory=list)
    recordings: list[str] = field(default_factory=list)
    holds: list[Span[Hold, HoldEnd]] = field(default_factory=list)
    not_run: list[str] = field(default_factory=list)
    dut_fault: bool = False
    undecided: bool = False
    answers: list[Answer] = field(default_factory=list)
    asked_witness: str = ""
    seen_by: list[tuple[str, str]] = field(default_factory=list)

    @property
    def own_verdict(self) -> Verdict:
        """How the case ended, regardless of its checks."""
        if self.end is not None:
            return self.end.verdict
        return Verdict.ABORTED if self.attempts else Verdict.NOT_RUN

    @property
    def own_verdicts(self) -> list[Verdict]:
        """How every attempt ended, and NOT_RUN for one that is missing."""
        before = [each.ended.verdict if each.ended else Verdict.ABORTED for each in self.attempts[:-1]]
        missing = bool(self.attempts) and not self.all_begun
        return [*before, *self.left_verdicts, self.own_verdict, *([Verdict.NOT_RUN] if missing else [])]

    @property
    def left_verdicts(self) -> list[Verdict]:
        """The verdicts of the attempts given up that count."""
        return [] if self.planned.repeatable else [Verdict.ABORTED] * len(self.given_up)

    @property
    def all_begun(self) -> bool:
        """Whether there was an attempt for each time that the case was planned."""
        return len(self.attempts) >= self.times

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the case ended as it did."""
        if self.end is not None:
            return self.end.reasons
        if self.attempts:
            return ("the run ended within this case",)
        return tuple(self.not_run) or ("the run ended before this case",)

    @property
    def step(self) -> Step | None:
        """The innermost step that has not ended."""
        return next((each.begun for each in reversed(self.steps) if each.ended is None), None)

    def plan_again(self, planned: PlannedCase) -> None:
        """Add a second case with the same id: each then carries the requirements of both."""
        self.times += 1
        carried = (*self.planned.requirements, *planned.requirements)
        self.planned = msgspec.structs.replace(self.planned, requirements=carried)

    def begin(self, event: Case) -> None:
        """Begin an attempt."""
        if self.attempts:
            for check in self.checks:
                self.earlier.setdefault(check.requirement, []).append(check.verdict)
            for name in self.planned.requirements:
                said = self.end.requirements.get(name) if self.end else None
                self.earlier.setdefault(name, []).append(said or self.own_verdict)
        self.attempts.append(Span(event))
        self.end, self.checks, self.steps = None, [], []
        self.dut_fault = self.undecided = False

    def finish(self, event: CaseEnd) -> None:
        """End the attempt."""
        self.end = event
        if self.attempts:
            self.attempts[-1].ended = event

    def end_step(self, event: StepEnd) -> None:
        """End the innermost step of this number."""
        for each in reversed(self.steps):
            if each.begun.number == event.number and each.ended is None:
                each.ended = event
                return


class RunState:
    """State of a run, folded from its events one by one.

    Attributes:
        run: its request, None before its first event.
        cases: the planned cases by id, in order, and any others that were run.
        present: the running case, None between cases.
        recordings: the beginning of every recording by id, in order; the last one if it began twice.
        ended: the ends of recordings by id, even if the beginning is missing.
        rows: by recording, the hashes in the journal by number of rows.
        gates: the readiness gates of the bench.
        host_gates: those of people, the machine and the guardian.
        attachments: the files that were attached or created.
        given: the files that were given as answers.
        added: notes, attachments and anomalies since the first gate.
        resumptions: its resumptions.
        executed: the comparisons of executed code.
        reaches: what code frozen during the run reaches for beyond what cases are given.
        trip: the first trip, if any.
        stop: why the run was ended early, None if it was not, and once it is rearmed.
        stopped: whether it was ever ended early.
        recovered: whether it was sealed as it is.
        armed: whether the bench was ever armed.
        safe: whether every way to the safe state proved every output safe, None before the first.
        results: the event of the derived results, if they were.
        end: how it ended, None until then.
        t: bench time of the newest event in s.
    """

    def __init__(self) -> None:
        self.run: Run | None = None
        self.cases: dict[str, CaseState] = {}
        self.present: CaseState | None = None
        self.recordings: dict[str, Recording] = {}
        self.ended: dict[str, RecordingEnd] = {}
        self.rows: dict[str, dict[int, str]] = {}
        self.gates: list[Gate] = []
        self.host_gates: list[Gate] = []
        self.attachments: list[Attachment] = []
        self.given: list[GivenFile] = []
        self.added: list[Note | Attachment | Anomaly] = []
        self.resumptions: list[Resumed] = []
        self.trip: Trip | None = None
        self.stop: Stop | None = None
        self.stopped = self.recovered = self.armed = False
        self.safe: bool | None = None
        self.results: Results | None = None
        self.end: End | None = None
        self.t = 0.0
        self.reaches: list[str] = []
        self.executed: list[Executed] = []

    @property
    def interrupted(self) -> bool:
        """Whether the run did not come to its own end."""
        return self.stopped or self.recovered or self.run is None

    @property
    def exceptions(self) -> tuple[str, ...]:
        """What counts as hardware by the word of the bench file alone, a sentence each."""
        return tuple(f"{gate.instrument}: {gate.exception}" for gate in self.host_gates if gate.exception)

    @property
    def left_open(self) -> tuple[Recording, ...]:
        """The recordings that have not ended."""
        return tuple(begun for name, begun in self.recordings.items() if name not in self.ended)

    @property
    def deviations(self) -> tuple[str, ...]:
        """How the run deviates from its plan, resumptions included."""
        asked = self.run.deviations if self.run else ()
        return (*asked, *self.reaches, *(each.deviation for each in self.resumptions if each.deviation))

    def take(self, event: Event) -> None:  # noqa: C901 - one case per kind of event
        """Take the next event."""
        self.t = event.t
        match event:
            case Question() | Answer() | Step() | StepEnd() | Check() | Fault() | Case() | CaseEnd() | NotRun():
                self._of_case(event)
            case Recording():
                self.recordings[event.recording] = event
                self.rows.setdefault(event.recording, {})
                if event.case is not None:
                    self._case(event.case).recordings.append(event.recording)
            case Rows():
                self.rows.setdefault(event.recording, {})[event.rows] = event.sha256
            case RecordingEnd():
                self.rows.setdefault(event.recording, {})[event.rows] = event.sha256
                self.ended[event.recording] = event
            case Hold() | HoldEnd():
                self._hold(event)
            case Gate():
                self._gate(event)
            case FrozenLater():
                self.reaches += event.reaches
            case Executed():
                self.executed.append(event)
            case Trip():
                self.trip = self.trip or event
            case SafeEnd():
                self.safe = event.ok and self.safe is not False
            case _:
                self._of_run(event)

    def _gate(self, event: Gate) -> None:
        if event.origin is Origin.COURSE:
            self.gates.append(event)
            self.stop = None
        else:
            self.host_gates.append(event)
            if event.name == HostGate.GUARDIANS_PROOF and not event.ok:
                self.safe = False

    def _of_run(self, event: Event) -> None:  # noqa: C901 - one case per kind of event
        match event:
            case Run():
                self.run = self.run or event
            case Planned():
                self._plan(event)
            case Armed():
                self.armed = True
            case Stop():
                self.stop, self.stopped = event, True
            case Recovered():
                self.recovered = True
            case Resumed():
                self.resumptions.append(event)
                for failed in event.entry.failed if event.entry else ():
                    self._case(failed.case).earlier.setdefault(failed.requirement, []).append(Verdict.FAIL)
            case Results():
                self.results = event
            case End():
                self.end = event
            case Note() | Attachment() | Anomaly():
                if isinstance(event, Attachment):
                    self.attachments.append(event)
                if self.gates:  # earlier anomalies concern the catalogue's sources
                    self.added.append(event)

    def _of_case(self, event: _OfCase) -> None:
        case = self._case(event.case)
        match event:
            case Case():
                case.begin(event)
                self.present = case
            case CaseEnd():
                case.finish(event)
                self.present = None
            case NotRun():
                case.not_run.append(event.reason)
            case Check():
                case.checks.append(event)
            case Step():
                case.steps.append(Span(event))
            case StepEnd():
                case.end_step(event)
            case Answer():
                case.answers.append(event)
                case.seen_by += [(case.asked_witness, event.witness)] if event.witness else []
                self.given += [event.file] if event.file else []
            case Question():
                case.asked_witness = event.witness
            case Fault():
                case.dut_fault = case.dut_fault or event.dut
                case.undecided = case.undecided or event.undecided

    def _plan(self, event: Planned) -> None:
        for planned in event.cases:
            if planned.case in self.cases:
                self.cases[planned.case].plan_again(planned)
            else:
                self.cases[planned.case] = CaseState(planned)

    def give_up(self, attempts: Iterable[Abandoned]) -> None:
        """Add the attempts that were given up; the events that stand do not include them."""
        for attempt in attempts:
            self._case(attempt.case).given_up.append(attempt)

    def _case(self, name: str) -> CaseState:
        if name not in self.cases:
            unplanned = PlannedCase(case=name, title="", plan="", requirements=(), max_duration=0.0)
            self.cases[name] = CaseState(unplanned)
        return self.cases[name]

    def _hold(self, event: Hold | HoldEnd) -> None:
        if self.present is None:
            return
        if isinstance(event, Hold):
            self.present.holds.append(Span(event))
        elif self.present.holds:
            self.present.holds[-1].ended = event


def standing(events: Iterable[Event]) -> tuple[Event, ...]:
    """Return the events that stand: a run resumed after a stop has left some void.

    Events from outside the run's own course are never void.
    """
    events = tuple(events)
    entries = [each.entry for each in events if isinstance(each, Resumed) and each.entry]
    void = [(entry.boundary, entry.void_to) for entry in entries]
    return tuple(
        event
        for event in events
        if event.origin is Origin.OUTSIDE or not any(after < event.seq <= last for after, last in void)
    )


def before_results(events: Iterable[Event]) -> Iterator[Event]:
    """Yield the events from which the results are derived."""
    return takewhile(lambda event: not isinstance(event, Results), events)


def fold(events: Iterable[Event]) -> RunState:
    """Return the state of a run after these events."""
    state = RunState()
    for event in events:
        state.take(event)
    return state
