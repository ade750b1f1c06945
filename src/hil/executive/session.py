"""A session: one run from its folder to its seal."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from itertools import count
from pathlib import Path

from hil.bench.bound import BoundBench
from hil.evidence import events
from hil.evidence.folder import ATTACHMENTS
from hil.evidence.package.sealing import ReportWriter
from hil.executive.cases.artifacts import Artifacts
from hil.executive.cases.case_run import CaseRun
from hil.executive.cases.checks import Checks
from hil.executive.cases.effects import Effects
from hil.executive.cases.facade import Facade, RoleSet, facades
from hil.executive.cases.operator import Operator
from hil.executive.cases.recorder import Recorder
from hil.executive.cases.steps import Steps
from hil.executive.ending.exit_codes import code_of
from hil.executive.ending.signals import handle_signals
from hil.executive.ending.stop import Astray, StopFlags, Stopped, Turn, leave_unsealed
from hil.executive.journaling.events import Listener
from hil.executive.journaling.record import Record
from hil.executive.people.answers import Answering
from hil.executive.resuming.beginnings import NewRun
from hil.executive.resuming.entering import Entering
from hil.executive.setup.configuration import Configuration
from hil.executive.setup.head import PlannedCase
from hil.executive.watching.host import host_of
from hil.executive.watching.keeper import BenchKeeper
from hil.model.identity import Source
from hil.model.verdict import Verdict
from hil.wire.transcript import Transcript

__all__ = ["Session"]

Binder = Callable[[Transcript, Callable[[], str]], BoundBench]
"""Makes the bench; gets the transcript, and what tells the present step."""


class Session:
    """One run. Its methods are called in this order: `arm`, then `begin` and `end` per case, `safe`, `seal`.

    Args:
        configuration: what the run is made of.
        planned: every case, before anything is deselected.
        binder: makes the bench.
        answers: makes what answers questions.
        leases: what this run must hold alone, such as the ports of its instruments.
        listeners: are shown every event.
        beginning: what the run begins from: nothing, an interrupted run, or a package.

    Attributes:
        record: what it writes down.
        at_last: seals and ends the process, for a case that never comes to its end; nothing of the run is left then.
    """

    def __init__(
        self,
        configuration: Configuration,
        planned: Sequence[PlannedCase],
        *,
        binder: Binder,
        answers: Answering,
        leases: Sequence[str] = (),
        listeners: Sequence[Listener] = (),
        beginning: NewRun | None = None,
    ) -> None:
        self.configuration = configuration
        self.flags = StopFlags()
        self.poison = ""
        self.current: CaseRun | None = None
        self._beginning = beginning or NewRun()
        self._made: set[Path] = set()
        self._ids = count(1)
        self._verdicts: list[Verdict] = []
        self._attempts: dict[str, int] = {}
        self._stopped = False
        self._open_cases = dict.fromkeys(case.id for case in planned)
        self.at_last: Callable[[], object] = leave_unsealed
        self._closing = ExitStack()
        try:
            self._open(planned, binder, answers, leases, listeners)
            self._may_be_entered()
        except BaseException:
            self._closing.close()
            raise

    def _open(
        self,
        planned: Sequence[PlannedCase],
        binder: Binder,
        answers: Answering,
        leases: Sequence[str],
        listeners: Sequence[Listener],
    ) -> None:
        """Take the leases, make the folder, write the head of the journal, and open the bench.

        From here to the seal signals are requests to stop.
        """
        configuration = self.configuration
        alarm = self._closing.enter_context(handle_signals(self.flags))
        self.record = Record(configuration, self.flags, leases, listeners, self._beginning, self._closing)
        self.record.begin(planned)
        self._events = self.record.events
        self.bench = binder(self.record.transcript, self._where)
        self._closing.callback(self.bench.close)
        self.record.follow(self.bench, checkpoints=bool(leases))  # nobody resumes a rehearsal
        store, tick = self.record.store, self.record.upkeep.tick
        self.keeper = BenchKeeper(self.bench, configuration.dut, self.flags, self._events, store, tick)
        self._events.listen(self.keeper.holding)
        self._events.catch_up = self.keeper.scheduler.follow(lambda: self._events.course)
        self.flags.make_safe, self.flags.give_up = self.keeper.safe, self.give_up
        if self.bench.live is not None:
            host = host_of(self.bench, self.bench.live, self.keeper.scheduler, self.record, configuration)
            self.keeper.outside, host.drives = host, self.keeper.holding.drives
            alarm.keep(host.amid, host.between)
        self._answers = answers(self.bench, self.keeper.scheduler.idle, self.record.upkeep.elsewhere)

    def _may_be_entered(self) -> None:
        """Enter the run again where it was, or where it was stopped to be resumed."""
        self.keeper.not_opened = self._beginning.not_opened
        entering = Entering(self.record, self.bench, self.keeper, self._beginning, self._count_from)
        if entering.needed:
            self._events.behind = entering.behind

    def _count_from(self, number: int) -> None:
        self._ids = count(number)

    @property
    def folder(self) -> Path:
        """The run's folder."""
        return self.record.folder

    def arm(self) -> None:
        """Arm the bench; where it cannot be, every case is NOT_RUN for that reason, and so they are after a stop."""
        if self.flags.reason:
            return
        refusal = self.keeper.arm()
        if refusal:
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
        scheduler.deadline_ns = self._began_ns + round(planned.max_duration_s * 1e9)
        scheduler.refused = 0
        if not scheduler.watching:  # the bench was made safe under the case before
            scheduler.watch_from_now()
        used: dict[str, Source] = {}
        self.current = CaseRun(
            planned=planned,
            requirements=requirements,
            steps=steps,
            effects=effects,
            check=Checks(requirements, steps, journal, used),
            record=Recorder(steps, scheduler, effects, self.record.store, self.bench.source, lambda: next(self._ids)),
            operator=Operator(self._answers, effects, steps, journal, scheduler.point),
            artifact=Artifacts(steps, effects, journal, self.folder / ATTACHMENTS, self._made),
            scheduler=scheduler,
            journal=journal,
            source=self.bench.source,
            used=used,
        )
        scheduler.monitoring.faulted, scheduler.present.held_up = self.current.fault, self.current.raised
        return self.current

    def end(self, run: CaseRun) -> Verdict:
        """End a case: write its verdict down, and bring the bench to rest."""
        verdict = self._conclude(run)
        self.poison = self.poison or self._poison(run)
        return verdict

    def _conclude(self, run: CaseRun) -> Verdict:
        self._own()
        self.keeper.scheduler.catch_up()  # up to here the record tells what the case did
        if self.flags.astray:
            run.raised(Astray(self.flags.astray))
            self.flags.astray = ""
        if self.flags.reason and (self.keeper.scheduler.refused or self.flags.cuts):
            run.raised(Stopped(self.flags.reason))  # whatever the case made of it
        run.close()
        scheduler = self.keeper.scheduler
        scheduler.deadline_ns = scheduler.monitoring.faulted = None
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
        with suppress(OSError):  # a full disk is told by who looks after it
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
        """Make the bench safe, whatever else fails, and write down why the run was stopped, if it was."""
        self._own()
        try:
            self._stopped = bool(self.flags.reason)
            if self._stopped:
                flags = self.flags
                self._events.write(events.Stop(reason=flags.reason, urgent=flags.urgent, resumable=flags.leave_open))
        finally:
            self.keeper.release()

    def give_up(self) -> None:
        """End the run from where it is, amid a case that lets no stop and no timeout end it."""
        with self.flags.shielded():
            try:
                if run := self.current:
                    self.record.store.end_of_case(run.planned.id)
                    self._conclude(run)
                for case in tuple(self._open_cases):
                    self.not_run(case, "the run was ended amid a case that nothing else ended")
                self.safe()
            finally:
                self.at_last()

    def exit_code(self, pytest_code: int) -> int:
        """Return the run's exit code."""
        tripped = self.keeper.scheduler.tripped is not None
        return code_of(pytest_code, self._verdicts, unsafe=self.keeper.unsafe, tripped=tripped, stopped=self._stopped)

    def seal(self, exit_code: int, write_reports: ReportWriter) -> str:
        """Seal the package and return its evidence digest."""
        with self.flags.shielded(), self._closing:
            return self.record.seal(exit_code, write_reports)

    @property
    def left_open(self) -> bool:
        """Whether the run was stopped to be resumed, with its bench safe."""
        return self._stopped and self.flags.leave_open and not self.keeper.unsafe and not self.keeper.scheduler.tripped

    def leave_open(self) -> None:
        """Close everything without a seal, so that the run can be resumed."""
        with self.flags.shielded(), self._closing:
            self.record.leave_open()

    def abandon(self) -> None:
        """Close everything without a seal: for runs whose folder nobody keeps."""
        with self._closing:
            self.record.abandon()

    def _now(self) -> float:
        self.flags.stay_home()
        return self.bench.clock.now()

    def _own(self) -> None:
        """End a copy of this process that a case forked and let go on: there is one run."""
        if self.flags.is_copy:
            os._exit(1)

    def _where(self) -> str:
        return f"step {self.current.steps.number or 'none'} of {self.current.planned.id}" if self.current else "no case"

    def _poison(self, run: CaseRun) -> str:
        """Return why no further case can run, if so."""
        trip = self.keeper.scheduler.tripped
        if trip:
            return f"the envelope tripped: {trip.text}"
        if run.bench_fault:
            return f"bench fault: {run.bench_fault}"
        return self.keeper.rest()
