"""Questions of a case: who answers them, and what becomes of a case that nobody answers."""

from __future__ import annotations

import base64
import hashlib

import pytest
import sweeps
from given_files import CSV, JPEG, PNG
from told_as_json import bodies
from workspaces import agreed, make

from hil.evidence.package.verification import verify
from hil.model.errors import ConfigurationError, Refused
from hil.plugin.rehearsing import procedure, replay

ASKING = """
@pytest.mark.requirement("T-050")
def test_asking(operator, check):
    operator.confirm("Is the jig closed?", name="jig-closed")
    voltage = operator.measure("Read the voltmeter", "V", name="voltmeter", uncertainty=0.01)
    check("T-050", "voltage", voltage)
"""


def answers(workspace, text):
    """Write an answers file, and return where it is."""
    path = workspace.root / "answers.yaml"
    path.write_text(f"schema: hil/answers/1\nanswers: {text}\n")
    return path


def test_answers_of_a_file_are_evidence(tmp_path):
    """Each answer is in the journal with the question it was given to, and with its source."""
    workspace = make(tmp_path / "workspace", ASKING)
    ran = workspace.run(answers=answers(workspace, '{jig-closed: "Yes", voltmeter: "4.98"}'), person=True)
    agreed(ran, {"test_asking": "PASS"}, "PASS", 0)
    assert [(each["name"], each["value"], each["by"]) for each in bodies(ran.package, "answer")] == [
        ("jig-closed", True, "answers file"),
        ("voltmeter", 4.98, "answers file"),
    ]


def test_a_hand_instrument_is_evidence_as_one_of_the_bench_is(tmp_path):
    """Frozen with its certificate, beside the check, on the report's page; verified, and the same when replayed."""
    asking = ASKING.replace("uncertainty=0.01", 'instrument="PSU-01"')
    workspace = make(tmp_path / "workspace", asking)
    ran = workspace.run(answers=answers(workspace, '{jig-closed: "Yes", voltmeter: "4.98"}'), person=True)
    agreed(ran, {"test_asking": "PASS"}, "PASS", 0)
    (check,) = bodies(ran.package, "check")
    assert (check["instruments"], check.get("unproven", [])) == (["PSU-01"], [])
    assert check["uncertainty"] == pytest.approx((0.003 + 0.0005 * 4.98) / 2)
    record = ran.package.json("data/bench/calibration.json")["instruments"]["PSU-01"]
    assert (record["serial"], record["number"], record["due"]) == ("DP8C231402017", "SPECIMEN-2026-1", "2027-09-30")
    assert (ran.package.folder / "data/registers/certificates/psu-01-2026.txt").is_file()
    page = ran.page()
    assert "Read the voltmeter (with PSU-01, RIGOL TECHNOLOGIES DP832, serial DP8C231402017)" in page
    assert "read by a person" in page
    assert (verify(ran.package.folder).findings, replay(ran.package).differences) == ((), ())


ATTACHING = """
@pytest.mark.requirement("T-050")
def test_attaching(operator, check):
    operator.attach(
        "A photo of the jig", name="photo", accepts=("picture",), witness="quality", picture="pictures/jig.jpg"
    )
    curve = operator.attach("The curve", name="curve", accepts=("csv",))
    check("T-050", "voltage", operator.measure("Read the voltmeter", "V", name="voltmeter", uncertainty=0.01))
    assert curve.text().startswith("voltage")
"""


def test_files_are_evidence(tmp_path):
    """Copied, hashed, named with who gave and who witnessed them; verified, and the same when replayed."""
    workspace = make(tmp_path / "workspace", ATTACHING)
    (workspace.root / "files").mkdir()
    shown = next((workspace.root / "testplans").glob("*/requirements.yaml")).parent / "pictures/jig.jpg"
    shown.parent.mkdir()
    shown.write_bytes(JPEG)
    (workspace.root / "files/jig.png").write_bytes(PNG)
    (workspace.root / "files/curve.csv").write_bytes(CSV)
    path = answers(workspace, '{photo: files/jig.png, curve: files/curve.csv, voltmeter: "4.98"}')
    path.write_text(path.read_text() + "witnesses: {photo: Quinn Quality}\nby: Ada Engineer\n")
    ran = workspace.run(answers=path, person=True)
    agreed(ran, {"test_attaching": "PASS"}, "PASS", 0)
    photo, curve, _ = bodies(ran.package, "answer")
    assert (photo["value"], photo["by"], photo["witness"]) == (
        "jig.png",
        "Ada Engineer (answers file)",
        "Quinn Quality",
    )
    asked = bodies(ran.package, "question")[0]
    assert asked["witness"] == "quality"
    kept = ran.package.folder / asked["picture"]["file"]
    assert (kept.read_bytes(), asked["picture"]["sha256"]) == (JPEG, hashlib.sha256(JPEG).hexdigest())
    page = ran.page()
    for data, kind in ((PNG, "png"), (JPEG, "jpeg")):
        assert f'src="data:image/{kind};base64,{base64.b64encode(data).decode()}"' in page
    assert "img-src data:" in page
    for part in ("curve.csv", curve["file"]["sha256"], "CSV, 24 bytes", "Quinn Quality", "witnessed by"):
        assert part in page
    for answer, content in ((photo, PNG), (curve, CSV)):
        assert (ran.package.folder / "data/attachments" / answer["file"]["file"]).read_bytes() == content
    assert (verify(ran.package.folder).findings, replay(ran.package).differences) == ((), ())
    kept = ran.package.folder / "data/attachments" / photo["file"]["file"]
    kept.chmod(0o600)
    kept.write_bytes(JPEG)
    assert any(kept.name in str(finding) for finding in verify(ran.package.folder).findings)


