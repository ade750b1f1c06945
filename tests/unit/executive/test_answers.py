"""Who answers: a file, a person, or nobody."""

from __future__ import annotations

import pytest
from case_parts import Case

from hil.evidence.events import Effect
from hil.executive.ending.stop import Stopped
from hil.executive.people.answers import (
    AnswersFile,
    AskedLive,
    FirstOf,
    Nobody,
    NobodyLive,
    Prepared,
    Recorded,
    SimulatedPerson,
    TerminalPerson,
    load_answers,
)
from hil.executive.people.files import Unfit
from hil.executive.people.questions import Answer, Declined, Elsewhere, Question
from hil.model.errors import ConfigurationError, Refused

CONFIRM = Question(name="jig", form="confirm", text="Closed?")
SAFETY = Question(name="fuse", form="confirm", text="Is the fuse in?", safety=True)
CHOOSE = Question(name="phone", form="choose", text="Which way?", options=("outward", "inward"))
MEASURE = Question(name="meter", form="measure", text="Read it", unit="V")
CONNECT = Question(name="board", form="connect", text="Connect x", options=("x", "y"))


class Typed:
    """A terminal at which lines were typed; None is a moment without one, and at the end input ends.

    The first `ahead` of them were typed before anything was shown.
    """

    def __init__(self, *lines, ahead=0):
        self.lines = list(lines)
        self.ahead = ahead
        self.shown = []

    def show(self, text):
        """Keep what is shown."""
        self.shown.append(text)

    def discard(self):
        """Drop what was typed ahead."""
        assert not self.shown, "a question that stands on the screen may have its answer"
        del self.lines[: self.ahead]

    def line(self):
        """Return the next line."""
        return self.lines.pop(0) if self.lines else ""


@pytest.mark.parametrize(
    ("question", "line", "value"),
    [
        (CONFIRM, "yes\n", True),
        (CONFIRM, " Y \n", True),
        (CONFIRM, "NO\n", False),
        (CHOOSE, "inward\n", "inward"),
        (MEASURE, "12.5\n", 12.5),
        (MEASURE, "12,5\n", 12.5),
        (MEASURE, "0,125\n", 0.125),
        (MEASURE, "-1.25e-3\n", -0.00125),
        (CONNECT, "yes\n", "x"),
        (CONNECT, "y\n", "x"),
    ],
)
def test_a_person_answers_in_the_form_of_the_question(question, line, value):
    """Each form understands what a person would type."""
    terminal = Typed(line)
    assert TerminalPerson(terminal, "Ada", lambda: None).answer(question) == Answer(value, "Ada")
    assert terminal.shown[0].startswith(question.text)


@pytest.mark.parametrize(
    ("question", "line"),
    [
        *((CONFIRM, "maybe"), (CONFIRM, ""), (CHOOSE, "up")),
        *((MEASURE, each) for each in ("much", "nan", "inf", "1,000", "-12,345", "1_000")),
    ],
)
def test_what_is_no_answer_is_asked_again(question, line):
    """A person is told what would be one; nothing is guessed, and no comma taken for thousands or for a point."""
    terminal = Typed(f"{line}\n", None, None, "yes\n", "inward\n", "1\n")
    answer = TerminalPerson(terminal, "Ada", lambda: None).answer(question)
    assert answer.value in {True, "inward"}
    assert terminal.shown[1].startswith("Please answer ")


def test_a_stop_is_found_while_a_person_thinks():
    """Waiting for an answer is a scheduling point."""

    def stop():
        raise Stopped("SIGINT")

    with pytest.raises(Stopped):
        TerminalPerson(Typed(None), "Ada", stop).answer(CONFIRM)


def test_the_end_of_input_is_nobody():
    """A terminal that is gone is not asked for ever."""
    with pytest.raises(Declined, match="the terminal's input has ended"):
        TerminalPerson(Typed("perhaps\n"), "Ada", lambda: None).answer(CONFIRM)


def test_a_file_answers_by_name():
    """Every form has its text in the file; who answered is the file."""
    file = AnswersFile({"jig": "Yes", "phone": "inward", "meter": "4.9", "board": "y"}, "answers.yaml")
    found = [file.answer(question).value for question in (CONFIRM, CHOOSE, MEASURE)]
    assert found == [True, "inward", 4.9]
    assert file.answer(CONFIRM).by == "answers file"


def test_a_file_connects_what_it_names():
    """For what is to be connected the file says yes, or what is connected."""
    assert AnswersFile({"board": "yes"}, "a").answer(CONNECT).value == "x"
    assert AnswersFile({"board": "x"}, "a").answer(CONNECT).value == "x"


