"""The packages below a folder of reports, each verified and read into what the audit needs of it."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Generic, TypeVar

import msgspec

from hil.audit.cache import Cache
from hil.audit.inputs import Instrument, Package, Result
from hil.evidence.durable import read_plain
from hil.evidence.events import Run
from hil.evidence.folder import CALIBRATION, CATALOGUE, DUT, JOURNAL, RESULTS, is_sealed
from hil.evidence.journal.reader import read_ends, read_journal
from hil.evidence.ledger.book import Ledger
from hil.evidence.package.bag import INFO, MANIFEST, digest_of_manifest, identifier_of
from hil.evidence.package.verification import State, verify
from hil.evidence.results.derived import results_of
from hil.evidence.results.eligibility import of_simulation
from hil.evidence.results.facts import FrozenCalibration, read_json
from hil.evidence.results.outcome import AS_INSTALLED, EXCEPTION, EXECUTED, NO_OTHERS, OTHERS, write_outcome
from hil.evidence.runs import run_folders
from hil.model.errors import EvidenceError, HilError
from hil.model.identity import Source
from hil.model.verdict import Verdict

__all__ = ["read_packages"]

_SOFTWARE = "data/software.json"
_RUNNING = "the run is still running"
_Item = TypeVar("_Item")


# What the audit needs of files that verification has read strictly: they are decoded at the speed of a copy.


class _Checked(msgspec.Struct, frozen=True):
    requirement: str
    verdict: str
    instruments: tuple[str, ...] = ()


class _Case(msgspec.Struct, frozen=True):
    case: str
    requirements: dict[str, str] = {}
    used: dict[str, str] = {}
    checks: tuple[_Checked, ...] = ()


class _Carrying(msgspec.Struct, frozen=True):
    case: str


class _Condition(msgspec.Struct, frozen=True):
    name: str
    proven: bool
    text: str


class _Judged(msgspec.Struct, frozen=True):
    id: str
    verdict: str
    eligible: bool
    rev: int | None = None
    reasons: tuple[str, ...] = ()
    cases: tuple[_Carrying, ...] = ()
    conditions: tuple[_Condition, ...] | None = None


class _Said(msgspec.Struct, frozen=True):
    cases: tuple[_Case, ...]
    requirements: tuple[_Judged, ...]
    conditions: tuple[_Condition, ...] | None = None


class _Meant(msgspec.Struct, frozen=True):
    fingerprint: str = ""


class _Frozen(msgspec.Struct, Generic[_Item], frozen=True):
    requirements: dict[str, _Item] = {}
    instruments: dict[str, _Item] = {}


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
    """Return the content of one folder as far as it can be read, with whatever is wrong with it."""
    try:
        found = verify(folder, Ledger(reports=folder.parent))  # the engine compares it with the ledger
    except HilError as error:
        return Package(folder=folder.name, run=folder.name, problem=error.message, known=False)
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
    except (HilError, OSError, msgspec.MsgspecError, ValueError) as error:
        problem = package.problem or f"its results cannot be read: {error}"
        return msgspec.structs.replace(package, sealed=False, known=False, problem=problem, named="")


def _named(folder: Path) -> str:
    try:
        return identifier_of(read_plain(folder / INFO).decode(errors="replace")) or folder.name
    except OSError:
        return folder.name


def _manifest_digest(folder: Path) -> str:
    """Return the evidence digest that a manifest gives; empty if the results are not those that it lists."""
    try:
        manifest, results = read_plain(folder / MANIFEST), read_plain(folder / RESULTS)
    except OSError:
        return ""
    listed = f"{hashlib.sha256(results).hexdigest()}  {RESULTS}".encode()
    return digest_of_manifest(manifest) if manifest.splitlines().count(listed) == 1 else ""


def _told(folder: Path, package: Package) -> Package:
    """Return a package with its content."""
    if is_sealed(folder):
        ends = read_ends(folder / JOURNAL)
        said = msgspec.json.decode(read_plain(folder / RESULTS), type=_Said)
    else:
        ends = read_journal(folder / JOURNAL)
        said = msgspec.json.decode(write_outcome(results_of(folder, ends)), type=_Said)
    calibration = _calibration(folder)
    stamps = [str(line.wall.get("utc", "")) for line in ends.lines]
    simulated = bool(_json(folder / DUT).get("simulated", False))
    run = next((line.event for line in ends.lines if isinstance(line.event, Run)), None)
    if run is None:
        raise EvidenceError("it never began")
    last = ends.lines[-1].wall
    return msgspec.structs.replace(
        package,
        before=str(last.get("ledger", "")),
        source=run.source,
        purpose=run.purpose,
        bench=run.bench,
        began=min(stamps),
        ended=max(stamps),
        operator=run.operator,
        serial=run.dut.serial,
        part=run.dut.part,
        hardware=run.dut.hardware,
        firmware=run.dut.firmware,
        simulated_unit=simulated,
        version=run.version,
        analysis=str(_json(folder / _SOFTWARE).get("analysis", "")),
        plans=run.plans,
        instruments=calibration,
        results=dict(_results(said, _fingerprints(folder), run.source, unit=simulated)),
        orphans=tuple(case.case for case in said.cases if not case.requirements),
        exceptions=tuple(_exceptions(said.conditions or ())),
        others=tuple(_others(said.conditions or ())),
    )


def _others(conditions: Iterable[_Condition]) -> Iterator[str]:
    """Give what is of other packages: what offers a driver or the like, and what was only executed, such as late."""
    texts = [each.text for each in conditions if each.name == OTHERS and each.text != NO_OTHERS]
    yield from texts
    for each in conditions:
        if each.name == EXECUTED and (ran := each.text.removeprefix(f"{AS_INSTALLED}, that of ")) != each.text:
            named = ran.removesuffix(" included").split(", ")
            yield from (f"{name} was executed, as installed" for name in named if not any(name in it for it in texts))


def _exceptions(conditions: Iterable[_Condition]) -> Iterator[tuple[str, str]]:
    """Give instrument and reason of every exception that the run declared."""
    for each in conditions:
        if each.name == EXCEPTION:
            instrument, _, why = each.text.removeprefix("EXCEPTION: ").partition(": ")
            yield instrument, why


def _calibration(folder: Path) -> dict[str, Instrument]:
    """Return the instruments of a run that have a calibration record, devices under test left out."""
    path = folder / CALIBRATION
    if not path.exists():
        return {}
    frozen = msgspec.json.decode(read_plain(path), type=_Frozen[FrozenCalibration]).instruments
    return {
        name: Instrument(certificate=its.certificate, entry=its.register) for name, its in frozen.items() if not its.dut
    }


def _fingerprints(folder: Path) -> dict[str, str]:
    path = folder / CATALOGUE
    if not path.exists():
        return {}
    frozen = msgspec.json.decode(read_plain(path), type=_Frozen[_Meant]).requirements
    return {name: its.fingerprint for name, its in frozen.items()}


def _json(path: Path) -> Mapping[str, object]:
    found = read_json(path) if path.exists() else {}
    return found if isinstance(found, dict) else {}


def _results(
    said: _Said, fingerprints: Mapping[str, str], source: Source, *, unit: bool
) -> Iterator[tuple[str, Result]]:
    """Give what the results say of each requirement that the run's plans have."""
    checked: dict[str, set[str]] = {}
    used: dict[str, set[str]] = {}
    failed: set[str] = set()
    for case in said.cases:
        for identifier, verdict in case.requirements.items():
            used.setdefault(identifier, set()).update(case.used)
            if verdict == Verdict.FAIL:
                failed.add(identifier)
        for check in case.checks:
            checked.setdefault(check.requirement, set()).update(check.instruments)
            if check.verdict == Verdict.FAIL:
                failed.add(check.requirement)
    for each in said.requirements:
        yield (
            each.id,
            Result(
                rev=each.rev or 0,
                fingerprint=fingerprints.get(each.id, ""),
                verdict=each.verdict,
                failed=each.id in failed,
                eligible=each.eligible,
                reasons=each.reasons,
                cases=tuple(case.case for case in each.cases),
                of_simulation=tuple(
                    its.text
                    for its in (*(said.conditions or ()), *(each.conditions or ()))
                    if source is not Source.HARDWARE and not its.proven and of_simulation(its.name, its.text, unit=unit)
                ),
                instruments=tuple(sorted(checked.get(each.id) or used.get(each.id) or ())),
            ),
        )
