"""One case from its first event to its verdict."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import cast

from hil.documents.text import writable
from hil.evidence import events
from hil.evidence.attempts import Abandoned
from hil.evidence.events import EventSink
from hil.evidence.results.outcome import CHANNELS, rule, silence
from hil.executive.cases.artifacts import Artifacts
from hil.executive.cases.charts import Charts
from hil.executive.cases.checks import CheckFailed, Checks
from hil.executive.cases.effects import Effects
from hil.executive.cases.escapes import Escapes, OfThisProcess
from hil.executive.cases.operator import Operator
from hil.executive.cases.recorder import Recorder
from hil.executive.cases.recording import data_checks, provenance_of, recorded_as
from hil.executive.cases.steps import Steps
from hil.executive.ending.stop import Stopped
from hil.executive.setup.head import PlannedCase
from hil.executive.watching.scheduler import CaseTimeout, Scheduler
from hil.model.bench import InstrumentSpec
from hil.model.errors import DeviceFault, Diverged, HilError, Implausible, NotTriggered
from hil.model.identity import Source
from hil.model.verdict import NO_CHECK, Verdict, worst
from hil.requirements.requirement import Requirement

__all__ = ["CaseRun", "Outcome"]

_MOST_NAMED = 4
_ADDRESS = re.compile(r" at 0x[0-9A-Fa-f]{8,}")
"""An object's memory address in its text: different in every run, and no evidence."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """Outcome of a case: its verdict, one per requirement, and the reasons in sentences."""

    verdict: Verdict
    requirements: dict[str, Verdict]
    reasons: tuple[str, ...]


