"""Every single byte of a signed and approved package of a real run, of its signatures and of the ledger."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest
from told_pages import Written, steps_of
from workspaces import ROOT, command_line

from hil.cli.main import cli

GUIDE = ROOT / "docs" / "how-to" / "write-a-plan.md"
SIGNERS = """schema: hil/signers/1
signers:
- {principal: ada@x, name: Ada, roles: [{role: quality, since: "2026-01-01"}]}
- {principal: bo@x, name: Bo, roles: [{role: quality, since: "2026-01-01"}]}
"""
RUN = ("run", "load", "--bench", "load", "--source", "simulated", "--dut", "SIM-LOAD-1", "--operator", "Ada")
GROUPS = {
    "ledger": (".ledger/*",),
    "signatures": (".ledger/*/**/*",),
    "tag files": ("2*/*",),
    "journal": ("2*/data/journal.jsonl",),
    "transcript": ("2*/data/transcript.tsv",),
    "recordings": ("2*/data/recordings/*",),
    "report": ("2*/data/report/*",),
    "frozen": ("2*/data/bench/**/*", "2*/data/catalogue/**/*", "2*/data/sources/**/*"),
    "results": ("2*/data/*.json",),
}
PARTS = {"journal": 2, "transcript": 2, "report": 4}
"""Into how many parts a group is divided, so that workers share it; every so many bytes are one."""

pytestmark = [
    pytest.mark.system,
    pytest.mark.soak,
    pytest.mark.timeout(14400),
    pytest.mark.skipif(shutil.which("ssh-keygen") is None, reason="ssh-keygen is not installed"),
]


@pytest.fixture(scope="module")
def signed(tmp_path_factory):
    """Return the workspace of the guide after a run that was signed by its author and approved by another."""
    root = tmp_path_factory.mktemp("every-byte") / "own"
    for step in steps_of(GUIDE):
        if isinstance(step, Written):
            (root / step.path).parent.mkdir(parents=True, exist_ok=True)
            (root / step.path).write_text(step.content)
    allowed = ""
    for name in ("ada", "bo"):
        key = root.parent / name
        subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", key], check=True)
        allowed += f"{name}@x {key.with_suffix('.pub').read_text()}"
    (root / "fixtures/signers.yaml").write_text(SIGNERS)
    (root / "fixtures/allowed_signers").write_text(allowed)
    approved = ("approve", "latest", "--role", "quality", "--meaning", "results reviewed", "--as", "bo@x", "--key")
    for arguments in (
        ("requirements", "lock", "load"),
        RUN,
        ("sign", "latest", "--key", f"{root.parent}/ada", "--as", "ada@x"),
        (*approved, f"{root.parent}/bo"),
    ):
        subprocess.run(command_line(*arguments), cwd=root, check=True, capture_output=True)
    for path in (root / "reports").rglob("*"):
        path.chmod(0o755)
    return root


def code_of(*arguments):
    """Return the exit code of a command, called here."""
    return cli.main(arguments, prog_name="hil", standalone_mode=False)


@pytest.mark.parametrize(("group", "part"), [(name, part) for name in GROUPS for part in range(PARTS.get(name, 1))])
def test_every_byte_counts(signed, monkeypatch, capsys, group, part):
    """Whichever byte is another one: `hil verify` exits with 1 for the package, `hil ledger` for what is beside it."""
    monkeypatch.chdir(signed)
    reports = Path("reports")
    (package,) = reports.glob("2*")
    beside = group in {"ledger", "signatures"}
    command = ("ledger", str(reports)) if beside else ("verify", str(package))
    files = [path for pattern in GROUPS[group] for path in reports.glob(pattern) if path.is_file()]
    assert files
    assert code_of(*command) == 0
    for path in files:
        good = path.read_bytes()
        file = os.open(path, os.O_WRONLY)
        for place in range(part, len(good), PARTS.get(group, 1)):
            byte = good[place]
            os.pwrite(file, bytes([byte ^ 1 << place % 8]), place)
            assert code_of(*command) == 1, f"{path}: byte {place}"
            os.pwrite(file, bytes([byte]), place)
            capsys.readouterr()
        os.close(file)
        assert path.read_bytes() == good
    assert code_of(*command) == 0


def test_no_file_is_left_out(signed):
    """The groups hold every file below the folder of reports."""
    reports = signed / "reports"
    swept = [path for patterns in GROUPS.values() for pattern in patterns for path in reports.glob(pattern)]
    files = sorted(path for path in swept if path.is_file())
    assert files == sorted(path for path in reports.rglob("*") if path.is_file())
