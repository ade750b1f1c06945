"""The command `hil answer`, at a terminal at which a person takes time."""

from __future__ import annotations

import json

import pytest

from hil.cli.commands import answer
from hil.evidence.folder import INBOX, JOURNAL
from hil.evidence.inbox import peek

QUESTION = {
    "kind": "question", "case": "a", "step": "1", "name": "fuse",
    "form": "confirm", "text": "Is the fuse in?", "options": [],
}  # fmt: skip
ANSWER = {"kind": "answer", "case": "a", "step": "1", "name": "fuse", "value": True, "by": "Bob"}
ANOMALY = {"kind": "anomaly", "text": "something else"}


@pytest.fixture
def told(tmp_path, monkeypatch):
    """Return what lets somebody answer at a terminal; the events that it is given come while that person types."""
    journal = tmp_path / JOURNAL
    journal.parent.mkdir(parents=True)
    (tmp_path / INBOX).mkdir(parents=True, exist_ok=True)

    def write(*events):
        with journal.open("ab") as stream:
            stream.writelines(
                json.dumps({"body": {"t": 0.0, **event}, "wall": {}}).encode() + b"\n" for event in events
            )

    def call(*meanwhile):
        write(QUESTION)
        monkeypatch.setattr(answer, "find_running", lambda _: tmp_path)
        monkeypatch.setattr(answer, "_read", lambda _: write(*meanwhile) or "yes")
        monkeypatch.setattr(
            answer, "answer_of", lambda follower, *_: next((line.event for line in follower.read()), None)
        )
        return answer.command.callback(run="latest", answer="", by="Ada", witness="")

    call.posted = lambda: [(message.name, message.text, message.by) for message in peek(tmp_path)]
    return call


@pytest.mark.parametrize("next_one", [[], [QUESTION]])
def test_a_question_that_was_answered_meanwhile_gets_no_answer(told, next_one, capsys):
    """Nor does the next one of the same name, which nobody at this terminal has seen."""
    assert told(ANSWER, *next_one) == 1
    assert told.posted() == []
    assert capsys.readouterr().err == "not taken: 'fuse' is no longer asked\n"


def test_what_came_before_an_answer_says_nothing_of_it(told, capsys):
    """An anomaly while the person types is not the run's word on what was typed."""
    assert told(ANOMALY) == 0
    assert told.posted() == [("fuse", "yes", "Ada")]
    assert "the run has not read the answer yet" in capsys.readouterr().out
