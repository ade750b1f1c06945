"""The guardian's client: the executive starts and drills the guardian, sends heartbeats, and detects its loss."""

from __future__ import annotations

import os
import select
import socket
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from hil.guardian import channel
from hil.guardian.channel import DrillResult, HungUp
from hil.guardian.plan_codec import seconds_of, written_plan
from hil.model.errors import GuardianLost, HilError, Refused
from hil.model.safing import GuardPlan

__all__ = ["Guardian"]

_STANDARD_ERROR = 2
_START_S = 10.0
_MARGIN_S = 5.0
_LEAVING_S = 2.0
_BEATS_IN_A_DRILL = 3
_LOOK_S = 0.1
_FRAME_S = 0.5
_HINT = "check whether somebody stopped it, and the load of this machine; the bench is made safe without it"


class Guardian:
    """A running guardian, used from one thread of the executive.

    Args:
        process: the guardian's process.
        end: this process's end of the channel.
        plan: what is guarded.
        look: see `start`.

    Attributes:
        stays_for: the outputs for which it stays after `close`, until they are proven safe or a person acknowledges it.
    """

    def __init__(
        self,
        process: subprocess.Popen[bytes],
        end: socket.socket,
        plan: GuardPlan,
        look: Callable[[], None] = lambda: None,
    ) -> None:
        self._look = look
        self._process = process
        self._end = end
        self._plan = plan
        self._poll = select.poll()
        self._poll.register(end, select.POLLIN)
        self._number = 0
        self._unanswered: deque[tuple[int, float]] = deque()
        self._watched = False
        self._disarmed = False
        self._closed = False
        self._lost = False
        self.stays_for: tuple[str, ...] = ()

    @classmethod
    def start(
        cls,
        plan: GuardPlan,
        descriptors: Mapping[str, int],
        lock_descriptors: Sequence[int] = (),
        look: Callable[[], None] = lambda: None,
    ) -> Guardian:
        """Start the process and pass it what it guards.

        Args:
            plan: what is guarded; relative paths in it count from the working directory.
            descriptors: open descriptors of all ports of the plan, by device.
            lock_descriptors: descriptors of the leases; the guardian holds them until it exits.
            look: called a few times a second while an answer is awaited before it watches; if it raises, the guardian,
                which has nothing to guard yet, is ended at once.

        Raises:
            Refused: if it does not start, or cannot use the plan.
        """
        plan = _with_absolute_paths(plan)
        missing = [port.device for port in plan.ports if port.device not in descriptors]
        if missing:
            raise Refused(f"the guardian gets no port of {', '.join(missing)}", "open every port of its plan first")
        mine, its = channel.pair()
        try:
            with its:
                guardian = cls(_started(its), mine, plan, look)
        except OSError as error:
            mine.close()
            raise _does_not_start(error) from error
        try:
            guardian._pass_plan([*(descriptors[port.device] for port in plan.ports), *lock_descriptors])
            guardian._await("ready", _START_S)
        except (HilError, OSError) as error:
            guardian._end_process(_LEAVING_S)
            raise _does_not_start(error) from error
        return guardian

    @property
    def descriptor(self) -> int:
        """This process's end of the channel; -1 once it is closed."""
        return self._end.fileno()

    @property
    def pid(self) -> int:
        """Process id of the guardian."""
        return self._process.pid

    def drill(self) -> tuple[DrillResult, ...]:
        """Have the guardian make every output safe and prove it, then withhold the beats until it would have acted.

        Nothing else may use the ports during the drill.

        Raises:
            GuardianLost: if it is gone or does not answer.
        """
        return self._results("drill")

    def watch(self) -> None:
        """Have the guardian act on the executive's death or silence from now on; the first beat is due within `hang_s`.

        Raises:
            GuardianLost: if it is gone or does not answer.
        """
        self._send("watch")
        self._await("watching", self._plan.hang_s + _MARGIN_S)
        self._watched, self._disarmed = True, False

    def beat(self, fresh_until: float) -> None:
        """Send a heartbeat without waiting.

        Args:
            fresh_until: until when the last check of the envelope is valid, in seconds since boot (CLOCK_BOOTTIME).

        Raises:
            GuardianLost: if the guardian is gone, or has answered no beat for `hang_s`.
        """
        self._take_answers()
        now = time.monotonic()
        if self._unanswered and now - self._unanswered[0][1] > self._plan.hang_s:
            self._lost = True
            raise GuardianLost(f"the guardian has not answered for {now - self._unanswered[0][1]:.1f} s", _HINT)
        self._number += 1
        if self._send("beat", number=self._number, fresh_until=fresh_until) or not self._unanswered:
            self._unanswered.append((self._number, now))

    def disarm(self) -> tuple[DrillResult, ...]:
        """Have the guardian prove every output; it stops watching only if all are proven.

        Nothing else may use the ports meanwhile. If an output is not proven it keeps watching, and beats are due.

        Raises:
            GuardianLost: if it is gone or does not answer.
        """
        results = self._results("disarm")
        self._disarmed = all(result.ok for result in results)
        return results

    def close(self) -> None:
        """Leave, and wait for the guardian to exit. If it is watching it makes the bench safe first, and kills nothing.

        A guardian that cannot prove every output safe stays, and `stays_for` names them. One that is lost, or neither
        exits nor says so, is killed. Closing twice is harmless.
        """
        if self._closed:
            return
        self._closed = True
        acts = self._watched and not self._disarmed and not self._lost
        try:
            self._send("leave")
            if acts:
                self.stays_for = tuple(self._await("acted", self._acting_s())["unproven"])
        except GuardianLost:
            pass
        if self.stays_for:
            self._end.close()
            self._process.returncode = 0  # it is not waited for
        else:
            self._end_process(_LEAVING_S)

    def _acting_s(self) -> float:
        """Return the longest time that the guardian may take to act [s], when every exchange fails."""
        within_s = max((output.within_s for output in self._plan.outputs), default=0.0)
        return within_s + 3 * sum(self._longest_s()) + 3 * _MARGIN_S

    def _longest_s(self) -> list[float]:
        return [seconds_of(output.code) for output in self._plan.outputs]

    def _results(self, kind: str) -> tuple[DrillResult, ...]:
        results = []
        limit_s = self._plan.hang_s + _MARGIN_S + 2 * max(self._longest_s(), default=0.0)
        self._send(kind)
        while (message := self._next(limit_s))["kind"] != "done":
            if message["kind"] == "result":
                del message["kind"]
                results.append(DrillResult(**message))
            elif message["kind"] == "beats":
                for _ in range(_BEATS_IN_A_DRILL):
                    self.beat(0.0)
        self._unanswered.clear()
        return tuple(results)

    def _await(self, kind: str, limit_s: float) -> dict[str, Any]:
        until = time.monotonic() + limit_s
        while (message := self._next(until - time.monotonic()))["kind"] != kind:
            if message["kind"] == "refused":
                raise GuardianLost(message["why"])
        return message

    def _next(self, limit_s: float) -> dict[str, Any]:
        """Return the guardian's next message."""
        until = time.monotonic() + limit_s
        while not self._poll.poll(max(min(until - time.monotonic(), _LOOK_S), 0) * 1000):
            if not self._watched:
                self._call_look()
            if time.monotonic() >= until:
                raise GuardianLost("the guardian does not answer", _HINT)
        message = self._received()
        return {"kind": "nothing"} if message is None else message

    def _call_look(self) -> None:
        """Call `look`; if it raises, end the guardian, to which nothing was entrusted yet."""
        try:
            self._look()
        except BaseException:
            self._poll.poll(_FRAME_S * 1000)  # it may be talking to an output, which ends with this message
            self._closed = True
            self._process.kill()
            self._end_process(_LEAVING_S)
            raise

    def _take_answers(self) -> None:
        while (message := self._received()) is not None:
            while message["kind"] == "heard" and self._unanswered and self._unanswered[0][0] <= message["number"]:
                self._unanswered.popleft()

    def _received(self) -> dict[str, Any] | None:
        try:
            packet = channel.receive(self._end)
        except HungUp as error:
            raise GuardianLost("the guardian is gone", _HINT) from error
        return None if packet is None else packet[0]

    def _send(self, kind: str, **fields: object) -> bool:
        try:
            return channel.send(self._end, kind, **fields)
        except HungUp as error:
            raise GuardianLost("the guardian is gone", _HINT) from error

    def _pass_plan(self, descriptors: Sequence[int]) -> None:
        """Pass the plan, as a file because it may be of any length, and the open descriptors."""
        if len(descriptors) + 2 > channel.MOST_DESCRIPTORS:
            raise HilError(f"{len(descriptors)} ports and leases are more than one packet can pass")
        passed = [os.pidfd_open(os.getpid()), os.memfd_create("guardian-plan")]
        try:
            os.pwrite(passed[1], written_plan(self._plan), 0)
            channel.send(self._end, "plan", *passed, *descriptors)
        except HungUp as error:
            raise GuardianLost("the guardian is gone") from error
        finally:
            for each in passed:
                os.close(each)

    def _end_process(self, longest_s: float) -> None:
        """Close this end, and make sure that the guardian exits."""
        self._end.close()
        try:
            self._process.wait(longest_s)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def _does_not_start(error: Exception) -> Refused:
    return Refused(f"the guardian does not start: {error}", "nothing was driven; correct this and try again")


def _started(end: socket.socket) -> subprocess.Popen[bytes]:
    """Start the process in its own session; it inherits only its end of the channel and standard error."""
    program = str(Path(__file__).with_name("__main__.py").resolve())
    return subprocess.Popen(  # noqa: S603 - ourselves
        [sys.executable, "-I", "-S", program, str(end.fileno())],
        pass_fds=(end.fileno(),),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=None if _is_open(_STANDARD_ERROR) else subprocess.DEVNULL,
        start_new_session=True,
    )


def _with_absolute_paths(plan: GuardPlan) -> GuardPlan:
    """Return the plan for a process with another working directory; links stay links."""
    ports = tuple(replace(port, url=port.url if "://" in port.url else _absolute(port.url)) for port in plan.ports)
    latches = tuple(_absolute(each) for each in plan.latches)
    return replace(plan, ports=ports, journal=_absolute(plan.journal), latches=latches)


def _absolute(path: str) -> str:
    return str(Path(path).absolute()) if path else ""


def _is_open(descriptor: int) -> bool:
    try:
        os.fstat(descriptor)
    except OSError:
        return False
    return True
