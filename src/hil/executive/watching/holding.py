"""Holding: the bench waits in its hold state until it is released, and is then restored."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

from hil.bench.bound import BoundBench
from hil.bench.safe_off import SafeResult, make_safe
from hil.clock import wall
from hil.clock.port import NANOSECONDS
from hil.evidence import events
from hil.evidence.events import EventSink
from hil.executive.ending.stop import StopFlags
from hil.executive.watching.scheduler import Scheduler
from hil.instruments.registry import role_of, states_of
from hil.model.errors import DeviceFault
from hil.model.figure import decoded
from hil.wire.replay import HOLD, HOLD_END

__all__ = ["Call", "Driven", "Holding"]

_ENDS = (events.Case, events.Rest)
"""Kinds of events after which nothing is driven any more: each case itself drives what it needs."""


@dataclass(frozen=True, slots=True)
class Call:
    """A driving call, and the bench time in s at which its operation was first needed."""

    output: str
    operation: str
    arguments: Mapping[str, object]
    first_t: float


class Driven:
    """What has been driven, learnt from the events of a run.

    For every output the last call of each operation is kept, in the order in which they were first needed: a voltage is
    set before an output is switched on. A call that leads to a state of rest voids those before it. A call that
    starts something is not kept: only the case may start it again.
    """

    def __init__(self) -> None:
        self._calls: dict[str, dict[str, Call]] = {}

    def take(self, event: events.Event) -> None:
        """Take one event."""
        if isinstance(event, _ENDS):
            self._calls.clear()
        elif isinstance(event, events.Effect) and event.effect == "drives" and not event.raised:
            output, _, operation = event.name.rpartition(".")
            self._drove(output, operation, event.arguments, event.t)

    def of(self, output: str) -> tuple[Call, ...]:
        """Return the calls that restore an output."""
        return tuple(self._calls.get(output, {}).values())

    @property
    def any_on(self) -> bool:
        """Whether an output was driven to anything but a state of rest."""
        return any(
            call.operation not in states_of(output).values()
            for output, calls in self._calls.items()
            for call in calls.values()
        )

    @property
    def calls(self) -> list[Call]:
        """The calls of all outputs, in the order in which they were first needed: a sensor wakes after its supply."""
        return sorted((call for output in self._calls for call in self.of(output)), key=lambda call: call.first_t)

    def _drove(self, output: str, operation: str, arguments: Mapping[str, object], t: float) -> None:
        role = role_of(output)
        if role and operation in role.operations and role.operations[operation].begins:
            return
        calls = self._calls.setdefault(output, {})
        if operation in states_of(output).values():
            calls.clear()
        part = role.part if role else ""
        key = f"{part} {arguments[part]}" if arguments.get(part) is not None else operation
        first_t = calls[key].first_t if key in calls else t
        calls[key] = Call(output, operation, arguments, first_t)


_PATIENCE_S = 0.05
_LONGEST_APART_S = 5.0
_LOOK_NS = 200_000_000

_NOBODY = events.HoldAsked(release=True, by="", text="")


class Holding:
    """Holds the bench on request; a listener of the run's events.

    Meanwhile the bench time of a simulated bench stands still, as it does while a person is asked. That of hardware
    continues, with monitors and recordings. Neither counts towards the case's `max_duration`.

    Args:
        bench: the bench.
        flags: stop requests; they end a hold.
        journal: where events are written.
        scheduler: the scheduling points to pass in the meantime.

    Attributes:
        hears: the kinds of events that it needs.
        effects: the kinds of effects that it needs.
    """

    hears: ClassVar[tuple[type[events.Event], ...]] = (events.HoldAsked, events.Effect, *_ENDS)
    effects: ClassVar[frozenset[str]] = frozenset({"drives"})

    def __init__(self, bench: BoundBench, flags: StopFlags, journal: EventSink, scheduler: Scheduler) -> None:
        self._bench = bench
        self._flags = flags
        self._journal = journal
        self._scheduler = scheduler
        self._driven = Driven()
        self._wanted: events.HoldAsked | None = None
        self._released: events.HoldAsked | None = None
        self._held = False

    def __call__(self, event: events.Event) -> None:
        """Learn from an event what is driven, and who requests what."""
        if isinstance(event, events.HoldAsked):
            self._asked(event)
        else:
            self._driven.take(event)

    def tick(self) -> None:
        """Hold the bench, if requested, until it is released.

        Raises:
            Stopped, Tripped: the hold ended that way.
            DeviceFault: an output could not be restored.
        """
        if self._wanted is None or self._held:
            return
        asked, self._wanted = self._wanted, None
        self._scheduler.timeline.mark_hold(HOLD)
        self._hold(asked)

    def hold_as_recorded(self) -> None:
        """Hold the bench where its record does; a resumed run killed during a hold is held again."""
        if not self._held and self._scheduler.timeline.holds(HOLD):
            self._hold_as_recorded()
            self._scheduler.catch_up(to_event=False)  # perhaps to the next one

    def _hold_as_recorded(self) -> None:
        began_ns, deadline_ns = self._scheduler.now_ns(), self._scheduler.deadline_ns
        self._held, self._scheduler.deadline_ns = True, None
        try:
            while not self._scheduler.timeline.holds(HOLD_END):
                if self._scheduler.timeline.holds(HOLD):  # a second one is from a run resumed during a hold
                    self._scheduler.timeline.mark_hold(HOLD)
                    self._take()
                    self._scheduler.watch_from_now()
                    continue
                before = self._bench.transcript.operations
                self._scheduler.idle(held=True)  # monitors and turns beside the case, as during the hold
                if not self._scheduler.timeline.retraces:
                    break
                if self._bench.transcript.operations == before:
                    return
            else:
                self._scheduler.timeline.mark_hold(HOLD_END)
                self._as_before()
                return
        finally:
            self._held = False
            lasted_ns = self._scheduler.now_ns() - began_ns
            self._scheduler.deadline_ns = None if deadline_ns is None else deadline_ns + lasted_ns
        self._scheduler.timeline.mark_hold(HOLD)
        self._hold(events.HoldAsked(release=False, by="", text="it was held when the run was interrupted"))

    def drives(self) -> bool:
        """Return whether the case has an output on, by what it has driven."""
        return self._driven.any_on

    def drive_again(self) -> None:
        """Reissue what had been driven on every output, in the same order and with the same spacing.

        A sensor needs settling time after its supply is on; longer waits than that were the case's own.

        Raises:
            DeviceFault: an output could not be restored.
            Stopped: a stop was requested; nothing more is driven.
        """
        before: Call | None = None
        clock = self._bench.clock
        for call in self._driven.calls:
            apart = call.first_t - before.first_t if before else 0.0
            until_ns = clock.now_ns() + round(min(apart, _LONGEST_APART_S) * NANOSECONDS)
            while clock.now_ns() < until_ns:
                self._flags.check()
                clock.wait_until(min(until_ns, clock.now_ns() + _LOOK_NS))
            self._flags.check()
            self._issue(call)
            before = call

    def _asked(self, event: events.HoldAsked) -> None:
        problem = self._against(release=event.release)
        if problem:
            self._journal.write(events.HoldRefused(by=event.by, text=problem))
        elif event.release:
            self._released = event
        else:
            self._wanted = event

    def _against(self, *, release: bool) -> str:
        """Return why the request cannot be met, empty if it can."""
        held = self._held or self._wanted is not None
        if release:
            return "" if held and self._released is None else "the bench is not held"
        if held:
            return "the bench is held already"
        if not self._bench.spec.hold:
            return f"the bench {self._bench.spec.name} has no hold state: its bench file has no 'hold'"
        return "" if self._scheduler.watching else "the bench is in its safe state already"

    def _hold(self, asked: events.HoldAsked) -> None:
        began_ns, began = self._scheduler.now_ns(), wall.monotonic()
        deadline_ns, self._scheduler.deadline_ns = self._scheduler.deadline_ns, None
        how: Literal["released", "ended"] = "ended"
        self._held = True
        try:
            results = self._take()
            outputs = tuple(
                events.Brought(
                    output=each.output, state=each.state, ok=each.ok, detail=each.detail, seconds=each.seconds
                )
                for each in results
            )
            self._journal.write(events.Hold(by=asked.by, text=asked.text, outputs=outputs))
            self._end_unless_held(results)
            self._scheduler.watch_from_now()
            while self._released is None:
                wall.pause(_PATIENCE_S)
                self._scheduler.idle(held=True)
            self._scheduler.timeline.mark_hold(HOLD_END)
            self._as_before()
            how = "released"
        finally:
            lasted_ns = self._scheduler.now_ns() - began_ns
            released = _NOBODY if self._released is None else self._released
            self._released, self._held = None, False
            self._scheduler.deadline_ns = None if deadline_ns is None else deadline_ns + lasted_ns
            lasted = round(lasted_ns / NANOSECONDS, 9)
            ended = events.HoldEnd(how=how, by=released.by, text=released.text, duration=lasted)
            self._journal.write(ended, beside={"held": round(wall.monotonic() - began, 3)})

    def _take(self) -> list[SafeResult]:
        """Bring the outputs to their hold state, in the order of the bench file, uninterrupted."""
        results: list[SafeResult] = []
        with self._flags.shielded():
            bench = self._bench
            make_safe(bench.spec.hold, bench.roles, bench.clock, results.append, speed=bench.speed)
        return results

    def _end_unless_held(self, results: list[SafeResult]) -> None:
        """End the run if the hold state was not reached: the person who requested it may rely on it."""
        wrong = [f"{each.output} is not {each.state}: {each.detail}" for each in results if not each.ok]
        if wrong:
            self._flags.request(f"the bench, which did not reach its hold state: {wrong[0]}")

    def _as_before(self) -> None:
        """Reissue what had been driven on the outputs of the hold state, in the order of the wiring."""
        held = {step.output for step in self._bench.spec.hold}
        with self._flags.undisturbed():
            for output in [wire.name for wire in self._bench.spec.wiring if wire.name in held]:
                for call in self._driven.of(output):
                    self._issue(call)

    def _issue(self, call: Call) -> None:
        given = {name: decoded(value) for name, value in call.arguments.items()}
        try:
            getattr(self._bench.roles[call.output], call.operation)(**given)
        except DeviceFault as fault:
            if (case := self._scheduler.monitoring.case) is not None:
                wire = self._bench.spec.wire(call.output)
                case.fault(self._bench.spec.instrument(wire.instrument), fault)
            raise
