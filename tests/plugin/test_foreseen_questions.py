"""Questions without anybody to answer them are reported first, with their places in plan and answers file."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace

import pytest
from given_files import PNG, TEXT
from workspaces import make

from hil.documents.node import Place
from hil.executive.people.questions import Question
from hil.executive.people.witnesses import Witnesses
from hil.executive.setup.configuration import configure
from hil.model.errors import ConfigurationError, Refused
from hil.plugin.launch import launch
from hil.plugin.plans.prompts import Attended, Foreseen, foreseen, require_answers, require_witness_points
from hil.registers.signers import HeldRole, Signer, Signers

CASES = """
import pytest

PLACE = "bench-place"


class Jig:
    def __init__(self, operator):
        self.operator = operator

    def close(self):
        self.operator.confirm("Is the jig closed?", name="jig-closed")

    def never_called(self):
        self.operator.confirm("Never asked", name="never")


@pytest.fixture
def jig(operator):
    return Jig(operator)


def turn(operator, axis):
    operator.connect(axis, "Turn it", name=f"turned-{axis}", options=("x", "y"))


@pytest.mark.requirement("T-050")
def test_asking(operator, check, jig):
    jig.close()
    operator.attach("A photo of the jig", name="photo", accepts=("picture",), witness="quality")
    operator.choose("Where is it?", ["here", "there"], name=PLACE)
    operator.witness("quality", "The wiring is as drawn", name="wiring")
    check("T-050", "voltage", operator.measure("Read the voltmeter", "V", name="voltmeter", uncertainty=0.01))


def test_turning(operator):
    turn(operator, "x")
