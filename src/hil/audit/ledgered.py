"""What the ledger says about packages: their seals, their order, what is missing, and later entries about them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from hil.audit.inputs import Package, Policy
from hil.audit.remembered import Removed
from hil.evidence.ledger.entries import ZERO, Entry, Head, Replayed, Sealed, set_back
from hil.model.identity import Source

__all__ = ["DISPOSITION", "Ledgered", "Missing", "ledgered"]

DISPOSITION = "nonconformance"
"""The role in which a FAIL is disposed of: by a signed approval of the package that holds it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Missing:
    """A run that the ledger saw, and that is not there as it was; its outcome is unknown."""

    run: str
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Ledgered:
    """The ledger as an audit needs it.

    Attributes:
        seals: the first seal of each run: whoever enters another one does not change what was sealed.
        heads: every head that the ledger had.
        policy: which signatures are valid.
        damage: what is wrong with it, empty where nothing is.
        missing: packages of hardware that are not there.
        removed: what catalogue and registers had, and no longer have.
        backwards: why the times of an entry are implausible, by the run that it is of: the first one of each.
        doubted: how many lines were written by an implausible clock, and the first of them.
        replays: the last replay of each package by each analysis, by evidence digest and digest of the analysis.
    """

    seals: dict[str, Sealed] = field(default_factory=dict)
    heads: frozenset[str] = frozenset()
    policy: Policy = field(default_factory=Policy)
    damage: str = ""
    missing: tuple[Missing, ...] = ()
    removed: Removed = field(default_factory=Removed)
    backwards: dict[str, str] = field(default_factory=dict)
    doubted: str = ""
    replays: dict[tuple[str, str], Replayed] = field(default_factory=dict)

    def seal_of(self, package: Package) -> Sealed | None:
        """Return the seal of a package; None if the ledger does not have it with this content."""
        found = self.seals.get(package.run) or self.seals.get(package.folder)
        return found if found and found.evidence == package.digest else None

    def evidence_of(self, package: Package) -> str:
        """Return the evidence digest with which a package was sealed, empty if the ledger does not have its run."""
        found = self.seals.get(package.run) or self.seals.get(package.folder)
        return found.evidence if found else ""

    def place_of(self, package: Package) -> tuple[bool, int, str, str]:
        """Return the sort key of packages: their seals in the ledger; those without one come last."""
        found = self.seals.get(package.run) or self.seals.get(package.folder)
        return (found is None, found.seq if found else 0, package.ended, package.folder)

    def backwards_of(self, package: Package) -> str:
        """Return why the times of a package contradict the order of the ledger, empty if they agree."""
        return self.backwards.get(package.run) or self.backwards.get(package.folder, "")

    def disposed(self, package: Package) -> bool:
        """Return whether the disposition of a FAIL in this package is signed."""
        return bool(package.digest) and DISPOSITION in self.policy.valid.get(package.digest, frozenset())

    def replay_of(self, package: Package, analysis: str) -> Replayed | None:
        """Return the last replay of a package by an analysis, None if there was none."""
        return self.replays.get((package.digest, analysis)) if package.digest else None


def ledgered(entries: Sequence[Entry], packages: Sequence[Package], policy: Policy, head: str) -> Ledgered:
    """Return the ledger as the audit needs it.

    A package of hardware that is missing, or whose list of results cannot be trusted, may hold a FAIL of anything.
    So may a run that was never sealed, from its first reading on. One of a simulated bench cannot speak against
    anything, so that nobody misses it.
    """
    seals: dict[str, Sealed] = {}
    for entry in entries:
        if isinstance(entry, Sealed):
            seals.setdefault(entry.run, entry)
    trusted = {(name, package.named) for package in packages for name in (package.run, package.folder)}
    missing = [
        Missing(run=seal.run, text=_why(seal, packages))
        for seal in seals.values()
        if (seal.run, seal.evidence) not in trusted and seal.source not in {Source.SIMULATED, Source.REPLAYED}
    ]
    replays = {(each.evidence, each.analysis): each for each in entries if isinstance(each, Replayed)}
    missing += _unsealed([each for each in entries if isinstance(each, Head) and each.run not in seals], packages)
    heads = frozenset({ZERO, head, *(each.prev for each in entries)})
    told = set_back(entries)
    return Ledgered(
        seals=seals,
        heads=heads,
        policy=policy,
        missing=tuple(missing),
        backwards=_backwards(entries, told),
        doubted=_doubted(list(told.values())),
        replays=replays,
    )


def _backwards(entries: Sequence[Entry], told: Mapping[int, str]) -> dict[str, str]:
    """Return what the ledger says against the times of runs, by their names."""
    found: dict[str, str] = {}
    for entry in entries if told else ():
        if isinstance(entry, Head | Sealed) and entry.seq in told:
            found.setdefault(entry.run, told[entry.seq])
    return found


def _doubted(sentences: Sequence[str]) -> str:
    more = f"; likewise {len(sentences) - 1} more" if len(sentences) > 1 else ""
    return f"{sentences[0]}{more}" if sentences else ""


def _unsealed(heads: Sequence[Head], packages: Sequence[Package]) -> Iterator[Missing]:
    """Give the runs that measured something and were not sealed, and that are not there, or not whole."""
    known = {package.folder for package in packages if package.known}
    cut = {package.folder: package.problem for package in packages}
    seen: dict[str, list[Head]] = {}
    for head in heads:
        seen.setdefault(head.run, []).append(head)
    for run, its in seen.items():
        planned_only = len(its) == 1
        if run not in known and not planned_only and its[-1].source not in {Source.SIMULATED, Source.REPLAYED}:
            what = cut.get(run) or "it is not there"
            text = f"{run} ran until {its[-1].utc}, and was not sealed: {what}; its outcome is unknown"
            yield Missing(run=run, text=text)


def _why(seal: Sealed, packages: Sequence[Package]) -> str:
    there = any(seal.run in {package.run, package.folder} for package in packages)
    what = "is there with another content" if there else "is not there"
    return f"{seal.run} was sealed with {seal.dut} on {seal.bench} and {what}: its outcome is unknown"
