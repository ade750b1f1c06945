"""Whether everything in a package follows from its journal, its recordings and what was frozen."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from hil.documents.canonical import JsonError, parse_strict
from hil.evidence.durable import read_plain
from hil.evidence.events import Check, End, Frozen, Recovered, Results, Run
from hil.evidence.folder import ATTACHMENTS, CALIBRATION, CATALOGUE, JOURNAL, PARAMETERS, RECORDINGS, RESULTS
from hil.evidence.journal.reader import JournalReading
from hil.evidence.package.bag import INFO, is_named
from hil.evidence.package.listing import shown
from hil.evidence.package.sealing import info_of
from hil.evidence.recordings.hdf5 import hashes_of
from hil.evidence.results.derived import results_of
from hil.evidence.results.facts import Entries, facts_of, limit_of
from hil.evidence.results.outcome import FORMAT, write_outcome
from hil.evidence.state import fold
from hil.model.errors import EvidenceError, Finding, HilError
from hil.model.figure import Figure, FigureStatus
from hil.model.verdict import Verdict
from hil.requirements.decision import Judgement, judge
from hil.requirements.requirement import Kind, Limit

__all__ = ["content_findings", "guarded", "judge_again"]

_HEAD = ([Run, Frozen], [Run, Recovered])
"""How a sealed journal begins; a run that was killed before its first case has nothing frozen to name."""

Hashes = Mapping[str, str]
"""Path and SHA-256 of every file below `data`, as they are now."""


def content_findings(folder: Path, reading: JournalReading, hashes: Hashes) -> Iterator[Finding]:
    """Derive again whatever the package claims, and give every difference.

    Args:
        folder: the run's folder.
        reading: its journal.
        hashes: path and SHA-256 of every file below `data`, as they are now.
    """
    for look in (
        _journal_findings,
        _info_findings,
        _file_findings,
        _begun_findings,
        _results_findings,
        _recording_findings,
        _attachment_findings,
        _check_findings,
    ):
        yield from guarded(partial(look, folder, reading, hashes))


def guarded(look: Callable[[], Iterator[Finding]]) -> Iterator[Finding]:
    """Turn whatever hostile content makes of a look into a finding."""
    try:
        yield from look()
    except Exception as error:  # noqa: BLE001 - the content decides what goes wrong in reading it
        what = error.message if isinstance(error, HilError) else f"{type(error).__name__}: {error}"
        yield Finding("data", 0, 0, f"verification cannot continue: {what}")


def _journal_findings(_: Path, reading: JournalReading, __: Hashes) -> Iterator[Finding]:
    yield from reading.findings
    if reading.torn:
        yield Finding(JOURNAL, 0, 0, f"{len(reading.torn)} bytes at the end are an incomplete line")
    kinds = [type(event) for event in reading.events]
    if kinds[:1] != [Run] or kinds[-2:] != [Results, End] or kinds.count(Results) != 1:
        yield Finding(JOURNAL, 0, 0, "a sealed journal begins with run, and ends with results and end, each once")
    for line in reading.lines:
        if not line.canonical:
            yield Finding(JOURNAL, line.number, 1, "this is not canonical JSON")


def _info_findings(folder: Path, reading: JournalReading, _: Hashes) -> Iterator[Finding]:
    text = read_plain(folder / INFO)
    names = [line.removeprefix(b"External-Identifier: ") for line in text.split(b"\n") if line.startswith(b"Ext")]
    if len(names) != 1 or not reading.lines or text != info_of(folder, names[0].decode(), reading):
        yield Finding(INFO, 0, 0, "it does not agree with the journal and the files")


def _file_findings(_: Path, reading: JournalReading, hashes: Hashes) -> Iterator[Finding]:
    """Compare every file with the journal, which names what was frozen first, and the whole folder at its end."""
    if [type(event) for event in reading.events[:2]] not in _HEAD:
        yield Finding(JOURNAL, 0, 0, "its second event does not name what was frozen")
    frozen = _frozen_files(reading)
    for path, digest in frozen.items():
        if hashes.get(path) != digest:
            what = "it is not what was frozen before the first step" if path in hashes else "what was frozen is missing"
            yield Finding(shown(path), 0, 0, what)
    ended = _hashes_at_end(reading)
    for path in sorted({*ended, *filter(is_named, hashes)} - {*frozen}):
        if path not in hashes:
            yield Finding(shown(path), 0, 0, "the journal names it, and it is missing")
        elif path not in ended:
            yield Finding(shown(path), 0, 0, "the journal does not name it")
        elif hashes[path] != ended[path]:
            yield Finding(shown(path), 0, 0, "it is not the file that the journal names")


def _hashes_at_end(reading: JournalReading) -> Mapping[str, str]:
    """Return what the journal's last event says of the files.

    Raises:
        EvidenceError: where it says nothing.
    """
    last = reading.lines[-1] if reading.lines else None
    if last is None or not isinstance(last.event, End):
        raise EvidenceError("the journal has no end that names the files")
    return _hashes(last.wall.get("files"), "end")


def _frozen_files(reading: JournalReading) -> dict[str, str]:
    lines = [(line.event, line.wall) for line in reading.lines]
    named = [part for event, wall in lines if isinstance(event, Frozen) for part in (event.files, wall.get("files"))]
    return {path: digest for files in named for path, digest in _hashes(files, "frozen").items()}


def _hashes(files: Any, kind: str) -> Mapping[str, str]:  # noqa: ANN401 - whatever a journal holds
    if not isinstance(files, dict) or not all(isinstance(digest, str) for digest in files.values()):
        raise EvidenceError(f"the event {kind} does not name files with their hashes")
    return files


def _begun_findings(_: Path, reading: JournalReading, hashes: Hashes) -> Iterator[Finding]:
    run = fold(reading.events).run
    for field, path in (("catalogue", CATALOGUE), ("parameters", PARAMETERS), ("calibration", CALIBRATION)):
        if getattr(run, field, None) != hashes.get(path):
            yield Finding(path, 0, 0, f"this is not the {field} that the run started with")


def _results_findings(folder: Path, reading: JournalReading, hashes: Hashes) -> Iterator[Finding]:
    named = fold(reading.events).results
    if named is None or named.sha256 != hashes.get(RESULTS):
        yield Finding(RESULTS, 0, 0, "the journal names other results")
    sealed = read_plain(folder / RESULTS)
    derived = results_of(folder, reading, _format(sealed))
    if named is None or named.verdict is not derived.verdict:
        yield Finding(JOURNAL, 0, 0, f"the run's verdict is {derived.verdict}, and not what the journal says")
    if write_outcome(derived) != sealed:
        yield Finding(RESULTS, 0, 0, "journal and frozen catalogue give other results")


def _format(results: bytes) -> int:
    """Return the format that results are said to be in; the newest for what is none."""
    try:
        found = parse_strict(results)
    except JsonError:
        return FORMAT
    form = found.get("format") if isinstance(found, dict) else None
    return 1 if form == 1 else FORMAT


def _recording_findings(folder: Path, reading: JournalReading, hashes: Hashes) -> Iterator[Finding]:
    """Compare rows with the journal's hashes; a file that is not the one the run wrote is not even opened."""
    written = _hashes_at_end(reading)
    state = fold(reading.events)
    for identifier, claim in state.rows.items():
        path = f"{RECORDINGS}/{identifier}.h5"
        ended = state.ended.get(identifier)
        if ended is None:
            yield Finding(shown(path), 0, 0, "the journal has no end of this recording")
        elif path not in hashes:
            yield Finding(shown(path), 0, 0, "the recording is missing")
        elif hashes[path] == written.get(path):
            yield from guarded(partial(_row_findings, folder, path, claim, ended.rows))


