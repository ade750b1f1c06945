"""Events of people: questions and answers, notes and attachments, requests, acknowledgements."""

from typing import ClassVar

from hil.evidence.events.event import Event, Origin, Part

__all__ = [
    "Acknowledged",
    "Answer",
    "AskedAgain",
    "Attachment",
    "Called",
    "Confirmed",
    "GivenFile",
    "HoldAsked",
    "Note",
    "PlanPicture",
    "Question",
    "Reached",
]


class Note(Event, frozen=True, kw_only=True):
    """A note that somebody added.

    Attributes:
        text: the note.
        by: who wrote it.
    """

    text: str
    by: str

    origin: ClassVar[Origin] = Origin.OUTSIDE


class Attachment(Event, frozen=True, kw_only=True):
    """A file that somebody attached, or that a case made.

    Attributes:
        file: its name in `data/attachments`.
        sha256: its hash.
        text: a description.
        by: who attached it, or the case that made it.
    """

    file: str
    sha256: str
    text: str
    by: str

    origin: ClassVar[Origin] = Origin.OUTSIDE
    synced: ClassVar[bool] = True


class HoldAsked(Event, frozen=True, kw_only=True):
    """Somebody requested that the bench be held or released.

    Attributes:
        release: whether it is to be released.
        text: why.
        by: who requested it.
    """

    release: bool
    text: str
    by: str

    origin: ClassVar[Origin] = Origin.OUTSIDE


class Called(Event, frozen=True, kw_only=True):
    """A code was sent to the person on call.

    Attributes:
        name: who is on call.
        text: a description in words.
    """

    name: str
    text: str

    origin: ClassVar[Origin] = Origin.OUTSIDE


class Reached(Event, frozen=True, kw_only=True):
    """Somebody returned a code.

    Attributes:
        by: who returned it.
        ok: whether it was the code that was sent.
    """

    by: str
    ok: bool

    origin: ClassVar[Origin] = Origin.OUTSIDE


class AskedAgain(Event, frozen=True, kw_only=True):
    """A safety confirmation is asked for again because the bench is being rearmed.

    Attributes:
        name: the question's name.
        form: its form.
        text: what the person reads.
        options: the possible answers, if they are given.
        safety: whether a person's safety depends on the answer.
    """

    name: str
    form: str
    text: str
    options: tuple[str, ...]
    safety: bool

    origin: ClassVar[Origin] = Origin.OUTSIDE


class Confirmed(Event, frozen=True, kw_only=True):
    """The answer to a safety confirmation that was asked for again.

    Attributes:
        name: the question's name.
        text: what the person read.
        value: the answer.
        by: who gave it.
    """

    name: str
    text: str
    value: bool | float | str
    by: str

    origin: ClassVar[Origin] = Origin.OUTSIDE


class Acknowledged(Event, frozen=True, kw_only=True):
    """A named person acknowledged the guardian's actions.

    Attributes:
        text: what was seen.
        by: who looked.
        guardian: the SHA-256 of the guardian's journal at that time.
    """

    text: str
    by: str
    guardian: str

    origin: ClassVar[Origin] = Origin.OUTSIDE


class PlanPicture(Part, frozen=True, kw_only=True):
    """A picture of a plan that a question shows.

    Attributes:
        file: its path in the package.
        sha256: its hash.
    """

    file: str
    sha256: str


class Question(Event, frozen=True, kw_only=True):
    """A person is asked.

    Attributes:
        case: the case that asks.
        step: the number of its step, empty outside steps.
        name: the question's name.
        form: `confirm`, `choose`, `measure`, `connect` or `file`; `attach` in older packages, for `connect`.
        text: what the person reads.
        options: the possible answers, if they are given; for `file` the kinds of files that are accepted.
        unit: the unit of the number asked for.
        safety: whether somebody's safety depends on the answer.
        instrument: what the number is read off, by its name in the register of instruments; empty if not given.
        witness: who has to be present, by role or name; empty if no witness is needed.
        picture: the picture shown beside the text.
    """

    case: str
    step: str
    name: str
    form: str
    text: str
    options: tuple[str, ...]
    unit: str = ""
    safety: bool = False
    instrument: str = ""
    witness: str = ""
    picture: PlanPicture | None = None

    origin: ClassVar[Origin] = Origin.PERSON


class GivenFile(Part, frozen=True, kw_only=True):
    """A file that a person provided as an answer.

    Attributes:
        file: its name in `data/attachments`.
        given: its original name, without control characters.
        type: its type, judged by its content: `pdf`, `png`, `jpeg`, `step`, `csv` or `text`.
        size: its size in bytes.
        sha256: its hash.
    """

    file: str
    given: str
    type: str
    size: int
    sha256: str


class Answer(Event, frozen=True, kw_only=True):
    """A person's answer.

    Attributes:
        case: the case that asked.
        step: the number of its step, empty outside steps.
        name: the question's name.
        value: the answer; for a file its original name.
        by: who gave it.
        file: the file that was provided.
        witness: the name of the witness who confirmed it, empty if none was required.
    """

    case: str
    step: str
    name: str
    value: bool | float | str
    by: str
    file: GivenFile | None = None
    witness: str = ""

    origin: ClassVar[Origin] = Origin.PERSON
    synced: ClassVar[bool] = True
