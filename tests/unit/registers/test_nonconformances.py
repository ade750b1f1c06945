"""The registers of nonconformance reports and waivers: read strictly, and every error has a place."""

from __future__ import annotations

import hashlib

import pytest

from hil.documents.findings import Findings
from hil.model.identity import Dut, Model
from hil.registers.nonconformances import Action, Disposition, NamedDocument, Record, UnitName, load_records

REPORTS = """schema: hil/nonconformances/1
nonconformances:
- id: NCR-7
  title: Cell at 4.3 V
  date: "2026-06-02"
  by: Ada
  requirements: [EPS-1]
  units: [{part: BAT-1, serial: FM-7}]
  run: 20260602T080000Z-battery-FM-7-ab12cd
  check: cell_voltage
  disposition: rework
  action: {text: Limiter changed, date: "2026-06-10"}
"""
WAIVERS = f"""schema: hil/waivers/1
waivers:
- id: W-1
  title: 4.3 V is accepted
  date: "2026-06-03"
  until: "2027-06-03"
  by: Ada
  requirement: EPS-1
  rev: 1
  fingerprint: {"f" * 64}
  units: [{{part: BAT-1, serial: FM-7}}]
  reason: The cell stands it
  nonconformance: NCR-7
"""
VERIFICATIONS = f"""schema: hil/verifications/1
verifications:
- id: V-1
  title: Drawing of the cell
  method: inspection
  date: "2026-06-03"
  by: Ada
  role: inspector
  requirement: EPS-1
  rev: 1
  fingerprint: {"f" * 64}
  verdict: PASS
  statement: The cell has the size of the drawing
  documents: [{{file: documents/cell.pdf, sha256: {"a" * 64}}}]
  units: [{{part: BAT-1, serial: FM-7}}]
  witness: Quinn
"""
DUTS = {"FM-7": Dut(serial="FM-7", part="BAT-1", model=Model.FM, hardware="A")}
KINDS = {"EPS-1": "limit", "EPS-0": "parent"}


def load(tmp_path, reports=REPORTS, waivers=WAIVERS, verifications=VERIFICATIONS):
    """Return what the registers hold, and what is wrong with them."""
    fixtures = tmp_path / "fixtures"
    fixtures.mkdir(exist_ok=True)
    (fixtures / "nonconformances.yaml").write_text(reports, encoding="utf-8")
    (fixtures / "waivers.yaml").write_text(waivers, encoding="utf-8")
    (fixtures / "verifications.yaml").write_text(verifications, encoding="utf-8")
    findings = Findings()
    found = load_records(fixtures, findings, requirements=KINDS, duts=DUTS)
    return found, [str(each) for each in findings]


def test_a_verification_is_read_whole(tmp_path):
    """An analysis or a review need not name a unit."""
    found, wrong = load(tmp_path)
    assert wrong == []
    item = found.find("V-1")
    assert (item.method, item.verdict, item.witness) == ("inspection", "PASS", "Quinn")
    assert item.documents == (NamedDocument(file="documents/cell.pdf", sha256="a" * 64),)
    without = VERIFICATIONS.replace("  units: [{part: BAT-1, serial: FM-7}]\n", "")
    assert load(tmp_path, verifications=without.replace("inspection", "analysis"))[1] == []


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("inspection", "test", "verifications.yaml:5:11: verifications: 'method' must be one of"),
        ("verdict: PASS", "verdict: RECORDED", "verifications: 'verdict' must be one of"),
        (
            "witness: Quinn",
            "witness: ' ada'",
            "verifications.yaml:16:12: V-1: ada did it, and cannot be the witness",
        ),
        ("documents/cell.pdf", "../cell.pdf", "V-1: '../cell.pdf' must be a path below the folder of fixtures"),
        ("documents/cell.pdf", "/cell.pdf", "V-1: '/cell.pdf' must be a path below the folder of fixtures"),
        ("a" * 64, hashlib.sha256(b"").hexdigest(), "this is the SHA-256 of an empty file: documents/cell.pdf shows"),
        ("a" * 64, "a" * 63, "'sha256' must be the 64 digits that sha256sum prints"),
        ("[{file: documents/cell.pdf, sha256: " + "a" * 64 + "}]", "[]", "V-1: name at least one document"),
        ("  units: [{part: BAT-1, serial: FM-7}]\n", "", "V-1: name at least one unit"),
        ("2026-06-03", "2026-06-31", "V-1: the date 2026-06-31 does not exist"),
        ("requirement: EPS-1", "requirement: EPS-2", "V-1: there is no requirement 'EPS-2', did you mean 'EPS-1'?"),
        ("by: Ada", "by: ''", "'by'"),
    ],
)
def test_a_wrong_verification_has_a_place(tmp_path, old, new, message):
    """Methods that runs show, verdicts that are none, documents elsewhere, a witness who did it."""
    _, wrong = load(tmp_path, verifications=VERIFICATIONS.replace(old, new, 1))
    assert any(message in line for line in wrong), wrong


