"""What an audit is computed from: catalogue, registers, ledger and packages, each typed and nothing of it a path."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import msgspec

from hil.evidence.ledger.entries import Entry
from hil.model.identity import Dut, UnitEvent
from hil.registers.instruments import RegisteredInstrument
from hil.registers.nonconformances import Nonconformance, Records, Verification
from hil.registers.signers import Signer
from hil.requirements.carried import CarryingCase

__all__ = [
    "Approval",
    "Asked",
    "Filed",
    "Instrument",
    "Package",
    "Policy",
    "Register",
    "Remembered",
    "Result",
    "World",
    "catalogue_digest",
]


class Asked(msgspec.Struct, frozen=True, kw_only=True):
    """One requirement of the workspace, as the audit needs it.

    Attributes:
        id: its id.
        rev: its revision.
        fingerprint: SHA-256 of its meaning.
        text: its text.
        kind: its kind.
        method: its verification method.
        source: where it comes from.
        anomaly: what is wrong with the text at its source.
        parents: the requirements that it serves.
        level: level of verification, or empty.
        stage: stage of verification, or empty.
        withdrawn: whether it is withdrawn.
        max_age_s: how old its evidence may be in s, None for any age.
        plan: the name of its plan, empty for one of the workspace.
        document: id of the document that its file stands for.
        issue: the document's issue.
        place: file and line.
        part_numbers: the part numbers that its plan is for, none for any.
        witness: who has to be present when it is verified, empty if no one has to.
        independent: whether someone other than its author has to confirm its verification.
    """

    id: str
    rev: int
    fingerprint: str
    text: str
    kind: str
    method: str
    source: str = ""
    anomaly: str = ""
    parents: tuple[str, ...] = ()
    level: str = ""
    stage: str = ""
    withdrawn: bool = False
    max_age_s: float | None = None
    plan: str = ""
    document: str = ""
    issue: str = ""
    place: str = ""
    part_numbers: tuple[str, ...] = ()
    witness: str = ""
    independent: bool = False


class Instrument(msgspec.Struct, frozen=True, kw_only=True):
    """One instrument of a run, as its package froze it.

    Attributes:
        certificate: the file of its certificate, empty without one.
        entry: its name in the register of instruments, empty if the bench file gave its calibration itself.
    """

    certificate: str = ""
    entry: str = ""


class Result(msgspec.Struct, frozen=True, kw_only=True):
    """What one package says of one requirement.

    Attributes:
        rev: the revision that it was judged against, 0 if it is not recorded.
        fingerprint: SHA-256 of that revision's meaning, empty if it is not recorded.
        verdict: the verdict.
        failed: whether any check of it failed, however the case went on.
        eligible: whether the run's results say that it can close the requirement.
        reasons: why not, a sentence each.
        of_simulation: those of them that come from a simulated bench or device under test.
        cases: the cases that carry it.
        instruments: the names of the instruments behind its checks and recordings.
    """

    rev: int
    fingerprint: str
    verdict: str
    failed: bool
    eligible: bool
    reasons: tuple[str, ...]
    cases: tuple[str, ...]
    of_simulation: tuple[str, ...] = ()
    instruments: tuple[str, ...]


class Package(msgspec.Struct, frozen=True, kw_only=True):
    """What one package says, and whether that can be trusted.

    Attributes:
        folder: the name of its folder.
        run: the name that the folder had at its seal.
        sealed: whether it is whole and verified.
        known: whether it holds all that the ledger saw of its run, as far as that can be told.
        problem: what is wrong with it in one line, empty where nothing is.
        named: the evidence digest that its manifest gives, also where it is damaged, as long as its results are those
            that the manifest lists; empty before the seal.
        digest: its evidence digest, empty unless it is verified.
        before: the head that the ledger had before the seal, empty if the package does not name it.
        source: where the run's bytes came from.
        purpose: why the run was made.
        bench: the bench's name.
        began: UTC of its first event.
        ended: UTC of its last event.
        operator: who ran it, as the run recorded it.
        serial: serial number of the device under test.
        part: its part number.
        hardware: its hardware revision.
        firmware: its firmware revision.
        simulated_unit: whether it exists in simulated benches only.
        version: the version of hil that made the run.
        analysis: SHA-256 over the analysis and the judging that gave its verdicts, empty if it is not recorded.
        plans: its plans.
        instruments: its instruments by name.
        results: what it says of each requirement, by id.
        orphans: its cases without requirement.
        exceptions: instrument and declared reason of what counts as hardware by the word of the bench file alone.
        others: what its conditions say of drivers and the like of other packages than hil, a sentence each.
    """

    folder: str
    run: str = ""
    sealed: bool = False
    known: bool = True
    problem: str = ""
    named: str = ""
    digest: str = ""
    before: str = ""
    source: str = ""
    purpose: str = ""
    bench: str = ""
    began: str = ""
    ended: str = ""
    operator: str = ""
    serial: str = ""
    part: str = ""
    hardware: str = ""
    firmware: str = ""
    simulated_unit: bool = False
    version: str = ""
    analysis: str = ""
    plans: tuple[str, ...] = ()
    instruments: Mapping[str, Instrument] = {}
    results: Mapping[str, Result] = {}
    orphans: tuple[str, ...] = ()
    exceptions: tuple[tuple[str, str], ...] = ()
    others: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Register:
    """The registers of the workspace.

    Attributes:
        duts: the units under test by serial number.
        instruments: the instruments by their names in the register.
        sha256: SHA-256 of each register's content, by `units` and `instruments`; without it there is no such register.
    """

    duts: Mapping[str, Dut] = field(default_factory=dict)
    instruments: Mapping[str, RegisteredInstrument] = field(default_factory=dict)
    sha256: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Approval:
    """A valid approval of a nonconformance report, a waiver or a verification.

    Attributes:
        record: its number.
        sha256: SHA-256 of the content that was approved.
        role: the role in which it was approved.
        principal: who approved it.
        utc: when it was entered in the ledger.
        seq: the number of its entry there.
        own: whether it may be the author's own.
    """

    record: str
    sha256: str
    role: str
    principal: str
    utc: str
    seq: int
    own: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Filed:
    """The nonconformance reports, waivers and verifications of the workspace.

    Attributes:
        registers: as they are.
        earlier: every report that the ledger has, as often as it has changed; what was reported stays so.
        shown: every verification that the ledger has, likewise.
        documents: SHA-256 of every document that a verification names, by its path; empty if it is not there.
        approvals: the valid approvals, the oldest first.
        people: who is in the register of signers, with names and roles.
    """

    registers: Records = field(default_factory=Records)
    earlier: tuple[Nonconformance, ...] = ()
    shown: tuple[Verification, ...] = ()
    documents: Mapping[str, str] = field(default_factory=dict)
    approvals: tuple[Approval, ...] = ()
    people: tuple[Signer, ...] = ()


class Remembered(msgspec.Struct, frozen=True, kw_only=True):
    """One entry that catalogue or registers had when a baseline was entered into the ledger.

    Attributes:
        mark: what tells it from all others, its content included.
        name: the entry in words.
        owner: the id, serial number or name of what it belongs to.
        item: a requirement; the id of a parent; an event of a unit; or an instrument with this one certificate.
        seq: the number of the ledger's entry that had it first.
        utc: when that was entered.
    """

    mark: str
    name: str
    owner: str
    item: Asked | str | UnitEvent | RegisteredInstrument
    seq: int = -1
    utc: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Policy:
    """What the workspace requires beyond the seal.

    Attributes:
        signatures: whether a package must be signed.
        approvals: the roles of which each must have approved it.
        valid: evidence digest to the roles under which it has valid signatures; an empty role is the package's own.
        said: UTC, evidence digest and role of every valid signature, of which `valid` tells.
    """

    signatures: bool = False
    approvals: tuple[str, ...] = ()
    valid: Mapping[str, frozenset[str]] = field(default_factory=dict)
    said: tuple[tuple[str, str, str], ...] = ()

    def until(self, day: str) -> Policy:
        """Return it with the signatures that had been entered by the end of a day of UTC, ISO 8601."""
        valid: dict[str, frozenset[str]] = {}
        for utc, digest, role in self.said:
            if utc[:10] <= day:
                valid[digest] = valid.get(digest, frozenset()) | {role}
        return replace(self, valid=valid)


@dataclass(frozen=True, slots=True, kw_only=True)
class World:
    """Everything that an audit is computed from.

    Attributes:
        asked: the requirements of the workspace.
        packages: what the packages say; no run stands twice among them.
        cases: the cases of the plans as their sources are now; None where only the packages can tell, as in the past.
        register: the registers.
        remembered: what catalogue and registers ever had, but for what was explained.
        entries: the entries of the ledger, in order.
        head: its head.
        problems: what is wrong with the ledger, a sentence each.
        policy: what the workspace asks for beyond the seal.
        filed: its nonconformance reports and waivers.
        analysis: SHA-256 over the analysis and the judging of now.
        date: the day of the audit, ISO 8601; ages are counted up to it.
        as_of: the day at whose end the state is told, empty for now.
        name: the name of the workspace.
        version: the version of hil that computes it.
    """

    asked: tuple[Asked, ...]
    packages: tuple[Package, ...] = ()
    cases: tuple[CarryingCase, ...] | None = None
    register: Register = field(default_factory=Register)
    remembered: tuple[Remembered, ...] = ()
    entries: tuple[Entry, ...] = ()
    head: str = ""
    problems: tuple[str, ...] = ()
    policy: Policy = field(default_factory=Policy)
    filed: Filed = field(default_factory=Filed)
    analysis: str = ""
    date: str = ""
    as_of: str = ""
    name: str = ""
    version: str = ""


def catalogue_digest(asked: tuple[Asked, ...]) -> str:
    """Return the SHA-256 over id and fingerprint of every requirement, in the order of their ids."""
    lines = sorted(f"{each.id} {each.fingerprint}\n" for each in asked)
    return hashlib.sha256("".join(lines).encode()).hexdigest()
