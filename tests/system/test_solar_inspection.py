"""The documents of the solar cells: evidence of a run, and open until they are there, agree and are approved."""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess

import pytest
from given_files import JPEG
from solar_plans import DOCUMENTS, ON_BENCH, solar_workspace
from told_as_json import bodies
from workspaces import ROOT

from hil.evidence.package.verification import verify
from hil.model.errors import ConfigurationError
from hil.plugin.rehearsing import replay

pytestmark = [pytest.mark.system, pytest.mark.timeout(180)]

FILES = {"datasheet": "datasheet.pdf", "model": "cell.step", "panel": "panel.png"}
DIGESTS = {name: hashlib.sha256((ROOT / DOCUMENTS / file).read_bytes()).hexdigest() for name, file in FILES.items()}
SHOWN = {"EPS-SOL-060": "datasheet", "EPS-SOL-061": "model", "EPS-SOL-062": "panel"}
"""The document that each requirement needs."""

SIGNERS = """\
schema: hil/signers/1
signers:
- {principal: ada@x, name: Ada Lovelace, roles: [{role: verification, since: "2026-01-01"}]}
- {principal: bo@x, name: Bo Diddley, roles: [{role: verification, since: "2026-01-01"}]}
"""


def inspected(made):
    """Run the plan with the specimen's answers."""
    return made.run(**ON_BENCH, answers=made.root / DOCUMENTS / "answers.yaml")


def test_the_documents_are_evidence(tmp_path):
    """Each with kind, hash and inspector, at the check that it is of; the bench stays dark; the same replayed."""
    made = solar_workspace(tmp_path / "w", "solar_inspection")
    ran = inspected(made)
    assert ran.verdicts() == {"test_documents": "PASS", "test_damage": "PASS"}, ran.out
    answered = {each["name"]: each for each in bodies(ran.package, "answer")}
    assert {each["by"] for each in answered.values()} == {"Specimen Inspector (answers file)"}
    for (name, digest), kind in zip(DIGESTS.items(), ("pdf", "step", "png"), strict=True):
        file = answered[name]["file"]
        assert (file["sha256"], file["type"]) == (digest, kind)
        kept = (ran.package.folder / "data/attachments" / file["file"]).read_bytes()
        assert hashlib.sha256(kept).hexdigest() == digest
        assert f"SHA-256 {digest[:16]}" in ran.page()
    assert [event for event in bodies(ran.package, "effect") if event["effect"] == "drives"] == []
    assert verify(ran.package.folder).findings == ()
    assert replay(ran.package).differences == ()


@pytest.mark.parametrize(
    ("old", "new", "case", "verdict"),
    [
        ("datasheet-agrees: agrees", "datasheet-agrees: differs", "test_documents", "FAIL"),
        ("panel-damage: none", "panel-damage: crack", "test_damage", "FAIL"),
    ],
    ids=["another data sheet", "a crack"],
)
def test_what_differs_fails(tmp_path, old, new, case, verdict):
    """And the other case is as it was."""
    made = solar_workspace(tmp_path / "w", "solar_inspection")
    made.change(f"{DOCUMENTS}/answers.yaml", {old: new})
    ran = inspected(made)
    assert ran.verdicts() == {"test_documents": "PASS", "test_damage": "PASS", case: verdict}, ran.out


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("  model: cell.step\n", "", "no answer to 'model'"),
        ("model: cell.step", "model: panel.jpg", "this is a JPEG file; give STEP"),
    ],
    ids=["no model", "a picture for a model"],
)
def test_it_does_not_begin_without_its_documents(tmp_path, old, new, told):
    """What is missing is told before anything is opened."""
    made = solar_workspace(tmp_path / "w", "solar_inspection")
    (made.root / DOCUMENTS / "panel.jpg").write_bytes(JPEG)
    made.change(f"{DOCUMENTS}/answers.yaml", {old: new})
    with pytest.raises(ConfigurationError, match=told):
        inspected(made)
    assert made.folders() == []