def test_both_are_read_whole(tmp_path):
    """Every field arrives; a workspace without them has none."""
    found, wrong = load(tmp_path)
    assert wrong == []
    report, waiver = found.nonconformances["NCR-7"], found.waivers["W-1"]
    assert (report.disposition, report.action) == (
        Disposition.REWORK,
        Action(text="Limiter changed", date="2026-06-10"),
    )
    assert (waiver.rev, waiver.until, waiver.units) == (1, "2027-06-03", (UnitName(part="BAT-1", serial="FM-7"),))
    assert report.complete
    assert (found.find("W-1"), found.find("NCR-8")) == (waiver, None)
    assert load_records(tmp_path, Findings()).waivers == {}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[EPS-1]", "[EPS-2]", "nonconformances.yaml:7:18: NCR-7: there is no requirement 'EPS-2', did you mean"),
        ("[EPS-1]", "[EPS-0]", "nonconformances.yaml:7:18: NCR-7: EPS-0 is met by the requirements below it"),
        ("[EPS-1]", "[]", "nonconformances.yaml:7:17: NCR-7: name at least one requirement"),
        ("serial: FM-7", "serial: FM-8", "nonconformances.yaml:8:11: NCR-7: there is no unit 'FM-8', did you mean"),
        ("part: BAT-1", "part: BAT-2", "nonconformances.yaml:8:11: NCR-7: FM-7 is of the part BAT-1, not BAT-2"),
        ("rework", "reworked", "nonconformances.yaml:11:16: nonconformances: 'disposition' must be one of"),
        ("2026-06-10", "2026-02-30", "nonconformances.yaml:12:41: NCR-7: the date 2026-02-30 does not exist"),
        ("  run: 20260602T080000Z-battery-FM-7-ab12cd\n", "", "name the run, too, whose check failed"),
        ("NCR-7", "NC-7", "nonconformances: 'id' must be a number such as NCR-0007"),
    ],
)
def test_a_wrong_report_has_a_place(tmp_path, old, new, message):
    """Names that nothing has, dates that do not exist, dispositions that are none."""
    _, wrong = load(tmp_path, reports=REPORTS.replace(old, new, 1), waivers="schema: hil/waivers/1\nwaivers: []\n")
    assert any(message in line for line in wrong), wrong


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("NCR-7", "NCR-8", "waivers.yaml:13:19: W-1: there is no report 'NCR-8', did you mean 'NCR-7'?"),
        ("2027-06-03", "2026-06-02", "waivers.yaml:6:10: W-1: it counts until 2026-06-02, and was asked for on"),
        ("ffff", "fff", "waivers: 'fingerprint' must be the 64 digits of the requirement's fingerprint"),
        ("rev: 1", 'rev: "1"', "waivers: 'rev' must be a whole number without quotes"),
        ("  until:", "  untill:", "waivers.yaml:6:3: unknown key 'untill', did you mean 'until'?"),
        ("requirement: EPS-1", "requirement: EPS-3", "waivers.yaml:8:16: W-1: there is no requirement 'EPS-3'"),
    ],
)
def test_a_wrong_waiver_has_a_place(tmp_path, old, new, message):
    """A report, a requirement or a day that cannot be; a waiver has no end without its last day."""
    _, wrong = load(tmp_path, waivers=WAIVERS.replace(old, new, 1))
    assert any(message in line for line in wrong), wrong


def test_one_number_stands_for_one_report(tmp_path):
    """Whatever its case."""
    entry = REPORTS.partition("nonconformances:\n")[2]
    _, wrong = load(tmp_path, reports=REPORTS + entry.replace("NCR-7", "NCR-7a") + entry.replace("NCR-7", "NCR-7A"))
    assert wrong == ["fixtures/nonconformances.yaml:23:7: NCR-7A is in the register twice"]


def test_any_change_of_content_is_another_content(tmp_path):
    """An approval of one text is no approval of another; comments and the order of keys mean nothing."""
    first = Record(of=load(tmp_path)[0].waivers["W-1"]).sha256
    assert Record(of=load(tmp_path, waivers=f"# as agreed\n{WAIVERS}")[0].waivers["W-1"]).sha256 == first
    for old, new in (("2027", "2028"), ("stands it", "stands"), ("f" * 64, "e" * 64), ("by: Ada", "by: Bo")):
        assert Record(of=load(tmp_path, waivers=WAIVERS.replace(old, new, 1))[0].waivers["W-1"]).sha256 != first
