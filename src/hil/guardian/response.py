"""The guardian's response to a failed executive: off, kill it, off and proof until all is proven, then the log."""

from __future__ import annotations

import os
import select
import signal
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import TypeVar

from hil.guardian.incident import IncidentLog, utc_now
from hil.guardian.ports.outputs import Outputs
from hil.guardian.ports.worker import Outcome
from hil.model.safing import CutOutput, GuardedOutput, GuardPlan

__all__ = ["Response", "state_of"]

_KEEPS_S = 3.0
_BETWEEN_S = 0.3
_LOOK_S = 0.1
_FOR_DEATH_MS = 500
_MOST_NOTES = 200
_SAFE = "safe"
_NOT_ASKED = Outcome(ok=False, detail="it was not asked yet", silent=True)
T = TypeVar("T")


class Response:
    """One response. It ends when everything is proven safe, or when a person has acknowledged the latch.

    Args:
        plan: what is guarded.
        outputs: what makes the outputs safe.
        log: records what is done.
        executive: descriptor of the executive's process.
        acted: called once, after the first tries are over and logged, with the outputs that are not proven safe.
    """

    def __init__(
        self,
        plan: GuardPlan,
        outputs: Outputs,
        log: IncidentLog,
        executive: int,
        acted: Callable[[tuple[str, ...]], None] = lambda _: None,
    ) -> None:
        self._plan = plan
        self._outputs = outputs
        self._log = log
        self._executive = executive
        self._acted = acted
        self._proofs: dict[str, Outcome] = {}
        self._states: dict[str, str] = {}
        self._why = self._since = ""
        self._notes = 0

    def act(self, why: str, *, kill: bool) -> bool:
        """Make every output safe, `kill` the executive, latch the bench; return whether all are safe or cut off.

        A step that fails does not prevent the next ones.
        """
        self._why, self._since = why, utc_now()
        began = time.monotonic()
        self._step(self._first_pass)
        if kill:
            self._step(self._end_executive)
        while True:
            if self._step(self._round) is not False:
                self._write_down()
            if not self._unproven():
                self._log.say(self._why, self._end())
            if time.monotonic() > began + _KEEPS_S:
                break
            time.sleep(_BETWEEN_S)
        self._retry_until_safe(began, killed=kill)
        return not self._unproven()

    def _retry_until_safe(self, began: float, *, killed: bool) -> None:
        """Retry until everything is proven safe or somebody has acknowledged; the log does not grow.

        Args:
            began: when the response began.
            killed: whether the executive was killed. If not, it may seal the run's folder once `acted` was called.
        """
        tried = concluded = False
        while unproven := self._unproven() or (tried and self._proven_at_once()):
            if not concluded and time.monotonic() > self._until(began):
                concluded = True
                self._log.note("trying", unproven=unproven, pid=os.getpid())
                self._conclude()
                if not killed:
                    self._log.wait_for(self._executive)
            if concluded and self._log.is_acknowledged():
                return
            tried = True
            time.sleep(_LOOK_S)
            self._step(self._try_again)
        self._log.note("done", unproven=(), proven=self._plan.names)
        if concluded:
            self._write_down()
        else:
            self._conclude()

    def _conclude(self) -> None:
        """Report how the first tries ended, once everything is on disk."""
        self._step(self._log.save)
        self._log.say(self._why, self._end())
        self._step(lambda: self._acted(self._unproven()))

    def _end(self) -> str:
        if not self._plan.names:
            return "it guards no output, so nothing was proven"
        if unproven := self._unproven():
            return f"NOT PROVEN SAFE: {', '.join(unproven)}; it keeps trying until they are, or until 'hil ack' ends it"
        return "all outputs are safe"

    def _first_pass(self) -> None:
        began = time.monotonic()
        self._log.note("acting", why=self._why)
        for output, done in self._outputs.first_pass().items():
            self._log.note("off", output=output, ok=done.ok, detail=done.detail)
        self._log.note("first pass over", seconds=round(time.monotonic() - began, 3))

    def _end_executive(self) -> None:
        with suppress(ProcessLookupError):
            signal.pidfd_send_signal(self._executive, signal.SIGKILL)
        poll = select.poll()
        poll.register(self._executive, select.POLLIN)
        self._log.note("executive ended", ok=bool(poll.poll(_FOR_DEATH_MS)))

    def _round(self) -> bool:
        """Make everything safe and prove it; return whether the state of any output changed."""
        return self._take(self._outputs.round())

    def _proven_at_once(self) -> tuple[str, ...]:
        """Prove everything in one round, after outputs were proven one by one; return what is not."""
        if self._step(self._round) is not False:
            self._write_down()
        return self._unproven()

    def _try_again(self) -> None:
        proofs = self._outputs.turn(self._unproven())
        if proofs and self._take(proofs):
            self._write_down()

    def _take(self, proofs: Mapping[str, Outcome]) -> bool:
        """Note what changed, in words only a limited number of times; return whether anything did."""
        self._proofs.update(proofs)
        now = state_of(self._plan.outputs, self._proofs, self._plan.cut)
        changes = {output: said for output, said in now.items() if self._states.get(output) != said}
        if self._notes > _MOST_NOTES:
            changes = {each: said for each, said in changes.items() if _is_safe(said) != _is_safe(self._states[each])}
        self._states = now
        for output, said in changes.items() if self._notes < 2 * _MOST_NOTES else ():
            self._notes += 1
            self._log.note("proof", output=output, ok=_is_safe(said), detail=said)
        return bool(changes)

    def _unproven(self) -> tuple[str, ...]:
        return tuple(output for output in self._plan.names if not _is_safe(self._states.get(output, "")))

    def _until(self, began: float) -> float:
        unproven = self._unproven()
        return began + max([_KEEPS_S, *(each.within_s for each in self._plan.outputs if each.output in unproven)])

    def _write_down(self) -> None:
        self._step(lambda: self._log.latch(self._why, self._since, self._unproven()))
        self._step(self._log.save)

    def _step(self, step: Callable[[], T]) -> T | None:
        try:
            return step()
        except Exception as error:  # noqa: BLE001 - the next step must be taken
            if self._notes < 2 * _MOST_NOTES:
                self._notes += 1
                self._log.note("failed", why=repr(error))
            return None


def state_of(
    outputs: Sequence[GuardedOutput], proofs: Mapping[str, Outcome], cut: Sequence[CutOutput] = ()
) -> dict[str, str]:
    """Return the state of every output: safe, cut off by one that is safe, or what is wrong with it.

    A cut-off counts only where the output's own port is gone or silent, or no bytes lead to it: an instrument that
    answers and is not safe is not safe.
    """
    safe = {output for output, proof in proofs.items() if proof.ok}
    states = {}
    for each in outputs:
        proof = proofs.get(each.output, _NOT_ASKED)
        by = [other for other in each.cut_by if other in safe]
        if proof.ok:
            states[each.output] = _SAFE
        elif proof.silent and by:
            states[each.output] = f"cut off by {by[0]}, which is safe; {proof.detail}"
        else:
            states[each.output] = f"not proven: {proof.detail}"
    for one in cut:
        by = [other for other in one.cut_by if other in safe]
        end = f"cut off by {by[0]}, which is safe" if by else f"not proven: not cut off by {', '.join(one.cut_by)}"
        states[one.output] = f"{end}; it {one.why}"
    return states


def _is_safe(said: str) -> bool:
    return said == _SAFE or said.startswith("cut off by ")
