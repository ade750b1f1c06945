"""Summaries of runs: which exist, how far they got, and how they ended."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from hil.clock import wall
from hil.documents.canonical import JsonError, parse_strict
from hil.evidence.durable import open_plain, read_plain
from hil.evidence.events import Anomaly, Attachment, End, Note
from hil.evidence.folder import JOURNAL, is_held, is_run, is_sealed
from hil.evidence.index import Index, Seen
from hil.evidence.journal.reader import JournalLine, JournalReading, read_ends, read_journal, require_known_format
from hil.evidence.ledger.book import Ledger, read
from hil.evidence.ledger.heads import cut_or_rewritten
from hil.evidence.ledger.packages import Seals
from hil.evidence.package.bag import INFO, MANIFEST, digest_of_manifest, identifier_of
from hil.evidence.package.listing import shown
from hil.evidence.package.verification import NO_SEAL, State, in_short, verify
from hil.evidence.safed import was_safed
from hil.evidence.state import fold
from hil.model.errors import EvidenceError, Finding, HilError

__all__ = ["RunSummary", "find_runs", "run_folders", "status"]

_STAMP = re.compile(r"(\d{4})(\d\d)(\d\d)T(\d\d)(\d\d)(\d\d)Z")
_FIRST_LINE = 1_000_000
_VERIFIED_BYTES = 50_000_000
"""A package up to this size is verified when its status is requested."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSummary:
    """Summary of one run.

    Attributes:
        folder: the run's folder.
        state: its state; for a sealed run as far as it was checked.
        problem: what is wrong with it, in a sentence, or empty.
        began: when it began, as ISO 8601; empty if that is not known, and for a single run's status.
        checked: what was checked of a sealed run, empty before the seal and if something is wrong.
        plans: the plans it was asked for.
        bench: the bench's name.
        dut: the serial number of the device under test.
        source: where its bytes come from.
        purpose: why it was made.
        planned: how many cases were planned.
        ended: how many of them ended.
        case: the running case, empty if none is.
        step: its step, as `1.2 title`.
        t: bench time of the newest event in s.
        age: seconds since the newest event; None if the machine was booted since.
        stopped: who or what asked it to stop, and why; empty if nobody did, and once the run is resumed.
        verdict: the sealed verdict; empty before, and for a package in which something is wrong.
        deviates: whether it differs from its plan.
        exceptions: what counts as hardware by the word of the bench file alone, a sentence each.
        added: notes, attachments and anomalies since the first gate, in order.
    """

    folder: Path
    state: State
    problem: str = ""
    began: str = ""
    checked: str = ""
    plans: tuple[str, ...] = ()
    bench: str = ""
    dut: str = ""
    source: str = ""
    purpose: str = ""
    planned: int = 0
    ended: int = 0
    case: str = ""
    step: str = ""
    t: float = 0.0
    age: float | None = None
    stopped: str = ""
    verdict: str = ""
    deviates: bool = False
    exceptions: tuple[str, ...] = ()
    added: tuple[Note | Attachment | Anomaly, ...] = ()


_INDEXED = tuple(each.name for each in fields(RunSummary) if each.name in Seen.__struct_fields__)
"""The fields of a run that an index holds."""


def run_folders(reports: Path) -> list[Path]:
    """Return the folder of every run in the folder of reports, the newest last; hidden folders are not runs.

    Raises:
        EvidenceError: if the folder of reports cannot be read.
    """
    return sorted(_inside(reports), key=lambda path: (_began(path), os.fsencode(path.name)))


def _inside(reports: Path) -> list[Path]:
    try:
        return [path for path in reports.iterdir() if not path.name.startswith(".") and _is_one(path)]
    except FileNotFoundError:
        return []
    except OSError as error:
        raise EvidenceError(f"{reports}: cannot be read: {error.strerror}", "check who may read it") from error


