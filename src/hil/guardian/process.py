"""The guardian's process: answers the executive, watches it, and responds once when it fails."""

from __future__ import annotations

import math
import os
import select
import signal
import socket
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import Any

from hil.guardian import channel
from hil.guardian.channel import DrillResult, HungUp
from hil.guardian.incident import IncidentLog
from hil.guardian.plan_codec import read_plan
from hil.guardian.ports.outputs import Outputs
from hil.guardian.ports.worker import PortWorker
from hil.guardian.response import Response
from hil.guardian.watchdog import Watchdog
from hil.model.safing import GuardedOutput, GuardPlan

__all__ = ["Guard", "main"]

_IGNORED = ("HUP", "INT", "QUIT", "TERM", "TSTP", "TTIN", "TTOU", "USR1", "USR2", "ALRM", "VTALRM", "PROF", "PIPE")
_IDLE_S = 0.5
_FOR_DEATH_MS = 50
_FOR_A_PLAN_MS = 10_000
_LATE_S = 1.0
_MOST_AT_ONCE = 64
_STANDARD_ERROR = 2


class _Ended(Exception):
    """The executive is dead, or does not do what it must."""


class Guard:
    """Serves one executive.

    Args:
        end: this process's end of the channel.
        plan: what is guarded.
        executive: descriptor of the executive's process.
        workers: by device.
    """

    def __init__(self, end: socket.socket, plan: GuardPlan, executive: int, workers: dict[str, PortWorker]) -> None:
        self._end = end
        self._plan = plan
        self._executive = executive
        self._outputs = Outputs(plan, workers, self._look)
        self._record = IncidentLog(plan)
        self._watchdog = Watchdog(plan.hang_s)
        self._watching = False
        self._disarmed = False
        self._left = False
        self._poll = select.poll()
        self._poll.register(end, select.POLLIN)
        self._poll.register(executive, select.POLLIN)

    def serve(self) -> bool:
        """Serve until the executive leaves or fails; return whether all outputs are safe, as far as is known.

        An executive that leaves properly is not killed, even with outputs unproven: it has released its ports. Nor is
        it killed when the guardian itself fails: its next beat reports that.
        """
        kill = False
        try:
            self._send("ready")
            while not self._left:
                self._turn()
            why = "the executive left before the guardian had found every output safe" if self._watching else ""
        except (_Ended, HungUp) as ended:
            why = "" if self._disarmed else self._why_ended(ended)
            kill = True
        except Exception as error:  # noqa: BLE001 - a guardian that fails makes the bench safe before it exits
            why = f"the guardian itself failed: {error!r}" if self._watching else ""
        if not why:
            return True
        response = Response(self._plan, self._outputs, self._record, self._executive, self._have_acted)
        return response.act(why, kill=kill)

    def _have_acted(self, unproven: tuple[str, ...]) -> None:
        """Report to the executive, if it is there; if staying, close standard error, whose reader awaits its end."""
        if unproven:
            _fall_silent()
        with suppress(HungUp):
            self._send("acted", unproven=unproven)

    def _turn(self) -> None:
        self._poll.poll((self._watchdog.next_s() if self._watching else _IDLE_S) * 1000)
        for message in self._messages():
            self._answer(message)
        self._look_for_death()
        if self._watching and (why := self._watchdog.why()):
            raise _Ended(why)

    def _messages(self) -> Iterator[dict[str, Any]]:
        for _ in range(_MOST_AT_ONCE):
            packet = None if self._left else channel.receive(self._end)
            if packet is None:
                return
            yield packet[0]

    def _answer(self, message: dict[str, Any]) -> None:
        """Do what the executive asks for.

        Raises:
            KeyError: if the request is unknown.
        """
        answers: dict[str, Callable[[dict[str, Any]], None]] = {
            "beat": self._take_beat,
            "drill": self._drill,
            "watch": self._watch,
            "disarm": self._disarm,
            "leave": self._leave,
        }
        answers[message["kind"]](message)

    def _take_beat(self, message: dict[str, Any]) -> None:
        self._watchdog.beat(message["fresh_until"])
        self._send("heard", number=message["number"])

    def _drill(self, _message: dict[str, Any]) -> None:
        self._outputs.begin(reopen=False)
        self._report(self._outputs.drill)
        self._send_result(self._drill_heartbeat())
        self._watchdog.restart()
        self._send("done")

    def _watch(self, _message: dict[str, Any]) -> None:
        self._watchdog.restart()
        self._watching, self._disarmed = True, False
        self._send("watching")

    def _disarm(self, _message: dict[str, Any]) -> None:
        self._outputs.begin(reopen=True)
        if self._report(self._outputs.prove):
            self._watching, self._disarmed = False, True
        self._watchdog.restart()
        self._send("done")

    def _leave(self, _message: dict[str, Any]) -> None:
        self._left = True

    def _drill_heartbeat(self) -> DrillResult:
        """Let the executive beat, then be silent, and measure when its silence would make the guardian act."""
        watchdog, heard = Watchdog(self._plan.hang_s), 0
        self._send("beats")
        while not watchdog.why():
            self._poll.poll(watchdog.next_s() * 1000)
            for message in self._messages():
                watchdog.beat(math.inf)
                heard += 1
                self._send("heard", number=message["number"])
            self._look_for_death()
        silent_s = watchdog.silent_s
        ok = heard > 0 and self._plan.hang_s <= silent_s < self._plan.hang_s + _LATE_S
        said = f"heard {heard} beats; would have acted after {silent_s:.2f} s of silence"
        return DrillResult(output="heartbeat", ok=ok, detail=said, seconds=silent_s)

    def _report(self, ask: Callable[[GuardedOutput], DrillResult]) -> bool:
        results = []
        for each in self._plan.outputs:
            results.append(ask(each))
            self._send_result(results[-1])
        safe = {result.output for result in results if result.ok}
        for cut in self._plan.cut:
            by = [each for each in cut.cut_by if each in safe]
            said = f"cut off by {by[0]}, which is proven safe" if by else f"not cut off by {', '.join(cut.cut_by)}"
            results.append(DrillResult(output=cut.output, ok=bool(by), detail=said, seconds=0.0))
            self._send_result(results[-1])
        return all(result.ok for result in results)

    def _send_result(self, result: DrillResult) -> None:
        self._send("result", output=result.output, ok=result.ok, detail=result.detail, seconds=result.seconds)

    def _send(self, kind: str, **fields: object) -> None:
        channel.send(self._end, kind, **fields)  # a stopped executive does not read; do not wait for it

    def _look(self) -> None:
        """Notice the executive's death during other work."""
        self._look_for_death()
        if any(event & (select.POLLHUP | select.POLLERR) for _, event in self._poll.poll(0)):
            raise HungUp("closed")

    def _look_for_death(self) -> None:
        if _is_dead(self._executive, 0):
            raise _Ended("the executive died")

    def _why_ended(self, ended: Exception) -> str:
        if isinstance(ended, _Ended):
            return str(ended)
        dead = _is_dead(self._executive, _FOR_DEATH_MS)
        return "the executive died" if dead else "the executive closed the channel"


