"""`operator`: a person's hands and eyes, with every answer as evidence."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import cast, overload

import msgspec

from hil.documents.suggest import did_you_mean
from hil.evidence import events
from hil.evidence.events import EventSink
from hil.executive.cases.certificate import standard_uncertainty, uncovered
from hil.executive.cases.effects import Effects, Where
from hil.executive.cases.escapes import OfThisProcess
from hil.executive.cases.steps import file_part
from hil.executive.people.at_hand import AtHand
from hil.executive.people.files import Shelf, kinds_of
from hil.executive.people.questions import FILE, Answer, AnswerSource, Declined, Question, form, witness_problem
from hil.executive.setup.hand_instruments import HandInstrument
from hil.model.bench import InstrumentSpec
from hil.model.errors import HilError, Misused
from hil.model.figure import Figure
from hil.model.provenance import Provenance, Word, answer_to

__all__ = ["Attached", "Operator"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Attached:
    """A file that a person gave.

    Attributes:
        name: its original name.
        file: its name in `data/attachments` of the package.
        type: `pdf`, `png`, `jpeg`, `step`, `csv` or `text`.
        size: its size in bytes.
        sha256: its hash.
        by: who gave it.
    """

    name: str
    file: str
    type: str
    size: int
    sha256: str
    by: str
    _shelf: Shelf = field(repr=False, compare=False)

    @classmethod
    def of(cls, told: object, shelf: Shelf) -> Attached:
        """Return the file that an effect's result describes."""
        facts = cast("Mapping[str, str]", told)
        return cls(
            name=facts["given"],
            file=facts["file"],
            type=facts["type"],
            size=int(facts["size"]),
            sha256=facts["sha256"],
            by=facts["by"],
            _shelf=shelf,
        )

    def content(self) -> bytes:
        """Return the file's content, in a replay from the package.

        Raises:
            Unfit: if it has changed since it was given.
        """
        return self._shelf.content(self.file, self.sha256)

    def text(self) -> str:
        """Return the content of a table or a text.

        Raises:
            Misused: for a file of another kind.
            Unfit: as in `content`.
        """
        if self.type not in {"csv", "text"}:
            raise Misused(f"{self.name} is no text", "ask for one with accepts=('csv', 'text'), or use content()")
        return self.content().decode("utf-8-sig")


