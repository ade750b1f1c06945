"""Verification without a run: what a statement and its documents close, and everything by which they close nothing."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
from dataclasses import replace

import msgspec
import pytest
from audited import ASKED, DUT, PARENT, UNIT, approval, codes, row, world_of

from hil.audit.cache import Cache
from hil.audit.changes import changes
from hil.audit.engine import audit
from hil.audit.inputs import Filed
from hil.audit.pages.page import as_html
from hil.audit.reading import Folders, read_world, record_subject
from hil.audit.recorded import past, record, verifications_ever
from hil.audit.supposed import suppose
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
    Records,
    UnitName,
    Verification,
)
from hil.registers.signers import HeldRole, Signer, load_signers
from hil.requirements.catalogue import load_catalogue
from hil.requirements.lock import lock_text

REVIEWED = msgspec.structs.replace(ASKED, method="analysis", kind="limit")
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


def world(*items, asked=REVIEWED, approvals=None, documents=None, reports=(), shown=(), people=(), **changed):
    """Return a world without packages, in which these were stated and approved unless approvals are given."""
    registers = Records(
        verifications={each.id: each for each in items}, nonconformances={each.id: each for each in reports}
    )
    given = tuple(approval(each) for each in items) if approvals is None else tuple(approvals)
    there = {"documents/thermal.pdf": DIGEST} if documents is None else documents
    filed = Filed(registers=registers, approvals=given, documents=there, shown=tuple(shown), people=people)
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
        ({}, "documents/thermal.pdf is not there, as a file below the folder of fixtures; it was made with dddddddd"),
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
        "V-1: only Ada, who made it, approved it, and the requirement demands somebody else"
    ]
    assert codes(world(SHOWN, asked=independent, approvals=(own, approval(SHOWN)))) == []
    changed = replace(SHOWN, statement="The load has 90 ohm")
    assert codes(world(changed, approvals=(approval(SHOWN),))) == ["AWAITING_APPROVAL"]
    assert codes(world(SHOWN, approvals=(approval(SHOWN, role="quality"),))) == ["AWAITING_APPROVAL"]


PEOPLE = (
    Signer(principal="ada@x", name="Ada", also=("A. Lovelace",)),
    Signer(
        principal="quinn@x", name="Quinn", roles=(HeldRole(role="quality", since="2026-01-01", until="2026-06-02"),)
    ),
    Signer(principal="tess@x", name="Tess"),
)


@pytest.mark.parametrize(
    ("wanted", "witness", "date", "text"),
    [
        ("quality", "Quinn", "2026-06-02", ""),
        ("Quinn", "quinn@x", "2026-06-02", ""),
        ("", "Tess", "2026-06-02", ""),
        ("quality", "Tess", "2026-06-02", "Tess has neither this role on 2026-06-02 nor this name"),
        ("quality", "Quinn", "2026-06-03", "Quinn has neither this role on 2026-06-03 nor this name"),
        ("quality", "Zoe", "2026-06-02", "its witness, Zoe, is not in the register of signers"),
        ("quality", "A. Lovelace", "2026-06-02", "A. Lovelace is Ada, who made it, and cannot be its witness"),
    ],
)
def test_a_witness_has_the_role_that_is_asked_for(wanted, witness, date, text):
    """Attack: a stranger, a colleague without the role or from after it, the author by another name."""
    asked = msgspec.structs.replace(REVIEWED, witness=wanted)
    found = row(world(replace(SHOWN, witness=witness, date=date), asked=asked, people=PEOPLE))
    assert [reason.code for reason in found.reasons] == ["NOT_ELIGIBLE"] * bool(text)
    assert text in "".join(reason.text for reason in found.reasons)


def test_nobody_approves_what_is_not_done_yet():
    """Attack: approved with a date of next week, it closes by itself when that day has come."""
    later = replace(SHOWN, date="2026-06-21")
    found = row(world(later, approvals=(approval(later),)))
    assert [reason.text for reason in found.reasons] == ["V-1: it was approved before 2026-06-21, when it was not done"]
    again = approval(later, utc="2026-06-21T07:00:00Z", seq=6)
    assert codes(world(later, approvals=(approval(later), again))) == []


def test_a_fail_stands_until_a_report_says_what_was_done():
    """A later PASS does not take it back, nor does its removal, nor another word in the register."""
    fail = replace(SHOWN, id="V-0", verdict="FAIL")
    passed = replace(SHOWN, date="2026-07-01")
    later = (approval(passed, utc="2026-07-02T08:00:00Z"),)
    assert codes(world(fail)) == ["NO_VERDICT", "FAILED"]
    assert row(world(fail)).compliance == "no"
    assert codes(world(fail, passed, approvals=later)) == ["FAILED"]
    gone = row(world(passed, shown=(fail,), approvals=later))
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
    approvals = (approval(passed, utc="2026-07-02T08:00:00Z"), approval(report, role="nonconformance"))
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


needs_keys = pytest.mark.skipif(shutil.which("ssh-keygen") is None, reason="ssh-keygen is not installed")


class Workspace:
    """A workspace with a requirement that is verified by analysis, its report, and the keys of two persons."""

    def __init__(self, root):
        self.root, self.fixtures = root, root / "fixtures"
        self.plan = root / "testplans/load/requirements.yaml"
        for folder in (self.fixtures / "documents", root / "reports", self.plan.parent):
            folder.mkdir(parents=True)
        self.plan.write_text(REQUIREMENTS.format(independent="true"))
        (self.plan.parent / "requirements.lock.json").write_text(
            lock_text(load_catalogue(root, [self.plan.parent], locked=False).of_plan("load"))
        )
        (self.fixtures / "signers.yaml").write_text(SIGNERS)
        allowed = ""
        for name in ("ada", "bo"):
            subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", "", "-f", root / name], check=True)
            allowed += f"{name}@x {(root / f'{name}.pub').read_text()}"
        (self.fixtures / "allowed_signers").write_text(allowed)
        self.folders = Folders(
            root=root, testplans=root / "testplans", fixtures=self.fixtures, reports=root / "reports", name="w"
        )
        self.document = self.fixtures / "documents/thermal.txt"
        self.document.write_text("78 degC")
        [self.asked] = self.now().asked
        self.register = self.fixtures / "verifications.yaml"
        self.stated = (
            "schema: hil/verifications/1\nverifications:\n- {id: V-1, title: Sunlight, method: analysis,"
            " date: '2026-06-02', by: Ada, role: analyst, requirement: T-010, rev: 1,"
            f" fingerprint: {self.asked.fingerprint}, verdict: PASS, statement: It stays at 78 degC,"
            f" documents: [{{file: documents/thermal.txt, sha256: {hashlib.sha256(b'78 degC').hexdigest()}}}]}}\n"
        )
        self.register.write_text(self.stated)

    def now(self):
        """Return what an audit of it is computed from."""
        return read_world(self.folders, Cache(None, "1"), version="1", locked=False)

    def codes(self):
        """Return why the requirement is open."""
        return codes(self.now(), "T-010")

    def approve(self, name):
        """Approve the statement as it is."""
        approve(
            self.folders.reports,
            record_subject(self.folders, "V-1"),
            load_signers(self.fixtures),
            principal=f"{name}@x",
            key=self.root / name,
            role="verification",
            meaning="read",
        )


@needs_keys
def test_a_statement_of_the_workspace_is_approved_and_closes(tmp_path):
    """From the files to the audit: the document's digest, the approval with a key, and who may give it."""
    of = Workspace(tmp_path)
    assert (of.asked.method, of.asked.independent) == ("analysis", True)
    assert of.codes() == ["AWAITING_APPROVAL"]
    with pytest.raises(Refused, match="ada@x is the author of V-1: somebody else must approve it"):
        of.approve("ada")
    of.register.write_text(of.stated.replace("2026-06-02", "2999-01-01"))
    with pytest.raises(Refused, match="V-1 is of 2999-01-01, and today is .*; approve it once it is done"):
        of.approve("bo")
    of.register.write_text(of.stated)
    of.approve("bo")
    assert of.codes() == []
    of.document.write_text("88 degC")
    assert of.codes() == ["INTEGRITY"]
    with pytest.raises(Refused, match=r"documents/thermal.txt has the SHA-256 .*; put the document back"):
        of.approve("bo")
    of.document.unlink()
    assert of.codes() == ["INTEGRITY"]
    with pytest.raises(Refused, match="is not there, as a file below the folder of fixtures"):
        of.approve("bo")
    of.document.write_text("78 degC")
    of.plan.write_text(of.plan.read_text().replace("80 degC", "75 degC"))
    assert of.codes() == ["SUSPECT_REQ"]


