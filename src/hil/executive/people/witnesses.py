"""Eligibility of witnesses: somebody other than who answers, and in the role that is asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache

from hil.clock import wall
from hil.executive.people.answers import SIMULATED_PERSON, SIMULATED_WITNESS
from hil.executive.people.questions import FROM_FILE, Answer, AnswerSource, Declined, Question, witness_problem
from hil.executive.setup.configuration import Configuration
from hil.registers.signers import SIGNERS, Signers, load_signers

__all__ = ["SOMEBODY", "Witnessed", "Witnesses", "witnesses_of"]

SOMEBODY = "somebody"
"""Asks for any witness, in whatever role."""


class Witnesses:
    """Decides who may witness an answer.

    If the register of signers names people, it also says who holds which role, and by which names a person goes.

    Args:
        operator: the operator of the run, who may not witness any answer; empty if none is named.
        signers: returns the register; called only if a witness is asked for.
        day: returns the day on which roles must be held, ISO 8601.
    """

    def __init__(self, operator: str, signers: Callable[[], Signers], day: Callable[[], str]) -> None:
        self._operator = operator
        self._signers = signers
        self._day = day

    def problem(self, question: Question, by: str, witness: str) -> str:
        """Return why a person cannot witness this answer, empty if the person can or no witness is asked for.

        Args:
            question: the question.
            by: who answers.
            witness: who witnesses the answer.
        """
        if not question.witness or (by == SIMULATED_PERSON and witness == SIMULATED_WITNESS):
            return ""
        others = (by, self._operator)
        return next(filter(None, (witness_problem(question, each, witness) for each in others)), "") or self._unknown(
            question, others, witness.strip()
        )

    def _unknown(self, question: Question, others: Iterable[str], witness: str) -> str:
        """Return why the register of signers rules out a witness, empty if it names nobody."""
        signers = self._signers()
        if not signers.people:
            return ""
        needs = f"'{question.name}' needs a witness ({question.witness})"
        person = signers.called(witness)
        if person is None:
            return f"{needs}: {witness} is not in fixtures/{SIGNERS}"
        if any(person.is_called(each.removesuffix(FROM_FILE)) for each in others):
            return f"{needs}: {witness} cannot witness an own answer"
        if question.witness == SOMEBODY or person.stands_for(question.witness, self._day()):
            return ""
        return f"{needs}: by fixtures/{SIGNERS}, {witness} has neither this role on {self._day()} nor this name"

    def missing(self, question: Question) -> str:
        """Return why nobody at all can witness the answers to a question, empty if somebody can."""
        people = self._signers().people if question.witness and question.witness != SOMEBODY else ()
        if not people or any(each.stands_for(question.witness, self._day()) for each in people):
            return ""
        told = f"'{question.name}' needs a witness ({question.witness})"
        return f"{told}, and nobody in fixtures/{SIGNERS} has this role on {self._day()}, or this name"


class Witnessed:
    """Refuses answers whose witness is not eligible.

    Args:
        source: answers.
        witnesses: decides who may witness.
    """

    def __init__(self, source: AnswerSource, witnesses: Witnesses) -> None:
        self._source = source
        self._witnesses = witnesses

    def answer(self, question: Question) -> Answer:
        """Answer as the source does."""
        answer = self._source.answer(question)
        if problem := self._witnesses.problem(question, answer.by, answer.witness):
            raise Declined(problem, "name another person")
        return answer


def witnesses_of(configuration: Configuration) -> Witnesses:
    """Return who may witness the answers of a run."""
    fixtures = configuration.workspace.fixtures
    return Witnesses(configuration.request.operator, cache(lambda: load_signers(fixtures)), lambda: wall.utc_now()[:10])
