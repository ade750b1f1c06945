"""The guardian's one act: off, end the executive, off and proof again until they hold, and only then words."""

from __future__ import annotations

import select
import signal
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import TypeVar

from hil.guardian.duty.record import Record, say, utc_now
from hil.guardian.ports.acting import Acting
from hil.guardian.ports.hand import Done
from hil.model.safing import GuardedOutput, GuardPlan

__all__ = ["Ending", "standing"]

_KEEPS_S = 3.0
_BETWEEN_S = 0.3
_FOR_DEATH_MS = 500
_SAFE = "safe"
T = TypeVar("T")


class Ending:
    """Acts once.

    Args:
        plan: what is guarded.
        acting: on the outputs.
        record: where it is noted.
        executive: descriptor of the executive's process.
    """

    def __init__(self, plan: GuardPlan, acting: Acting, record: Record, executive: int) -> None:
        self._plan = plan
        self._acting = acting
        self._record = record
        self._executive = executive
        self._standing: dict[str, str] = {}
        self._said = False

    def act(self, why: str, *, kill: bool) -> bool:
        """Make everything safe, `kill` the executive, latch; return whether all outputs are safe or cut off.

        Whatever goes wrong in one step, the next ones are taken.
        """
        since, began = utc_now(), time.monotonic()
        self._step(lambda: self._first_pass(why))
        if kill:
            self._step(self._end_executive)
        while True:
            changed = self._step(self._round)
            if changed is not False:
                self._step(lambda: self._record.latch(why, since, self._unproven()))
                self._step(self._record.save)
            self._say(why, last=False)
            if time.monotonic() > self._until(began):
                break
            time.sleep(_BETWEEN_S)
        self._record.note("done", unproven=self._unproven())
        self._step(self._record.save)
        self._say(why, last=True)
        return not self._unproven()

    def _first_pass(self, why: str) -> None:
        began = time.monotonic()
        self._record.note("acting", why=why)
        for output, done in self._acting.first_pass().items():
            self._record.note("off", output=output, ok=done.ok, detail=done.detail)
        self._record.note("first pass over", seconds=round(time.monotonic() - began, 3))

    def _end_executive(self) -> None:
        with suppress(ProcessLookupError):
            signal.pidfd_send_signal(self._executive, signal.SIGKILL)
        poll = select.poll()
        poll.register(self._executive, select.POLLIN)
        self._record.note("executive ended", ok=bool(poll.poll(_FOR_DEATH_MS)))

    def _round(self) -> bool:
        """Make everything safe and prove it; return whether an output's standing changed."""
        now = standing(self._plan.outputs, self._acting.round())
        changes = {output: said for output, said in now.items() if self._standing.get(output) != said}
        self._standing = now
        for output, said in changes.items():
            self._record.note("proof", output=output, ok=_holds(said), detail=said)
        return bool(changes)

    def _unproven(self) -> tuple[str, ...]:
        return tuple(each.output for each in self._plan.outputs if not _holds(self._standing.get(each.output, "")))

    def _until(self, began: float) -> float:
        unproven = self._unproven()
        return began + max([_KEEPS_S, *(each.within_s for each in self._plan.outputs if each.output in unproven)])

    def _say(self, why: str, *, last: bool) -> None:
        """Write one line, as soon as all is well or at the end."""
        unproven = self._unproven()
        if self._said or (unproven and not last):
            return
        self._said = True
        end = f"NOT PROVEN SAFE: {', '.join(unproven)}" if unproven else "all outputs are safe"
        say(f"bench {self._plan.bench}: {why}; {end}; {self._record.latched} (run {self._plan.run})")

    def _step(self, step: Callable[[], T]) -> T | None:
        try:
            return step()
        except Exception as error:  # noqa: BLE001 - the next step must be taken
            self._record.note("failed", why=repr(error))
            return None


def standing(outputs: tuple[GuardedOutput, ...], proofs: Mapping[str, Done]) -> dict[str, str]:
    """Return of every output that it is safe, or cut off by one that is, or what is wrong with it.

    What cuts it off counts only where its own port is gone or silent: an instrument that answers and is not safe is
    not safe.
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


def _holds(said: str) -> bool:
    return said == _SAFE or said.startswith("cut off by ")
