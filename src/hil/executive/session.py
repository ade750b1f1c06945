"""Session: one run from its folder to its seal."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from typing import Protocol

from hil.bench.bound import BoundBench
from hil.evidence import events
from hil.evidence.package.sealing import ReportWriter
from hil.executive.cases.artifacts import Artifacts
from hil.executive.cases.case_run import CaseRun
from hil.executive.cases.charts import Charts
from hil.executive.cases.checks import Checks
from hil.executive.cases.effects import Effects
from hil.executive.cases.escapes import Escapes
from hil.executive.cases.facade import Facade, RoleSet, facades
from hil.executive.cases.operator import Operator
from hil.executive.cases.recorder import Recorder
from hil.executive.cases.steps import Steps
from hil.executive.ending.signals import handle_signals
from hil.executive.ending.stop import Astray, StopFlags, Stopped, Turn, kept_from_copies
from hil.executive.journaling.events import Caller, Unheard
from hil.executive.journaling.freezing import freezing
from hil.executive.journaling.record import Record
from hil.executive.people.answers import Answering
from hil.executive.people.at_hand import at_hand
from hil.executive.people.files import Shelf
from hil.executive.resuming.beginnings import Entering, NewRun
from hil.executive.setup.configuration import Configuration
from hil.executive.setup.head import PlannedCase
from hil.executive.watching.attending import Attendant, Lookout
from hil.executive.watching.keeper import BenchKeeper
from hil.executive.watching.machine import LiveMachine, live_machine
from hil.executive.watching.ports import Machine, NoMachine
from hil.executive.watching.recorded import timeline_of
from hil.executive.watching.room import asked_of
from hil.model.identity import Source
from hil.model.verdict import Verdict
from hil.wire.transcript import Transcript

__all__ = ["EXIT_INTERRUPTED", "EXIT_TRIPPED", "EXIT_UNSAFE", "Session", "Spectator", "code_of"]

EXIT_INTERRUPTED = 2
EXIT_TRIPPED = 6
EXIT_UNSAFE = 7


def code_of(pytest_code: int, verdicts: Sequence[Verdict], *, unsafe: bool, tripped: bool, stopped: bool) -> int:
    """Return the run's exit code: what happened to the bench outweighs pytest's result.

    Args:
        pytest_code: what pytest returned; it counts before the teardown, which may still evaluate checks.
        verdicts: the verdicts of all planned cases.
        unsafe: whether the bench could not be proven safe.
        tripped: whether the envelope tripped.
        stopped: whether the run was requested to stop.
    """
    if unsafe:
        return EXIT_UNSAFE
    if tripped:
        return EXIT_TRIPPED
    if stopped:
        return EXIT_INTERRUPTED
    if pytest_code in {0, 1}:
        return 0 if verdicts and all(verdict.good for verdict in verdicts) else 1
    return pytest_code


Binder = Callable[[Transcript, Callable[[], str]], BoundBench]
"""Makes the bench from the transcript and a function that returns the current step."""


class Spectator(Protocol):
    """Shows what happens in a run, or notifies somebody."""

    def __call__(self, event: events.Event, /) -> None:
        """Take one event."""

    def tick(self) -> None:
        """Do what is due."""


class Session:
    """One run. Its methods are called in this order: `arm`, then `begin` and `end` per case, `safe`, `seal`.

    Args:
        configuration: what the run is made of.
        planned: every case, before anything is deselected.
        binder: makes the bench.
        answers: makes the source of answers.
        leases: what this run must hold exclusively, such as the ports of its instruments.
        spectators: are shown every event, and get a turn several times a second.
        beginning: what the run begins from: nothing, an interrupted run, or a package.
        caller: is notified of what the run cannot recover from.

    Attributes:
        record: the record of the run.
        machine: drives a bench outside this process, None for one in it.
    """

    def __init__(
        self,
        configuration: Configuration,
        planned: Sequence[PlannedCase],
        *,
        binder: Binder,
        answers: Answering,
        leases: Sequence[str] = (),
        spectators: Sequence[Spectator] = (),
        beginning: NewRun | None = None,
        caller: Caller | None = None,
    ) -> None:
        self.configuration = configuration
        self.flags = StopFlags()
        self.machine: LiveMachine | None = None
        self.poison = ""
        self.current: CaseRun | None = None
        self._beginning = beginning or NewRun()
        self._caller = caller or Unheard()
        self._made: set[Path] = set()
        self._verdicts: list[Verdict] = []
        self._attempts: dict[str, int] = {}
        self._stopped = False
        self._planned = tuple(planned)
        self._open_cases = dict.fromkeys(case.id for case in planned)
        self._closing = ExitStack()
        try:
            self._open(planned, binder, answers, leases, spectators)
        except BaseException:
            self._closing.close()
            raise

    def _open(
        self,
        planned: Sequence[PlannedCase],
        binder: Binder,
        answers: Answering,
        leases: Sequence[str],
        spectators: Sequence[Spectator],
    ) -> None:
        """Take the leases, make the folder, write the head of the journal, and open the bench.

        From here to the seal, signals are requests to stop.
        """
        configuration = self.configuration
        alarm = self._closing.enter_context(handle_signals(self.flags))
        self.record = record = Record(
            configuration, self.flags, leases, spectators, self._beginning, self._caller, self._closing
        )
        self._events = record.events
        self._freezing = self._closing.enter_context(
            freezing(configuration.inputs, record.folder, record.events, self.flags)
        )
        record.begin(planned)
        if configuration.request.source is Source.HARDWARE:
            self._freezing.compare_executed()
        self.bench = bench = binder(record.transcript, self._where)
        self._closing.callback(bench.close)
        record.follow(bench, checkpoints=bool(leases))  # a rehearsal is not resumed
        machine: Machine = NoMachine()
        if bench.live is not None:
            inhibit = configuration.workspace.inhibitor
            machine = self.machine = live_machine(bench, bench.live, self.flags, record, inhibit)
        timeline = timeline_of(bench, machine, record.events, self._beginning.not_opened)
        self.keeper = BenchKeeper(
            bench,
            configuration.dut,
            self.flags,
            record.events,
            record.store,
            machine,
            timeline,
            (record.upkeep, *spectators),
        )
        record.events.listen(self.keeper.holding)
        self._entering = Entering(record, bench, self.keeper, self._beginning)
        if self._beginning.resumes or self.machine is not None or timeline.retraces:
            record.events.serve(self)  # any other run is always caught up
        self.flags.govern(self)
        self._closing.enter_context(kept_from_copies(self._descriptors))
        if bench.live is not None and self.machine is not None:
            alarm.keep(Attendant(bench, self.machine, bench.live, self.keeper.scheduler, self.keeper.holding))
        else:
            alarm.keep(Lookout(bench, self.keeper.scheduler, self.keeper.holding, self._caller.expect))
        self._answers = answers(bench, self.keeper.scheduler.idle, record.upkeep.elsewhere)

    def _descriptors(self) -> list[int]:
        """Return the descriptors that no copy of this process may keep."""
        return [*self.record.descriptors, *(self.machine.descriptors if self.machine else ())]

    def before_event(self) -> None:
        """Catch up with where a resumed or replayed run is, before an event is stamped."""
        if self.flags.reason and self.record.retraces():
            self._caller.stopped_early()
        self.keeper.scheduler.catch_up()

    def before_line(self) -> None:
        """Hand what an event of a live bench is based on to the operating system."""
        if self.machine is not None:
            self.record.before_line()

    def after_event(self, course: int) -> None:
        """Enter a resumed run, if this event is its point of entry."""
        try:
            self._entering.after(course)
        finally:
            self._keep_failed()

    @property
    def folder(self) -> Path:
        """The run's folder."""
        return self.record.folder

    def arm(self, left_out: Collection[str] = ()) -> None:
        """Arm the bench; if that fails, every case is NOT_RUN for that reason, as it is after a stop.

        No room is required for the recordings of cases that are left out.
        """
        if self.flags.reason:
            return
        refusal = self.keeper.arm(asked_of(self._planned, left_out, self.configuration.catalogue.requirement))
        if refusal and not self.flags.reason:
            self.poison = f"the bench was not armed: {refusal}"
            self._verdicts.append(Verdict.ERROR)

    def begin(self, planned: PlannedCase) -> CaseRun:
        """Begin a case."""
        scheduler = self.keeper.scheduler
        turn = Turn(self.flags, scheduler.catch_up)
        journal = turn.guarded(self._events)
        self._open_cases.pop(planned.id, None)
        attempt = self._attempts[planned.id] = self._attempts.get(planned.id, 0) + 1
        journal.write(events.Case(case=planned.id, attempt=attempt))
        steps = Steps(planned.id, journal, self._now, turn.undisturbed)
        effects = Effects(journal, steps, self._beginning.recall, turn.undisturbed)
        requirements = {name: self.configuration.catalogue.requirement(name) for name in planned.requirements}
        self._began_ns = self.bench.clock.now_ns()
        used: dict[str, Source] = {}
        shelf = Shelf(self.record.attachments, self._beginning.attachments, scheduler.point, self._made)
        self.current = CaseRun(
            planned=planned,
            requirements=requirements,
            steps=steps,
            effects=effects,
            check=Checks(requirements, steps, journal, partial(self.configuration.stands, planned.plan)),
            record=Recorder(
                steps, scheduler, effects, self.record.store, self.bench.source, tuple(requirements.values())
            ),
            operator=Operator(self._answers, effects, steps, journal, shelf, at_hand(self.configuration, planned.plan)),
            artifact=Artifacts(steps, effects, journal, shelf.folder, self._made),
            chart=Charts(requirements, steps, journal),
            scheduler=scheduler,
            escapes=Escapes(self.flags, self.configuration.workspace),
            journal=journal,
            source=self.bench.source,
            used=used,
        )
        self.current.escapes.begin()
        self._keep_failed()
        scheduler.begin_case(self.current, round(planned.max_duration_s * 1e9))
        if self.machine is None:  # for any other, the guardian ends what does not return
            self._caller.expect(scheduler.patience_s)
        return self.current

    def _keep_failed(self) -> None:
        """Count what failed in the present case before the run was interrupted, and the attempts given up then."""
        if self.current is not None:
            self.current.check.keep(self._entering.take_failed(self.current.planned.id))
            self.current.given_up += self._entering.take_given_up(self.current.planned.id)

    def end(self, run: CaseRun) -> Verdict:
        """End a case: record its verdict, and bring the bench to rest."""
        verdict = self._conclude(run)
        self.poison = self.poison or self._poison(run)
        return verdict

    def _conclude(self, run: CaseRun) -> Verdict:
        self._own()
        self.keeper.scheduler.catch_up()  # up to here the record covers what the case did
        for error in self._freezing.end_of_case():
            run.refused(error)
        if self.flags.astray:
            run.raised(Astray(self.flags.astray))
            self.flags.astray = ""
        run.escapes.end(run.raised)
        scheduler = self.keeper.scheduler
        if self.flags.reason and (scheduler.refused or scheduler.lost or self.flags.cuts):
            run.raised(Stopped(self.flags.reason))  # even if the case suppressed it
        run.finish()
        run.close()
        self.keeper.scheduler.end_case()
        self._caller.expect(None)
        outcome = run.outcome()
        ended = events.CaseEnd(
            case=run.planned.id,
            attempt=self._attempts[run.planned.id],
            verdict=outcome.verdict,
            reasons=outcome.reasons,
            requirements=outcome.requirements,
            duration=round((self.bench.clock.now_ns() - self._began_ns) / 1e9, 9),
            used=run.used,
        )
        self._events.write(ended)
        self._verdicts.append(outcome.verdict)
        self.current = None
        with suppress(OSError):  # a full disk is reported by its own watch
            self.record.transcript.flush()
        return outcome.verdict

    def not_run(self, case: str, reason: str) -> None:
        """Note that a planned case is not run."""
        self._open_cases.pop(case, None)
        self._events.write(events.NotRun(case=case, reason=reason))
        self._verdicts.append(Verdict.NOT_RUN)

    def roles(self, run: CaseRun) -> Mapping[str, Facade | RoleSet]:
        """Return the façades of one case, by role."""
        return facades(self.bench.spec, self.bench.roles, run.effects, run)

    def safe(self) -> None:
        """Make the bench safe, whatever else fails, and record why the run was stopped, if it was."""
        self._own()
        try:
            self._stopped = bool(self.flags.reason)
            if self._stopped:
                flags = self.flags
                self._events.write(events.Stop(reason=flags.reason, urgent=flags.urgent, resumable=flags.leave_open))
        finally:
            self.keeper.release()

    def make_safe(self) -> None:
        """Make the bench safe in the middle of whatever a case does."""
        self.keeper.safe()

    def give_up(self) -> None:
        """End the run from where it is, in the middle of a case that suppresses every stop and timeout."""
        with self.flags.shielded():
            try:
                if run := self.current:
                    self.record.store.end_of_case(run.planned.id)
                    self._conclude(run)
                for case in tuple(self._open_cases):
                    self.not_run(case, "the run was ended in the middle of a case that nothing else ended")
                self.safe()
            finally:
                self._caller.given_up()

    def exit_code(self, pytest_code: int) -> int:
        """Return the run's exit code."""
        tripped = self.keeper.scheduler.tripped is not None
        return code_of(pytest_code, self._verdicts, unsafe=self.keeper.unsafe, tripped=tripped, stopped=self._stopped)

    def seal(self, exit_code: int, write_reports: ReportWriter) -> str:
        """Seal the package and return its evidence digest."""
        with self.flags.shielded(), self._closing:
            self._freezing.tell_changes()
            return self.record.seal(exit_code, write_reports)

    @property
    def left_open(self) -> bool:
        """Whether the run was stopped to be resumed, see `BenchKeeper.stays_open`."""
        return self._stopped and self.keeper.stays_open

    def leave_open(self) -> None:
        """Close everything without a seal, so that the run can be resumed."""
        with self.flags.shielded(), self._closing:
            self.record.leave_open()

    def abandon(self) -> None:
        """Close everything without a seal: for runs whose folder is discarded."""
        with self._closing:
            self.record.abandon()

    def _now(self) -> float:
        self.flags.stay_home()
        return self.bench.clock.now()

    def _own(self) -> None:
        """End this process if it is a copy that a case forked and let continue: there is only one run."""
        if self.flags.is_copy:
            os._exit(1)

    def _where(self) -> str:
        return f"step {self.current.steps.number or 'none'} of {self.current.planned.id}" if self.current else "no case"

    def _poison(self, run: CaseRun) -> str:
        """Return why no further case can run, empty if one can."""
        trip = self.keeper.scheduler.tripped
        if trip:
            return f"the envelope tripped: {trip.text}"
        if run.bench_fault:
            return f"bench fault: {run.bench_fault}"
        return self.keeper.rest()