@dataclass
class CaseRun(OfThisProcess):
    """One case while it runs; it decides the verdict, whatever the case's code suppresses."""

    said = "its turn at the bench"

    planned: PlannedCase
    requirements: dict[str, Requirement]
    steps: Steps
    effects: Effects
    check: Checks
    record: Recorder
    operator: Operator
    artifact: Artifacts
    chart: Charts
    scheduler: Scheduler
    escapes: Escapes
    journal: EventSink
    source: Source
    used: dict[str, Source] = field(default_factory=dict)
    given_up: list[Abandoned] = field(default_factory=list)
    """The attempts of this case that the interruption of the run ended without a verdict."""
    _bench_faults: list[str] = field(default_factory=list)
    _dut_faults: list[str] = field(default_factory=list)
    _undecided: list[str] = field(default_factory=list)
    _problems: list[str] = field(default_factory=list)
    _raised: list[BaseException] = field(default_factory=list)
    _refused: list[HilError] = field(default_factory=list)
    _judged: int = 0
    _aborted: str = ""
    _skipped: str = ""

    def iterations(self, name: str, count: int) -> Iterator[int]:
        """Count from 1; each turn is a step, and its beginning a checkpoint."""
        for index in range(1, count + 1):
            with self.steps(f"{name} {index} of {count}", turn=index):
                yield index

    @property
    def bench_fault(self) -> str:
        """The first silence or nonsense of the bench, empty if there was none."""
        return self._bench_faults[0] if self._bench_faults else ""

    def point(self) -> None:
        """Pass a scheduling point."""
        self.scheduler.point()

    def uses(self, instrument: InstrumentSpec) -> None:
        """Note that the case uses this instrument; the weakest source decides what the evidence is worth."""
        self.used[instrument.name] = self.source

    def fault(self, instrument: InstrumentSpec, fault: DeviceFault) -> None:
        """Note silence or nonsense of a device, whether or not the case suppresses the error.

        Raises:
            Stopped: the bench can no longer be driven, see `Scheduler.hear`; the case is resumed, and not judged.
        """
        self._write_fault(fault, dut=instrument.dut)
        if not instrument.dut:
            self.scheduler.hear(instrument, fault)
        (self._dut_faults if instrument.dut else self._bench_faults).append(str(fault))

    def refused(self, error: HilError) -> None:
        """Note a refused operation of a role, whether or not the case suppresses the error."""
        self._refused.append(error)

    def skip(self, reason: str) -> None:
        """Note that the case skipped itself; it is NOT_RUN at best, and its checks until then stand."""
        self._skipped = writable(reason) or "skipped"

    def raised(self, error: BaseException, where: str = "") -> None:
        """Note what the case's code raised, and from where (file and line, as people see them)."""
        self._raised.append(error)
        if isinstance(error, Stopped):
            self._aborted = f"stopped by {error}"
        elif self.scheduler.lost:
            return  # if this has consequences, the resumed case meets them itself
        elif isinstance(error, CaseTimeout):
            self._took_too_long(str(error))
        elif isinstance(error, Diverged) or str(error) in {*self._bench_faults, *self._dut_faults}:
            return
        elif isinstance(error, Implausible):
            self._distrusted(error)
        elif isinstance(error, NotTriggered):
            self._untriggered(error)
        elif not isinstance(error, CheckFailed):
            name = "" if isinstance(error, HilError) else f"{type(error).__name__}: "  # ours are sentences
            problem = writable(_ADDRESS.sub("", f"{name}{error}".rstrip(": ")))
            self._problems.append(f"{problem} ({where})" if where else problem)

    def finish(self) -> None:
        """Evaluate the criteria for the recordings that requirements ask for.

        Called again after the teardown, which may add a recording with a name that was judged already: then all of
        them are evaluated, and the worst counts.
        """
        taken = self.record.taken
        names = {cast("events.Recording", each["facts"]).name for each in taken[self._judged :]}
        self._judged = len(taken)
        for requirement in self.requirements.values():
            if requirement.records is not None and requirement.records.recording in names:
                named = recorded_as(requirement.records, taken)
                origin = provenance_of(requirement.records, named)
                for limit, value, reason in data_checks(requirement.records, named):
                    self.check.data(requirement, limit, value, origin, reason)

    def close(self) -> None:
        """Collect what shows only when nothing of the case is left to run, whatever it suppressed."""
        self.steps.close()
        self.record.close()
        deadline_ns = self.scheduler.deadline_ns
        if deadline_ns is not None and self.scheduler.now_ns() > deadline_ns and not self.scheduler.lost:
            self._took_too_long()
        if self.scheduler.overdue:
            self._took_too_long(self.scheduler.overdue)
        if not self._aborted:
            self.effects.end()

    def outcome(self) -> Outcome:
        """Return the verdict as it stands now."""
        reasons = (*([self._skipped] if self._skipped else []), *self._check_reasons())
        problems = [*self._problems, *self._suppressed()]
        problems += [f"Diverged: {self.effects.diverged}"] if self.effects.diverged else []
        failed = problems or self._bench_faults or self.scheduler.tripped
        counted = () if self.planned.repeatable else tuple(each.counts for each in self.given_up)
        ended = Verdict.ERROR if failed else Verdict.ABORTED if self._aborted or counted else None
        requirements = {name: self._requirement(item, ended) for name, item in self.requirements.items()}
        case = ended or worst(requirements.values() or ([Verdict.NOT_RUN] if self._skipped else []))
        trip = [self.scheduler.tripped.text] if self.scheduler.tripped else []
        told = (*counted, *trip, *problems, *self._bench_faults, *self._dut_faults, *self._undecided, *reasons)
        if not requirements and not self._skipped:
            told = (*told, "the case carries no requirement")
        reasons = tuple(dict.fromkeys([*([self._aborted] if self._aborted else []), *told]))
        return Outcome(verdict=case, requirements=requirements, reasons=reasons)

    def _suppressed(self) -> list[str]:
        """Return what was refused, if the case's code suppressed all of it."""
        refused = (*self.check.refused, *self.operator.refused, *self._refused)
        return [writable(str(error)) for error in refused if not any(error is each for each in self._raised)]

    def _distrusted(self, fault: Implausible) -> None:
        """Note a fixture's judgement that the bench is not as declared; nothing more is run on it."""
        self._write_fault(fault, dut=False)
        self._bench_faults.append(str(fault))

    def _untriggered(self, error: NotTriggered) -> None:
        """Note that an instrument waited in vain: whether bench or DUT is to blame is unknown."""
        if str(error) not in self._undecided:
            self._write_fault(error, dut=False, undecided=True)
            self._undecided.append(str(error))

    def _write_fault(self, fault: DeviceFault | NotTriggered, *, dut: bool, undecided: bool = False) -> None:
        self.journal.write(
            events.Fault(
                case=self.planned.id,
                device=fault.device,
                dut=dut,
                error=type(fault).__name__,
                message=fault.message,
                hint=fault.hint,
                undecided=undecided,
            )
        )

    def _took_too_long(self, why: str = "") -> None:
        problem = why or f"the case took longer than its {self.planned.max_duration_s:g} s of bench time"
        if problem not in self._problems:
            self._problems.append(problem)

    def _requirement(self, requirement: Requirement, ended: Verdict | None) -> Verdict:
        return rule(
            [item.verdict for item in (*self.check.kept, *self.check.evaluated) if item.requirement == requirement.id],
            missing=bool(self._missing(requirement) or self._unrecorded(requirement)),
            silent=silence(
                [limit.parameter for limit in requirement.limits],
                dut=bool(self._dut_faults),
                undecided=bool(self._undecided),
            ),
            taken_out=bool(self._skipped),
            ended=ended,
        )

    def _unrecorded(self, requirement: Requirement) -> str:
        """Return the recording that a requirement asks for and did not get, empty if there is none."""
        asked = requirement.records.recording if requirement.records else ""
        got = any(item.requirement == requirement.id and item.parameter == CHANNELS for item in self.check.evaluated)
        return "" if got else asked

    def _missing(self, requirement: Requirement) -> list[str]:
        """Return the checks that a requirement lacks; of many with one parameter, only the first and the last."""
        done = {(item.parameter, item.of) for item in self.check.evaluated if item.requirement == requirement.id}
        found: list[str] = []
        for limit in requirement.limits:
            left = [of for of in (limit.of or (None,)) if (limit.parameter, of) not in done]
            named = [limit.parameter if of is None else f"{limit.parameter} of {of}" for of in left]
            found += named if len(named) <= _MOST_NAMED else [f"{named[0]} to {left[-1]} ({len(left)} checks)"]
        return found

    def _check_reasons(self) -> tuple[str, ...]:
        reasons = [
            f"{item.requirement} {item.parameter}{f' of {item.of}' if item.of else ''} is {item.verdict}: {item.reason}"
            for item in (*self.check.kept, *self.check.evaluated)
            if not item.verdict.good
        ]
        for requirement in () if self._skipped else self.requirements.values():
            if missing := self._missing(requirement):
                reasons.append(f"{requirement.id}{NO_CHECK}{', '.join(missing)}")
            if name := self._unrecorded(requirement):
                reasons.append(f"{requirement.id} got no whole recording '{name}'")
        return tuple(reasons)
