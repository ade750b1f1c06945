"""The register of signers, `fixtures/signers.yaml`: who may sign, and in which roles.

Their keys stand beside it, in OpenSSH's own files: `allowed_signers` and, if there are any, `revoked_keys`.
"""

from __future__ import annotations

import unicodedata
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from hil.clock.wall import is_date
from hil.documents.declared import read_document
from hil.documents.findings import Findings
from hil.documents.suggest import did_you_mean
from hil.model.errors import Refused
from hil.model.identity import Day
from hil.model.notation import Flag, Text, matching
from hil.model.notation import Path as Keys

__all__ = ["ALLOWED", "REVOKED", "SIGNERS", "HeldRole", "Required", "Signer", "Signers", "load_signers"]

SIGNERS = "signers.yaml"
"""The file's name, in the folder of fixtures."""
ALLOWED = "allowed_signers"
"""The keys by principal, with namespaces and validity, as `ssh-keygen -Y verify` reads them."""
REVOKED = "revoked_keys"
"""Keys that no longer count, whatever they signed when; a public key a line, or a key revocation list."""

_SCHEMA = "hil/signers/1"
_Principal = Annotated[str, matching(r"[A-Za-z0-9][A-Za-z0-9._@+-]*", "a name such as ada@example.org")]
_Role = Annotated[str, matching("[a-z][a-z-]*", "a word in small letters, such as quality")]


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldRole:
    """A role that a person holds.

    Attributes:
        role: the role's name.
        since: the first day.
        until: the last day; open where it is left out.
    """

    role: _Role
    since: Day
    until: Day = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Signer:
    """A person who signs.

    Attributes:
        principal: by which `allowed_signers` names the person's keys.
        name: the person's name.
        also: other names under which runs record the person as operator.
        roles: the roles the person holds.
    """

    principal: _Principal
    name: Text
    also: tuple[Text, ...] = ()
    roles: tuple[HeldRole, ...] = ()

    def is_called(self, name: str) -> bool:
        """Return whether a name is one of this person's, whatever its case and spaces."""
        return _plain(name) in {_plain(each) for each in (self.principal, self.name, *self.also)}

    def holds(self, role: str, day: str) -> bool:
        """Return whether the person holds a role on a day, ISO 8601; first and last day count."""
        return any(each.role == role and each.since <= day <= (each.until or day) for each in self.roles)

    def stands_for(self, who: str, day: str) -> bool:
        """Return whether this person fits a required role or name on a day, ISO 8601."""
        return self.is_called(who) or self.holds(_plain(who).replace(" ", "-"), day)


@dataclass(frozen=True, slots=True, kw_only=True)
class Required:
    """What a package needs before it can close anything.

    Attributes:
        signature: whether it must be signed.
        approvals: the roles of which each must have approved it.
    """

    signature: Flag = False
    approvals: tuple[_Role, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Signers:
    """The register and the files of keys beside it.

    Attributes:
        people: everyone in the register.
        folder: the folder of fixtures.
        required: what a package needs.
    """

    people: tuple[Signer, ...]
    folder: Path
    required: Required = field(default_factory=Required)

    def find(self, principal: str) -> Signer:
        """Return the signer of a principal.

        Raises:
            Refused: if it is not in the register.
        """
        for each in self.people:
            if each.principal == principal:
                return each
        known = [each.principal for each in self.people]
        raise Refused(
            f"'{principal}' is not in fixtures/{SIGNERS}{did_you_mean(principal, known)}",
            f"registered are: {', '.join(known)}" if known else "no signer is registered yet: write that file first",
        )

    def called(self, name: str) -> Signer | None:
        """Return the person of a name; None if there is none."""
        return next((each for each in self.people if each.is_called(name)), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Register:
    signers: tuple[Signer, ...]
    required: Required = field(default_factory=Required)


def load_signers(fixtures: Path) -> Signers:
    """Return the register of a folder of fixtures; empty if it does not exist.

    Raises:
        ConfigurationError: with all errors in it.
    """
    path = fixtures / SIGNERS
    if not path.exists():
        return Signers(people=(), folder=fixtures)
    findings = Findings()
    document = read_document(path, f"{fixtures.name}/{SIGNERS}", findings, _Register, schema=_SCHEMA)
    people = document.model.signers if document else ()
    names: dict[str, str] = {}
    for index, signer in enumerate(people):
        at: Keys = ("signers", index)
        for name in dict.fromkeys(_plain(each) for each in (signer.principal, signer.name, *signer.also)):
            if document and names.setdefault(name, signer.principal) != signer.principal:
                text = f"'{name}' names {names[name]} already: every name belongs to one person"
                findings.add(document.place(at), text)
        for number, held in enumerate(signer.roles):
            for key, day in (("since", held.since), ("until", held.until)):
                if document and day and not is_date(day):
                    findings.add(document.place((*at, "roles", number, key)), f"the date {day} does not exist")
    findings.raise_if_any()
    return Signers(people=people, folder=fixtures, required=document.model.required if document else Required())


def _plain(name: str) -> str:
    return " ".join(unicodedata.normalize("NFKC", name).casefold().split())