@pytest.mark.skipif(shutil.which("ssh-keygen") is None, reason="ssh-keygen is not installed")
def test_it_is_open_until_it_is_done(tmp_path):
    """Open without evidence, after a simulated run and before the approval; then closed, by whom and with what."""
    made = solar_workspace(tmp_path / "w", "solar_inspection")
    rows = audited(made)
    for row in rows.values():
        assert (row["close_out"], row["compliance"], row["method"]) == ("open", "no", "inspection")
        told = "it is verified by inspection, and neither a package nor a verification shows that"
        assert [(each["code"], each["text"]) for each in row["reasons"]] == [("NO_EVIDENCE", told)]
    inspected(made)
    for row in audited(made).values():
        assert row["close_out"] == "open"
        assert ("SIM_ONLY", "the run's source is simulated") in [
            (each["code"], each["text"]) for each in row["reasons"]
        ]
    state(made, rows)
    for row in audited(made).values():
        assert row["close_out"] == "open"
        assert [each["code"] for each in row["reasons"] if not each["package"]] == ["AWAITING_APPROVAL"]
    for number in range(1, 4):
        approve(made, tmp_path, f"V-{number}")
    for number, (name, row) in enumerate(audited(made).items(), start=1):
        assert (row["close_out"], row["compliance"], row["closed_by"]) == ("closed", "yes", f"V-{number}")
        told = json.dumps(row["stated"])
        for part in ("Ada Lovelace", "inspector", DIGESTS[SHOWN[name]], FILES[SHOWN[name]], "bo@x", "SOL-FM-1"):
            assert part in told, part
    with (made.root / DOCUMENTS / "datasheet.pdf").open("ab") as sheet:
        sheet.write(b"%")
    assert {name: row["close_out"] for name, row in audited(made, code=2).items()} == {
        "EPS-SOL-060": "open",
        "EPS-SOL-061": "closed",
        "EPS-SOL-062": "closed",
    }


def audited(made, code=0):
    """Return the rows of the three requirements, as `hil audit` tells them; 2 where something is damaged."""
    ended = made.hil("audit", "--no-cache", "--format", "json")
    assert ended.code == code, ended.err
    return {each["id"]: each for each in json.loads(ended.out)["rows"] if each["id"] in SHOWN}


def state(made, rows):
    """Enter what an inspector found of a flight unit, with a document for each requirement, and keys of two people."""
    fixtures = made.root / "fixtures"
    (fixtures / "signers.yaml").write_text(SIGNERS, encoding="utf-8")
    allowed = ""
    for name in ("ada", "bo"):
        key = made.root.parent / name
        subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", "", "-f", key], check=True)
        allowed += f"{name}@x {key.with_suffix('.pub').read_text(encoding='utf-8')}"
    (fixtures / "allowed_signers").write_text(allowed, encoding="utf-8")
    entries = [
        f"- {{id: V-{number}, title: Solar cell against its documents, method: inspection, date: '2026-11-20',"
        f" by: Ada Lovelace, role: inspector, requirement: {requirement}, rev: 1,"
        f" fingerprint: {rows[requirement]['fingerprint']}, verdict: PASS, statement: As asked,"
        f" documents: [{{file: documents/solar/{FILES[name]}, sha256: {DIGESTS[name]}}}],"
        " units: [{part: SOL-1, serial: SOL-FM-1}]}\n"
        for number, (requirement, name) in enumerate(SHOWN.items(), start=1)
    ]
    text = f"schema: hil/verifications/1\nverifications:\n{''.join(entries)}"
    (fixtures / "verifications.yaml").write_text(text, encoding="utf-8")


def approve(made, keys, number):
    """Approve a verification as somebody else."""
    said = ("--role", "verification", "--meaning", "documents read", "--key", str(keys / "bo"), "--as", "bo@x")
    ended = made.hil("approve", number, *said)
    assert ended.code == 0, ended.out + ended.err