def find_runs(reports: Path, index: Index | None = None) -> list[RunSummary]:
    """Return every run in the folder of reports, the newest last; one that cannot be read says why.

    Sealed ones get a quick look, see `hil.evidence.package.look`.

    Args:
        reports: the folder of reports.
        index: what is known of unchanged runs. Nothing of these is read, and their case, step, time and age are left
            out; every one is compared with the ledger.
    """
    ledger = read(reports)
    index = index or Index(None, "")
    seals = Seals(ledger)
    keys = ((folder, index.key(folder)) for folder in _inside(reports))
    found = [_from_index(*each, index, seals) or _summary_of(*each, index, ledger) for each in keys]
    index.save()
    return sorted(found, key=lambda run: (run.began, os.fsencode(run.folder.name)))


def _from_index(folder: Path, key: str, index: Index, seals: Seals) -> RunSummary | None:
    """Return an unchanged run from the index; None if it has to be read."""
    seen = index.get(folder, key)
    if seen is None or (seen.state != State.SEALED and is_held(folder)):
        return None
    if seen.state == State.SEALED:
        against = seals.known(run=seen.run, folder=shown(folder.name), evidence=seen.evidence, before=seen.before)
        if against.findings:
            return None
    index.keep(folder, seen)
    indexed = {name: getattr(seen, name) for name in _INDEXED}
    return RunSummary(folder=folder, **{**indexed, "state": State(seen.state)})


def _summary_of(folder: Path, key: str, index: Index, ledger: Ledger) -> RunSummary:
    run = replace(_whatever_it_is(folder, ledger), began=_began(folder))
    if key and run.state in _LASTING:
        seen: dict[str, Any] = {name: getattr(run, name) for name in Seen.__struct_fields__ if hasattr(run, name)}
        with suppress(HilError, OSError):
            seen |= _by_its_seal(folder) if run.state is State.SEALED else {}
            index.keep(folder, Seen(**{**seen, "key": key, "state": str(run.state)}))
    return run


_LASTING = frozenset({State.SEALED, State.INTERRUPTED, State.SAFED})
"""States that a run keeps as long as its folder does not change and no process holds it."""


def _by_its_seal(folder: Path) -> dict[str, str]:
    """Return what the ledger needs to look up a package."""
    return {
        "run": identifier_of(read_plain(folder / INFO).decode()),
        "evidence": digest_of_manifest(read_plain(folder / MANIFEST)),
        "before": str(read_ends(folder / JOURNAL).lines[-1].wall.get("ledger", "")),
    }


def status(folder: Path) -> RunSummary:
    """Return the summary of one run; it is only read, even while it is running.

    A sealed package is verified completely, except a large one, which gets a quick look.

    Raises:
        EvidenceError: if there is no journal to read.
    """
    if not is_sealed(folder):
        return _unsealed(folder)
    from hil.evidence.package.look import LOOKED_AT, look  # noqa: PLC0415 - heavy, and runs in the index need none

    ledger = read(folder.resolve().parent)
    seen = look(folder, ledger)
    if seen.state is not State.SEALED:
        return _suspicious(folder, seen.state, seen.findings)
    checked = f"{LOOKED_AT}; not the recordings ({seen.size / 1e9:.1f} GB), which hil verify reads"
    if seen.size <= _VERIFIED_BYTES:
        found = verify(folder, ledger)
        if found.state is not State.SEALED:
            return _suspicious(folder, found.state, found.findings)
        checked = "everything, as hil verify does"
    summary = _summary(folder, read_journal(folder / JOURNAL), State.SEALED)
    return replace(summary, checked=checked, verdict=str(seen.outcome.verdict) if seen.outcome else "")


def _is_one(path: Path) -> bool:
    return is_run(path) or (path.is_dir() and _STAMP.match(path.name) is not None)


def _whatever_it_is(folder: Path, ledger: Ledger) -> RunSummary:
    try:
        return _sealed(folder, ledger) if is_sealed(folder) else _unsealed(folder, ledger)
    except (HilError, OSError) as error:
        what = error.message if isinstance(error, HilError) else str(error)
        return RunSummary(folder=folder, state=State.DAMAGED, problem=what.removeprefix(f"{folder}/"))