def main(arguments: Sequence[str]) -> None:
    """Run the guardian on its end of the channel, then end the process without exit handlers."""
    try:
        end = socket.socket(fileno=int(arguments[0]))
    except (IndexError, ValueError, OSError):
        raise SystemExit("hil starts its guardian itself; do not start it by hand") from None
    for name in _IGNORED:
        signal.signal(getattr(signal, f"SIG{name}"), signal.SIG_IGN)
    os.chdir("/")
    try:
        guard = _received(end)
    except Exception as error:  # noqa: BLE001 - reported to the executive; nothing was driven yet
        with suppress(HungUp):
            channel.send(end, "refused", why=str(error) or repr(error))
        os._exit(2)
    code = 0 if guard.serve() else 1
    sys.stderr = None
    os._exit(code)


def _received(end: socket.socket) -> Guard:
    """Wait for the plan and its descriptors: the executive's process, the plan as a file, ports, leases."""
    poll = select.poll()
    poll.register(end, select.POLLIN)
    poll.poll(_FOR_A_PLAN_MS)
    packet = channel.receive(end)
    if packet is None:
        raise TimeoutError("no plan came")
    executive, written, *passed = packet[1]
    with os.fdopen(written, "rb") as file:
        plan = read_plan(file.read())
    IncidentLog(plan).check()
    workers = {port.device: PortWorker(port, each) for port, each in zip(plan.ports, passed, strict=False)}
    return Guard(end, plan, executive, workers)  # the descriptors of leases stay open until the process ends


def _fall_silent() -> None:
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, _STANDARD_ERROR)
    os.close(nowhere)


def _is_dead(process: int, wait_ms: int) -> bool:
    poll = select.poll()
    poll.register(process, select.POLLIN)
    return bool(poll.poll(wait_ms))