def _row_findings(folder: Path, path: str, claim: Mapping[int, str], rows: int) -> Iterator[Finding]:
    """Compare the rows with every hash that the journal has; one row more is asked for, and must not be there."""
    *found, (there, _) = hashes_of(folder / path, [*claim, max(claim) + 1])
    if there != rows:
        yield Finding(path, 0, 0, f"it has {there} rows, and the journal {rows}")
    for due, (count, digest) in zip(sorted(claim), found, strict=True):
        if count != due or digest != claim[due]:
            yield Finding(path, 0, 0, f"its first {due} rows are not those that the journal names")


def _attachment_findings(_: Path, reading: JournalReading, hashes: Hashes) -> Iterator[Finding]:
    for event in fold(reading.events).attachments:
        path = f"{ATTACHMENTS}/{event.file}"
        if hashes.get(path) != event.sha256:
            yield Finding(shown(path), 0, 0, "this is not the attachment that the journal names")


def _check_findings(folder: Path, reading: JournalReading, _: Hashes) -> Iterator[Finding]:
    catalogue = facts_of(folder, reading).catalogue
    for line in reading.lines:
        if isinstance(line.event, Check):
            for message in judge_again(line.event, catalogue):
                yield Finding(JOURNAL, line.number, 1, message)


_LAST_DIGITS = 1e-9