@pytest.mark.parametrize(
    ("text", "reason"),
    sweeps.sample(
        [
            ('{jig-close: "yes", voltmeter: "4.98"}', "answers.yaml:2:22: no case asks 'jig-close', did you mean"),
            ('{jig-closed: "yes"}', "answers.yaml: no answer to 'voltmeter' (testplans/"),
            ('{jig-closed: "perhaps", voltmeter: "1"}', "'perhaps' does not answer 'jig-closed': answer yes or no"),
            ('{jig-closed: "yes", voltmeter: "much"}', "'much' does not answer 'voltmeter': answer a number in V"),
            ('{jig-closed: "yes", voltmeter: "nan"}', "'nan' does not answer 'voltmeter': answer a number in V"),
        ],
        2,
    ),
)
def test_an_answer_that_is_none_is_told_before_the_run(tmp_path, text, reason):
    """A file that does not answer the questions of the cases is refused, with its place and what to write."""
    workspace = make(tmp_path / "workspace", ASKING)
    with pytest.raises(ConfigurationError) as caught:
        workspace.run(answers=answers(workspace, text), person=True)
    assert reason in "\n".join(map(str, caught.value.findings))
    assert workspace.folders() == []


def test_a_no_ends_the_case(tmp_path):
    """Whoever says it; that is an answer."""
    workspace = make(tmp_path / "workspace", ASKING)
    ran = workspace.run(answers=answers(workspace, '{jig-closed: "no", voltmeter: "4.98"}'), person=True)
    agreed(ran, {"test_asking": "ERROR"}, "ERROR", 1)
    assert "'Is the jig closed?' was not confirmed" in ran.reasons("test_asking")


def test_a_wrong_answers_file_is_refused_before_the_run(tmp_path):
    """A file of another kind is told with its place, and no run begins."""
    workspace = make(tmp_path / "workspace", ASKING)
    path = workspace.root / "answers.yaml"
    path.write_text('schema: hil/answers/1\nanswer: {a: "yes"}\n')
    with pytest.raises(ConfigurationError, match=r"answers.yaml:2:1: .*unknown key 'answer', did you mean 'answers'\?"):
        workspace.run(answers=path)
    assert workspace.folders() == []


def test_without_a_person_a_question_says_what_to_do(tmp_path):
    """Asked to ask at a terminal where there is none, no run begins, and the error names a way out."""
    workspace = make(tmp_path / "workspace", ASKING)
    with pytest.raises(
        Refused, match=r"there is nobody to answer .*'jig-closed' \(testplans/.*--answers FILE, or run from a"
    ):
        workspace.run(person=True)
    assert workspace.folders() == []


def test_what_the_simulated_person_does_not_know_is_told_before_the_run(tmp_path):
    """A question that the simulated bench has no answer to names the place where it would be given."""
    workspace = make(tmp_path / "workspace", ASKING)
    with pytest.raises(
        Refused, match=r"there is nobody to answer 'voltmeter' \(testplans/.* simulated\.person in the bench"
    ):
        workspace.run()
    assert workspace.folders() == []


CONNECTING = """
@pytest.mark.requirement("T-040")
def test_connecting(operator, coil, check):
    operator.connect("x_plus", "Connect x+", name="outer-board", options=("x_plus", "y_plus"))
    coil.drive(0.016)
    seen = operator.choose("Which way?", ("outward", "inward", "unclear"), name="phone-direction")
    check("T-040", "answers", "yes" if seen == "inward" else str(seen))
"""


@pytest.mark.parametrize(
    ("said", "verdict", "reason"),
    [('"yes"', "PASS", ""), ("y_plus", "ERROR", "'y_plus' is"), ('"no"', "ERROR", "answers 'no' to 'outer-board'")],
)
def test_on_a_simulated_bench_is_done_what_a_file_says_is_done(tmp_path, said, verdict, reason):
    """The coil of x+ is wound the other way than the one that was there: only connected it points inward."""
    workspace = make(tmp_path / "workspace", CONNECTING)
    workspace.change_bench({'x_plus: {resistance: "97.9"}': 'x_plus: {resistance: "97.9", winding: left}'})
    ran = workspace.run(answers=answers(workspace, f"{{outer-board: {said}}}"))
    agreed(ran, {"test_connecting": verdict}, verdict, 0 if verdict == "PASS" else 1)
    assert reason in ran.reasons("test_connecting")
    assert replay(ran.package).differences == ()


@pytest.mark.system
def test_a_procedure_is_rehearsed_with_the_answers_of_the_run(tmp_path):
    """What passes in a run with an answers file passes in `hil plan` with the same file, and not without it."""
    workspace = make(tmp_path / "workspace", ASKING)
    path = answers(workspace, '{jig-closed: "Yes", voltmeter: "4.98"}')
    told, alone = (procedure(workspace.request(answers=given)) for given in (path, None))
    assert [any(line.startswith("not passed") for line in lines) for lines in (told, alone)] == [False, True]
    assert workspace.folders() == []
