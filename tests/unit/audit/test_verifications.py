"""Verification without a run: what a statement and its documents close, and everything by which they close nothing."""

from __future__ import annotations

import hashlib
import shutil
import subprocess
from dataclasses import replace

import msgspec
import pytest
from audited import ASKED, DUT, PARENT, codes, row, world_of

from hil.audit.cache import Cache
from hil.audit.engine import audit
from hil.audit.inputs import Approval, Filed
from hil.audit.pages.page import as_html
from hil.audit.reading import Folders, read_world, record_subject
from hil.audit.recorded import past, record, verifications_ever
from hil.audit.tables import as_csv, as_json
from hil.evidence.ledger.approvals import approve
from hil.evidence.ledger.book import read
from hil.model.errors import Refused
from hil.model.identity import UnitEvent
from hil.registers.nonconformances import (
    Action,
    Disposition,
    NamedDocument,
    Nonconformance,
    Record,
    Records,
    UnitName,
    Verification,
)
from hil.registers.signers import load_signers
from hil.requirements.catalogue import load_catalogue
from hil.requirements.lock import lock_text

REVIEWED = msgspec.structs.replace(ASKED, method="analysis", kind="limit")
UNIT = UnitName(part=DUT.part, serial=DUT.serial)
DIGEST = "d" * 64
SHOWN = Verification(
    id="V-1",
    title="Thermal analysis of the load",
    method="analysis",
    date="2026-06-02",
    by="Ada",
    role="thermal analyst",
    requirement=ASKED.id,
    rev=ASKED.rev,
    fingerprint=ASKED.fingerprint,
    verdict="PASS",
    statement="The load has 97 to 103 ohm from -20 to 60 degC",
    documents=(NamedDocument(file="documents/thermal.pdf", sha256=DIGEST),),
)


def approval(of, **changed):
    """Return a valid approval of a verification by somebody else."""
    fields = {"record": of.id, "sha256": Record(of=of).sha256, "role": "verification", "principal": "bo@x"}
    return Approval(**{**fields, "utc": "2026-06-20T08:00:00Z", "seq": 5, **changed})


def world(*items, asked=REVIEWED, approvals=None, documents=None, reports=(), shown=(), **changed):
    """Return a world without packages, in which these were stated and approved unless approvals are given."""
    registers = Records(
        verifications={each.id: each for each in items}, nonconformances={each.id: each for each in reports}
    )
    given = tuple(approval(each) for each in items) if approvals is None else tuple(approvals)
    there = {"documents/thermal.pdf": DIGEST} if documents is None else documents
    filed = Filed(registers=registers, approvals=given, documents=there, shown=tuple(shown))
    return replace(world_of([]), asked=(PARENT, asked), filed=filed, **changed)


def test_an_approved_statement_with_its_documents_closes():
    """The row names method, verdict, who, in what role, when and the digests; so does every form of the document."""
    found = row(world(SHOWN))
    assert (found.close_out, found.compliance, found.closed_by) == ("closed", "yes", "V-1")
    [stated] = found.stated
    assert stated.closes
    assert stated.told == (
        "2026-06-02 PASS V-1 analysis by Ada (thermal analyst): "
        f"documents/thermal.pdf {DIGEST}; approved by bo@x as verification on 2026-06-20"
    )
    document = audit(world(SHOWN))
    assert row(world(SHOWN), PARENT.id).closed
    assert not document.gaps
    page, cells = "".join(as_html(document, "reports")), as_csv(document).decode()
    assert stated.told in cells
    for part in ("V-1", "Ada (thermal analyst)", "documents/thermal.pdf", DIGEST[:12], SHOWN.statement, "closes it"):
        assert part in page
    assert b'"closed_by":"V-1"' in as_json(document)


@pytest.mark.parametrize("method", ["analysis", "inspection", "review"])
def test_it_is_open_until_it_is_done(method):
    """Nothing counts before."""
    found = row(world(asked=msgspec.structs.replace(REVIEWED, method=method)))
    assert [reason.text for reason in found.reasons] == [
        f"it is verified by {method}, and neither a package nor a verification shows that"
    ]
    assert (found.close_out, found.compliance) == ("open", "no")


