"""`hil approve` of a nonconformance report and of a waiver, with real keys, and what `hil audit` says then."""

from __future__ import annotations

import json
import shutil
import subprocess

import pytest
from workspaces import make

from hil.cli.main import main

pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(shutil.which("ssh-keygen") is None, reason="ssh-keygen is not installed"),
]

SIGNERS = """schema: hil/signers/1
signers:
- {principal: ada@x, name: Ada, roles: [{role: waiver, since: "2026-01-01"}]}
- {principal: bo@x, name: Bo, roles: [{role: waiver, since: "2026-01-01"}, {role: nonconformance, since: "2026-01-01"}]}
- {principal: cy@x, name: Cy}
"""
DUT = '- {serial: FM-1, part: ADCS-2, model: FM, hardware: "B"}\n'
REPORT = """schema: hil/nonconformances/1
nonconformances:
- {id: NCR-1, title: Ratio too high, date: "2026-06-02", by: Ada, requirements: [T-010],
   units: [{part: ADCS-2, serial: FM-1}], disposition: use-as-is}
"""
WAIVER = """schema: hil/waivers/1
waivers:
- {id: W-1, title: Ratio accepted, date: "2026-06-02", until: "2099-12-31", by: Ada, requirement: T-010, rev: 1,
   fingerprint: "%s", units: [{part: ADCS-2, serial: FM-1}], reason: The orbit allows it, nonconformance: NCR-1}
"""


@pytest.fixture
def said(tmp_path, monkeypatch, capsys):
    """Return what calls a command in a workspace with a key for each of three people."""
    root = make(tmp_path / "workspace", "def test_one(): ...").root
    fixtures = root / "fixtures"
    allowed = ""
    for name in ("ada", "bo", "cy"):
        subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", "", "-f", tmp_path / name], check=True)
        allowed += f"{name}@x {(tmp_path / f'{name}.pub').read_text()}"
    (fixtures / "allowed_signers").write_text(allowed)
    (fixtures / "signers.yaml").write_text(SIGNERS)
    with (fixtures / "duts.yaml").open("a") as register:
        register.write(DUT)
    (fixtures / "nonconformances.yaml").write_text(REPORT)
    (fixtures / "waivers.yaml").write_text(WAIVER % ("0" * 64))
    monkeypatch.chdir(root)

    def call(*arguments):
        with pytest.raises(SystemExit) as left:
            main(arguments)
        told = capsys.readouterr()
        return left.value.code, told.out, told.err

    return call


def approve(said, tmp_path, number, role, name):
    """Approve a record as somebody."""
    return said(
        "approve", number, "--role", role, "--meaning", "accepted", "--key", str(tmp_path / name), "--as", f"{name}@x"
    )


def audited(said):
    """Return the row of T-010."""
    _, out, err = said("audit", "--no-cache", "--format", "json")
    assert all(line.startswith("NOT PINNED: ") for line in err.split("\n") if line), err
    return next(each for each in json.loads(out)["rows"] if each["id"] == "T-010")


def test_a_waiver_is_approved_by_somebody_else_and_closes(said, tmp_path):
    """Not by its author, not in a role that nobody holds, not for another meaning; changed afterwards, it is open."""
    row = audited(said)
    assert {each["code"] for each in row["reasons"]} == {"NO_EVIDENCE", "OPEN_NCR"}
    code, _, err = approve(said, tmp_path, "W-1", "waiver", "bo")
    assert code == 4
    assert f"give it rev: 1 and fingerprint: {row['fingerprint']}" in err
    file = tmp_path / "workspace/fixtures/waivers.yaml"
    file.write_text(WAIVER % row["fingerprint"])
    for number, role, name, why in (
        ("W-1", "waiver", "ada", "ada@x is the author of W-1: somebody else must approve it"),
        ("W-1", "waiver", "cy", "cy@x does not hold the role waiver"),
        ("NCR-1", "nonconformance", "ada", "ada@x does not hold the role nonconformance"),
        ("W-2", "waiver", "bo", "there is no report, waiver or verification 'W-2', did you mean 'W-1'?"),
    ):
        code, _, err = approve(said, tmp_path, number, role, name)
        assert (code, why in err) == (4, True), err
    assert approve(said, tmp_path, "W-1", "waiver", "bo")[0] == 0
    assert [each["code"] for each in audited(said)["reasons"]] == ["OPEN_NCR"]
    code, out, _ = approve(said, tmp_path, "NCR-1", "nonconformance", "bo")
    assert (code, out.startswith('approved for nonconformance by bo@x: "accepted"')) == (0, True)
    row = audited(said)
    assert (row["close_out"], row["compliance"], row["waiver"]) == ("closed", "partial", "W-1")
    assert "closed by waivers: T-010" in said("audit", "--no-cache")[1]
    assert said("ledger")[0] == 0
    file.write_text(file.read_text().replace("2099", "2098"))
    row = audited(said)
    assert row["records"][-1] == "W-1 closes nothing: it is not approved in its present form by anyone but its author"
    file.unlink()
    (tmp_path / "workspace/fixtures/nonconformances.yaml").unlink()
    assert [each["code"] for each in audited(said)["reasons"]] == ["NO_EVIDENCE", "OPEN_NCR"]
