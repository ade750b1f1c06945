"""`operator`: a person's hands and eyes, with every answer as evidence."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

from hil.documents.suggest import did_you_mean
from hil.evidence import events
from hil.evidence.events import EventSink
from hil.executive.cases.certificate import standard_uncertainty, uncovered
from hil.executive.cases.effects import Effects, Where
from hil.executive.cases.escapes import OfThisProcess
from hil.executive.people.questions import AnswerSource, Declined, Question
from hil.executive.setup.hand_instruments import HandInstrument
from hil.model.bench import InstrumentSpec
from hil.model.errors import HilError, Misused
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
        hand: the instruments that a person can be asked to read, by name.

    Attributes:
        refused: why calls were refused, in order: a number that was not asked for is an error, whatever the case
            makes of it.
    """

    said = "`operator`"

    def __init__(
        self,
        source: AnswerSource,
        effects: Effects,
        where: Where,
        journal: EventSink,
        point: Callable[[], None],
        hand: Mapping[str, HandInstrument] = MappingProxyType({}),
    ) -> None:
        self._source = source
        self._effects = effects
        self._where = where
        self._journal = journal
        self._point = point
        self._hand = hand
        self.refused: list[HilError] = []

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

    def measure(
        self, text: str, unit: str, *, name: str, uncertainty: float | None = None, instrument: str | None = None
    ) -> Figure:
        """Ask for a number that the person reads off.

        Args:
            text: what the person reads.
            unit: the unit of the number.
            name: the question's name.
            uncertainty: its standard uncertainty, if known; that of the instrument's certificate where it is left out.
            instrument: the name of what is read in the register of instruments; it then stands behind the figure.
                Write it as a text in the call, so that its certificate is known before the run.

        Raises:
            Declined: for an answer that is no number.
            Misused: if the instrument is none that plans and fixtures name.
        """
        read = None if instrument is None else self._read(instrument)
        shown = text if read is None else f"{text} (with {read.label})"
        question = Question(name=name, form="measure", text=shown, unit=unit, instrument=instrument or "")
        figure = Figure(value=float(self._ask(question)), unit=unit, uncertainty=uncertainty)
        if read is None:
            unknown = f"the {answer_to(name)} was read off an instrument that the bench does not know"
            return figure.with_provenance(Provenance(sources=(answer_to(name),), unproven=(unknown,)))
        return _calibrated(figure, read.spec, name)

    def _read(self, name: str) -> HandInstrument:
        """Return the instrument of this name."""
        found = self._hand.get(name)
        if found is None:
            error = Misused(
                f"no plan or fixture of this run names a hand instrument '{name}'{did_you_mean(name, self._hand)}",
                'write it as a text in the call, such as operator.measure(..., instrument="DMM-017")',
            )
            self.refused.append(error)
            raise error
        return found

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
            **({"instrument": question.instrument} if question.instrument else {}),
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
            instrument=question.instrument,
        )
        self._journal.write(asked)
        answer = self._source.answer(question)
        _check(question, answer.value)
        told = events.Answer(case=case, step=step, name=question.name, value=answer.value, by=answer.by)
        self._journal.write(told)
        return answer.value


def _calibrated(figure: Figure, spec: InstrumentSpec, name: str) -> Figure:
    """Return what was read off an instrument, with its certificate's uncertainty and its provenance."""
    own = standard_uncertainty(spec.calibration, figure.unit, figure.value)
    given = figure.uncertainty
    small = given is not None and own is not None and given < own
    provenance = Provenance(
        instruments=(spec.name,),
        sources=(answer_to(name),),
        unproven=(f"its uncertainty was written by hand, below that of the certificate of {spec.name}",)
        if small
        else (),
        uncovered=uncovered(spec, figure.unit, figure.value),
    )
    return (figure if given is not None else replace(figure, uncertainty=own)).with_provenance(provenance)


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