@pytest.mark.parametrize(
    ("changed", "code", "text"),
    [
        ({"verdict": "INCONCLUSIVE"}, "NO_VERDICT", "V-1: its verdict is INCONCLUSIVE"),
        ({"method": "review"}, "NOT_ELIGIBLE", "made by review, and the requirement is verified by analysis"),
        ({"rev": 2}, "SUSPECT_REQ", "it is for rev 2 (ffffffff) of the requirement, which is now rev 1 (ffffffff)"),
        ({"fingerprint": "e" * 64}, "SUSPECT_REQ", "it is for rev 1 (eeeeeeee)"),
        ({"date": "2027-01-01"}, "INTEGRITY", "it is of 2027-01-01, which is after 2026-11-22"),
        ({"units": (UnitName(part="LOAD-1", serial="FM-8"),)}, "WRONG_DUT", "the register has no unit FM-8"),
        ({"units": (UnitName(part="LOAD-2", serial=DUT.serial),)}, "WRONG_DUT", "no unit FM-7 of the part LOAD-2"),
    ],
)
def test_what_a_statement_says_of_itself_may_close_nothing(changed, code, text):
    """Another method, another meaning, another unit, no verdict."""
    found = row(world(replace(SHOWN, **changed)))
    assert not found.closed
    assert any(reason.code == code and text in reason.text for reason in found.reasons), found.reasons


@pytest.mark.parametrize(
    ("documents", "text"),
    [
        ({}, "documents/thermal.pdf is not there; it was made with dddddddd"),
        ({"documents/thermal.pdf": ""}, "documents/thermal.pdf is not there"),
        ({"documents/thermal.pdf": "c" * 64}, "documents/thermal.pdf has another content now, SHA-256 cccccccc"),
    ],
)
def test_a_changed_document_reopens(documents, text):
    """By its digest, whatever its name."""
    found = row(world(SHOWN, documents=documents))
    assert [reason.code for reason in found.reasons] == ["INTEGRITY"]
    assert text in found.reasons[0].text


def test_what_changes_in_the_requirement_reopens():
    """Text, age, and a witness or somebody else that it asks for later; its revision says so, too."""
    for changed, expected in (
        ({"fingerprint": "a" * 64, "rev": 2}, ["SUSPECT_REQ"]),
        ({"max_age_s": 30 * 86_400.0}, ["EXPIRED"]),
        ({"witness": "quality"}, ["NOT_ELIGIBLE"]),
        ({"part_numbers": ("LOAD-2",)}, []),
    ):
        assert codes(world(SHOWN, asked=msgspec.structs.replace(REVIEWED, **changed))) == expected, changed
    witnessed = replace(SHOWN, witness="Quinn")
    assert codes(world(witnessed, asked=msgspec.structs.replace(REVIEWED, witness="quality"))) == []
    assert row(world(witnessed)).stated[0].told.count("witnessed by Quinn") == 1


def test_a_unit_that_changed_after_its_inspection_reopens():
    """The inspection speaks of the unit as it was."""
    asked = msgspec.structs.replace(REVIEWED, method="inspection")
    inspected = replace(SHOWN, method="inspection", units=(UNIT,))
    assert codes(world(inspected, asked=asked)) == []
    changed = replace(DUT, events=(UnitEvent(kind="repair", date="2026-07-01", text="load changed", reverify=True),))
    register = replace(world_of([]).register, duts={DUT.serial: changed})
    assert codes(world(inspected, asked=asked, register=register)) == ["STALE_DUT"]


def test_its_author_counts_unless_the_requirement_asks_for_somebody_else():
    """An approval of the present content is due in any case."""
    independent = msgspec.structs.replace(REVIEWED, independent=True)
    own = approval(SHOWN, own=True)
    assert codes(world(SHOWN, approvals=())) == ["AWAITING_APPROVAL"]
    assert codes(world(SHOWN, approvals=(own,))) == []
    found = row(world(SHOWN, asked=independent, approvals=(own,)))
    assert [reason.text for reason in found.reasons] == [
        "V-1: only Ada, who made it, approved it, and the requirement asks for somebody else"
    ]
    assert codes(world(SHOWN, asked=independent, approvals=(own, approval(SHOWN)))) == []
    changed = replace(SHOWN, statement="The load has 90 ohm")
    assert codes(world(changed, approvals=(approval(SHOWN),))) == ["AWAITING_APPROVAL"]
    assert codes(world(SHOWN, approvals=(approval(SHOWN, role="quality"),))) == ["AWAITING_APPROVAL"]


def test_a_fail_stands_until_a_report_says_what_was_done():
    """A later PASS does not take it back, nor does its removal, nor another word in the register."""
    fail = replace(SHOWN, id="V-0", verdict="FAIL")
    passed = replace(SHOWN, date="2026-07-01")
    assert codes(world(fail)) == ["NO_VERDICT", "FAILED"]
    assert row(world(fail)).compliance == "no"
    assert codes(world(fail, passed)) == ["FAILED"]
    gone = row(world(passed, shown=(fail,)))
    assert [reason.text for reason in gone.reasons] == [
        "V-0 said FAIL on 2026-06-02, and is no longer in the register as it was"
    ]
    assert codes(world(replace(fail, verdict="PASS"), shown=(fail,))) == ["FAILED"]
    report = Nonconformance(
        id="NCR-7",
        title="The load is 120 ohm",
        date="2026-06-03",
        by="Ada",
        requirements=(ASKED.id,),
        units=(UNIT,),
        run="V-0",
        disposition=Disposition.REWORK,
        action=Action(text="Drawing changed", date="2026-06-10"),
    )
    approvals = (approval(passed), approval(report, role="nonconformance"))
    assert codes(world(fail, passed, reports=(report,), approvals=approvals)) == []
    assert codes(world(fail, reports=(report,), approvals=approvals[1:])) == ["NO_VERDICT", "AWAITING_APPROVAL"]