@pytest.mark.parametrize(
    ("answers", "message"),
    [
        ({"jgi": "yes"}, "a.yaml has no answer to 'jig', did you mean 'jgi'?; the question was: Closed?"),
        ({"jig": "sure"}, "a.yaml answers 'sure' to 'jig'; answer yes or no; the question was: Closed?"),
    ],
)
def test_a_file_that_does_not_answer_declines(answers, message):
    """The nearest name, or the form of the answer, is told."""
    with pytest.raises(Declined) as caught:
        AnswersFile(answers, "a.yaml").answer(CONFIRM)
    assert str(caught.value) == message


def test_the_file_goes_before_whoever_is_there():
    """A question that the file knows goes to the file, every other one to the person."""

    class Person:
        def answer(self, form, name, text, options):
            return f"{form} {name}"

    both = FirstOf(AnswersFile({"phone": "inward"}, "a"), SimulatedPerson(Person), frozenset({"phone"}))
    assert both.answer(CHOOSE) == Answer("inward", "answers file")
    assert both.answer(MEASURE) == Answer("measure meter", "simulated person")


def test_nobody_says_what_to_do():
    """A question without anybody names the way out."""
    with pytest.raises(Declined, match=r"needs a person, and there is no terminal; .*'jig' with --answers FILE"):
        Nobody().answer(CONFIRM)


def test_a_file_of_answers_is_read_strictly(tmp_path):
    """What is wrong with it is told with its place."""
    file = tmp_path / "a.yaml"
    file.write_text('schema: hil/answers/1\nanswers: {jig: "yes"}\n')
    assert load_answers(file, "a.yaml") == Prepared(answers={"jig": "yes"})
    file.write_text('schema: hil/answers/1\nanswer: {jig: "yes"}\n')
    with pytest.raises(ConfigurationError, match=r"unknown key 'answer', did you mean 'answers'\?"):
        load_answers(file, "a.yaml")


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        ('by: "Ada\\nPASS"', "a.yaml:2:5: the name contains the character U\\+000A"),
        (f"by: {'A' * 500}", "a.yaml:2:5: the name has 500 characters, and may have"),
        ('witnesses: {jig: "Bo\\tBell"}', "a.yaml:2:18: the name contains the character U\\+0009"),
    ],
)
def test_who_answers_has_a_name_like_everybody(tmp_path, lines, told):
    """As on the command line: a name of several lines would print lines of its own."""
    file = tmp_path / "a.yaml"
    file.write_text(f'schema: hil/answers/1\n{lines}\nanswers: {{jig: "yes"}}\n')
    with pytest.raises(ConfigurationError, match=told):
        load_answers(file, "a.yaml")


class Says:
    """Answers everything with one value."""

    def __init__(self, value):
        self.value = value

    def answer(self, question):
        """Answer."""
        return Answer(self.value, "Ada")


def test_an_answer_is_evidence_with_its_question(tmp_path):
    """The journal has what was asked, what was answered, and by whom."""
    case = Case(tmp_path, answers=Says("4.9"))
    figure = case.run.operator.measure("Read it", "V", name="meter", uncertainty=0.1)
    assert (figure.value, figure.unit, figure.uncertainty) == (4.9, "V", 0.1)
    kinds = [event["kind"] for event in case.written.events]
    assert kinds == ["question", "answer", "effect"]
    assert case.written.of("answer")[0]["by"] == "Ada"


@pytest.mark.parametrize(
    ("value", "ask", "message"),
    [
        (False, lambda operator: operator.confirm("Closed?", name="jig"), "'Closed?' was not confirmed"),
        ("up", lambda operator: operator.choose("Which?", ["in", "out"], name="way"), "'up' is not an answer to 'way'"),
        ("nan", lambda operator: operator.measure("Read", "V", name="meter"), "'nan' is not a number for 'meter'"),
        (True, lambda operator: operator.measure("Read", "V", name="meter"), "'True' is not a number for 'meter'"),
        (
            "y",
            lambda operator: operator.connect("x", "Connect x", name="b", options=["x", "y"]),
            "'x' was to be connected",
        ),
    ],
)
def test_an_answer_that_does_not_fit_is_declined(tmp_path, value, ask, message):
    """Whoever answers, the operator takes only what the question allows."""
    case = Case(tmp_path, answers=Says(value))
    with pytest.raises(Declined, match=message.replace("?", r"\?")):
        ask(case.run.operator)


def test_a_safety_confirmation_is_a_persons_alone():
    """A file that has its name is not asked, and everything else is still the file's."""
    file = AnswersFile({"fuse": "yes", "jig": "yes"}, "answers.yaml")
    source = AskedLive(TerminalPerson(Typed("yes\n"), "Ada", lambda: None), file)
    assert source.answer(SAFETY) == Answer(True, "Ada")
    assert source.answer(CONFIRM) == Answer(True, "answers file")


def test_without_a_person_a_safety_confirmation_is_declined():
    """Whatever a file says; the way out is a terminal."""
    source = AskedLive(NobodyLive(), AnswersFile({"fuse": "yes"}, "answers.yaml"))
    with pytest.raises(Declined, match=r"'Is the fuse in\?' is a safety confirmation.*run from a terminal"):
        source.answer(SAFETY)


