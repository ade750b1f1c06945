"""What a file or a person says was done on a simulated bench is done there."""

from __future__ import annotations

import pytest

from hil.evidence.events import Answer as Given
from hil.evidence.journal.reader import JournalLine
from hil.executive.people.answers import Answered, AnswersFile, SimulatedPerson
from hil.executive.people.hands import ActedOut
from hil.executive.people.questions import Answer, Declined, Question

CONNECT = Question(name="board", form="connect", text="Connect red", options=("red", "blue"))


class Person:
    """A simulated person who notes what its hands did."""

    def __init__(self):
        self.did = []

    def answer(self, form, name, text, options):
        """Connect what is asked for."""
        return options[0]

    def act(self, form, name, said):
        """Note it."""
        self.did.append((form, name, said))


@pytest.mark.parametrize(("said", "done"), [("yes", "red"), ("red", "red"), ("blue", "blue")])
def test_what_a_file_says_is_connected_is_connected(said, done):
    """Asked for or not; the case then says that it is the wrong one."""
    person = Person()
    source = ActedOut(AnswersFile({"board": said}, "a.yaml"), lambda: person)
    assert source.answer(CONNECT) == Answer(done, "answers file")
    assert person.did == [("connect", "board", done)]


def test_a_no_moves_nothing():
    """Nor does any other word that is no answer."""
    person = Person()
    with pytest.raises(Declined):
        ActedOut(AnswersFile({"board": "no"}, "a.yaml"), lambda: person).answer(CONNECT)
    assert person.did == []


def test_what_the_simulated_person_answers_it_has_done_itself():
    """Once, not twice."""
    person = Person()
    assert ActedOut(SimulatedPerson(lambda: person), lambda: person).answer(CONNECT).value == "red"
    assert person.did == []


def test_without_hands_a_file_only_answers():
    """On a bench outside this process, and on a resumed one before it continues."""
    assert ActedOut(AnswersFile({"board": "yes"}, "a.yaml"), lambda: None).answer(CONNECT).value == "red"


def test_a_resumed_bench_gets_what_was_answered_before_it():
    """The world continues from before the answer: nobody is asked again, and the hands move again."""
    person, given = Person(), Given(case="c", step="1", name="board", value="red", by="Ada (answers file)")
    told = JournalLine(number=1, event=given, wall={}, raw=b"", rest=b"")
    source = ActedOut(Answered([told], AnswersFile({}, "a.yaml"), lambda: True), lambda: person)
    assert source.answer(CONNECT) == Answer("red", "Ada (answers file)")
    assert person.did == [("connect", "board", "red")]