"""
WHOLE = {
    "jig-closed": '"yes"',
    "photo": "jig.png",
    "bench-place": "here",
    "wiring": '"yes"',
    "voltmeter": '"4.98"',
    "turned-x": '"yes"',
}


@pytest.fixture(scope="module")
def workspace(tmp_path_factory):
    """A workspace with a plan that asks."""
    made = make(tmp_path_factory.mktemp("foreseen") / "workspace", CASES)
    (made.root / "jig.png").write_bytes(PNG)
    (made.root / "notes.txt").write_bytes(TEXT)
    return made


@pytest.fixture(scope="module")
def cases(workspace):
    """What each case may ask, collected once."""
    found = {}

    def opened(_configuration, planned):
        found.update((case.id.partition("::")[2], foreseen(case.item, workspace.root)) for case in planned)
        raise Refused("seen", "stop here")

    with pytest.raises(Refused, match="seen"):
        launch(configure(workspace.request()), opened)
    return found


def answers(folder, witness="Quinn", **changed):
    """Write an answers file; None leaves an answer out."""
    path = folder / "answers.yaml"
    given = {name.replace("_", "-"): value for name, value in changed.items()}
    lines = [f"  {name}: {value}" for name, value in {**WHOLE, **given}.items() if value is not None]
    told = f"witnesses: {{photo: {witness or 'Quinn'}, wiring: Quinn}}" if witness else "witnesses: {wiring: Quinn}"
    path.write_text("\n".join(["schema: hil/answers/1", "by: Ada", "answers:", *lines, told, ""]))
    return path


NOBODY = Attended(terminal=False, simulated=None, safety=False)
PERSON = Attended(terminal=True, simulated=None, safety=False)
KNOWN = frozenset({"bench-place", "voltmeter", "turned-x"})
SIMULATED = Attended(terminal=True, simulated=KNOWN, safety=False)


NO_REGISTER = Signers(people=(), folder=Path())


def required(cases, file, attended=NOBODY, operator="Olga", signers=NO_REGISTER):
    """Require answers of all cases, and return what is wrong, each with its place."""
    asked = [each for its in cases.values() for each in its]
    request = SimpleNamespace(answers=file)
    witnesses = Witnesses(operator, lambda: signers, lambda: "2026-06-01")
    try:
        require_answers(asked, asked, request, attended, witnesses, lambda path: path.name)
    except ConfigurationError as error:
        return [str(finding) for finding in error.findings]
    return []


def test_every_question_of_a_case_is_foreseen(cases):
    """Its own, those of its fixtures and of what they call; of a class only methods that somebody names."""
    told = {name: sorted(each.name or each.pattern.pattern for each in its) for name, its in cases.items()}
    assert told == {
        "test_asking": ["bench-place", "jig-closed", "photo", "voltmeter", "wiring"],
        "test_turning": [r"turned\-.*"],
    }
    [photo] = [each for each in cases["test_asking"] if each.name == "photo"]
    assert (photo.question.form, photo.question.options, photo.question.witness) == ("file", ("png", "jpeg"), "quality")
    assert re.fullmatch(r"testplans/\w+/test_\w+\.py:\d+", photo.where)


def test_whole_answers_are_enough(workspace, cases):
    """Nobody is needed then, and with a person no file is."""
    assert required(cases, answers(workspace.root)) == []
    assert required(cases, None, PERSON) == []


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"photo": None}, "answers.yaml: no answer to 'photo' (testplans/"),
        ({"jig_closed": None}, "no answer to 'jig-closed' (testplans/"),
        ({"turned_x": None}, "no answer to a question named turned-... (testplans/"),
        ({"fotos": "jig.png"}, "answers.yaml:10:10: no case asks 'fotos', did you mean 'photo'?"),
        ({"photo": "missing.png"}, "missing.png: there is no such file; check its path"),
        ({"photo": "notes.txt"}, "answers.yaml:5:10: 'photo': "),
        ({"photo": "."}, "this is a folder; give one file"),
        ({"jig_closed": "perhaps"}, "answers.yaml:4:15: 'perhaps' does not answer 'jig-closed': answer yes or no"),
        ({"bench_place": "nowhere"}, "'nowhere' does not answer 'bench-place': answer here or there"),
        ({"voltmeter": '"much"'}, "'much' does not answer 'voltmeter': answer a number in V"),
        ({"witness": ""}, "'photo' needs a witness (quality), and none is named; name another person under witnesses"),
        ({"witness": " ADA"}, "ADA cannot witness an own answer"),
        ({"witness": "olga"}, "olga cannot witness an own answer"),
    ],
)
def test_what_an_answers_file_lacks_or_has_too_many_is_told_with_its_place(workspace, cases, changed, message):
    """Before the run: missing, misspelt, unfit, and a witness who is nobody else."""
    wrong = required(cases, answers(workspace.root, **changed))
    assert len(wrong) == 1, wrong
    assert message in wrong[0]


def test_a_witness_whom_nobody_asks_for_is_told(workspace, cases):
    """Whoever prepared the file believes that the answer is witnessed, and no package would say so."""
    file = answers(workspace.root)
    file.write_text(file.read_text().replace("witnesses: {", "witnesses: {jig-closed: Quinn, "))
    (wrong,) = required(cases, file)
    assert wrong.startswith("answers.yaml:10:25: 'jig-closed' asks for no witness; remove it")


def test_without_a_file_nobody_answers(cases):
    """The questions are named with their places; the simulated person has no files, and answers what it knows."""
    with pytest.raises(Refused) as caught:
        required(cases, None)
    told = str(caught.value)
    assert told.startswith("there is nobody to answer '")
    assert "'jig-closed' (testplans/" in told
    assert "give answers with --answers FILE, or run from a terminal" in str(caught.value)
    with pytest.raises(Refused) as caught:
        required(cases, None, SIMULATED)
    assert "'jig-closed'" not in str(caught.value)
    assert "'photo'" in str(caught.value)
    assert "the simulated person has no files" in str(caught.value)


@pytest.mark.parametrize(("name", "told"), [("voltmeter", "'voltmeter'"), ("turned-x", "a question named turned-...")])
def test_the_simulated_person_answers_what_the_bench_file_maps(cases, name, told):
    """There is nobody to answer anything else that it may be asked, terminal or not; a confirmation needs no map."""
    without = Attended(terminal=True, simulated=KNOWN - {name}, safety=False)
    with pytest.raises(Refused) as caught:
        required(cases, None, without)
    assert told in str(caught.value)
    assert "'bench-place'" not in str(caught.value)


def test_a_picture_that_is_missing_is_told_with_its_place(tmp_path):
    """Before anything is opened, and no folder of a run: a wrong name, one beside the plan, and one that is none."""
    made = make(
        tmp_path / "workspace",
        CASES.replace('name="jig-closed")', 'name="jig-closed", picture="jig.png")')
        .replace("name=PLACE)", 'name=PLACE, picture="../jig.png")')
        .replace('name="wiring")', 'name="wiring", picture="wiring.png")'),
    )
    plan = next((made.root / "testplans").glob("*/requirements.yaml")).parent
    (plan / "jig.png").write_bytes(PNG)
    (plan.parent / "jig.png").write_bytes(PNG)
    (plan / "wiring.png").write_bytes(PNG[:-5])
    (made.root / "jig.png").write_bytes(PNG)
    with pytest.raises(ConfigurationError) as caught:
        made.run(answers=answers(made.root), person=True)
    told = str(caught.value)
    assert len(caught.value.findings) == 2, told
    assert "has no picture '../jig.png'" in told
    assert "wiring.png: this PNG is damaged" in told
    assert re.search(r"testplans/\w+/test_\w+\.py:\d+:1: ", told)
    assert made.folders() == []


QUALITY = HeldRole(role="quality", since="2026-01-01", until="2026-12-31")
PEOPLE = Signers(
    people=(
        Signer(principal="ada@x", name="Ada Lovelace", also=("Ada", "AL"), roles=(QUALITY,)),
        Signer(principal="quinn@x", name="Quinn", roles=(QUALITY,)),
        Signer(principal="bo@x", name="Bo", roles=(HeldRole(role="quality", since="2026-06-02"),)),
    ),
    folder=Path(),
)


@pytest.mark.parametrize(
    ("witness", "message"),
    [
        ("quinn@x", ""),
        ("Al", "Al cannot witness an own answer"),
        ("ada@x", "ada@x cannot witness an own answer"),
        ("Rita", "Rita is not in fixtures/signers.yaml; name another person under witnesses"),
        ("Bo", "by fixtures/signers.yaml, Bo has neither this role on 2026-06-01 nor this name"),
    ],
)
def test_a_register_says_who_may_witness(workspace, cases, witness, message):
    """Nobody is two persons by another of their names, and a role counts on the day of the run."""
    wrong = required(cases, answers(workspace.root, witness=witness), operator="", signers=PEOPLE)
    assert len(wrong) == bool(message), wrong
    assert message in "".join(wrong)


def test_a_role_that_nobody_has_is_told_with_its_place(workspace, cases):
    """Before anything is opened, where persons answer; the simulated witness needs no role."""
    nobody = Signers(people=(Signer(principal="quinn@x", name="Quinn"),), folder=Path())
    wrong = required(cases, None, PERSON, signers=nobody)
    assert len(wrong) == 2, wrong
    assert wrong[0].startswith("testplans/")
    assert wrong[0].endswith(
        ": 'photo' needs a witness (quality), and nobody in fixtures/signers.yaml has this role on 2026-06-01, or this"
        " name"
    )
    assert required(cases, answers(workspace.root, witness="Quinn"), SIMULATED, signers=PEOPLE) == []


@pytest.mark.parametrize(
    ("asked", "fields", "message"),
    [
        (("quality",), {"witness": "Quality "}, ""),
        (("quality",), {"independent": True}, ""),
        (("somebody",), {"witness": "quality"}, ""),
        (("technician", ""), {"witness": "quality"}, "T-050 needs a witness (quality), and no question of its cases"),
        (("",), {"independent": True}, "T-050 needs a witness (somebody), and no question of its cases"),
        ((), {}, ""),
    ],
)
def test_a_witness_of_a_requirement_is_asked_for_by_its_cases(asked, fields, message):
    """Or the run for qualification or acceptance is refused; one whose name is computed may be the right one."""
    told = {"witness": "", "independent": False, "place": Place(path="testplans/x/requirements.yaml", line=3, column=5)}
    catalogue = SimpleNamespace(requirement=lambda _: SimpleNamespace(**told | fields))
    found = [SimpleNamespace(question=Question(name="q", form="confirm", text="", witness=each)) for each in asked]
    run = [(SimpleNamespace(requirements=("T-050",)), found)]
    if not message:
        require_witness_points(catalogue, run)
        return
    with pytest.raises(ConfigurationError) as caught:
        require_witness_points(catalogue, run)
    assert message in str(caught.value)
    assert "testplans/x/requirements.yaml:3:5" in str(caught.value)
    assert "add operator.witness('" in str(caught.value)


def test_a_safety_confirmation_needs_a_person_whatever_a_file_says():
    """On a bench outside the process; a terminal is enough."""
    safety = Foreseen(
        pattern=re.compile("fuse"),
        name="fuse",
        question=Question(name="fuse", form="confirm", text="Is the fuse in?", safety=True),
        options=False,
        where="testplans/x/test_x.py:1",
    )
    for terminal in (True, False):
        attended = Attended(terminal=terminal, simulated=None, safety=True)
        request = SimpleNamespace(answers=None)
        witnesses = Witnesses("", lambda: NO_REGISTER, lambda: "2026-06-01")
        if terminal:
            require_answers([safety], [safety], request, attended, witnesses, str)
        else:
            with pytest.raises(Refused, match="is a safety confirmation: a person gives it live"):
                require_answers([safety], [safety], request, attended, witnesses, str)