def test_a_safety_confirmation_is_given_by_name():
    """Where the run was not told who operates it, the person is asked, until a name comes or the input ends."""
    terminal = Typed("yes\n", "\n", None, "Ada\n")
    assert TerminalPerson(terminal, "", lambda: None).answer(SAFETY) == Answer(True, "Ada")
    assert terminal.shown[1:] == ["Your name:", "Your name:"]
    assert TerminalPerson(Typed("yes\n"), "", lambda: None).answer(CONFIRM) == Answer(True, "person at the terminal")
    with pytest.raises(Declined, match="answered without a name"):
        TerminalPerson(Typed("yes\n"), "", lambda: None).answer(SAFETY)


def test_what_was_typed_ahead_confirms_no_safety():
    """It goes right before the question is shown; any other question is answered by it."""
    answered = [
        TerminalPerson(Typed("yes\n", "yes\n", "no\n", ahead=2), "Ada", lambda: None).answer(question).value
        for question in (SAFETY, CONFIRM)
    ]
    assert answered == [False, True]


def test_what_is_asked_for_safety_is_in_the_events(tmp_path):
    """Question and effect say so; those of other questions are as they always were."""
    case = Case(tmp_path, answers=Willing())
    case.run.operator.confirm("Is the fuse in?", name="fuse", safety=True)
    case.run.operator.confirm("Closed?", name="jig")
    assert [event.get("safety") for event in case.written.of("question")] == [True, None]
    assert ["safety" in event["arguments"] for event in case.written.of("effect")] == [True, False]


class Willing:
    """Somebody who says yes to everything."""

    def answer(self, question):
        """Say yes."""
        return Answer(True, "Ada")


@pytest.mark.parametrize(
    ("question", "text", "value"),
    [(SAFETY, "yes", True), (CONFIRM, "no", False), (CHOOSE, "inward", "inward"), (MEASURE, "4,9", 4.9)],
)
def test_another_terminal_answers_while_this_one_waits(question, text, value):
    """What was said there counts under the name that was given there."""
    elsewhere = Elsewhere()
    problems = []
    person = TerminalPerson(
        Typed(None, None, "yes\n"),
        "Bob",
        lambda: problems.append(elsewhere.take(question.name, text, " Ada ")),
        elsewhere,
    )
    assert person.answer(question) == Answer(value, "Ada")
    assert problems == [""]


def test_what_another_terminal_says_in_vain_is_told():
    """Another question, no name, no answer, and what comes too late: the question goes on waiting."""
    elsewhere = Elsewhere()
    assert elsewhere.take("jig", "yes", "Ada") == "'jig' is not being asked now"
    with elsewhere.asks(CONFIRM):
        assert elsewhere.take("phone", "yes", "Ada") == "'phone' is not being asked now"
        assert elsewhere.take("jig", "yes", " ") == "'jig' was answered without a name"
        assert elsewhere.take("jig", "maybe", "Ada") == "'maybe' is not an answer to 'jig', which takes yes or no"
        assert elsewhere.answer is None
        assert elsewhere.take("jig", "yes", "Ada") == ""
        assert elsewhere.take("jig", "no", "Eve") == "'jig' is not being asked now"
        assert elsewhere.answer == Answer(True, "Ada")
    assert elsewhere.answer is None


def test_who_typed_an_answer_here_gives_a_name_here():
    """Nothing from elsewhere comes between an answer and its name."""
    elsewhere = Elsewhere()
    taken = []
    terminal = Typed("yes\n", None, "Bob\n")
    person = TerminalPerson(terminal, "", lambda: taken.append(elsewhere.take("fuse", "no", "Ada")), elsewhere)
    assert person.answer(SAFETY) == Answer(True, "Bob")
    assert taken == ["'fuse' is not being asked now"]


@pytest.mark.parametrize("kind", [Declined, Unfit, Refused])
def test_a_replay_declines_what_was_declined(kind):
    """With the same error in the same words, by the names of the questions; everything else is Nobody's."""
    effects = [
        Effect(
            case="c",
            step="1",
            name=f"operator.{name}",
            ordinal=1,
            effect="asks",
            arguments={},
            result=None,
            raised=raised,
            why=f"why {name}",
            hint="what to do",
        )
        for name, raised in (("given", ""), ("one", kind.__name__), ("two", kind.__name__))
    ]
    source = Recorded(effects)
    for name in ("one", "two"):
        with pytest.raises(kind, match=f"why {name}; what to do") as said:
            source.answer(Question(name=name, form="file", text="A file"))
        assert type(said.value) is kind
    with pytest.raises(Declined, match="needs a person"):
        source.answer(Question(name="two", form="file", text="A file"))
