"""Notifications: a command of the workspace is run when somebody should know, without ever holding up a run."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from hil.clock import wall
from hil.documents.canonical import canonical
from hil.documents.text import counted
from hil.evidence import events
from hil.evidence.events import EventSink
from hil.model.verdict import Verdict, worst

__all__ = ["Notifier"]

_LIMIT_S = 10.0
_LOOK_S = 0.02
_MOST_AT_ONCE = 4
_LONGEST_TEXT = 1000
_FAILED = 1
_TOLD = (
    events.Answer,
    events.AskedAgain,
    events.CaseEnd,
    events.Confirmed,
    events.Effect,
    events.Lost,
    events.MonitorLate,
    events.NotRun,
    events.Planned,
    events.Question,
    events.Trip,
)
_ENDS = {
    0: "every case passed",
    _FAILED: "not every case passed",
    2: "the run was stopped",
    6: "the envelope tripped, and the bench is safe",
    7: "the bench could not be proven safe",
}


@dataclass(slots=True)
class _Sent:
    """One notification and its outcome: empty if it succeeded, None while it is in progress."""

    event: str
    began: float
    process: subprocess.Popen[bytes] | None = None
    problem: str | None = None
    lasted: float = 0.0


class Notifier:
    """Runs a command on a trip, a pending question, late data, and the end of a run.

    The command gets a JSON object on standard input and the same as variables HIL_EVENT, HIL_RUN and HIL_TEXT. Its
    outcome is recorded at the end of the run, so that equal runs have equal events.

    Args:
        command: program and arguments; empty for no notifications.
        place: the folder in which it runs.
        limit_s: timeout in wall time, after which it is killed with all that it started.
    """

    def __init__(self, command: Sequence[str], place: Path, limit_s: float = _LIMIT_S) -> None:
        self._command = tuple(command)
        self._place = place
        self._limit_s = limit_s
        self._run = ""
        self._journal: EventSink | None = None
        self._sent: list[_Sent] = []
        self._late: set[str] = set()
        self._question = ""
        self._planned = 0
        self._verdicts: dict[str, Verdict] = {}

    effects: ClassVar[frozenset[str]] = frozenset({"asks"})
    """The kinds of effects that it needs: those that a person has answered."""

    @property
    def hears(self) -> tuple[type[events.Event], ...]:
        """The kinds of events that it needs: none if nobody is to be notified."""
        return _TOLD if self._command else ()

    def attach(self, run: str, journal: EventSink | None) -> None:
        """Begin, for the run of this name, with its journal unless the run is over."""
        self._run, self._journal = run, journal

    def __call__(self, event: events.Event) -> None:
        """Take one event of the run."""
        match event:
            case events.Trip():
                self._send("trip", event.text)
            case events.Lost():
                self._send("lost", event.text)
            case events.MonitorLate() if event.limit not in self._late:
                self._late.add(event.limit)
                self._send("stale", event.text)
            case events.Question() | events.AskedAgain():
                self._question = event.text
            case events.Answer() | events.Confirmed() | events.Effect():
                self._question = ""
            case events.CaseEnd():
                self._question = ""
                self._verdicts[event.case] = event.verdict
            case events.NotRun():
                self._verdicts[event.case] = Verdict.NOT_RUN
            case events.Planned():
                self._planned = len(event.cases)

    def send(self, event: str, text: str) -> Callable[[], str | None]:
        """Notify of something that is not an event of the run; return a function that returns the outcome.

        The outcome is None while it is in progress, empty once the command succeeded, and otherwise the error.
        """
        sent = self._send(event, text)
        return lambda: sent.problem if sent else "no command notifies anybody here"

    def tick(self) -> None:
        """Notify of a question that waits for a person, and check on running commands."""
        if self._question:
            how = f" Answer with: hil answer {self._run}"
            self._send("question", self._question[: _LONGEST_TEXT - len(how)] + how)
            self._question = ""
        for sent in self._sent:
            if sent.problem is None:
                self._look_after(sent)

    def finish(self, code: int, text: str = "") -> None:
        """Notify of the end of the run, wait for every command within its timeout, and record their outcomes.

        Args:
            code: the run's exit code.
            text: the sentence about the end; by default that of the exit code.
        """
        self._question = ""
        self._send("end", text or self._ended(code))
        while any(sent.problem is None for sent in self._sent):
            self.tick()
            wall.pause(_LOOK_S)
        for sent in self._sent:
            beside = {"seconds": round(sent.lasted, 3)}
            failed = events.NotifyFailed(event=sent.event, reason=sent.problem) if sent.problem else None
            if self._journal is not None:
                self._journal.write(failed or events.Notified(event=sent.event), beside=beside)
        self._sent.clear()

    def _ended(self, code: int) -> str:
        """Return how the run ended: unless it passed, with its verdict and the number of cases per verdict."""
        told = _ENDS.get(code, f"the run ended with exit code {code}")
        counts = Counter(verdict for verdict in self._verdicts.values() if not verdict.good)
        if code != _FAILED or not counts:
            return told
        cases = ", ".join(f"{counts[verdict]} {verdict}" for verdict in reversed(Verdict) if counts[verdict])
        return f"{worst(counts)}: {told}: of {counted(self._planned, 'case')} {cases}"

    def _send(self, event: str, text: str) -> _Sent | None:
        """Start the command and return its state; an error in starting it is kept, not raised."""
        if not self._command or not self._run:
            return None
        sent = _Sent(event, wall.monotonic())
        self._sent.append(sent)
        if sum(each.problem is None for each in self._sent) > _MOST_AT_ONCE:
            self._end(sent, "too many commands were still running")
            return sent
        text = text.replace("\0", "")[:_LONGEST_TEXT]
        try:
            sent.process = self._started(event, text)
        except (OSError, ValueError) as error:
            self._end(sent, getattr(error, "strerror", None) or type(error).__name__)
            return sent
        told = canonical({"event": event, "run": self._run, "text": text})
        if sent.process.stdin is not None:
            with suppress(OSError):  # it may have ended without reading; the pipe holds it all, so this does not block
                sent.process.stdin.write(told + b"\n")
                sent.process.stdin.flush()
            with suppress(OSError):
                sent.process.stdin.close()
        return sent

    def _started(self, event: str, text: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen(  # noqa: S603 - the workspace names it, and no shell reads it
            self._command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            cwd=self._place,
            env={**os.environ, "HIL_EVENT": event, "HIL_RUN": self._run, "HIL_TEXT": text},
            start_new_session=True,
        )

    def _look_after(self, sent: _Sent) -> None:
        if sent.process is None:
            return
        code = sent.process.poll()
        if code is not None:
            self._end(sent, "" if code == 0 else _manner(code))
        elif wall.monotonic() - sent.began > self._limit_s:
            with suppress(OSError):  # it may be ending by itself right now
                os.killpg(sent.process.pid, signal.SIGKILL)
            sent.process.wait()  # nothing survives that signal, so this returns at once
            self._end(sent, f"it took longer than {self._limit_s:g} s")

    def _end(self, sent: _Sent, problem: str) -> None:
        sent.problem, sent.lasted = problem, wall.monotonic() - sent.began
        if problem:
            with suppress(OSError, ValueError, AttributeError):
                sys.stderr.write(f"hil: nobody was notified of '{sent.event}': {self._command[0]}: {problem}\n")
                sys.stderr.flush()


def _manner(code: int) -> str:
    return f"exit code {code}" if code > 0 else f"it was ended by signal {-code}"
