"""Signatures and approvals: which count, and what is said of each that does not."""

from __future__ import annotations

import shutil
import subprocess
from base64 import b64encode
from dataclasses import dataclass
from pathlib import Path

import pytest
from evidence_runs import sealed_run
from sweeps import sample

from hil.evidence.ledger import approvals
from hil.evidence.ledger.approvals import Subject, approve, keep_signers, said_of, sign_package, stray_files
from hil.evidence.ledger.book import append, check, object_file, put_object, read
from hil.evidence.ledger.entries import Approved, Baseline, Signed
from hil.evidence.ledger.signing import APPROVAL, PACKAGE, Statement, sign
from hil.evidence.package.verification import verify
from hil.model.errors import Refused
from hil.registers.signers import Signers, load_signers

pytestmark = pytest.mark.skipif(shutil.which("ssh-keygen") is None, reason="ssh-keygen is not installed")

NAME = "20261121T093100Z-flight-SN1-ab12cd"
SIGNERS = """schema: hil/signers/1
signers:
- {principal: ada@x, name: Ada, roles: [{role: quality, since: "2026-01-01"}]}
- {principal: bo@x, name: Bo, roles: [{role: quality, since: "2026-01-01"}]}
- {principal: cy@x, name: Cy, roles: [{role: quality, since: "2026-01-01", until: "2026-01-02"}]}
"""


@dataclass(frozen=True, kw_only=True)
class Place:
    """A workspace with one package, and a key for each of three people; Eve has one that nobody knows."""

    fixtures: Path
    package: Path

    @property
    def reports(self) -> Path:
        """The folder of reports."""
        return self.package.parent

    @property
    def subject(self) -> Subject:
        """The package."""
        found = verify(self.package)
        return Subject(run=found.run, evidence=found.evidence_digest, operator=found.operator)

    @property
    def signers(self) -> Signers:
        """The register."""
        return load_signers(self.fixtures)

    def key(self, name: str) -> Path:
        """Return a person's key."""
        return self.fixtures.parent / name

    def approve(self, name: str, key: str = "") -> None:
        """Approve the package."""
        key_file = self.key(key or name)
        wanted = {"principal": f"{name}@x", "role": "quality", "meaning": "results reviewed"}
        approve(self.reports, self.subject, self.signers, key=key_file, **wanted)

    def problems(self) -> list[str]:
        """Return why signatures and approvals do not count, empty for one that does."""
        return [said.problem for said in said_of(read(self.reports), self.subject, self.signers)]

    def allow(self, *lines: str) -> None:
        """Write the file of allowed signers."""
        names = [line.partition("@")[0] for line in lines]
        written = [f"{line} {self.key(f'{name}.pub').read_text()}" for line, name in zip(lines, names, strict=True)]
        (self.fixtures / "allowed_signers").write_text("".join(written))


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a workspace that is copied for each test: keys and a seal are what takes time. Ada ran the package."""
    root = tmp_path_factory.mktemp("made")
    for name in ("ada", "bo", "cy", "eve"):
        subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", "", "-f", root / name], check=True)
    (root / "fixtures").mkdir()
    (root / "fixtures/signers.yaml").write_text(SIGNERS)
    sealed_run(root / "reports" / NAME)
    return root


@pytest.fixture
def place(tmp_path, made):
    """Return a copy of the workspace."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    place = Place(fixtures=tmp_path / "fixtures", package=tmp_path / "reports" / NAME)
    place.allow(*(f'{name}@x namespaces="hil-package,hil-approval"' for name in ("ada", "bo", "cy")))
    return place


def forged(place: Place, *, key: str, namespace: str = APPROVAL, **changes: str) -> None:
    """Enter an approval by Bo that hil would refuse, as anybody with a shell can."""
    facts = {"run": NAME, "evidence": place.subject.evidence, "content": "c", "verdict": "PASS", "source": "hardware"}
    facts |= {"principal": "bo@x", "role": "quality", "meaning": "m", "utc": "2026-01-01T00:00:00Z"} | changes
    data = Statement(format=1, namespace=namespace, **facts).line()
    names = {"statement": data, "signature": sign(data, key=place.key(key), namespace=namespace)}
    kept = {name: put_object(place.reports, each) for name, each in names.items()}
    who = {"principal": changes.get("principal", "bo@x"), "role": "quality", "meaning": "m"}
    append(place.reports, Approved(run=NAME, evidence=place.subject.evidence, **who, **kept))


def test_a_signature_and_an_approval_by_somebody_else_count(place):
    """Both stand in the ledger, with who could sign then, and as files of their own."""
    said = sign_package(place.reports, place.subject, place.signers, principal="ada@x", key=place.key("ada"))
    assert str(said).startswith("ada@x, ")
    place.approve("bo")
    ledger = read(place.reports)
    assert place.problems() == ["", ""]
    assert (len(ledger.of(Signed)), len(ledger.of(Approved)), len(ledger.of(Baseline))) == (1, 1, 1)
    assert str(said_of(ledger, place.subject, place.signers)[1]).startswith('quality by bo@x: "results reviewed", ')
    assert sorted(path.suffix for path in (place.reports / ".ledger/signatures" / NAME).iterdir()) == [
        ".json",
        ".json",
        ".sig",
        ".sig",
    ]
    assert (list(stray_files(ledger, NAME)), check(place.reports)) == ([], ())


