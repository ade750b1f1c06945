"""What the guardian does to outputs: drill them, prove them, make them safe whatever is in the way."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError, Future

from hil.guardian.carrying import every_exchange, seconds_of
from hil.guardian.channel import Drilled
from hil.guardian.ports.exchanging import Patience
from hil.guardian.ports.hand import Done, Hand
from hil.model.safing import GuardedOutput, GuardPlan, SafeBytes

__all__ = ["Acting"]

_HURRY_S = 0.25
_MARGIN_S = 0.05
_OPENING_S = 1.0
_LOOK_S = 0.005
_STILL_BUSY = Done(ok=False, detail="its port holds up whoever uses it", silent=True)


class Acting:
    """All hands, and what they are asked for.

    Args:
        plan: the guardian's.
        hands: by device.
        look: called often while hands are waited for in a drill or a disarming; may raise to end that.
    """

    def __init__(self, plan: GuardPlan, hands: Mapping[str, Hand], look: Callable[[], None]) -> None:
        self._outputs = plan.outputs
        self._hands = hands
        self._look = look
        self._codes: dict[str, SafeBytes] = {}
        for each in reversed(plan.outputs):
            self._codes[each.device] = each.code  # the first output of a port says how it comes in step

    def drill(self, output: GuardedOutput) -> Drilled:
        """Make one output safe through its own descriptor, and prove it; nothing is opened anew."""
        hand, code, began = self._hands[output.device], output.code, time.monotonic()
        hand.begin(code, Patience(), anew=False)
        asked = [hand.off(code, Patience()), hand.prove(code)]
        off, proof = (self._patiently(future, code) for future in asked)
        ok = off.ok and proof.ok
        said = "off and proven" if ok else f"off: {off.detail or 'taken'}; proof: {proof.detail or 'holds'}"
        return Drilled(output=output.output, ok=ok, detail=said, seconds=time.monotonic() - began)

    def prove(self, output: GuardedOutput) -> Drilled:
        """Prove one output; nothing is sent that changes anything. A port that is gone is opened anew."""
        hand, code, began = self._hands[output.device], output.code, time.monotonic()
        for _ in range(2):  # one lost byte is no danger
            hand.begin(code, Patience(), anew=True)
            proof = self._patiently(hand.prove(code), code)
            if proof.ok:
                break
        said = proof.detail or "proven"
        return Drilled(output=output.output, ok=proof.ok, detail=said, seconds=time.monotonic() - began)

    def first_pass(self) -> dict[str, Done]:
        """Send everything once, in order, in a hurry: a port that says nothing costs the others a quarter of a second.

        Before, all far ends are brought in step at once, since that changes nothing.
        """
        patience = {device: Patience(_HURRY_S) for device in self._hands}
        for hand in self._hands.values():
            hand.drop_everything()
        for device, code in self._codes.items():
            self._hands[device].begin(code, patience[device], anew=False)
        return self._off_in_order(patience)

    def round(self) -> dict[str, Done]:
        """Send everything again, and prove it, with all the time that each exchange may take; return the proofs.

        A port that is slow is left to itself after a moment; what became of it is gathered in the end.
        """
        for device, code in self._codes.items():
            self._hands[device].begin(code, Patience(), anew=True)
        self._off_in_order({device: Patience() for device in self._hands})
        asked = {each.output: self._hands[each.device].prove(each.code) for each in self._outputs}
        until = time.monotonic() + self._longest_s()
        return {name: _result(future, until) for name, future in asked.items()}

    def _off_in_order(self, patience: Mapping[str, Patience]) -> dict[str, Done]:
        done: dict[str, Done] = {}
        slow: set[str] = set()
        for each in self._outputs:
            future = self._hands[each.device].off(each.code, patience[each.device])
            quiet_s = sum(one.quiet_s for one in (*each.code.resync, *each.code.off))
            longest_s = 0.0 if each.device in slow else _HURRY_S + quiet_s + _MARGIN_S
            done[each.output] = _result(future, time.monotonic() + longest_s)
            if done[each.output] is _STILL_BUSY:
                slow.add(each.device)
        return done

    def _longest_s(self) -> float:
        """Return how long the slowest port may be busy with one round [s]."""
        by_device = dict.fromkeys(self._hands, 0.0)
        for each in self._outputs:
            by_device[each.device] += seconds_of(every_exchange(each.code))
        return max(by_device.values(), default=0.0) + _OPENING_S

    def _patiently(self, future: Future[Done], code: SafeBytes) -> Done:
        until = time.monotonic() + seconds_of(every_exchange(code)) + _OPENING_S
        while not future.done() and time.monotonic() < until:
            self._look()
            _result(future, time.monotonic() + _LOOK_S)
        return _result(future, 0.0)


def _result(future: Future[Done], until: float) -> Done:
    try:
        return future.result(max(until - time.monotonic(), 0.0))
    except (TimeoutError, CancelledError):
        return _STILL_BUSY
