"""The packages below a folder of reports, each verified and read into what the audit needs of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path

import msgspec

from hil.audit.cache import Cache
from hil.audit.inputs import Instrument, Package, Result
from hil.documents.canonical import JsonError
from hil.evidence.durable import read_plain
from hil.evidence.folder import JOURNAL, RESULTS, is_sealed
from hil.evidence.journal.reader import read_ends, read_journal
from hil.evidence.ledger.book import Ledger
from hil.evidence.package.bag import INFO, MANIFEST, digest_of_manifest, identifier_of
from hil.evidence.package.verification import State, verify
from hil.evidence.results.derived import results_of
from hil.evidence.results.facts import FrozenCalibration, FrozenRequirement, facts_of, read_json
from hil.evidence.results.outcome import CaseOutcome, Outcome, RequirementOutcome, read_outcome
from hil.evidence.runs import run_folders
from hil.model.errors import EvidenceError, HilError
from hil.model.verdict import Verdict

__all__ = ["read_packages"]

_SOFTWARE = "data/software.json"
_NOT_FROZEN = FrozenRequirement()
_RUNNING = "the run is still running"


def read_packages(reports: Path, cache: Cache) -> tuple[Package, ...]:
    """Return what every package below the reports says, by the names of their folders; each run once.

    Args:
        reports: the folder of reports.
        cache: what is known of packages that did not change.

    Raises:
        EvidenceError: if two packages have one run's name and different contents, with both places.
    """
    found = [cache.package(folder, partial(_read, folder)) for folder in run_folders(reports)]
    return tuple(_once(sorted(found, key=lambda each: each.folder)))


def _once(packages: Iterable[Package]) -> Iterator[Package]:
    """Give each run once: a copy says nothing new, and two that differ cannot both be that run."""
    known: dict[str, Package] = {}
    for package in packages:
        first = known.setdefault(package.run, package) if package.sealed else package
        if first is package:
            yield package
        elif first.digest != package.digest:
            raise EvidenceError(
                f"{first.folder} and {package.folder}: both are the run {package.run}, and their contents differ "
                f"({first.digest[:8]}, {package.digest[:8]})",
                "one of them was rewritten; keep both, compare them with the ledger, and move the false one away",
            )


def _read(folder: Path) -> Package:
    """Return what one folder says; whatever is wrong with it is told, and what it says is told as far as it goes."""
    try:
        found = verify(folder, Ledger(reports=folder.parent))  # the engine compares it with the ledger
    except HilError as error:
        return Package(folder=folder.name, run=folder.name, problem=error.message)
    sealed = found.state is State.SEALED
    package = Package(
        folder=folder.name,
        run=found.run or _named(folder),
        sealed=sealed,
        problem="" if found.ok else _RUNNING if found.state is State.RUNNING else found.problem or "it is incomplete",
        named=_manifest_digest(folder) if is_sealed(folder) else "",
        digest=found.evidence_digest,
    )
    try:
        return _told(folder, package)
    except (HilError, JsonError, OSError, LookupError, TypeError, ValueError) as error:
        problem = package.problem or f"its results cannot be read: {error}"
        return msgspec.structs.replace(package, sealed=False, problem=problem, named="")


def _named(folder: Path) -> str:
    try:
        return identifier_of(read_plain(folder / INFO).decode(errors="replace")) or folder.name
    except OSError:
        return folder.name


def _manifest_digest(folder: Path) -> str:
    try:
        return digest_of_manifest(read_plain(folder / MANIFEST))
    except OSError:
        return ""


def _told(folder: Path, package: Package) -> Package:
    """Return a package with what it says."""
    if is_sealed(folder):
        outcome, ends = read_outcome(read_plain(folder / RESULTS)), read_ends(folder / JOURNAL)
    else:
        ends = read_journal(folder / JOURNAL)
        outcome = results_of(folder, ends)
    facts = facts_of(folder, ends)
    stamps = [str(line.wall.get("utc", "")) for line in ends.lines]
    run = outcome.run
    if run is None:
        raise EvidenceError("it never began")
    last = ends.lines[-1].wall if ends.lines else {}
    software = _json(folder / _SOFTWARE)
    return msgspec.structs.replace(
        package,
        before=str(last.get("ledger", "")),
        source=run.source,
        purpose=run.purpose,
        bench=run.bench,
        began=min(stamps, default=""),
        ended=max(stamps, default=""),
        operator=run.operator,
        serial=run.dut.serial,
        part=run.dut.part,
        hardware=run.dut.hardware,
        firmware=run.dut.firmware,
        version=run.version,
        analysis=str(software.get("analysis", "")),
        plans=run.plans,
        instruments={name: _instrument(its) for name, its in facts.calibration.items() if not its.dut},
        results=dict(_results(outcome, facts.catalogue)),
        orphans=tuple(case.case for case in outcome.cases if not case.requirements),
    )


def _json(path: Path) -> Mapping[str, object]:
    found = read_json(path) if path.exists() else {}
    return found if isinstance(found, dict) else {}


def _instrument(frozen: FrozenCalibration) -> Instrument:
    return Instrument(certificate=frozen.certificate, entry=frozen.register)


def _results(outcome: Outcome, catalogue: Mapping[str, FrozenRequirement]) -> Iterator[tuple[str, Result]]:
    """Give what the results say of each requirement that the run's plans have."""
    checked: dict[str, set[str]] = {}
    failed: set[str] = set()
    carrying: dict[str, list[CaseOutcome]] = {}
    for case in outcome.cases:
        failed.update(identifier for identifier, verdict in case.requirements.items() if verdict is Verdict.FAIL)
        for identifier in case.requirements:
            carrying.setdefault(identifier, []).append(case)
        for check in case.checks:
            checked.setdefault(check.requirement, set()).update(check.instruments)
            if check.verdict is Verdict.FAIL:
                failed.add(check.requirement)
    for each in outcome.requirements:
        cases = carrying.get(each.id, ())
        used = checked.get(each.id) or {name for case in cases for name in case.used}
        yield each.id, _result(each, catalogue.get(each.id, _NOT_FROZEN), used, failed)


def _result(each: RequirementOutcome, frozen: FrozenRequirement, used: Iterable[str], failed: set[str]) -> Result:
    return Result(
        rev=each.rev or 0,
        fingerprint=frozen.fingerprint,
        verdict=each.verdict,
        failed=each.id in failed,
        eligible=each.eligible,
        reasons=each.reasons,
        cases=tuple(said.case for said in each.cases),
        instruments=tuple(sorted(used)),
    )