def test_the_author_never_approves_alone(place):
    """Neither who ran it, nor who signed it; and where nobody knows who ran it, nobody can."""
    with pytest.raises(Refused, match="this would not count: ada@x is the author of the package: somebody else must"):
        place.approve("ada")
    sign_package(place.reports, place.subject, place.signers, principal="bo@x", key=place.key("bo"))
    with pytest.raises(Refused, match="bo@x is the author of the package"):
        place.approve("bo")
    (place.fixtures / "signers.yaml").write_text(SIGNERS.replace("name: Ada", "name: Al"))
    with pytest.raises(Refused, match="signers.yaml has nobody called 'Ada'"):
        place.approve("bo")
    assert read(place.reports).of(Approved) == ()


@pytest.mark.parametrize(
    ("who", "key", "said"),
    [
        ("cy", "cy", "cy@x does not hold the role quality on 20"),
        ("bo", "eve", "fixtures/allowed_signers has no key of bo@x that made it, for hil-approval"),
        ("bo", "ada", "fixtures/allowed_signers has no key of bo@x that made it, for hil-approval"),
        ("eve", "eve", "'eve@x' is not in fixtures/signers.yaml"),
        ("bo", "none", "there is no such key"),
    ],
)
def test_what_would_not_count_is_not_entered(place, who, key, said):
    """A role that has expired, the key of another or of nobody."""
    with pytest.raises(Refused) as raised:
        place.approve(who, key)
    assert said in raised.value.message
    assert read(place.reports).of(Approved) == ()


@pytest.mark.parametrize(
    ("allowed", "said"),
    [
        ('bo@x namespaces="hil-package"', "has no key of bo@x that made it, for hil-approval"),
        ('bo@x valid-before="20260102Z"', "key has expired"),
        ('bo@x valid-after="20990102Z"', "key is not yet valid"),
        ("cy@x", "has no key of bo@x"),
    ],
)
def test_an_approval_counts_no_longer_when_its_key_is_not_allowed(place, allowed, said):
    """For this namespace, at the time at which it was entered."""
    place.approve("bo")
    place.allow(allowed)
    (problem,) = place.problems()
    assert said in problem
    (place.fixtures / "allowed_signers").unlink()
    assert place.problems() == ["fixtures/allowed_signers is missing, so no key is known"]


def test_a_revoked_key_counts_for_nothing(place):
    """Whatever it signed when; an expired one still counts for what it signed before."""
    place.approve("bo")
    place.allow('bo@x valid-before="20990102Z"')
    assert place.problems() == [""]
    shutil.copy(place.key("bo.pub"), place.fixtures / "revoked_keys")
    assert place.problems() == ["its key is revoked by fixtures/revoked_keys"]


@pytest.mark.parametrize(
    ("forging", "said"),
    [
        ({"key": "bo", "run": "other"}, "it signs another package: other, evidence digest "),
        ({"key": "bo", "evidence": "0" * 64}, f"it signs another package: {NAME}, evidence digest 0000"),
        ({"key": "bo", "namespace": PACKAGE}, "its statement says something else than the ledger's entry"),
        ({"key": "bo", "role": "test"}, "its statement says something else than the ledger's entry"),
        ({"key": "bo", "meaning": "more"}, "its statement says something else than the ledger's entry"),
        ({"key": "bo", "utc": "2999-01-01T00:00:00Z"}, "after it was entered"),
        ({"key": "eve"}, "has no key of bo@x that made it"),
        ({"key": "ada", "principal": "ada@x"}, "ada@x is the author of the package"),
        ({"key": "cy", "principal": "cy@x"}, "cy@x does not hold the role quality"),
    ],
)
def test_an_approval_that_was_entered_by_hand_is_found(place, forging, said):
    """A signature of another package copied in, another namespace or role, an unknown key, the author's own."""
    forged(place, **forging)
    (problem,) = place.problems()
    assert said in problem


@pytest.mark.timeout(900)
def test_any_changed_byte_of_a_signature_is_found(place):
    """In the objects, and in the files beside them."""
    place.approve("bo")
    (entry,) = read(place.reports).of(Approved)
    files = [object_file(place.reports, name) for name in (entry.statement, entry.signature)]
    files += (place.reports / ".ledger/signatures" / NAME).iterdir()
    for path in files:
        good = path.read_bytes()
        for at in sample(range(len(good)), 2):
            path.write_bytes(good[:at] + bytes([good[at] ^ 1]) + good[at + 1 :])
            ledger = read(place.reports)
            assert any(place.problems()) or list(stray_files(ledger, NAME)), (path.name, at)
            assert check(place.reports) or list(stray_files(ledger, NAME)), (path.name, at)
        path.write_bytes(good)
    (path.parent / "more.sig").touch()
    assert list(stray_files(read(place.reports), NAME)) == [
        f".ledger/signatures/{NAME}/more.sig: no entry of the ledger names this file"
    ]
    path.unlink()
    assert "missing, or not the bytes that the ledger names" in " ".join(stray_files(read(place.reports), NAME))


