"""A session: one run from its folder to its seal."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from itertools import count
from pathlib import Path

from hil.bench.binding import BoundBench
from hil.evidence.folder import ATTACHMENTS
from hil.evidence.package.sealing import ReportWriter
from hil.executive.case.artifacts import Artifacts
from hil.executive.case.case_run import CaseRun, PlannedCase
from hil.executive.case.checks import Checks
from hil.executive.case.effects import Effects, Recall
from hil.executive.case.facade import Facade, RoleSet
from hil.executive.case.operator import AnswerSource, Operator
from hil.executive.case.recorder import Recorder
from hil.executive.case.steps import Steps
from hil.executive.run.earlier import Earlier
from hil.executive.run.events import Listener
from hil.executive.run.keeper import BenchKeeper
from hil.executive.run.record import Record
from hil.executive.run.stop import Astray, StopFlags, Stopped, Turn, handle_signals, leave_unsealed
from hil.executive.setup.configuration import Configuration
from hil.model.verdict import Verdict
from hil.wire.transcript import Transcript

__all__ = ["EXIT_INTERRUPTED", "EXIT_TRIPPED", "EXIT_UNSAFE", "Session"]

EXIT_INTERRUPTED = 2
EXIT_TRIPPED = 6
EXIT_UNSAFE = 7

Binder = Callable[[Transcript, Callable[[], str]], BoundBench]
"""Makes the bench; gets the transcript, and what tells the present step."""


class Session:
    """One run. Its methods are called in this order: `arm`, then `begin` and `end` per case, `safe`, `seal`.

    Args:
        configuration: what the run is made of.
        planned: every case, before anything is deselected.
        orphans: cases without a requirement.
        binder: makes the bench.
        answers: makes what answers questions, from the bench and the scheduling point to pass while waiting.
        leases: what this run must hold alone, such as the ports of its instruments.
        listeners: are shown every event.
        recall: the effects that this run must agree with, in a replay.
        earlier: the interrupted run that this one goes on with.

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
        answers: Callable[[BoundBench, Callable[[], None]], AnswerSource],
        leases: Sequence[str] = (),
        listeners: Sequence[Listener] = (),
        recall: Recall | None = None,
        earlier: Earlier | None = None,
    ) -> None:
        self.configuration = configuration
        self.flags = StopFlags()
        self.poison = ""
        self.current: CaseRun | None = None
        self._recall = recall
        self._earlier = earlier
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
        except BaseException:
            self._closing.close()
            raise

    def _open(
        self,
        planned: Sequence[PlannedCase],
        binder: Binder,
        answers: Callable[[BoundBench, Callable[[], None]], AnswerSource],
        leases: Sequence[str],
        listeners: Sequence[Listener],
    ) -> None:
        """Take the leases, make the folder, write the head of the journal, and open the bench.

        From here to the seal signals are requests to stop.
        """
        configuration = self.configuration
        self._closing.enter_context(handle_signals(self.flags))
        self.record = Record(configuration, self.flags, leases, listeners, self._earlier, self._closing)
        self.record.begin(planned)
        self._events = self.record.events
        self.bench = binder(self.record.transcript, self._where)
        self._closing.callback(self.bench.close)
        self.record.follow(self.bench, checkpoints=bool(leases))  # nobody resumes a rehearsal
        self.keeper = BenchKeeper(
            self.bench,
            configuration.dut,
            self.flags,
            self._events.write,
            self.record.store,
            self.record.upkeep.tick,
        )
        self._events.listen(self.keeper.holding)
        self.flags.make_safe, self.flags.give_up = self.keeper.safe, self.give_up
        self._answers = answers(self.bench, self.keeper.scheduler.idle)

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
        turn = Turn(self.flags)
        write = turn.guarded(self._events.write)
        scheduler = self.keeper.scheduler
        self._open_cases.pop(planned.id, None)
        attempt = self._attempts[planned.id] = self._attempts.get(planned.id, 0) + 1
        write("case", case=planned.id, attempt=attempt)
        steps = Steps(planned.id, write, self._now)
        effects = Effects(write, steps, self._recall, turn.undisturbed)
        requirements = {name: self.configuration.catalogue.requirement(name) for name in planned.requirements}
        self._began_ns = self.bench.clock.now_ns()
        scheduler.deadline_ns = self._began_ns + round(planned.max_duration_s * 1e9)
        scheduler.refused = 0
        if not scheduler.watching:  # the bench was made safe under the case before
            scheduler.watch_from_now()
        used: dict[str, str] = {}
        self.current = CaseRun(
            planned=planned,
            requirements=requirements,
            steps=steps,
            effects=effects,
            check=Checks(requirements, steps, write, used),
            record=Recorder(
                steps, scheduler, effects, self.record.store, self.bench.source.value, lambda: next(self._ids)
            ),
            operator=Operator(self._answers, effects, steps, write, scheduler.point),
            artifact=Artifacts(steps, effects, write, self.folder / ATTACHMENTS, self._made),
            scheduler=scheduler,
            write=write,
            source=self.bench.source.value,
            used=used,
        )
        scheduler.faulted = self.current.fault
        return self.current

    def end(self, run: CaseRun) -> Verdict:
        """End a case: write its verdict down, and bring the bench to rest."""
        verdict = self._conclude(run)
        self.poison = self.poison or self._poison(run)
        return verdict

    def _conclude(self, run: CaseRun) -> Verdict:
        self._own()
        if self.flags.astray:
            run.raised(Astray(self.flags.astray))
            self.flags.astray = ""
        if self.flags.reason and (self.keeper.scheduler.refused or self.flags.cuts):
            run.raised(Stopped(self.flags.reason))  # whatever the case made of it
        run.close()
        self.keeper.scheduler.deadline_ns = self.keeper.scheduler.faulted = None
        outcome = run.outcome()
        self._events.write(
            "case-end",
            case=run.planned.id,
            attempt=self._attempts[run.planned.id],
            verdict=outcome.verdict.value,
            reasons=list(outcome.reasons),
            requirements={name: verdict.value for name, verdict in outcome.requirements.items()},
            duration=round((self.bench.clock.now_ns() - self._began_ns) / 1e9, 9),
            used=run.used,
        )
        self._verdicts.append(outcome.verdict)
        self.current = None
        self.record.transcript.flush()
        return outcome.verdict

    def not_run(self, case: str, reason: str) -> None:
        """Note that a planned case is not run."""
        self._open_cases.pop(case, None)
        self._events.write("not-run", case=case, reason=reason)
        self._verdicts.append(Verdict.NOT_RUN)

    def roles(self, run: CaseRun) -> Mapping[str, Facade | RoleSet]:
        """Return the façades of one case, by role."""
        by_role: dict[str, dict[str, Facade]] = {}
        instruments = {instrument.name: instrument for instrument in self.bench.spec.instruments}
        for wire in self.bench.spec.wiring:
            instrument = self.bench.spec.instrument(wire.instrument)
            role = self.bench.roles[wire.name]
            facade = Facade(wire, instrument, role, run.effects, run, instruments)
            by_role.setdefault(wire.role, {})[wire.instance] = facade
        return {
            role: instances[""] if "" in instances else RoleSet(role, instances) for role, instances in by_role.items()
        }

    def safe(self) -> None:
        """Make the bench safe, whatever else fails, and write down why the run was stopped, if it was."""
        self._own()
        try:
            self._stopped = bool(self.flags.reason)
            if self._stopped:
                self._events.write("stop", reason=self.flags.reason, urgent=self.flags.urgent)
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
        """Return the run's exit code: what happened to the bench outweighs what pytest says."""
        if self.keeper.unsafe:
            return EXIT_UNSAFE
        if self.keeper.scheduler.tripped:
            return EXIT_TRIPPED
        if self._stopped:
            return EXIT_INTERRUPTED
        if pytest_code in {0, 1}:  # pytest counts before the teardown, which may still evaluate checks
            return 0 if self._verdicts and all(verdict.good for verdict in self._verdicts) else 1
        return pytest_code

    def seal(self, exit_code: int, write_reports: ReportWriter) -> str:
        """Seal the package and return its evidence digest."""
        with self.flags.shielded(), self._closing:
            return self.record.seal(exit_code, write_reports)

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
        if problem := self.keeper.rest():
            return f"the bench did not reach its rest state: {problem}"
        return ""
