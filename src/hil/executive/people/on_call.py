"""Unattended runs: what they require of a bench, and how the person on call is reached at arming."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Iterator
from typing import ClassVar

from hil.bench.connections import cut_path_shortfall
from hil.bench.gate import Gate
from hil.clock import wall
from hil.evidence import events
from hil.evidence.events import EventSink
from hil.executive.people.questions import AnswerSource, Declined, Question
from hil.executive.setup.configuration import Configuration
from hil.model.errors import Refused

__all__ = ["OnCall", "People", "require_unattended"]

_LEAST_PATHS = 2
_LOOK_S = 0.1
_CODE_LETTERS = "ABCDEFGHJKLMNPQRSTUVWXYZ23456789"
"""Letters that cannot be confused on a small display."""

_CODE_LENGTH = 6

Became = Callable[[], str | None]
"""Returns the outcome of a notification: None while it is in progress, empty once sent, otherwise the error."""


def require_unattended(configuration: Configuration) -> None:
    """Require of an unattended run everything that stands in for a person; any other run passes.

    Raises:
        Refused: with everything that is missing.
    """
    request, spec = configuration.request, configuration.bench
    if not request.unattended:
        if request.on_call:
            raise Refused("--on-call names somebody for a run that is attended", "add --unattended")
        return
    if not configuration.outside:
        raise Refused(
            "--unattended does not apply to a bench simulated in this process",
            "leave --unattended out, or use --detach",
        )
    missing = list(_missing(configuration))
    if missing:
        told = "; ".join(missing)
        raise Refused(f"this run of bench '{spec.name}' is unattended, which needs more: {told}", "or attend it")


def _missing(configuration: Configuration) -> Iterator[str]:
    spec = configuration.bench
    if not configuration.request.on_call.strip():
        yield "name who is on call with --on-call NAME"
    if not configuration.workspace.notify:
        yield "name a command that notifies people, notify = [...] in hil.toml"
    if all(path.needs_host for path in spec.cut_paths):
        yield "the bench file names no cut path that needs no host: a watchdog, such as a battery tester's, or hardware"
    yield from cut_path_shortfall(spec, _LEAST_PATHS)


class OnCall:
    """The person on call for a run: sent a code when the bench is armed, and reached once the code is returned.

    It listens to the run's events, and compares the codes that come through its inbox.

    Args:
        name: who is on call.
        run: the run's name, for the command that the person types.
        within_s: timeout for the answer, in wall time [s].
        notify: sends a notification, given its event and text; returns a function that returns its outcome.
        journal: where events are written.
    """

    def __init__(
        self,
        name: str,
        run: str,
        within_s: float,
        notify: Callable[[str, str], Became],
        journal: EventSink,
    ) -> None:
        self.name = name
        self._run = run
        self._within_s = within_s
        self._notify = notify
        self._journal = journal
        self._code = ""
        self._by = ""

    def __call__(self, event: events.Event) -> None:
        """Take one event of the run."""
        if isinstance(event, events.Reached) and event.ok:
            self._by = event.by

    def knows(self, code: str) -> bool:
        """Return whether this is the latest code sent, and it has not been returned yet."""
        given = code.strip().upper().encode(errors="surrogatepass")  # of str, only ASCII can be compared
        return bool(self._code) and not self._by and secrets.compare_digest(given, self._code.encode())

    def reach(self, idle: Callable[[], bool]) -> str:
        """Send a code and wait until it is returned; return why nobody was reached, empty if somebody was.

        Args:
            idle: watches the run while it waits; returns whether it may keep waiting.
        """
        self._by = ""
        self._code = "".join(secrets.choice(_CODE_LETTERS) for _ in range(_CODE_LENGTH))
        became = self._notify(
            "test", f"{self.name} is on call. Type: hil ack {self._run} --code {self._code} --by NAME"
        )
        wait = f"{self._within_s / 60:g} min"
        text = f"{self.name} was sent a code, and has {wait} to give it back"
        self._journal.write(events.Called(name=self.name, text=text))
        until = wall.monotonic() + self._within_s
        try:
            while not self._by:
                if not idle():
                    return "the run is to end"
                if problem := became():
                    return f"the notification was not sent: {problem}"
                if wall.monotonic() >= until:
                    return f"nobody gave the code of the notification back within {self._within_s:g} s"
                wall.pause(_LOOK_S)
            return ""
        finally:
            self._code = ""


class People:
    """Gates opened by people whenever a bench outside this process is armed, before anything is driven.

    It listens to the run's events for what was confirmed. Who opened a gate is recorded in separate events.

    Args:
        on_call: the person to be reached, None for an attended run.
        answers: asks a person again for safety confirmations given at an earlier arming.
        journal: where events are written.
        idle: watches the run while it waits for somebody; returns whether the run may continue.

    Attributes:
        hears: the kinds of events that it needs.
    """

    hears: ClassVar[tuple[type[events.Event], ...]] = (events.Question, events.Answer, events.Reached)

    def __init__(
        self,
        on_call: OnCall | None,
        answers: AnswerSource,
        journal: EventSink,
        idle: Callable[[], bool],
    ) -> None:
        self._on_call = on_call
        self._answers = answers
        self._journal = journal
        self._idle = idle
        self._asked: Question | None = None
        self._confirmed: dict[tuple[str, str], Question] = {}

    def __call__(self, event: events.Event) -> None:
        """Take one event of the run."""
        if isinstance(event, events.Question):
            asked_for = Question(name=event.name, form=event.form, text=event.text, safety=True)
            self._asked = asked_for if event.safety else None
        elif isinstance(event, events.Answer) and (asked := self._asked) is not None:
            self._asked = None
            if event.value is True:
                self._confirmed[asked.name, asked.text] = asked
        elif self._on_call is not None:
            self._on_call(event)

    def gates(self) -> Iterator[Gate]:
        """Yield the gates one by one."""
        if self._on_call is not None:
            problem = self._on_call.reach(self._idle)
            yield Gate("person on call", ok=not problem, detail=problem or f"{self._on_call.name} was reached")
        for question in tuple(self._confirmed.values()):
            yield self._again(question)

    def _again(self, question: Question) -> Gate:
        """Ask again for a confirmation given at an earlier arming."""
        name = f"confirmed again: {question.name}"
        asked = events.AskedAgain(name=question.name, form=question.form, text=question.text, options=(), safety=True)
        self._journal.write(asked)
        try:
            answer = self._answers.answer(question)
        except Declined as error:
            return Gate(name, ok=False, detail=str(error))
        told = events.Confirmed(name=question.name, text=question.text, value=answer.value, by=answer.by)
        self._journal.write(told)
        said = "yes" if answer.value is True else "no"
        return Gate(name, ok=answer.value is True, detail=f"{question.text} {said}, says {answer.by}")