def test_the_ledger_keeps_what_was_stated(tmp_path):
    """At every --record; an audit of a past day has it as it was."""
    (tmp_path / "reports").mkdir()
    now = world(SHOWN)
    record(tmp_path / "reports", now, audit(now))
    ledger = read(tmp_path / "reports")
    assert verifications_ever(tmp_path / "reports", ledger.entries) == (SHOWN,)
    day = ledger.entries[-1].utc[:10]
    then = past(replace(now, entries=ledger.entries, head=ledger.head), tmp_path / "reports", day)
    assert then.filed.registers.verifications == {"V-1": SHOWN}
    assert then.filed.documents == {"documents/thermal.pdf": DIGEST}


REQUIREMENTS = """schema: hil/requirements/1
requirements:
- id: T-010
  rev: 1
  text: The load shall stay below 80 degC in sunlight.
  kind: characterise
  method: analysis
  independent: {independent}
  limits: [{{parameter: temperature, unit: degC}}]
"""
SIGNERS = """schema: hil/signers/1
signers:
- {principal: ada@x, name: Ada, roles: [{role: verification, since: "2026-01-01"}]}
- {principal: bo@x, name: Bo, roles: [{role: verification, since: "2026-01-01"}]}
"""


@pytest.mark.skipif(shutil.which("ssh-keygen") is None, reason="ssh-keygen is not installed")
def test_a_statement_of_the_workspace_is_approved_and_closes(tmp_path):
    """From the files to the audit: the document's digest, the approval with a key, and who may give it."""
    fixtures, reports = tmp_path / "fixtures", tmp_path / "reports"
    for folder in (fixtures / "documents", reports, tmp_path / "testplans/load"):
        folder.mkdir(parents=True)
    plan = tmp_path / "testplans/load/requirements.yaml"
    plan.write_text(REQUIREMENTS.format(independent="true"))
    (plan.parent / "requirements.lock.json").write_text(
        lock_text(load_catalogue(tmp_path, [plan.parent], locked=False).of_plan("load"))
    )
    (fixtures / "signers.yaml").write_text(SIGNERS)
    allowed = ""
    for name in ("ada", "bo"):
        subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", "", "-f", tmp_path / name], check=True)
        allowed += f"{name}@x {(tmp_path / f'{name}.pub').read_text()}"
    (fixtures / "allowed_signers").write_text(allowed)
    folders = Folders(root=tmp_path, testplans=tmp_path / "testplans", fixtures=fixtures, reports=reports, name="w")

    def now():
        return read_world(folders, Cache(None, "1"), version="1", locked=False)

    document = fixtures / "documents/thermal.txt"
    document.write_text("78 degC")
    [asked] = now().asked
    assert (asked.method, asked.independent) == ("analysis", True)
    stated = (
        "schema: hil/verifications/1\nverifications:\n"
        "- {id: V-1, title: Sunlight, method: analysis, date: '2026-06-02', by: Ada, role: analyst, requirement: T-010,"
        f" rev: 1, fingerprint: {asked.fingerprint}, verdict: PASS, statement: It stays at 78 degC,"
        f" documents: [{{file: documents/thermal.txt, sha256: {hashlib.sha256(b'78 degC').hexdigest()}}}]}}\n"
    )
    (fixtures / "verifications.yaml").write_text(stated)
    assert codes(now(), "T-010") == ["AWAITING_APPROVAL"]
    signers = load_signers(fixtures)
    with pytest.raises(Refused, match="ada@x is the author of V-1: somebody else must approve it"):
        _approve(folders, signers, tmp_path, "ada")
    _approve(folders, signers, tmp_path, "bo")
    assert codes(now(), "T-010") == []
    document.write_text("88 degC")
    assert codes(now(), "T-010") == ["INTEGRITY"]
    with pytest.raises(Refused, match=r"documents/thermal.txt has the SHA-256 .*; put the document back"):
        _approve(folders, signers, tmp_path, "bo")
    document.unlink()
    assert codes(now(), "T-010") == ["INTEGRITY"]
    document.write_text("78 degC")
    plan.write_text(plan.read_text().replace("80 degC", "75 degC"))
    assert codes(now(), "T-010") == ["SUSPECT_REQ"]


def _approve(folders, signers, keys, name):
    subject = record_subject(folders, "V-1")
    approve(
        folders.reports, subject, signers, principal=f"{name}@x", key=keys / name, role="verification", meaning="read"
    )
