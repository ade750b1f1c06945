"""A session: one run from its folder to its seal."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from io import FileIO
from itertools import count
from pathlib import Path

from hil.bench.binding import BoundBench
from hil.bench.lease import Lease
from hil.evidence.folder import JOURNAL, RESERVE, TRANSCRIPT, create, free_reserve, hold, require_space
from hil.evidence.inbox import Message, poll
from hil.evidence.journal.writer import Journal
from hil.evidence.package.sealing import ReportWriter, seal, write_message
from hil.executive.case.case_run import CaseRun, PlannedCase
from hil.executive.case.checks import Checks
from hil.executive.case.effects import Effects, Recall
from hil.executive.case.facade import Facade, RoleSet
from hil.executive.case.operator import AnswerSource, Operator
from hil.executive.case.recorder import Recorder
from hil.executive.case.steps import Steps
from hil.executive.run.events import DISK_FULL, Events, Listener
from hil.executive.run.keeper import BenchKeeper
from hil.executive.run.row_store import RowStore
from hil.executive.run.stop import StopFlags, handle_signals
from hil.executive.setup.configuration import Configuration
from hil.executive.setup.head import write_head
from hil.model.errors import EvidenceError
from hil.model.verdict import Verdict
from hil.wire.transcript import Transcript

__all__ = ["EXIT_INTERRUPTED", "EXIT_TRIPPED", "EXIT_UNSAFE", "Session"]

EXIT_INTERRUPTED = 2
EXIT_TRIPPED = 6
EXIT_UNSAFE = 7

_LEAST_SPACE = 50_000_000

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
    ) -> None:
        self.configuration = configuration
        self.flags = StopFlags()
        self.poison = ""
        self.current: CaseRun | None = None
        self._recall = recall
        self._ids = count(1)
        self._verdicts: list[Verdict] = []
        self._attempts: dict[str, int] = {}
        self._stopped = False
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
        self.folder = self._open_folder(leases)
        self._closing.enter_context(handle_signals(self.flags))
        self._closing.enter_context(hold(self.folder))
        self._journal = Journal(self.folder / JOURNAL, reserve=self.folder / RESERVE)
        self._events = Events(self._journal, self.flags)
        for listener in listeners:
            self._events.listen(listener)
        self._store = RowStore(self.folder, self._events.write)
        self._sink = FileIO(self.folder / TRANSCRIPT, "w")
        self._transcript = Transcript(self._sink)
        write_head(configuration, planned, self.folder, self._events.write)
        self.bench = binder(self._transcript, self._where)
        self._closing.callback(self.bench.close)
        self._events.follow(self.bench.clock)
        self.keeper = BenchKeeper(
            self.bench, configuration.dut, self.flags, self._events.write, self._store, self._tick
        )
        self._answers = answers(self.bench, self.keeper.scheduler.idle)

    def arm(self) -> None:
        """Arm the bench; where it cannot be, every case is NOT_RUN for that reason."""
        refusal = self.keeper.arm()
        if refusal:
            self.poison = f"the bench was not armed: {refusal}"
            self._verdicts.append(Verdict.ERROR)

    def begin(self, planned: PlannedCase) -> CaseRun:
        """Begin a case."""
        write = self._events.write
        scheduler = self.keeper.scheduler
        attempt = self._attempts[planned.id] = self._attempts.get(planned.id, 0) + 1
        write("case", case=planned.id, attempt=attempt)
        steps = Steps(planned.id, write, self.bench.clock.now)
        effects = Effects(write, steps, self._recall, self.flags.undisturbed)
        requirements = {name: self.configuration.catalogue.requirement(name) for name in planned.requirements}
        self._began_ns = self.bench.clock.now_ns()
        scheduler.deadline_ns = self._began_ns + round(planned.max_duration_s * 1e9)
        used: dict[str, str] = {}
        self.current = CaseRun(
            planned=planned,
            requirements=requirements,
            steps=steps,
            effects=effects,
            check=Checks(requirements, steps, write, used),
            record=Recorder(steps, scheduler, effects, self._store, self.bench.source.value, lambda: next(self._ids)),
            operator=Operator(self._answers, effects, steps, write, scheduler.point),
            scheduler=scheduler,
            write=write,
            source=self.bench.source.value,
            used=used,
        )
        scheduler.faulted = self.current.fault
        return self.current

    def end(self, run: CaseRun) -> Verdict:
        """End a case: write its verdict down, and bring the bench to rest."""
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
        self._transcript.flush()
        self.poison = self.poison or self._poison(run)
        return outcome.verdict

    def not_run(self, case: str, reason: str) -> None:
        """Note that a planned case is not run."""
        self._events.write("not-run", case=case, reason=reason)
        self._verdicts.append(Verdict.NOT_RUN)

    def roles(self, run: CaseRun) -> Mapping[str, Facade | RoleSet]:
        """Return the façades of one case, by role."""
        by_role: dict[str, dict[str, Facade]] = {}
        for wire in self.bench.spec.wiring:
            instrument = self.bench.spec.instrument(wire.instrument)
            role = self.bench.roles[wire.name]
            facade = Facade(wire, instrument, role, run.effects, run)
            by_role.setdefault(wire.role, {})[wire.instance] = facade
        return {
            role: instances[""] if "" in instances else RoleSet(role, instances) for role, instances in by_role.items()
        }

    def safe(self) -> None:
        """Make the bench safe, whatever else fails, and write down why the run was stopped, if it was."""
        try:
            self._stopped = bool(self.flags.reason)
            if self._stopped:
                self._events.write("stop", reason=self.flags.reason, urgent=self.flags.urgent)
        finally:
            self.keeper.release()

    def exit_code(self, pytest_code: int) -> int:
        """Return the run's exit code: what happened to the bench outweighs what pytest says."""
        if self.keeper.unsafe:
            return EXIT_UNSAFE
        if self.keeper.scheduler.tripped:
            return EXIT_TRIPPED
        if self._stopped:
            return EXIT_INTERRUPTED
        if pytest_code == 0 and not all(verdict.good for verdict in self._verdicts):
            return 1
        return pytest_code

    def seal(self, exit_code: int, write_reports: ReportWriter) -> str:
        """Seal the package and return its evidence digest."""
        with self.flags.shielded(), self._closing:
            self._flush()
            self._sink.close()
            return seal(self.folder, self._journal, exit_code=exit_code, write_reports=write_reports)

    def abandon(self) -> None:
        """Close everything without a seal: for runs whose folder nobody keeps."""
        with self._closing:
            self._flush()
            self._sink.close()
            self._journal.close()

    def _open_folder(self, leases: Sequence[str]) -> Path:
        configuration = self.configuration
        require_space(configuration.reports, _LEAST_SPACE)
        lease = Lease(leases, f"a run of {', '.join(plan.name for plan in configuration.plans)}")
        self._closing.callback(lease.release)
        return create(configuration.reports, bench=configuration.bench.name, dut=configuration.dut.serial)

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

    def _tick(self) -> None:
        self._flush()
        if not (self.folder / RESERVE).exists():
            self._disk_is_full()
        for message in poll(self.folder):
            if message.kind == "stop":
                self.flags.request(f"{message.by or 'another terminal'}: {message.text}".rstrip(": "))
            else:
                self._write_message(message)

    def _write_message(self, message: Message) -> None:
        try:
            write_message(self._journal, self.bench.clock.now(), message)
        except EvidenceError:
            self._disk_is_full()

    def _disk_is_full(self) -> None:
        """Ask for the run's end; asked again and again, it is no more urgent than a person's first word."""
        if not self.flags.reason:
            self.flags.request(DISK_FULL)

    def _flush(self) -> None:
        try:
            self._transcript.flush()
            self._store.tick()
        except (OSError, EvidenceError):
            self._disk_is_full()
            if free_reserve(self.folder / RESERVE):
                self._flush()
