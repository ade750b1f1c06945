"""The guardian's response to a failed executive: off, kill it, off and proof until all is proven, then the log."""

from __future__ import annotations

import select
import signal
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import TypeVar

from hil.guardian.incident import IncidentLog, say, utc_now
from hil.guardian.ports.outputs import Outputs
from hil.guardian.ports.worker import Outcome
from hil.model.safing import GuardedOutput, GuardPlan

__all__ = ["Response", "state_of"]

_KEEPS_S = 3.0
_BETWEEN_S = 0.3
_FOR_DEATH_MS = 500
_SAFE = "safe"
T = TypeVar("T")


class Response:
    """Responds once.

    Args:
        plan: what is guarded.
        outputs: what makes the outputs safe.
        log: takes down what is done.
        executive: descriptor of the executive's process.
    """

    def __init__(self, plan: GuardPlan, outputs: Outputs, log: IncidentLog, executive: int) -> None:
        self._plan = plan
        self._outputs = outputs
        self._log = log
        self._executive = executive
        self._states: dict[str, str] = {}
        self._said = False

    def act(self, why: str, *, kill: bool) -> bool:
        """Make every output safe, `kill` the executive, latch the bench; return whether all are safe or cut off.

        A step that fails does not keep the next ones from being taken.
        """
        since, began = utc_now(), time.monotonic()
        self._step(lambda: self._first_pass(why))
        if kill:
            self._step(self._end_executive)
        while True:
            changed = self._step(self._round)
            if changed is not False:
                self._step(lambda: self._log.latch(why, since, self._unproven()))
                self._step(self._log.save)
            self._say(why, last=False)
            if time.monotonic() > self._until(began):
                break
            time.sleep(_BETWEEN_S)
        self._log.note("done", unproven=self._unproven())
        self._step(self._log.save)
        self._say(why, last=True)
        return not self._unproven()

    def _first_pass(self, why: str) -> None:
        began = time.monotonic()
        self._log.note("acting", why=why)
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
        """Make everything safe and prove it; return whether the state of one changed."""
        now = state_of(self._plan.outputs, self._outputs.round())
        changes = {output: said for output, said in now.items() if self._states.get(output) != said}
        self._states = now
        for output, said in changes.items():
            self._log.note("proof", output=output, ok=_is_safe(said), detail=said)
        return bool(changes)

    def _unproven(self) -> tuple[str, ...]:
        return tuple(each.output for each in self._plan.outputs if not _is_safe(self._states.get(each.output, "")))

    def _until(self, began: float) -> float:
        unproven = self._unproven()
        return began + max([_KEEPS_S, *(each.within_s for each in self._plan.outputs if each.output in unproven)])

    def _say(self, why: str, *, last: bool) -> None:
        """Write one line, as soon as all outputs are safe or at the end."""
        unproven = self._unproven()
        if self._said or (unproven and not last):
            return
        self._said = True
        end = f"NOT PROVEN SAFE: {', '.join(unproven)}" if unproven else "all outputs are safe"
        say(f"bench {self._plan.bench}: {why}; {end}; {self._log.latched} (run {self._plan.run})")

    def _step(self, step: Callable[[], T]) -> T | None:
        try:
            return step()
        except Exception as error:  # noqa: BLE001 - the next step must be taken
            self._log.note("failed", why=repr(error))
            return None


def state_of(outputs: tuple[GuardedOutput, ...], proofs: Mapping[str, Outcome]) -> dict[str, str]:
    """Return for every output that it is safe, that it is cut off by one that is safe, or what is wrong with it.

    A cut-off counts only where the output's own port is gone or silent: an instrument that answers and is not safe
    is not safe.
    """
    safe = {output for output, proof in proofs.items() if proof.ok}
    told = {}
    for each in outputs:
        proof = proofs[each.output]
        cut = [other for other in each.cut_by if other in safe]
        if proof.ok:
            told[each.output] = _SAFE
        elif proof.silent and cut:
            told[each.output] = f"cut off by {cut[0]}, which is safe; {proof.detail}"
        else:
            told[each.output] = f"not proven: {proof.detail}"
    return told


def _is_safe(said: str) -> bool:
    return said == _SAFE or said.startswith("cut off by ")
