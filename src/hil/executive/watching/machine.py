"""The machine that drives a bench outside this process: its ports, sleep inhibitor, and guardian."""

from __future__ import annotations

import select
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Protocol

from hil.bench.bound import BoundBench
from hil.bench.gate import Gate
from hil.bench.lease import clear_latches_of, keep_latched, latch_bench, latch_unsafe_end
from hil.bench.port_identity import port_gates, source_gates
from hil.clock import wall
from hil.clock.live import LiveClock
from hil.evidence import events
from hil.evidence.durable import audibly
from hil.evidence.safed import guardian_lines
from hil.executive.ending.signals import LOOK_S
from hil.executive.ending.stop import StopFlags
from hil.executive.watching.coverage import harmless, plan_of
from hil.executive.watching.inhibitor import Inhibitor
from hil.executive.watching.ports import Distress, Freshness, Tenant
from hil.guardian.channel import DrillResult
from hil.guardian.client import Guardian
from hil.guardian.latch import Latch
from hil.guardian.ports.outputs import switch_off
from hil.model.bench import BenchSpec
from hil.model.errors import HilError, Refused
from hil.model.identity import Source
from hil.model.safing import GuardPlan

__all__ = ["ArmingPeople", "Guarding", "LiveMachine", "live_machine"]

_BEAT_S = 0.1
_BETWEEN_S = 10.0
_GATE_S = 60.0
"""Longest duration of one gate of an arming, in addition to any outputs made safe in it."""

_ARMING_S = 1800.0
"""Longest total duration of all gates of an arming."""

_SPARE_S = 30.0
_GRACE_S = 1.0
_RENEWED_S = 600.0