def _unsealed(folder: Path, ledger: Ledger | None = None) -> RunSummary:
    held = is_held(folder)  # checked first: a run that ends in between is then sealed
    if held and not os.path.lexists(folder / JOURNAL):
        return RunSummary(folder=folder, state=State.RUNNING)  # it is about to begin
    reading = read_journal(folder / JOURNAL)
    try:
        require_known_format(reading)
    except EvidenceError as error:
        return RunSummary(folder=folder, state=State.UNKNOWN, problem=error.message)
    from hil.evidence.package.introduced import lost_files  # noqa: PLC0415 - as `look`

    ended = State.SAFED if was_safed(folder, reading.events) else State.INTERRUPTED
    lost = [] if held else list(lost_files(folder, reading, read=False))
    if not held and not reading.findings and (cut := cut_or_rewritten(folder, reading, ledger)):
        lost.append(Finding(JOURNAL, 0, 0, cut))
    if (reading.findings or lost) and not held:
        return _suspicious(folder, State.DAMAGED, (*reading.findings, *lost))
    summary = _summary(folder, reading, State.RUNNING if held else ended)
    has_ended = not held and bool(reading.events) and isinstance(reading.events[-1], End)
    return replace(summary, problem=NO_SEAL) if has_ended else summary


def _sealed(folder: Path, ledger: Ledger) -> RunSummary:
    """Return a sealed run by its results, which a quick look shows to be those that were sealed."""
    from hil.evidence.package.look import LOOKED_AT, look  # noqa: PLC0415 - heavy, and runs in the index need none

    seen = look(folder, ledger)
    if seen.outcome is None or seen.last is None:
        return _suspicious(folder, seen.state, seen.findings)
    run, cases = seen.outcome.run, seen.outcome.cases
    return RunSummary(
        folder=folder,
        state=State.SEALED,
        checked=LOOKED_AT,
        plans=run.plans if run else (),
        bench=run.bench if run else "",
        dut=run.dut.serial if run else "",
        source=run.source if run else "",
        purpose=run.purpose if run else "",
        planned=len(cases),
        ended=sum(any(attempt.verdict for attempt in case.attempts) for case in cases),
        t=seen.last.event.t,
        age=_age(seen.last),
        verdict=str(seen.outcome.verdict),
        deviates=bool(run and run.deviations),
    )


def _suspicious(folder: Path, state: State, findings: Sequence[Finding]) -> RunSummary:
    """Return a run in which something is wrong, with nothing but that."""
    return RunSummary(folder=folder, state=state, problem=in_short(findings))


def _began(folder: Path) -> str:
    """Return when a run began, as ISO 8601: from its first event, otherwise from its name."""
    try:
        with open_plain(folder / JOURNAL) as stream:
            line = parse_strict(stream.readline(_FIRST_LINE))
        stamp = line["wall"]["utc"] if isinstance(line, dict) else ""
        if isinstance(stamp, str) and stamp:
            return stamp
    except (OSError, JsonError, LookupError, TypeError):
        pass
    named = _STAMP.match(folder.name)
    return "{}-{}-{}T{}:{}:{}Z".format(*named.groups()) if named else ""


def _summary(folder: Path, reading: JournalReading, state: State) -> RunSummary:
    told = fold(reading.events)
    run, step = told.run, told.present.step if told.present else None
    return RunSummary(
        folder=folder,
        state=state,
        problem=str(reading.findings[0]) if reading.findings else "",
        plans=run.plans if run else (),
        bench=run.bench if run else "",
        dut=run.dut.serial if run else "",
        source=run.source if run else "",
        purpose=run.purpose if run else "",
        planned=len(told.cases),
        ended=sum(any(each.ended for each in case.attempts) for case in told.cases.values()),
        case=told.present.planned.case if told.present else "",
        step=f"{step.number} {step.path[-1]}" if step else "",
        t=told.t,
        age=_age(reading.lines[-1]) if reading.lines else None,
        stopped=told.stop.reason if told.stop else "",
        deviates=bool(told.deviations),
        exceptions=told.exceptions,
        added=tuple(told.added),
    )


def _age(line: JournalLine) -> float | None:
    now = wall.stamp()
    return now.boot - float(line.wall["boot"]) if line.wall.get("boot_id") == now.boot_id else None
