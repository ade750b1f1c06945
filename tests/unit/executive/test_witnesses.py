"""Witness points: who may witness an answer, and what is said to who may not."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest
from case_parts import Case

from hil.executive.people.answers import SimulatedPerson, TerminalPerson
from hil.executive.people.questions import Answer, Declined, Elsewhere, Question
from hil.executive.people.witnesses import Witnessed, Witnesses
from hil.model.errors import Misused
from hil.registers.signers import HeldRole, Signer, Signers

DAY = "2026-06-01"
PEOPLE = Signers(
    people=(
        Signer(principal="ada@x", name="Ada Lovelace", also=("Ada",)),
        Signer(principal="quinn@x", name="Quinn", roles=(HeldRole(role="quality-engineer", since=DAY, until=DAY),)),
    ),
    folder=Path(),
)
NOBODY = Signers(people=(), folder=Path())


def witnesses(operator="Ada", signers=PEOPLE, day=DAY):
    """Return who may witness answers in a run of Ada's."""
    return Witnesses(operator, lambda: signers, lambda: day)


def point(who="quality engineer"):
    """Return a question with a witness."""
    return Question(name="wired", form="confirm", text="Is it wired?", witness=who)


class Says:
    """Answers with yes."""

    def __init__(self, by="Ben", witness="Quinn"):
        self.given = Answer(True, by, witness=witness)

    def answer(self, _):
        """Say yes."""
        return self.given


@pytest.mark.parametrize("who", ["quality engineer", "Quality-Engineer", "quinn", "somebody", "quinn@x"])
def test_a_witness_is_asked_for_by_role_or_name(who):
    """As the register spells it or a person does."""
    assert witnesses().problem(point(who), "Ada", " Quinn ") == ""
    assert witnesses().missing(point(who)) == ""


@pytest.mark.parametrize(
    ("who", "by", "witness", "told"),
    [
        ("quality engineer", "Ben", "", "and none is named"),
        ("quality engineer", "Ben", "Zoe", "Zoe is not in fixtures/signers.yaml"),
        ("somebody", "Ben", "Zoe", "Zoe is not in fixtures/signers.yaml"),
        ("quality engineer", "Ben", "Ada Lovelace", "Ada Lovelace cannot witness an own answer"),
        ("somebody", "quinn@x (answers file)", "Quinn", "Quinn cannot witness an own answer"),
        ("technician", "Ben", "Quinn", "Quinn has neither this role on 2026-06-01 nor this name"),
        ("Rita", "Ben", "Quinn", "Quinn has neither this role on 2026-06-01 nor this name"),
        ("quality engineer", "Ben", "Quinn, Ada", "Quinn, Ada is not in fixtures/signers.yaml"),
        ("quality engineer", "Ben", "simulated witness", "simulated witness is not in fixtures/signers.yaml"),
    ],
)
def test_who_may_not_witness(who, by, witness, told):
    """Attack: nobody, a stranger, the operator by another name, another role, several persons in one name."""
    assert told in witnesses().problem(point(who), by, witness)


def test_a_role_counts_on_its_days():
    """One that ended yesterday is none."""
    assert "on 2026-06-02" in witnesses(day="2026-06-02").problem(point(), "Ben", "Quinn")
    assert "nobody in fixtures/signers.yaml has this role" in witnesses(day="2026-06-02").missing(point())


def test_without_a_register_a_witness_is_somebody_else():
    """Whatever letters and spaces the name is written with."""
    own = witnesses(signers=NOBODY)
    assert own.problem(point(), "Ben", "Zoe") == own.missing(point()) == ""
    for name in ("ada", " ADA ", "\uff21da"):
        assert "cannot witness an own answer" in own.problem(point(), "Ben", name), name
    assert "cannot witness an own answer" in own.problem(point(), "Ben", "ben")


def test_the_simulated_witness_is_nobodys_name_elsewhere():
    """It answers with the simulated person, and never for a person."""
    simulated = SimulatedPerson(lambda: SimpleNamespace(answer=lambda *_: True))
    assert Witnessed(simulated, witnesses()).answer(point()).witness == "simulated witness"
    with pytest.raises(Declined, match="simulated witness is not in fixtures"):
        Witnessed(Says(witness="simulated witness"), witnesses()).answer(point())


def test_a_witness_point_asks_for_a_confirmation_and_its_witness(tmp_path):
    """The journal has who had to be present, and who was."""
    case = Case(tmp_path, answers=Says())
    case.run.operator.witness("quality engineer", "The coil is wired as drawn", name="wired")
    asked, answer, _ = case.written.events
    assert (asked["form"], asked["witness"]) == ("confirm", "quality engineer")
    assert (answer["by"], answer["witness"]) == ("Ben", "Quinn")


def test_a_witness_point_without_anybody_is_an_error(tmp_path):
    """Also where the case goes on."""
    operator = Case(tmp_path, answers=Says()).run.operator
    with pytest.raises(Misused, match="'wired' names nobody as its witness"):
        operator.witness(" ", "The coil is wired as drawn", name="wired")
    assert len(operator.refused) == 1


def test_a_person_at_the_terminal_names_another_witness():
    """Who may not witness is told, and another name is asked for."""
    lines, shown = ["yes\n", "Ada Lovelace\n", "Zoe\n", "Quinn\n", "yes\n"], []
    terminal = SimpleNamespace(show=shown.append, line=lambda: lines.pop(0))
    elsewhere = Elsewhere()
    elsewhere.witnesses = witnesses().problem
    assert TerminalPerson(terminal, "Ada", lambda: None, elsewhere).answer(point()).witness == "Quinn"
    assert "'wired' needs a witness (quality engineer): Ada Lovelace cannot witness an own answer" in shown
    assert "'wired' needs a witness (quality engineer): Zoe is not in fixtures/signers.yaml" in shown


def test_another_terminal_is_told_who_may_not_witness():
    """The question goes on waiting."""
    elsewhere = Elsewhere()
    elsewhere.witnesses = witnesses().problem
    with elsewhere.asks(point()):
        assert "Zoe is not in fixtures" in elsewhere.take("wired", "yes", "Ben", witness="Zoe")
        assert not elsewhere.take("wired", "yes", "Ben", witness="Quinn")
