"""`operator`: a person's hands and eyes, with every answer as evidence."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from hil.evidence import events
from hil.evidence.events import EventSink
from hil.executive.cases.effects import Effects, Where
from hil.executive.cases.escapes import OfThisProcess
from hil.executive.people.questions import AnswerSource, Declined, Question
from hil.model.figure import Figure
from hil.model.provenance import Provenance, Word, answer_to

__all__ = ["Operator"]


class Operator(OfThisProcess):
    """The `operator` fixture of one case.

    Args:
        source: who answers.
        effects: where answers are noted and, in a replay, come from.
        where: returns case and step.
        journal: where events are written.
        point: the scheduling point.
    """

    said = "`operator`"

    def __init__(
        self,
        source: AnswerSource,
        effects: Effects,
        where: Where,
        journal: EventSink,
        point: Callable[[], None],
    ) -> None:
        self._source = source
        self._effects = effects
        self._where = where
        self._journal = journal
        self._point = point

    def confirm(self, text: str, *, name: str, safety: bool = False) -> None:
        """Ask for a confirmation.

        Args:
            text: what the person reads.
            name: the question's name.
            safety: whether somebody's safety hangs on it. On hardware, and on a served bench, no file answers it: a
                person does, live and by name, and again whenever the bench is armed again.

        Raises:
            Declined: if it is not given.
        """
        if not self._ask(Question(name=name, form="confirm", text=text, safety=safety)):
            raise Declined(f"'{text}' was not confirmed")

    def choose(self, text: str, options: Sequence[str], *, name: str) -> str:
        """Ask for one of the options and return it."""
        chosen = str(self._ask(Question(name=name, form="choose", text=text, options=tuple(options))))
        return Word(chosen, Provenance(sources=(answer_to(name),)))

    def measure(self, text: str, unit: str, *, name: str, uncertainty: float | None = None) -> Figure:
        """Ask for a number that the person reads off, in `unit`, with its standard uncertainty if known."""
        value = self._ask(Question(name=name, form="measure", text=text, unit=unit))
        unknown = f"the {answer_to(name)} was read off an instrument that the bench does not know"
        provenance = Provenance(sources=(answer_to(name),), unproven=(unknown,))
        return Figure(value=float(value), unit=unit, uncertainty=uncertainty).with_provenance(provenance)

    def attach(self, what: str, text: str, *, name: str, options: Sequence[str] = ()) -> None:
        """Ask the person to connect `what` to the bench, and wait until that is confirmed.

        Args:
            what: the thing, one of `options` where they are given.
            text: what the person reads.
            name: the question's name.
            options: everything that could be connected there.

        Raises:
            Declined: if something else is connected.
        """
        question = Question(name=name, form="attach", text=text, options=(what, *(o for o in options if o != what)))
        attached = self._ask(question)
        if attached != what:
            raise Declined(f"'{what}' was to be connected, '{attached}' is")

    def _ask(self, question: Question) -> str | float | bool:
        self._point()
        arguments = {
            "form": question.form,
            "text": question.text,
            "options": list(question.options),
            "unit": question.unit,
            **({"safety": True} if question.safety else {}),
        }
        return self._effects.perform(f"operator.{question.name}", "asks", arguments, lambda: self._asked(question))

    def _asked(self, question: Question) -> str | float | bool:
        case, step = self._where.case, self._where.number
        asked = events.Question(
            case=case,
            step=step,
            name=question.name,
            form=question.form,
            text=question.text,
            options=question.options,
            unit=question.unit,
            safety=question.safety,
        )
        self._journal.write(asked)
        answer = self._source.answer(question)
        _check(question, answer.value)
        told = events.Answer(case=case, step=step, name=question.name, value=answer.value, by=answer.by)
        self._journal.write(told)
        return answer.value


def _check(question: Question, value: str | float | bool) -> None:
    if question.options and value not in question.options:
        raise Declined(
            f"'{value}' is not an answer to '{question.name}'", f"answer one of: {', '.join(question.options)}"
        )
    if question.form == "measure" and (isinstance(value, bool) or not _is_number(value)):
        raise Declined(f"'{value}' is not a number for '{question.name}'", f"answer in {question.unit}")


def _is_number(value: str | float) -> bool:
    try:
        return math.isfinite(float(value))
    except ValueError:
        return False