class Guarding:
    """Keeps the guardian of a bench: started before the first output, released when everything is proven safe.

    Args:
        bench: the bench, on its open ports.
        clock: its clock, which sends a pulse wherever it is read.
        flags: know whether the executive is doing something that no monitor can interrupt.
        folder: the run's folder.
        leases: what the run holds exclusively.
        locks: descriptors of these leases, which the guardian keeps as long as it is active.

    Attributes:
        lost: why the guardian is lost, empty while it is not.
        proven: whether the guardian, released with something unsafe, has itself proven all of it safe; the bench is
            then latched.
    """

    def __init__(
        self,
        bench: BoundBench,
        clock: LiveClock,
        flags: StopFlags,
        *,
        folder: Path,
        leases: Sequence[str],
        locks: Sequence[int],
    ) -> None:
        self._bench = bench
        self._clock = clock
        self._flags = flags
        self._freshness: Freshness | None = None
        self._folder = folder
        self._leases = leases
        self._locks = locks
        self._guardian: Guardian | None = None
        self._watching = False
        self._latch: Latch | None = None
        self._latched = wall.monotonic()
        self._alone = bench.spec.head.acknowledge == "owner"
        self._beaten = self._pulsed = 0.0
        self._until = self._armed_by = 0.0
        self._uninterrupted_s = _longest_safing_s(bench.spec) + _SPARE_S
        self._gate_s = _longest_safing_s(bench.spec) + _GATE_S
        self.lost = ""
        self.proven = False

    def begin(self, freshness: Freshness, held: Sequence[int] = ()) -> Iterator[Gate]:
        """Start the guardian, have it drill every output's safe-off, and have it watch; each step is a gate.

        Args:
            freshness: says how long the last evaluation of the envelope is valid.
            held: further descriptors for the guardian to keep open as long as it is active.
        """
        self._freshness = freshness
        try:
            plan = plan_of(self._bench, self._folder, self._leases)
            locks = [*self._locks, *held]
            self._guardian = Guardian.start(plan, self._bench.descriptors, locks, self._flags.check)
            for each in self._guardian.drill():
                yield Gate(f"guardian: {each.output}", ok=each.ok, detail=each.detail or f"after {each.seconds:.3g} s")
            self._armed_by = _boot_s() + _ARMING_S
            self.passed()
            self._guardian.watch()
            self._watching, self._clock.pulse = True, self.pulse  # from now on it acts on silence
            self._latch = self._armed(plan)
            audibly(partial(latch_bench, self._leases, self._latch, alone=self._alone))
        except (HilError, OSError) as error:
            yield Gate("guardian", ok=False, detail=str(error))
            return
        yield Gate(
            "guardian",
            ok=True,
            detail=f"watches, and acts after {plan.hang_s:g} s without a heartbeat{self._left(plan)}",
        )

    def _left(self, plan: GuardPlan) -> str:
        """Return what the guardian does not cover."""
        nothing = "" if plan.names else "; it guards no output, so it proves nothing"
        others = ", ".join(harmless(self._bench.spec, plan.names))
        return nothing + (f"; not guarded, because they do no harm by their roles: {others}" if others else "")

    def passed(self) -> None:
        """Grant the next gate of the arming its time: no monitor says yet how long the bench is known to be good."""
        if self._armed_by and self._freshness is not None and self._freshness.fresh_until_ns is None:
            self._until = min(_boot_s() + self._gate_s, self._armed_by)

    def switch_off(self) -> None:
        """Send every output's safe command, as the guardian would: no slow instrument delays another.

        What cannot be sent that way is left to the drivers, run next. See `hil.guardian.ports.outputs.switch_off`.
        """
        with suppress(HilError, OSError):
            plan = plan_of(self._bench, self._folder, self._leases)
            switch_off(plan, self._bench.descriptors, self.pulse)

    def pulse(self) -> None:
        """Send the guardian a heartbeat, with how long the envelope's last evaluation is valid; cheap to call often."""
        self._pulsed = wall.monotonic()
        self._beat(self._pulsed)

    @property
    def descriptors(self) -> list[int]:
        """This process's end of the connection to the guardian."""
        end = -1 if self._guardian is None else self._guardian.descriptor
        return [] if end < 0 else [end]

    def between(self) -> None:
        """Send a heartbeat while the run reads no clock; after some seconds the run itself has to.

        Examples are the end of a case, when failures are formatted and written, and a slow disk.
        """
        now = wall.monotonic()
        if now - self._pulsed < _BETWEEN_S:
            self._beat(now)

    def _beat(self, now: float) -> None:
        if now - self._beaten < _BEAT_S or self._guardian is None or not self._watching:
            return
        self._beaten = now
        try:
            self._guardian.beat(self._good_until())
        except HilError as error:
            self.lost = self.lost or error.message
        self._keep_latched(now)

    def _keep_latched(self, now: float) -> None:
        """Renew the latches of the armed bench from time to time, so that they neither expire nor stay removed."""
        if self._latch is not None and now - self._latched >= _RENEWED_S:
            self._latched = now
            with suppress(OSError, HilError):  # the bench is still guarded; the next renewal may succeed
                audibly(partial(keep_latched, self._leases, self._latch, alone=self._alone))

    def end(self, *, proven: bool) -> list[str]:
        """Have the guardian check every output itself, and release it; return what it does not find safe.

        It is released in any case. If something is not safe, it has tried itself and has latched the bench. If it is
        gone, only the run can say what is safe.

        Args:
            proven: whether the run itself has just proven every output safe.
        """
        guardian, self._guardian, self._latch = self._guardian, None, None
        if guardian is None:
            return []
        self._clock.pulse = lambda: None
        before = len(guardian_lines(self._folder))
        try:
            found = guardian.disarm() if self._watching else ()
        except HilError as error:
            guardian.close()
            return self._unlatched() if proven else [str(error)]
        guardian.close()  # if it has not found everything safe, it acts now, and latches the bench
        wrong = [_described(each) for each in found if not each.ok]
        if stays := guardian.stays_for:
            wrong.append(f"the guardian keeps trying to make {', '.join(stays)} safe, until then or until hil ack")
        last = guardian_lines(self._folder)[before:][-1:]
        self.proven = any(line.get("event") == "done" and line.get("unproven") == [] for line in last)
        return wrong or self._unlatched()

    def _unlatched(self) -> list[str]:
        """Remove the latch of the arming; return what prevents that."""
        try:
            clear_latches_of(self._folder.name)
        except HilError as error:
            return [str(error)]
        return []

    def _armed(self, plan: GuardPlan) -> Latch:
        """Return the latch of the bench while it is armed: run and guardian may end at the same instant."""
        why = "it was armed, and neither its run nor the guardian has said since that it is safe"
        return Latch(bench=plan.bench, run=str(self._folder), why=why, since=wall.utc_now(), outputs=plan.names)

    def _good_until(self) -> float:
        """Return the boot time in s until which the bench needs no attention."""
        fresh_ns = self._freshness.fresh_until_ns if self._freshness else None
        if self._flags.is_shielded or fresh_ns is None:
            self._until = self._until or _boot_s() + self._uninterrupted_s
            return self._until
        self._until = 0.0
        return self._clock.boot_s_of(fresh_ns) + _GRACE_S


def _longest_safing_s(spec: BenchSpec) -> float:
    return sum(step.within_s for step in chain(spec.safe_off, spec.rest, spec.hold))


def _hung_up(gone: Sequence[str], spec: BenchSpec) -> Distress:
    """Return the distress of ports that hung up: the run can be resumed unless the device under test was lost."""
    ours = [name for name in gone if not spec.instrument(name).dut]
    text = f"the port of {', '.join(gone)} is gone"
    return Distress(text, "port", ", ".join(ours)) if ours else Distress(text)


def _described(drilled: DrillResult) -> str:
    return f"{drilled.output}: {drilled.detail}"


def _boot_s() -> float:
    return wall.stamp().boot


class ArmingPeople(Protocol):
    """The people that an armed bench needs."""

    def gates(self) -> Iterable[Gate]:
        """Yield the gates that people open, one by one."""
        ...


