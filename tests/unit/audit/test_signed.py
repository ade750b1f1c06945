"""Signatures in an audit: what a workspace asks for, and what it has at which day."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace

import pytest
from audited import closed_world, codes
from evidence_runs import sealed_run

from hil.audit.cache import Cache
from hil.audit.inputs import Policy, Register, World
from hil.audit.reading import Folders, read_world
from hil.audit.recorded import WAIVERS, encoded, keep, past, record_subject_of
from hil.evidence.ledger.approvals import Subject, approve, sign_package, signers_then
from hil.evidence.ledger.book import append, put_object, read
from hil.evidence.ledger.entries import Baseline
from hil.evidence.package.verification import verify
from hil.registers.nonconformances import UnitName, Waiver
from hil.registers.signers import load_signers

SIGNERS = """schema: hil/signers/1
signers:
- {principal: ada@x, name: Ada}
- {principal: bo@x, name: Bo, roles: [{role: quality, since: "2026-01-01"}]}
required: {signature: true, approvals: [quality]}
"""


def test_an_approval_counts_from_its_day_on():
    """The past is told as it was."""
    world = closed_world()
    digest = world.packages[0].digest
    asked = Policy(approvals=("quality",), said=(("2026-05-02T10:00:00Z", digest, "quality"),))
    assert codes(replace(world, policy=asked.until("2026-05-01"))) == ["AWAITING_APPROVAL"]
    assert codes(replace(world, policy=asked.until("2026-05-02"))) == []


@pytest.mark.skipif(shutil.which("ssh-keygen") is None, reason="ssh-keygen is not installed")
def test_an_audit_reads_the_signatures_that_count(tmp_path):
    """Those of people in the register, of packages that verify; a signature that does not count is none."""
    fixtures, reports = tmp_path / "fixtures", tmp_path / "reports"
    fixtures.mkdir()
    (tmp_path / "testplans").mkdir()
    (fixtures / "signers.yaml").write_text(SIGNERS)
    allowed = ""
    for name in ("ada", "bo"):
        subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", "", "-f", tmp_path / name], check=True)
        allowed += f"{name}@x {(tmp_path / f'{name}.pub').read_text()}"
    (fixtures / "allowed_signers").write_text(allowed)
    sealed_run(reports / "20261121T093100Z-flight-SN1-ab12cd")
    found = verify(reports / "20261121T093100Z-flight-SN1-ab12cd")
    subject = Subject(run=found.run, evidence=found.evidence_digest, operator=found.operator)
    signers = load_signers(fixtures)
    sign_package(reports, subject, signers, principal="ada@x", key=tmp_path / "ada")
    approve(reports, subject, signers, principal="bo@x", key=tmp_path / "bo", role="quality", meaning="read")
    folders = Folders(root=tmp_path, testplans=tmp_path / "testplans", fixtures=fixtures, reports=reports, name="w")

    def policy() -> Policy:
        return read_world(folders, Cache(None, ""), version="1").policy

    assert (policy().signatures, policy().approvals) == (True, ("quality",))
    assert policy().valid == {found.evidence_digest: frozenset({"", "quality"})}
    (fixtures / "allowed_signers").write_text(allowed.replace("bo@x", "cy@x"))
    assert policy().valid == {found.evidence_digest: frozenset({""})}
    keep(reports, (), Register())
    world = read_world(folders, Cache(None, ""), version="1")
    then = past(world, reports, world.entries[-1].utc[:10]).policy
    assert then.valid == {found.evidence_digest: frozenset({"", "quality"})}
    (fixtures / "signers.yaml").unlink()
    assert past(world, reports, world.entries[-1].utc[:10]).policy == then


def test_who_could_sign_is_read_as_earlier_versions_kept_it(tmp_path):
    """The files one after the other, each below its name."""
    kept = f"# signers.yaml\n{SIGNERS}# allowed_signers\nada@x ssh-ed25519 AAAA\n# revoked_keys\n".encode()
    entry = Baseline(subject="signers", object=put_object(tmp_path, kept))
    place = tmp_path / "then"
    place.mkdir()
    found = signers_then(tmp_path, [entry], place)
    assert found is not None
    assert [each.principal for each in found.people] == ["ada@x", "bo@x"]
    assert (place / "allowed_signers").read_text() == "ada@x ssh-ed25519 AAAA\n"
    assert (place / "revoked_keys").read_text() == ""
    assert signers_then(tmp_path, [], place) is None


@pytest.mark.skipif(shutil.which("ssh-keygen") is None, reason="ssh-keygen is not installed")
def test_a_waiver_of_the_past_has_the_approvals_of_then(tmp_path):
    """It reads otherwise now, and who approved it may not sign any more."""
    fixtures, reports = tmp_path / "fixtures", tmp_path / "reports"
    fixtures.mkdir()
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", "", "-f", tmp_path / "bo"], check=True)
    (fixtures / "signers.yaml").write_text(SIGNERS.replace("role: quality", "role: waiver"))
    (fixtures / "allowed_signers").write_text(f"bo@x {(tmp_path / 'bo.pub').read_text()}")
    waiver = Waiver(
        id="W-1", title="t", date="2026-01-01", until="2999-01-01", by="Ada", requirement="R", rev=1,
        fingerprint="f" * 64, units=(UnitName(part="P", serial="S"),), reason="r",
    )  # fmt: skip
    signers = load_signers(fixtures)
    subject = record_subject_of(waiver, {})
    approve(reports, subject, signers, principal="bo@x", key=tmp_path / "bo", role="waiver", meaning="read")
    append(reports, Baseline(subject=WAIVERS, object=put_object(reports, encoded(WAIVERS, (waiver,)))))
    keep(reports, (), Register())
    (fixtures / "allowed_signers").write_text("")
    entries = read(reports).entries
    then = past(World(asked=(), entries=entries), reports, entries[-1].utc[:10]).filed
    assert [(each.record, each.role) for each in then.approvals] == [("W-1", "waiver")]