class Operator(OfThisProcess):
    """The `operator` fixture of one case.

    Args:
        source: who answers.
        effects: where answers are recorded and, in a replay, come from.
        where: the present case and step.
        journal: where events are written.
        shelf: keeps the files that a person gives.
        hand: what a person has at hand.

    Attributes:
        refused: why calls were refused, in order: a measurement that was not asked for is an error, whatever the case
            does with it.
    """

    said = "`operator`"

    def __init__(
        self,
        source: AnswerSource,
        effects: Effects,
        where: Where,
        journal: EventSink,
        shelf: Shelf,
        hand: AtHand,
    ) -> None:
        self._source = source
        self._effects = effects
        self._where = where
        self._journal = journal
        self._hand = hand
        self._shelf = shelf
        self.refused: list[HilError] = []

    def confirm(self, text: str, *, name: str, safety: bool = False, witness: str = "", picture: str = "") -> None:
        """Ask for a confirmation.

        Args:
            text: what the person reads.
            name: the question's name.
            safety: whether somebody's safety depends on it. On hardware, and on a served bench, no file answers it: a
                person does, live and by name, and again whenever the bench is rearmed.
            witness: who has to be present, by role or name, and confirms the answer by name: a person other than the
                operator.
            picture: the picture to show: the path of a PNG or JPEG in the plan's folder.

        Raises:
            Declined: if it is not given.
        """
        question = Question(name=name, form="confirm", text=text, safety=safety, witness=witness)
        if not self._ask(question, picture):
            raise Declined(f"'{text}' was not confirmed")

    def witness(self, who: str, text: str, *, name: str, picture: str = "") -> None:
        """Continue only once it was witnessed: the operator confirms, and then the witness does, by name.

        Args:
            who: who has to be present, by role or name, as `witness` in `confirm`; `"somebody"` for anybody but the
                operator.
            text: what both confirm.
            name: the question's name.
            picture: as in `confirm`.

        Raises:
            Declined: unless both confirm it.
            Misused: if no witness is named.
        """
        if not who.strip():
            error = Misused(f"'{name}' names nobody as its witness", 'name a role or a person, or "somebody"')
            self.refused.append(error)
            raise error
        self.confirm(text, name=name, witness=who, picture=picture)

    def choose(self, text: str, options: Sequence[str], *, name: str, witness: str = "", picture: str = "") -> str:
        """Ask for one of the options and return it; `witness` and `picture` as in `confirm`."""
        question = Question(name=name, form="choose", text=text, options=tuple(options), witness=witness)
        chosen = str(self._ask(question, picture))
        return Word(chosen, Provenance(sources=(answer_to(name),)))

    def measure(
        self,
        text: str,
        unit: str,
        *,
        name: str,
        uncertainty: float | None = None,
        instrument: str | None = None,
        witness: str = "",
        picture: str = "",
    ) -> Figure:
        """Ask for a number that the person reads off.

        Args:
            text: what the person reads.
            unit: the unit of the number.
            name: the question's name.
            uncertainty: its standard uncertainty, if known; by default that of the instrument's certificate.
            instrument: the instrument that is read, by its name in the register; the figure then comes from it.
                Write it as a literal in the call, so that its certificate is known before the run.
            witness: as in `confirm`.
            picture: as in `confirm`.

        Raises:
            Declined: for an answer that is not a number.
            Misused: if the instrument is not one that plans and fixtures name.
        """
        read = None if instrument is None else self._read(instrument)
        shown = text if read is None else f"{text} (with {read.label})"
        question = Question(
            name=name, form="measure", text=shown, unit=unit, instrument=instrument or "", witness=witness
        )
        figure = Figure(value=float(str(self._ask(question, picture))), unit=unit, uncertainty=uncertainty)
        if read is None:
            unknown = f"the {answer_to(name)} was read off an instrument that the bench does not know"
            return figure.with_provenance(Provenance(sources=(answer_to(name),), unproven=(unknown,)))
        return _calibrated(figure, read.spec, name)

    def _read(self, name: str) -> HandInstrument:
        """Return the instrument of this name."""
        found = self._hand.instruments.get(name)
        if found is None:
            near = did_you_mean(name, self._hand.instruments)
            error = Misused(
                f"no plan or fixture of this run names a hand instrument '{name}'{near}",
                'write it as a text in the call, such as operator.measure(..., instrument="DMM-017")',
            )
            self.refused.append(error)
            raise error
        return found

    def connect(
        self, what: str, text: str, *, name: str, options: Sequence[str] = (), witness: str = "", picture: str = ""
    ) -> None:
        """Ask the person to connect `what` to the bench, and wait until that is confirmed.

        Args:
            what: the thing to connect, one of `options` if they are given.
            text: what the person reads.
            name: the question's name.
            options: everything that could be connected.
            witness: as in `confirm`.
            picture: as in `confirm`.

        Raises:
            Declined: if something else is connected.
        """
        listed = (what, *(each for each in options if each != what))
        self._connect(Question(name=name, form="connect", text=text, options=listed, witness=witness), picture)

    def _connect(self, question: Question, picture: str = "") -> None:
        what, connected = question.options[0], self._ask(question, picture)
        if connected != what:
            raise Declined(f"'{what}' was to be connected, '{connected}' is")

    @overload
    def attach(
        self, text: str, *, name: str, accepts: Sequence[str] = (), witness: str = "", picture: str = ""
    ) -> Attached: ...

    @overload
    def attach(self, text: str, connects: str, *, name: str, options: Sequence[str] = ()) -> None: ...

    def attach(
        self,
        text: str,
        connects: str | None = None,
        *,
        name: str,
        accepts: Sequence[str] = (),
        witness: str = "",
        picture: str = "",
        options: Sequence[str] = (),
    ) -> Attached | None:
        """Ask for a file: a picture, a certificate, a drawing, a table. It becomes part of the evidence.

        The file is copied into the package under a name of the run's own, and its kind, size and hash are recorded
        with who gave it.

        Args:
            text: what the person reads.
            connects: in plans of older packages what the person reads; `text` is then what is to be connected, as in
                `connect`.
            name: the question's name.
            accepts: the accepted kinds: `pdf`, `png`, `jpeg`, `step`, `csv` and `text`, or `picture` for PNG
                and JPEG; all if none is named. The content decides what a file is, not its name; only a table is
                distinguished from text by its name.
            witness: as in `confirm`.
            picture: as in `confirm`.
            options: as in `connect`, in plans of older packages.

        Raises:
            Declined: if nobody gives one.
            Unfit: if the file is missing, not a regular file, empty, too large, damaged or of another kind, or
                changes while it is copied.
            Misused: for a kind that cannot be accepted.
        """
        if connects is not None:
            listed = (text, *(each for each in options if each != text))
            self._connect(Question(name=name, form="attach", text=connects, options=listed))
            return None
        question = Question(name=name, form=FILE, text=text, options=kinds_of(accepts), witness=witness)
        return Attached.of(self._ask(question, picture), self._shelf)

    def _ask(self, question: Question, picture: str = "") -> object:
        self._shelf.point()
        if picture:
            question = replace(question, picture=self._hand.picture(picture))
        arguments = {
            "form": question.form,
            "text": question.text,
            "options": list(question.options),
            "unit": question.unit,
            **({"safety": True} if question.safety else {}),
            **({"instrument": question.instrument} if question.instrument else {}),
            **({"witness": question.witness} if question.witness else {}),
            **({"picture": msgspec.structs.asdict(question.picture)} if question.picture else {}),
        }
        return self._effects.perform(f"operator.{question.name}", "asks", arguments, lambda: self._asked(question))

    def _asked(self, question: Question) -> object:
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
            witness=question.witness,
            picture=question.picture,
        )
        self._journal.write(asked)
        answer = self._source.answer(question)
        _check(question, answer.value)
        if problem := witness_problem(question, answer.by, answer.witness):
            raise Declined(problem, "a witness is named, and is not who answers")
        kept = self._kept(question, answer)
        event = events.Answer(
            case=case,
            step=step,
            name=question.name,
            value=answer.value if kept is None else kept.given,
            by=answer.by,
            file=kept,
            witness=answer.witness,
        )
        self._journal.write(event)
        return answer.value if kept is None else {**msgspec.structs.asdict(kept), "by": answer.by}

    def _kept(self, question: Question, answer: Answer) -> events.GivenFile | None:
        """Take the file of an answer into the run, and return it."""
        if question.form != FILE or answer.file is not None:
            return answer.file
        if answer.path is None:
            raise Declined(f"'{question.name}' needs a file, and '{answer.value}' is none", form(question))
        stem = f"{file_part(self._where.case)}-{file_part(question.name)}"
        return self._shelf.take(answer.path, stem, question.options, str(answer.value))


def _calibrated(figure: Figure, spec: InstrumentSpec, name: str) -> Figure:
    """Return a figure read off an instrument, with its certificate's uncertainty and its provenance."""
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
    if question.options and question.form != FILE and value not in question.options:
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
