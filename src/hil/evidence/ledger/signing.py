"""OpenSSH signatures over a statement: made and verified by `ssh-keygen -Y`, with any key that it supports."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

from hil.documents.canonical import JsonError, parse_strict
from hil.evidence.events.codec import convert, quick_canonical
from hil.evidence.events.event import Part
from hil.model.errors import Refused
from hil.registers.signers import ALLOWED, REVOKED

__all__ = ["APPROVAL", "PACKAGE", "Statement", "problem_of", "read_statement", "sign"]

PACKAGE = "hil-package"
"""The namespace of signatures of packages."""
APPROVAL = "hil-approval"
"""The namespace of approvals."""

_PROGRAM = "ssh-keygen"
_MISSING = "install OpenSSH 8.9 or later"
_WHY = re.compile(r"(?:.*: )?(namespace does not match|incorrect signature|key has expired.*|key is not yet valid.*)")


class Statement(Part, frozen=True, kw_only=True):
    """The signed statement, as one line of canonical JSON.

    Attributes:
        format: 1.
        namespace: what kind of statement it is, see `PACKAGE` and `APPROVAL`.
        run: the name of the run.
        evidence: its evidence digest.
        content: its content digest.
        verdict: its verdict.
        source: where its bytes came from.
        principal: who signs.
        role: the role in which the package is approved.
        meaning: what the approval means, in the person's words.
        utc: when it was signed, by the clock of the signer's computer.
    """

    format: int
    namespace: str
    run: str
    evidence: str
    content: str
    verdict: str
    source: str
    principal: str
    role: str = ""
    meaning: str = ""
    utc: str

    def line(self) -> bytes:
        """Return the bytes that are signed."""
        return quick_canonical(self) + b"\n"


def read_statement(data: bytes) -> Statement:
    """Return the statement in signed bytes.

    Raises:
        JsonError: if they are not one, byte for byte as `Statement.line` writes it.
    """
    parsed = parse_strict(data)
    if not isinstance(parsed, dict):
        raise JsonError("expected an object")
    statement = convert(parsed, Statement, "statement")
    if statement.line() != data:
        raise JsonError("it is not written as statements are")
    return statement


def sign(data: bytes, *, key: Path, namespace: str) -> bytes:
    """Return the signature by `ssh-keygen -Y sign`, which itself asks for passphrase, PIN or touch.

    Args:
        data: what is signed.
        key: a private key, or a public key whose private half is in the agent or on a token.
        namespace: what the signature is for.

    Raises:
        Refused: if there is no ssh-keygen, or it does not sign.
    """
    if not key.is_file():
        raise Refused(f"{key}: there is no such key", "name a key file with --key, such as ~/.ssh/id_ed25519")
    done = _run(["-Y", "sign", "-f", str(key), "-n", namespace], data, shows=True)
    if done.returncode or b"SIGNATURE" not in done.stdout:
        raise Refused(
            f"{key}: ssh-keygen signed nothing", "its message stands above; ssh-add -l lists the agent's keys"
        )
    return done.stdout


def problem_of(statement: Statement, signature: Path, *, utc: str, fixtures: Path) -> str:
    """Return why a signature does not count, in a sentence; empty if `ssh-keygen -Y verify` finds it good.

    Args:
        statement: what was signed.
        signature: the file with the signature.
        utc: the moment at which the key must be valid, ISO 8601.
        fixtures: the folder with `allowed_signers` and `revoked_keys`.

    Raises:
        Refused: if there is no ssh-keygen.
    """
    data, principal, namespace = statement.line(), statement.principal, statement.namespace
    allowed, revoked = fixtures / ALLOWED, fixtures / REVOKED
    if not allowed.is_file():
        return f"fixtures/{ALLOWED} is missing, so no key is known"
    moment = re.sub(r"[^0-9]", "", utc)[:14]
    asked = ["-Y", "verify", "-f", str(allowed), "-I", principal, "-n", namespace, "-s", str(signature)]
    asked += [f"-Overify-time={moment}Z"]
    if revoked.exists():
        done = _run([*asked, "-r", str(revoked)], data)
        if done.returncode and not _run(asked, data).returncode:
            return f"its key is revoked by fixtures/{REVOKED}"
    else:
        done = _run(asked, data)
    if not done.returncode:
        return ""
    for line in done.stderr.decode(errors="replace").splitlines():
        if found := _WHY.search(line):
            return found[1]
    return f"fixtures/{ALLOWED} has no key of {principal} that made it, for {namespace}"


def _run(arguments: list[str], data: bytes, *, shows: bool = False) -> subprocess.CompletedProcess[bytes]:
    program = shutil.which(_PROGRAM)
    if program is None:
        raise Refused(f"signatures need {_PROGRAM}, which is not installed", _MISSING)
    stderr = None if shows else subprocess.PIPE
    command = [program, *arguments]
    return subprocess.run(command, input=data, stdout=subprocess.PIPE, stderr=stderr, check=False)  # noqa: S603 - no shell
