"""The guarded outputs: drilled, proven, and made safe whatever fails."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Collection, Mapping
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor, wait

from hil.guardian.channel import DrillResult
from hil.guardian.plan_codec import seconds_of
from hil.guardian.ports.dialogue import Patience
from hil.guardian.ports.worker import Outcome, PortWorker
from hil.model.safing import GuardedOutput, GuardPlan, SafeBytes

__all__ = ["Outputs", "switch_off"]

_HURRY_S = 0.25
_MARGIN_S = 0.05
_OPENING_S = 1.0
_LOOK_S = 0.005
_WAIT_S = 0.05
_AGAIN_S = 0.3
_PATIENT_S = 1.0
_STILL_BUSY = Outcome(ok=False, detail="its port blocks", silent=True)


class Outputs:
    """All guarded outputs, reached through their port workers.

    Args:
        plan: the guardian's plan.
        workers: by device.
        look: called often while a drill or a disarming waits for workers; may raise to end it.
    """

    def __init__(self, plan: GuardPlan, workers: Mapping[str, PortWorker], look: Callable[[], None]) -> None:
        self._outputs = plan.outputs
        self._workers = workers
        self._look = look
        self._codes: dict[str, SafeBytes] = {}
        self._asked: dict[str, dict[str, Future[Outcome]]] = {}
        self._due: dict[str, float] = {}
        for each in reversed(plan.outputs):
            self._codes[each.device] = each.code  # a port is resynchronised as its first output says

    def begin(self, *, reopen: bool) -> None:
        """Resynchronise with all instruments at once, so that late replies are awaited on all ports in parallel.

        Args:
            reopen: whether a port that is gone may be reopened.
        """
        for device, code in self._codes.items():
            self._workers[device].begin(code, Patience(), reopen=reopen)

    def drill(self, output: GuardedOutput) -> DrillResult:
        """Make one output safe, after `begin`, and prove it."""
        worker, code, began = self._workers[output.device], output.code, time.monotonic()
        asked = [worker.off(code, Patience()), worker.prove(code)]
        off, proof = (self._patiently(future, code) for future in asked)
        ok = off.ok and proof.ok
        if ok:
            self._patiently(worker.recognise(code), code)
        said = "off and proven" if ok else f"off: {off.detail or 'taken'}; proof: {proof.detail or 'holds'}"
        return DrillResult(output=output.output, ok=ok, detail=said, seconds=time.monotonic() - began)

    def prove(self, output: GuardedOutput) -> DrillResult:
        """Prove one output with queries only, after `begin`. A port that is gone is reopened."""
        worker, code, began = self._workers[output.device], output.code, time.monotonic()
        proof = self._patiently(worker.prove(code), code)
        if not proof.ok:  # one lost byte must not count as unsafe
            worker.begin(code, Patience(), reopen=True)
            proof = self._patiently(worker.prove(code), code)
        said = proof.detail or "proven"
        return DrillResult(output=output.output, ok=proof.ok, detail=said, seconds=time.monotonic() - began)

    def first_pass(self) -> dict[str, Outcome]:
        """Send everything once, in order, fast: a silent port costs the others a quarter of a second.

        All ports are resynchronised at once first, which changes no output.
        """
        patience = {device: Patience(_HURRY_S) for device in self._workers}
        for worker in self._workers.values():
            worker.drop_everything()
        for device, code in self._codes.items():
            self._workers[device].begin(code, patience[device], reopen=False)
        return self._off_in_order(patience)

    def settle(self) -> None:
        """Wait, on all ports in parallel, until no reply to anything sent can still be on its way."""
        asked = [self._workers[device].settle(code) for device, code in self._codes.items()]
        until = time.monotonic() + self._longest_s()
        for future in asked:
            _result(future, until)

    def round(self) -> dict[str, Outcome]:
        """Send everything again and prove it, with the full timeout of each exchange; return the proofs.

        A slow port is left to its worker after a moment; its result is collected at the end.
        """
        self.begin(reopen=True)
        self._off_in_order({device: Patience() for device in self._workers})
        asked = {each.output: self._workers[each.device].prove(each.code) for each in self._outputs}
        until = time.monotonic() + self._longest_s()
        return {name: _result(future, until) for name, future in asked.items()}

    def turn(self, names: Collection[str]) -> dict[str, Outcome]:
        """Retry the outputs that are not safe, each port by itself, and return the proofs that have come in since.

        Does not wait; to be called some ten times a second. A port that is gone is looked for about twice a second,
        and what returns is switched off at once.

        Args:
            names: the outputs that are not safe.
        """
        proofs: dict[str, Outcome] = {}
        for device, asked in list(self._asked.items()):
            if all(future.done() for future in asked.values()):
                proofs |= {name: _result(future, 0.0) for name, future in asked.items()}
                del self._asked[device]
                self._due[device] = time.monotonic() + _AGAIN_S
        for device in {each.device for each in self._outputs if each.output in names} - set(self._asked):
            if time.monotonic() >= self._due.get(device, 0.0):
                self._asked[device] = self._try(device)
        return proofs

    def _try(self, device: str) -> dict[str, Future[Outcome]]:
        worker, patience = self._workers[device], Patience(_PATIENT_S)
        worker.begin(self._codes[device], patience, reopen=True)
        mine = [each for each in self._outputs if each.device == device]
        for each in mine:
            worker.off(each.code, patience)
        return {each.output: worker.prove(each.code) for each in mine}

    def _off_in_order(self, patience: Mapping[str, Patience]) -> dict[str, Outcome]:
        done: dict[str, Outcome] = {}
        slow: set[str] = set()
        for each in self._outputs:
            future = self._workers[each.device].off(each.code, patience[each.device])
            quiet_s = sum(one.quiet_s for one in (*each.code.resync, *each.code.off))
            longest_s = 0.0 if each.device in slow else _HURRY_S + quiet_s + _MARGIN_S
            done[each.output] = _result(future, time.monotonic() + longest_s)
            if done[each.output] is _STILL_BUSY:
                slow.add(each.device)
        return done

    def _longest_s(self) -> float:
        """Return the longest time that one round may take on the slowest port [s]."""
        by_device = dict.fromkeys(self._workers, 0.0)
        for each in self._outputs:
            by_device[each.device] += seconds_of(each.code)
        return max(by_device.values(), default=0.0) + _OPENING_S

    def _patiently(self, future: Future[Outcome], code: SafeBytes) -> Outcome:
        until = time.monotonic() + seconds_of(code) + _OPENING_S
        while not future.done() and time.monotonic() < until:
            self._look()
            _result(future, time.monotonic() + _LOOK_S)
        return _result(future, 0.0)


def switch_off(
    plan: GuardPlan, descriptors: Mapping[str, int], look: Callable[[], object] = lambda: None
) -> dict[str, Outcome]:
    """Switch every output off as in the guardian's first pass, from the process that drives the bench; prove nothing.

    No command waits more than a moment for another one's reply, however slow the instruments have become. The lines
    are left in step, with no reply outstanding, so that a driver can go on. Nothing else may use the ports meanwhile.

    Args:
        plan: the guardian's plan.
        descriptors: open descriptors of its ports, by device; they stay open.
        look: called about twenty times a second.
    """
    with ThreadPoolExecutor(max_workers=1, thread_name_prefix="off") as thread:
        future = thread.submit(_switched_off, plan, descriptors)
        while not future.done():
            look()
            wait([future], _WAIT_S)
        return future.result()


def _switched_off(plan: GuardPlan, descriptors: Mapping[str, int]) -> dict[str, Outcome]:
    ports = [port for port in plan.ports if port.device in descriptors]
    workers = {port.device: PortWorker(port, os.dup(descriptors[port.device])) for port in ports}
    try:
        outputs = Outputs(plan, workers, lambda: None)
        done = outputs.first_pass()
        outputs.settle()
    finally:
        for worker in workers.values():
            worker.close()
    return done


def _result(future: Future[Outcome], until: float) -> Outcome:
    try:
        return future.result(max(until - time.monotonic(), 0.0))
    except (TimeoutError, CancelledError):
        return _STILL_BUSY
