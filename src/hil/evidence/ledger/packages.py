"""Packages in the ledger: the entries made at a seal and after a replay, and what it later says of a package."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from hil.evidence.ledger.book import Ledger, append_once, ledger_file, read
from hil.evidence.ledger.entries import ZERO, Replayed, Sealed, set_back
from hil.model.errors import EvidenceError, Finding

__all__ = ["Known", "Seals", "enter", "enter_replay", "known"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Known:
    """What a ledger says of a package.

    Attributes:
        entry: the entry of its seal; None if there is none.
        findings: what shows that the package is not the one that was sealed.
        told: the same in a sentence, or where the entry is; empty if there is no ledger.
        sure: whether nothing contradicts the package; also False if the ledger is damaged and does not have it.
    """

    entry: Sealed | None = None
    findings: tuple[Finding, ...] = ()
    told: str = ""
    sure: bool = True


def enter(reports: Path, sealed: Sealed) -> None:
    """Enter the seal of a package, unless it is there already.

    Raises:
        EvidenceError: if the ledger cannot be written, or has another evidence digest for this run.
    """
    other: list[Sealed] = []

    def stands(ledger: Ledger) -> bool:
        found = ledger.of(Sealed, sealed.run)
        other.extend(each for each in found if each.evidence != sealed.evidence)
        return bool(found)

    there = False
    with suppress(EvidenceError):  # which the append below says
        there = stands(read(reports))
    if not there:  # what is there needs no right to write
        append_once(reports, sealed, stands)
    if other:
        raise EvidenceError(
            f"{ledger_file(reports)}:{other[0].seq + 1}: {sealed.run} was sealed {_day(other[0])} with another digest",
            "one of the two was rewritten; keep both, and find out who had access",
        )


def enter_replay(reports: Path, replayed: Replayed) -> Replayed | None:
    """Enter the result of a replay, unless it equals the last one entered for this package and this analysis.

    Returns:
        The entry, or the earlier one if it is there already; None if the ledger does not have the seal of the package,
        such as beside a copy: nothing is created or written then.

    Raises:
        EvidenceError: if the ledger is damaged, or cannot be read or written.
    """
    ledger = read(reports)
    if all(each.evidence != replayed.evidence for each in ledger.of(Sealed, replayed.run)):
        return None
    if ledger.findings:
        raise EvidenceError(str(ledger.findings[0]), "nothing is entered in a damaged ledger")
    last: list[Replayed] = []

    def stands(now: Ledger) -> bool:
        same = [each for each in now.of(Replayed, replayed.run) if _subject(each) == _subject(replayed)]
        last[:] = same[-1:]
        return bool(last) and (last[0].same, last[0].differences) == (replayed.same, replayed.differences)

    return append_once(reports, replayed, stands) or last[0]


def _subject(replayed: Replayed) -> tuple[str, str]:
    return replayed.evidence, replayed.analysis


def known(ledger: Ledger, *, run: str, folder: str, evidence: str, before: str = "") -> Known:
    """Return what a ledger says of a package.

    Args:
        ledger: the ledger of the folder of reports that the package is in.
        run: the name that the run had at its seal.
        folder: the name of its folder now.
        evidence: its evidence digest now.
        before: the head that the ledger had before the seal, as the package's journal names it; empty in older ones.
    """
    if not ledger.hashes and not ledger.findings:
        return Known()
    sealed = ledger.of(Sealed)
    named = [each for each in sealed if each.run in {run, folder}]
    entry = next((each for each in sealed if (each.run, each.evidence) == (run, evidence)), None)
    findings = [*_other_digests(named, run, evidence), *_other_names(sealed, run, evidence)]
    if (
        entry
        and before not in {"", ZERO, *ledger.hashes[: entry.seq][-1:]}
        and before not in ledger.hashes[: entry.seq]
    ):
        findings.append(
            Finding("data/journal.jsonl", 0, 0, f"it names the ledger's head {before}, which the ledger never had")
        )
    if findings:
        return Known(entry=entry, findings=tuple(findings), told=findings[0].message, sure=False)
    if entry:
        why = set_back(ledger.entries[: entry.seq + 1]).get(entry.seq, "")
        return Known(entry=entry, told=f"line {entry.seq + 1}, sealed {entry.utc}{why and f'; {why}'}")
    if ledger.findings:
        return Known(told=f"DAMAGED, and has no entry of this package: {ledger.findings[0]}", sure=False)
    return Known(told=_unknown(ledger, before))


class Seals:
    """The seals in a ledger by name and by evidence, for looking up many packages.

    Args:
        ledger: the ledger of the folder of reports that the packages are in.
    """

    def __init__(self, ledger: Ledger) -> None:
        self._ledger = ledger
        self._by: dict[str, list[Sealed]] = {}
        for each in ledger.of(Sealed):
            for name in {each.run, each.evidence}:
                self._by.setdefault(name, []).append(each)

    def known(self, *, run: str, folder: str, evidence: str, before: str) -> Known:
        """Return what `known` says of a package, from only the entries that concern it."""
        concern = {each.seq: each for name in (run, folder, evidence) for each in self._by.get(name, ())}
        ledger = replace(self._ledger, entries=tuple(concern[seq] for seq in sorted(concern)))
        return known(ledger, run=run, folder=folder, evidence=evidence, before=before)


def _other_digests(named: list[Sealed], run: str, evidence: str) -> Iterator[Finding]:
    for each in named:
        if each.evidence == evidence:
            continue
        if each.run != run:
            text = f"the folder has the name of another package, of ledger line {each.seq + 1}: this one is {run}"
        elif any(other.evidence == evidence for other in named):
            text = f"the ledger names this run with another evidence digest as well, in line {each.seq + 1}"
        else:
            text = f"rewritten after its seal on {_day(each)}: ledger line {each.seq + 1} has another evidence digest"
        yield Finding("manifest-sha256.txt", 0, 0, text)


def _other_names(sealed: tuple[Sealed, ...], run: str, evidence: str) -> Iterator[Finding]:
    for each in sealed:
        if each.evidence == evidence and each.run != run:
            text = f"it says {run}, and the ledger sealed this evidence as {each.run} in line {each.seq + 1}"
            yield Finding("bag-info.txt", 0, 0, text)


def _unknown(ledger: Ledger, before: str) -> str:
    if before != ZERO and before in ledger.hashes:
        line = ledger.hashes.index(before) + 1
        return (
            f"not in the ledger, though its journal names the head of line {line}: the ledger was cut off after that, "
            "or could not be written at the seal (hil seal enters it)"
        )
    return "not in the ledger of this folder: a copy, or sealed elsewhere"


def _day(entry: Sealed) -> str:
    return entry.utc[:10]