class LiveMachine:
    """Machine of a live bench: ports with the right identity, a sleep inhibitor, and a guardian.

    A served bench is simulated: its ports have no identity, and nothing real suffers if its machine sleeps.

    Args:
        bench: the bench; one whose source is simulated is served.
        guarding: the guardian.
        inhibitor: inhibits sleep and shutdown.
        tenant: has the bench for itself.
    """

    def __init__(self, bench: BoundBench, guarding: Guarding, inhibitor: Inhibitor, tenant: Tenant) -> None:
        self._bench, self._spec = bench, bench.spec
        self._guarding = guarding
        self._inhibitor = inhibitor
        self._tenant = tenant
        self._looked = 0.0
        self._served = bench.source is Source.SIMULATED
        self._people: ArmingPeople | None = None

    def attend(self, people: ArmingPeople) -> None:
        """Arm only with these people."""
        self._people = people

    @property
    def descriptors(self) -> list[int]:
        """Descriptors that belong to this process alone: ports, inhibitor, and the connection to the guardian."""
        awake = self._inhibitor.descriptor
        return [*self._bench.descriptors.values(), *self._guarding.descriptors, *([] if awake is None else [awake])]

    def between(self) -> None:
        """Send the guardian a heartbeat while nothing reads the bench for some seconds."""
        self._guarding.between()

    def passed(self) -> None:
        """After a gate of an arming, have the guardian wait for the next one."""
        self._guarding.passed()

    def gates(self, freshness: Freshness) -> Iterator[Gate]:
        """Yield the gates that must hold before anything is driven; with the last one the guardian watches."""
        if not self._served:
            yield from port_gates(self._spec)
            yield from source_gates(self._spec)
        yield self._awake()
        if self._people is not None:
            yield from self._people.gates()
        awake = self._inhibitor.descriptor  # the guardian needs the machine, too
        yield from self._guarding.begin(freshness, () if awake is None else (awake,))

    def distress(self) -> Distress | None:
        """Return why the bench can no longer be driven, None while it can."""
        if self._guarding.lost:
            return Distress(self._guarding.lost, "guardian")
        now = wall.monotonic()
        if now - self._looked < LOOK_S:
            return None
        if gone := self._gone():
            return _hung_up(gone, self._spec)
        if why := "" if self._served else self._inhibitor.lost():
            return Distress(why, "machine")
        self._looked = now  # what was found is reported to every caller
        return None

    def _gone(self) -> list[str]:
        """Return the instruments whose port has hung up; nothing is read or sent to find out."""
        looked, names = select.poll(), {}
        for name, descriptor in self._bench.descriptors.items():
            names[descriptor] = name
            looked.register(descriptor, select.POLLRDHUP)
        return [names[descriptor] for descriptor, _ in looked.poll(0)]

    def switch_off(self) -> None:
        """Switch every output off before anything is proven. See `Guarding.switch_off`."""
        self._guarding.switch_off()

    @property
    def proven(self) -> bool:
        """Whether the guardian has proven safe in the end what the run could not. See `Guarding.proven`."""
        return self._guarding.proven

    def end(self, *, proven: bool) -> list[str]:
        """Release everything; return what the guardian does not find safe. See `Guarding.end`."""
        problems = self._guarding.end(proven=proven)
        self._inhibitor.close()
        return problems

    def latch(self, why: str) -> None:
        """Latch the bench, which was not proven safe; a failure to do so is reported."""
        try:
            latch_unsafe_end(
                self._tenant.leases,
                bench=self._spec.name,
                run=self._tenant.folder,
                why=why,
                alone=self._spec.head.acknowledge == "owner",
            )
        except (OSError, HilError) as error:
            self._tenant.events.write(events.Anomaly(text=f"the bench could not be latched: {error}"))

    def _awake(self) -> Gate:
        name = "sleep and shutdown held off"
        try:
            self._inhibitor.take()
        except Refused as error:
            if self._served:
                return Gate(name, ok=True, detail=f"not needed for a served bench, and not possible here: {error}")
            return Gate(name, ok=False, detail=str(error))
        return Gate(name, ok=True, detail="by this run, until it ends")


def live_machine(
    bench: BoundBench, clock: LiveClock, flags: StopFlags, tenant: Tenant, inhibit: Sequence[str]
) -> LiveMachine:
    """Return the machine of a bench outside this process.

    Args:
        bench: the bench.
        clock: its clock.
        flags: know whether the executive is doing something that no monitor can interrupt.
        tenant: has the bench for itself.
        inhibit: a command that inhibits sleep and shutdown in place of logind; empty for logind.
    """
    guarding = Guarding(bench, clock, flags, folder=tenant.folder, leases=tenant.leases, locks=tenant.lease.descriptors)
    return LiveMachine(bench, guarding, Inhibitor(f"hil drives bench {bench.spec.name}", inhibit), tenant)
