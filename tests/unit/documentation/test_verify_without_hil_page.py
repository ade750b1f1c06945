"""The page on verification without hil: its commands give the same answer as `hil verify`, for good and for bad."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from evidence_runs import sealed_run

from hil.cli.main import main
from hil.evidence.ledger.book import head, ledger_file, object_file, read
from hil.evidence.ledger.entries import Approved

pytestmark = pytest.mark.skipif(shutil.which("ssh-keygen") is None, reason="ssh-keygen is not installed")

PAGE = Path(__file__).parents[3] / "docs/how-to/verify-without-hil.md"
NAME = "20261121T093100Z-flight-SN1-ab12cd"
OTHER = "20261121T093200Z-flight-SN1-ab12ce"
SIGNERS = """schema: hil/signers/1
signers:
- {principal: ada@x, name: Ada}
- {principal: bo@x, name: Bo, roles: [{role: quality, since: "2026-01-01"}]}
"""


def code_of(*arguments):
    """Return the exit code of a command."""
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    return ended.value.code


def by_page(workspace, published):
    """Return whether the blocks of the page, in one shell, find everything good."""
    blocks = re.findall(r"^```sh\n(.*?)^```$", PAGE.read_text(), flags=re.DOTALL | re.MULTILINE)
    script = f"set -eu\nreports=reports\nrun={NAME}\nfixtures=fixtures\nhead={published}\n" + "".join(blocks)
    done = subprocess.run(["sh", "-c", script], cwd=workspace, capture_output=True, check=False, timeout=60)
    return done.returncode == 0


def by_hil(published):
    """Return whether hil finds everything good."""
    return code_of("verify", NAME) == 0 and code_of("ledger", "--head", published) == 0


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a workspace with a package that Ada ran and signed, and Bo approved, and another one."""
    root = tmp_path_factory.mktemp("signed")
    (root / "fixtures").mkdir()
    (root / "hil.toml").touch()
    allowed = []
    for name in ("ada", "bo"):
        subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", "", "-f", root / name], check=True)
        allowed.append(f'{name}@x namespaces="hil-package,hil-approval" {(root / f"{name}.pub").read_text()}')
    (root / "fixtures/signers.yaml").write_text(SIGNERS)
    (root / "fixtures/allowed_signers").write_text("".join(allowed))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(root)
        for run in (NAME, OTHER):
            sealed_run(root / "reports" / run)
            assert code_of("sign", run, "--key", "ada", "--as", "ada@x") == 0
            approval = ("--role", "quality", "--meaning", 'read "all" of it', "--key", "bo", "--as", "bo@x")
            assert code_of("approve", run, *approval) == 0
            assert code_of("approve", run, *approval[:4], "--key", "ada", "--as", "ada@x") == 4
    return root


@pytest.fixture
def workspace(made, tmp_path, monkeypatch):
    """Return a copy of it that can be changed, and be in it."""
    shutil.copytree(made, tmp_path / "w")
    for path in (tmp_path / "w").rglob("*"):
        path.chmod(0o700 if path.is_dir() else 0o600)
    monkeypatch.chdir(tmp_path / "w")
    return tmp_path / "w"


def flip(path, at=None):
    """Change one byte of a file, in its middle unless a place is given."""
    data = bytearray(path.read_bytes())
    data[len(data) // 2 if at is None else at] ^= 1
    path.write_bytes(data)


def test_what_is_good_is_good_for_both(workspace, capsys):
    """And hil says who signed and approved."""
    assert by_page(workspace, head(workspace / "reports"))
    assert by_hil(head(workspace / "reports"))
    out = capsys.readouterr().out
    assert re.search(r"^signed +ada@x, 20", out, flags=re.MULTILINE)
    assert re.search(r'^approved +quality by bo@x: "read "all" of it", 20', out, flags=re.MULTILINE)
    assert out.endswith(f"{head(workspace / 'reports')}\n")


def approved(workspace, run=NAME):
    """Return the approval of a run, and the path of its signature."""
    (entry,) = read(workspace / "reports").of(Approved, run)
    return entry, object_file(workspace / "reports", entry.signature)


def put_other_run(workspace):
    """Put another package, and all that the ledger says of it, under the first one's name."""
    shutil.rmtree(workspace / "reports" / NAME)
    (workspace / "reports" / OTHER).rename(workspace / "reports" / NAME)


def put_other_signature(workspace):
    """Copy the signature of another package into the place of one."""
    shutil.copy(approved(workspace, OTHER)[1], approved(workspace)[1])


def rewrite(workspace):
    """Write the whole package again, with another purpose: its own hashes are right."""
    shutil.rmtree(workspace / "reports" / NAME)
    sealed_run(workspace / "elsewhere" / NAME, purpose="acceptance")
    shutil.copytree(workspace / "elsewhere" / NAME, workspace / "reports" / NAME)


def cut_off(workspace):
    """Take the last line from the ledger."""
    path = ledger_file(workspace / "reports")
    path.write_bytes(b"".join(path.read_bytes().splitlines(keepends=True)[:-1]))


def change_allowed(workspace, old, new):
    """Change the file of allowed signers."""
    path = workspace / "fixtures/allowed_signers"
    path.write_text(path.read_text().replace(old, new))


@pytest.mark.parametrize(
    "attack",
    [
        pytest.param(
            lambda w: flip(w / "reports" / NAME / "data/journal.jsonl"),
            marks=pytest.mark.system,
            id="byte-of-the-journal",
        ),
        pytest.param(
            lambda w: flip(w / "reports" / NAME / "manifest-sha256.txt", 0),
            marks=pytest.mark.system,
            id="byte-of-the-manifest",
        ),
        pytest.param(
            lambda w: flip(w / "reports" / NAME / "bag-info.txt"), marks=pytest.mark.system, id="byte-of-a-tag-file"
        ),
        pytest.param(
            lambda w: (w / "reports" / NAME / "data/more.txt").touch(), marks=pytest.mark.system, id="another-file"
        ),
        pytest.param(
            lambda w: (w / "reports" / NAME / "data/results.json").unlink(), marks=pytest.mark.system, id="missing-file"
        ),
        pytest.param(lambda w: flip(ledger_file(w / "reports")), marks=pytest.mark.system, id="byte-of-the-ledger"),
        pytest.param(lambda w: flip(ledger_file(w / "reports"), -5), id="byte-of-the-last-line"),
        pytest.param(cut_off, marks=pytest.mark.system, id="ledger-cut-off"),
        pytest.param(rewrite, id="rewritten"),
        pytest.param(put_other_run, marks=pytest.mark.system, id="another-run"),
        pytest.param(lambda w: flip(approved(w)[1], 150), marks=pytest.mark.system, id="byte-of-a-signature"),
        pytest.param(put_other_signature, id="signature-of-another-package"),
        pytest.param(lambda w: change_allowed(w, "bo@x", "cy@x"), marks=pytest.mark.system, id="unknown-key"),
        pytest.param(
            lambda w: change_allowed(w, "hil-package,", "other,"), marks=pytest.mark.system, id="wrong-namespace"
        ),
        pytest.param(
            lambda w: change_allowed(w, 'l"', 'l",valid-before="20260101Z"'), marks=pytest.mark.system, id="expired"
        ),
        pytest.param(
            lambda w: shutil.copy(w / "bo.pub", w / "fixtures/revoked_keys"), marks=pytest.mark.system, id="revoked"
        ),
    ],
)
def test_what_was_tampered_with_is_bad_for_both(workspace, attack):
    """The page and hil give the same answer."""
    published = head(workspace / "reports")
    attack(workspace)
    assert not by_page(workspace, published)
    assert not by_hil(published)