def judge_again(check: Check, catalogue: Entries) -> Iterator[str]:
    """Give a sentence for everything in a check's event that does not follow from value, uncertainty and catalogue.

    A good verdict must follow exactly. One that is not good may also come from what the event does not tell: a device
    that fell silent, the analysis' own word, a value beyond the last digit written. A requirement that only asks for
    data is RECORDED where its figures pass.

    Args:
        check: the event; value, uncertainty and degrees of freedom combine figure and instruments.
        catalogue: the frozen requirements, with their limits.
    """
    name = f"{check.requirement} {check.parameter}"
    entry = catalogue.get(check.requirement, {})
    frozen = _frozen_limit(check, entry)
    written = _written_limit(check)
    if check.requirement not in catalogue:
        yield f"{name}: the frozen catalogue has no such requirement"
    if frozen is not None:
        yield from _against_catalogue(name, written, frozen)
    again = _judge(check, frozen or written)
    due = Verdict.RECORDED if entry.get("kind") == Kind.RECORD and again.verdict is Verdict.PASS else again.verdict
    if check.doubts:
        due = Verdict.INCONCLUSIVE
    verdict = check.verdict
    if verdict is not due and (verdict.good or not _may_be_worse(check, again)):
        yield f"{name}: the verdict is {verdict}, and its value gives {due} {again.reason}".rstrip()
    tolerance = _tolerance(check, again)
    for field in ("expanded", "margin", "tur"):
        if not _same(getattr(check, field), getattr(again, field), 0.0 if field == "tur" else tolerance):
            yield f"{name}: {field} is {getattr(check, field)}, and its value gives {getattr(again, field)}"


def _judge(check: Check, limit: Limit) -> Judgement:
    if isinstance(check.value, str):
        return judge(check.value, limit)
    figure = Figure(
        value=math.nan if check.value is None else check.value,
        unit=check.unit,
        uncertainty=check.uncertainty,
        dof=math.inf if check.dof is None else check.dof,
        status=FigureStatus(check.status or FigureStatus.MEASURED),
    )
    return judge(figure, limit)


def _may_be_worse(check: Check, again: Judgement) -> bool:
    if check.value is None or (check.verdict is Verdict.INCONCLUSIVE and check.status is None):
        return True
    return again.margin is not None and abs(again.margin) <= _tolerance(check, again)


def _tolerance(check: Check, again: Judgement) -> float:
    """Return how far figures in the limit's unit may differ: they are written with 12 digits."""
    bounds = [float(side) for side in (check.limit.min, check.limit.max) if side is not None]
    value = again.value if isinstance(again.value, float) and math.isfinite(again.value) else 0.0
    return _LAST_DIGITS * max(abs(number) for number in (value, again.expanded or 0.0, *bounds))


def _written_limit(check: Check) -> Limit:
    return Limit(
        parameter=check.parameter,
        unit=check.limit_unit,
        minimum=check.limit.min,
        maximum=check.limit.max,
        equals=check.limit.equals,
        decision=check.decision,
    )


def _frozen_limit(check: Check, entry: Mapping[str, Any]) -> Limit | None:
    limits = entry.get("limits") or []
    return next((limit_of(item) for item in limits if item["parameter"] == check.parameter), None)


def _against_catalogue(name: str, written: Limit, frozen: Limit) -> Iterator[str]:
    for field in ("minimum", "maximum", "equals", "unit", "decision"):
        if getattr(written, field) != getattr(frozen, field):
            yield f"{name}: {field} was {getattr(written, field)}, and the catalogue has {getattr(frozen, field)}"


def _same(written: float | None, again: float | None, tolerance: float) -> bool:
    if written is None or again is None:
        return written is again
    return math.isclose(written, again, rel_tol=_LAST_DIGITS, abs_tol=tolerance)