def test_only_a_package_that_the_ledger_has_is_signed(place, tmp_path):
    """With a meaning in one line."""
    shutil.copytree(place.package, tmp_path / "copies" / NAME)
    with pytest.raises(Refused, match="the ledger has no seal of it"):
        sign_package(tmp_path / "copies", place.subject, place.signers, principal="ada@x", key=place.key("ada"))
    with pytest.raises(Refused, match="--meaning must be one line"):
        approve(
            place.reports,
            place.subject,
            place.signers,
            principal="bo@x",
            key=place.key("bo"),
            role="quality",
            meaning="a\nb",
        )


@pytest.fixture
def agent(tmp_path_factory, monkeypatch):
    """Start an agent of the test's own, and end it."""
    socket = tmp_path_factory.mktemp("s") / "a"
    process = subprocess.Popen(["ssh-agent", "-D", "-a", socket], stdout=subprocess.DEVNULL)
    try:
        while not socket.exists():
            assert process.poll() is None
            process.poll()
        monkeypatch.setenv("SSH_AUTH_SOCK", str(socket))
        yield
    finally:
        process.terminate()
        process.wait()


@pytest.mark.system
def test_a_key_in_the_agent_signs_by_its_public_half(place, agent, capfd):
    """The private key is nowhere on the disk; when the agent has it no longer, nothing is signed or entered."""
    subprocess.run(["ssh-add", "-q", place.key("bo")], check=True)
    place.key("bo").unlink()
    place.approve("bo", "bo.pub")
    assert place.problems() == [""]
    subprocess.run(["ssh-add", "-q", "-D"], check=True)
    before = read(place.reports).head
    capfd.readouterr()
    with pytest.raises(Refused, match=r"bo\.pub: ssh-keygen signed nothing") as refused:
        place.approve("bo", "bo.pub")
    assert "ssh-add -l lists the agent's keys" in str(refused.value)
    assert "bo" in capfd.readouterr().err
    assert read(place.reports).head == before


def hardware_key(path: Path) -> str:
    """Write the public half of a key on a token that is not here, and return its line."""
    parts = (b"sk-ssh-ed25519@openssh.com", bytes.fromhex("58" + 31 * "66"), b"ssh:")
    blob = b"".join(len(part).to_bytes(4) + part for part in parts)
    line = f"sk-ssh-ed25519@openssh.com {b64encode(blob).decode()} bo's token"
    path.write_text(line + "\n")
    return line


def test_keys_on_tokens_are_allowed_beside_others(place, monkeypatch, capfd):
    """The file with a hardware key is read: others count as before, and a signature by another key of Bo does not."""
    monkeypatch.delenv("SSH_AUTH_SOCK", raising=False)
    token = place.key("token.pub")
    line = hardware_key(token)
    place.allow('ada@x namespaces="hil-package"')
    allowed = place.fixtures / "allowed_signers"
    allowed.write_text(f'{allowed.read_text()}bo@x namespaces="hil-approval" {line}\n')
    sign_package(place.reports, place.subject, place.signers, principal="ada@x", key=place.key("ada"))
    forged(place, key="bo")
    assert place.problems() == ["", "fixtures/allowed_signers has no key of bo@x that made it, for hil-approval"]
    capfd.readouterr()
    with pytest.raises(Refused, match=r"token\.pub: ssh-keygen signed nothing; its message stands above"):
        place.approve("bo", "token.pub")
    assert capfd.readouterr().err


def test_an_approval_is_judged_by_the_signers_of_its_day_as_well(place, monkeypatch):
    """Whoever gets a role today, from an earlier day on, did not hold it when the approval was entered."""
    held = SIGNERS.replace("name: Bo, roles: [{role: quality", "name: Bo, roles: [{role: reader")
    (place.fixtures / "signers.yaml").write_text(held)
    keep_signers(place.reports, place.signers)
    (place.fixtures / "signers.yaml").write_text(SIGNERS)
    with monkeypatch.context() as patched:  # as somebody would who writes the ledger's entry without hil
        patched.setattr(approvals, "keep_signers", lambda *_: None)
        place.approve("bo")
    (problem,) = place.problems()
    assert problem.startswith("by the signers of 20")
    assert "when it was entered: bo@x does not hold the role quality" in problem


def test_what_was_kept_of_signers_and_is_gone_counts_for_nothing(place):
    """Nobody can tell who could sign."""
    place.approve("bo")
    (kept,) = read(place.reports).of(Baseline)
    assert place.problems() == [""]
    object_file(place.reports, kept.object).unlink()
    (problem,) = place.problems()
    assert problem.startswith("it is not known who could sign when it was entered")
