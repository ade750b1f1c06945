"""Who answers on which bench: safety confirmations are a person's wherever something real hangs on them."""

from __future__ import annotations

import io
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from hil.executive.people.answers import AnswersFile
from hil.executive.people.questions import Answer, Declined, Elsewhere, Question
from hil.executive.people.witnesses import Witnesses
from hil.executive.setup.configuration import Request
from hil.model.identity import Source
from hil.plugin.terminal.answering import acted_out, answers_of
from hil.registers.signers import Signers

SAFETY = Question(name="fuse", form="confirm", text="Is the fuse in?", safety=True)
JIG = Question(name="jig", form="confirm", text="Closed?")


class Yes:
    """A simulated person who knows everything, and notes what its hands did."""

    def __init__(self):
        self.did = []

    def act(self, form, name, said):
        """Note it."""
        self.did.append((form, name, said))

    def answer(self, *_):
        """Say yes."""
        return True


def source_on(tmp_path, *, live, source=Source.SIMULATED, idle=lambda: None, elsewhere=None, **wanted):
    """Return what answers on a bench of this process or, if `live`, outside of it, with a file that has all answers."""
    file = tmp_path / "answers.yaml"
    file.write_text('schema: hil/answers/1\nanswers: {fuse: "yes", jig: "yes"}\n', encoding="utf-8")
    request = Request(start=tmp_path, plans=(), bench="b", dut="d", source=source, answers=file, **wanted)
    bench = SimpleNamespace(live=object() if live else None, has_person=not live, person=Yes())
    witnesses = Witnesses(request.operator, lambda: Signers(people=(), folder=tmp_path), lambda: "2026-06-01")
    return answers_of(request, Path.name.fget, witnesses)(bench, idle, elsewhere or Elsewhere())


@pytest.fixture(params=[Source.HARDWARE, Source.SIMULATED], ids=["hardware", "served"])
def source(request):
    """Return the source of a bench outside of this process."""
    return request.param


def test_no_file_answers_a_safety_confirmation_outside_of_this_process(tmp_path, source, monkeypatch):
    """On hardware as on a served bench, and whether or not somebody asked for a terminal that is not there."""
    monkeypatch.setattr(sys, "stdin", io.StringIO("yes\n"))
    for person in (False, True):
        answers = source_on(tmp_path, live=True, source=source, person=person)
        assert answers.answer(JIG) == Answer(True, "answers file")
        with pytest.raises(Declined, match="is a safety confirmation"):
            answers.answer(SAFETY)


def test_the_person_at_the_terminal_answers_it(tmp_path, source, monkeypatch):
    """By the name that the run was given; the file goes on answering the rest."""
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(isatty=lambda: True))
    terminal = SimpleNamespace(show=print, line=lambda: "yes\n", discard=lambda: None)
    monkeypatch.setattr("hil.plugin.terminal.answering.Terminal", lambda: terminal)
    answers = source_on(tmp_path, live=True, source=source, operator="Ada")
    assert answers.answer(SAFETY) == Answer(True, "Ada")
    assert answers.answer(JIG) == Answer(True, "answers file")


def test_an_unattended_run_waits_for_another_terminal(tmp_path, source, monkeypatch, capsys):
    """Where it has none itself; its log says where the question is answered."""
    monkeypatch.setattr(sys, "stdin", io.StringIO(""))
    elsewhere = Elsewhere()
    answers = source_on(
        tmp_path,
        live=True,
        source=source,
        unattended=True,
        elsewhere=elsewhere,
        idle=lambda: elsewhere.take("fuse", "yes", "Ada"),
    )
    assert answers.answer(SAFETY) == Answer(True, "Ada")
    assert capsys.readouterr().err == "  ? Is the fuse in? [yes or no]  answer it with hil answer\n"


def test_on_a_bench_of_this_process_a_file_may_answer(tmp_path):
    """Nothing real hangs on it there, and cases are the same on every bench."""
    assert source_on(tmp_path, live=False).answer(SAFETY) == Answer(True, "answers file")


@pytest.mark.parametrize(("simulated", "world"), [(True, True), (True, False), (False, True)])
def test_the_simulated_hands_do_what_is_answered(simulated, world):
    """Only where there is a simulated person and its world is there."""
    hands = Yes()
    bench = SimpleNamespace(has_person=simulated, world=SimpleNamespace(person=hands) if world else None)
    file = AnswersFile({"jig": "yes"}, "a.yaml")
    source = acted_out(lambda *_: file)(bench, lambda: None, Elsewhere())
    assert source.answer(JIG) == Answer(True, "answers file")
    assert hands.did == ([("confirm", "jig", True)] if simulated and world else [])
