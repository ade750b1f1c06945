"""Arming: the one way to drive a bench, with nothing energised unguarded or after a stop, and a safe end."""

from __future__ import annotations

import errno
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Protocol

from hil.bench.bound import BoundBench
from hil.bench.gate import Gate
from hil.bench.readiness import energised_gates, unpowered_gates
from hil.bench.safe_off import SafeResult, left_on
from hil.executive.ending.stop import StopFlags, Stopped
from hil.executive.watching.ports import Distress, Freshness, Machine
from hil.executive.watching.timeline import Timeline
from hil.model.identity import Dut

__all__ = ["FIRST_ARMING", "ArmedBench", "Course", "Passed"]

FIRST_ARMING = -1
"""Identifies the first arming of a run; every other one is identified by the `void_to` of its entry."""

Passed = Callable[[Gate, bool], None]
"""Takes a new gate, and whether it is one of people or machine."""

_LOOKED_AFTER = "bench looked after"


class Course(Freshness, Protocol):
    """Passage of time for whoever drives the bench."""

    @property
    def timeline(self) -> Timeline:
        """The timeline that holds now."""
        ...

    def come(self) -> object:
        """Catch up with the present."""
        ...


class ArmedBench:
    """A bench as driven by runs and visits; nothing else energises an output.

    First it is checked without driving it. Then people and machine must be ready, and the guardian watches a bench
    outside this process. Only then are outputs tried, one at a time. Once a stop was requested, or the guardian, a
    port or the sleep inhibitor was lost, no bytes are sent except those that make the bench safe. Whoever arms it
    leaves it by `make_safe`, `let_go` and `latch`.

    Args:
        bench: the bench.
        dut: the device under test, compared with what answers; None if it was not specified.
        flags: stop requests; they wait while the bench is made safe.
        machine: drives the bench, and guards it.
        thorough: whether all checks are done even after one has failed.
        room: yields, at the first arming of a run, whether there is room for its recordings.

    Attributes:
        touched: whether anything may have been driven.
        unsafe: whether an output was not proven safe in the end.
    """

    def __init__(
        self,
        bench: BoundBench,
        dut: Dut | None,
        flags: StopFlags,
        machine: Machine,
        *,
        thorough: bool = False,
        room: Callable[[], Iterable[Gate]] = tuple,
    ) -> None:
        self._thorough = thorough
        self._room = room
        self._bench = bench
        self._dut = dut
        self._flags = flags
        self._machine = machine
        self.touched = self.unsafe = False
        self._refused = False
        self._lost: Distress | None = None

    def arm(self, arming: int, course: Course, passed: Passed) -> str:
        """Pass the gates one by one; return the first that does not hold, empty if all do.

        Args:
            arming: identifies the arming, for those in the run's record.
            course: how time passes.
            passed: called with every gate.
        """
        refusal, self._refused = "", True
        with self._bench.brake.applied(self._why_not):
            for gate, of_host, is_new in self._gates(arming, course):
                told = gate
                if self._flags.reason:
                    told = replace(gate, ok=False, detail=f"stopped by {self._flags.reason}; {gate.detail}")
                self._machine.passed()
                if is_new:
                    passed(told, of_host)
                refusal = refusal or ("" if told.ok else f"{told.name}: {told.detail}")
                if refusal and (self.touched or self._flags.reason or not self._thorough):
                    break
            if self._lost and not self._flags.reason and told.name != _LOOKED_AFTER:
                passed(_unattended(self._lost), False)
                refusal = f"{_LOOKED_AFTER}: {self._lost.text}"
        self._refused = bool(refusal)
        return refusal

    def _why_not(self) -> object:
        """Return why no more bytes may be sent; a loss during a gate takes effect before the gate's end."""
        if self._flags.reason:
            return self._flags.reason
        if self.touched and self._lost is None and (found := self._machine.distress()) and found.what:
            self._lost = found
        return OSError(errno.ECANCELED, self._lost.text) if self._lost else None

    def look(self) -> Iterator[Gate]:
        """Yield the gates that drive nothing."""
        return unpowered_gates(self._bench, self._dut)

    def _gates(self, arming: int, course: Course) -> Iterator[tuple[Gate, bool, bool]]:
        """Yield the gates, each with whether it is one of people or machine, and whether it is new."""
        ready = True
        for gate in self.look():
            yield gate, False, True
            ready = ready and gate.ok
        if ready and arming == FIRST_ARMING and course.timeline.all_share:
            for gate in self._room():
                yield gate, False, True
                ready = ready and gate.ok
        if not ready:
            return
        self.touched = True
        try:
            yield from ((gate, True, is_new) for gate, is_new in course.timeline.host_gates(arming, course))
        except Stopped:
            yield Gate("guardian", ok=False, detail="not started"), True, True
        course.come()
        for gate in energised_gates(self._bench, self._dut):
            yield gate, False, True
            if distress := course.timeline.distress():
                yield _unattended(distress), False, True

    def switch_off(self) -> None:
        """Send every output its safe command, regardless of requests meanwhile; `make_safe` proves each."""
        if self.touched:
            with self._flags.shielded():
                self._machine.switch_off()

    def make_safe(self, tell: Callable[[SafeResult], None]) -> list[str]:
        """Execute every line of the safe-off, regardless of requests meanwhile; return what is not proven safe.

        On a bench that was armed, a line proven after its time limit is not safe. If the arming was refused, it
        is reported, but counts as safe: a bench too slow for its lines is one reason to refuse it.
        """
        with self._flags.shielded():
            problems = left_on(self._bench.spec.safe_off, self._bench, tell, forgive_late=self._refused)
        self.unsafe = bool(problems)
        return problems

    def let_go(self, *, lost: bool = False) -> list[str]:
        """Have the guardian prove every output itself, and release it; return what it does not find safe.

        Args:
            lost: whether the bench could no longer be driven; what the guardian then proves safe counts as safe.
        """
        problems = self._machine.end(proven=self.touched and not self.unsafe)
        if lost and self._machine.proven:
            self.unsafe = False
            return []
        self.unsafe = self.unsafe or bool(problems)
        return problems

    def latch(self, why: str) -> None:
        """Latch the bench if it was not proven safe."""
        if self.unsafe:
            self._machine.latch(why)


def _unattended(distress: Distress) -> Gate:
    return Gate(_LOOKED_AFTER, ok=False, detail=distress.text)