@needs_keys
def test_a_document_is_a_file_below_the_fixtures(tmp_path):
    """Attack: a link to the same content elsewhere, where nobody keeps it; a pipe; a folder."""
    of = Workspace(tmp_path)
    of.approve("bo")
    of.document.unlink()
    (tmp_path / "elsewhere.txt").write_text("78 degC")
    of.document.symlink_to(tmp_path / "elsewhere.txt")
    assert of.codes() == ["INTEGRITY"]
    of.document.unlink()
    (of.document.parent / "kept.txt").write_text("78 degC")
    of.document.symlink_to("kept.txt")
    assert of.codes() == []
    of.document.unlink()
    of.document.symlink_to(of.document.name)
    assert of.codes() == ["INTEGRITY"]
    of.document.unlink()
    os.mkfifo(of.document)
    assert of.codes() == ["INTEGRITY"]
    of.document.unlink()
    of.document.mkdir()
    assert of.codes() == ["INTEGRITY"]


@needs_keys
def test_a_supposed_register_says_what_would_close(tmp_path):
    """An approval that the content has counts; of one without, everything else that is missing is told."""
    of = Workspace(tmp_path)
    supposed = tmp_path / "supposed.yaml"
    supposed.write_text(of.stated.replace("verdict: PASS", "verdict: FAIL"))
    assert told_if(of, supposed) == [("changed", ["NO_VERDICT", "FAILED"])]
    of.approve("bo")
    assert told_if(of, supposed) == [("reopened", ["NO_VERDICT", "FAILED", "AWAITING_APPROVAL"])]
    supposed.write_text(of.stated.replace("It stays at", "It will stay at"))
    assert told_if(of, supposed) == [("reopened", ["AWAITING_APPROVAL"])]
    supposed.write_text(of.stated.replace("documents/thermal.txt", "documents/other.txt"))
    assert told_if(of, supposed) == [("reopened", ["INTEGRITY", "AWAITING_APPROVAL"])]
    supposed.write_text(of.stated)
    of.register.unlink()
    assert of.codes() == ["NO_EVIDENCE"]
    assert told_if(of, supposed) == [("closed", [])]
    of.register.write_text(of.stated)
    with pytest.raises(Refused, match="the ledger has no verifications to compare with"):
        told_if(of, of.register)
    record(of.folders.reports, of.now(), audit(of.now()))
    assert told_if(of, of.register) == []
    of.register.write_text(of.stated.replace("It stays at", "It will stay at"))
    assert told_if(of, of.register) == [("reopened", ["AWAITING_APPROVAL"])]


def told_if(of, file):
    """Return what `--if` tells of T-010: what becomes of it, and the reasons that come."""
    before, after = map(audit, suppose(of.now(), of.folders, str(file)))
    found = [each for each in changes(before, after) if each.id == "T-010"]
    return [(each.what, [str(reason.code) for reason in each.gained]) for each in found]
