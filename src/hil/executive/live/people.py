"""The people that an armed bench needs: somebody on call where nobody attends, and whoever confirmed what is safe."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from hil.bench.gate import Gate
from hil.executive.case.operator import AnswerSource, Declined, Question
from hil.executive.live.unattended import OnCall

__all__ = ["People"]


class People:
    """Gates that people open each time that a bench outside of this process is armed, before anything is driven.

    It listens to the run's events, for what was confirmed. Who opened a gate stands in events of its own.

    Args:
        on_call: whoever is to be reached, None for a run that somebody attends.
        answers: asks a person for safety confirmations that were given when the bench was armed before.
        write: writes an event.
        idle: looks after the run while somebody is awaited; returns whether the run may go on.
    """

    def __init__(
        self,
        on_call: OnCall | None,
        answers: AnswerSource,
        write: Callable[..., None],
        idle: Callable[[], bool],
    ) -> None:
        self._on_call = on_call
        self._answers = answers
        self._write = write
        self._idle = idle
        self._asked: Question | None = None
        self._confirmed: dict[tuple[str, str], Question] = {}

    def __call__(self, event: Mapping[str, Any]) -> None:
        """Take one event of the run."""
        if event["kind"] == "question":
            name, form, text = str(event["name"]), str(event["form"]), str(event["text"])
            self._asked = Question(name=name, form=form, text=text, safety=True) if event.get("safety") else None
        elif event["kind"] == "answer" and (asked := self._asked) is not None:
            self._asked = None
            if event["value"] is True:
                self._confirmed[asked.name, asked.text] = asked
        elif self._on_call is not None:
            self._on_call(event)

    def gates(self) -> Iterator[Gate]:
        """Give the gates one by one."""
        if self._on_call is not None:
            problem = self._on_call.reach(self._idle)
            yield Gate("person on call", ok=not problem, detail=problem or f"{self._on_call.name} was reached")
        for question in tuple(self._confirmed.values()):
            yield self._again(question)

    def _again(self, question: Question) -> Gate:
        """Ask again for what was confirmed when the bench was armed before."""
        name = f"confirmed again: {question.name}"
        asked = {"name": question.name, "form": question.form, "text": question.text}
        self._write("asked-again", **asked, options=[], safety=True)
        try:
            answer = self._answers.answer(question)
        except Declined as error:
            return Gate(name, ok=False, detail=str(error))
        self._write("confirmed", name=question.name, text=question.text, value=answer.value, by=answer.by)
        said = "yes" if answer.value is True else "no"
        return Gate(name, ok=answer.value is True, detail=f"{question.text} {said}, says {answer.by}")
