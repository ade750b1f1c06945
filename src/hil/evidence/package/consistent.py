"""Consistency checks: whether everything in a package follows from its journal, its recordings and its frozen files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import Any

import msgspec

from hil.documents.canonical import JsonError, canonical, parse_strict
from hil.evidence.durable import read_plain
from hil.evidence.events import (
    Check,
    End,
    Frozen,
    FrozenLater,
    Recording,
    RecordingEnd,
    Recovered,
    Results,
    Run,
)
from hil.evidence.folder import ATTACHMENTS, CALIBRATION, CATALOGUE, GUARDIAN, JOURNAL, PARAMETERS, RECORDINGS, RESULTS
from hil.evidence.journal.clocks import clock_findings
from hil.evidence.journal.reader import JournalLine, JournalReading
from hil.evidence.package.bag import INFO, identifier_of, is_named
from hil.evidence.package.introduced import introduced_findings
from hil.evidence.package.judging import judge_again
from hil.evidence.package.listing import shown
from hil.evidence.package.sealing import info_of
from hil.evidence.package.twice import LOOKS
from hil.evidence.recordings.hdf5 import differing_facts, hashes_of
from hil.evidence.results.derived import Sources
from hil.evidence.results.eligibility import against_hardware
from hil.evidence.results.facts import Catalogue, DamagedFile
from hil.evidence.results.outcome import FORMAT, is_outcome, without_sentences, write_outcome
from hil.model.errors import EvidenceError, Finding, HilError
from hil.model.identity import Source

__all__ = ["content_findings", "frozen_files", "frozen_findings", "guarded", "named_results"]

_HEAD = ([Run, Frozen], [Run, Recovered])
"""How a sealed journal begins; a run killed before its first case has nothing frozen to name."""

Hashes = Mapping[str, str]
"""Path and SHA-256 of every file below `data`, as they are now."""


def content_findings(folder: Path, reading: JournalReading, hashes: Hashes) -> Iterator[Finding]:
    """Rederive everything that the package claims, and yield every difference.

    Args:
        folder: the run's folder.
        reading: its journal.
        hashes: path and SHA-256 of every file below `data`, as they are now.
    """
    sources = Sources(folder=folder, reading=reading)
    for look in (
        _journal_findings,
        _info_findings,
        _file_findings,
        _introduced_findings,
        _begun_findings,
        _repeated_findings,
        _results_findings,
        _source_findings,
        _recording_findings,
        _attachment_findings,
        _check_findings,
    ):
        yield from guarded(partial(look, sources, hashes))


def frozen_findings(folder: Path, reading: JournalReading, hashes: Hashes) -> Iterator[Finding]:
    """Yield what the journal's first and last lines contradict: its shape, and hashes of files; nothing is rederived.

    Args:
        folder: the run's folder.
        reading: at least the first two and the last two lines of its journal.
        hashes: path and SHA-256 of every file below `data`.
    """
    sources = Sources(folder=folder, reading=reading)
    for look in (_shape_findings, _file_findings, _begun_findings):
        yield from guarded(partial(look, sources, hashes))


def guarded(look: Callable[[], Iterator[Finding]], path: str = "data") -> Iterator[Finding]:
    """Turn whatever exception hostile content causes in a check into a finding, at the path of what is checked."""
    try:
        yield from look()
    except DamagedFile as error:
        yield error.finding
    except OSError as error:
        yield Finding(path, 0, 0, f"cannot be checked: {error.strerror or error}")
    except Exception as error:  # noqa: BLE001 - hostile content may raise anything
        what = error.message if isinstance(error, HilError) else f"{type(error).__name__}: {error}"
        yield Finding(path, 0, 0, f"cannot be checked: {what}")


def _shape_findings(sources: Sources, _: Hashes) -> Iterator[Finding]:
    yield from sources.reading.findings
    if sources.reading.torn:
        yield Finding(JOURNAL, 0, 0, "the last line is incomplete")
    kinds = [type(event) for event in sources.reading.events]
    if kinds[:1] != [Run] or kinds[-2:] != [Results, End] or kinds.count(Results) != 1:
        yield Finding(JOURNAL, 0, 0, "expected the event run first, and results and end last, each once")


def _journal_findings(sources: Sources, hashes: Hashes) -> Iterator[Finding]:
    yield from _shape_findings(sources, hashes)
    for line in sources.reading.lines:
        if not line.canonical:
            yield Finding(JOURNAL, line.number, 1, "not canonical JSON")
    yield from clock_findings(sources.reading.lines)


def _info_findings(sources: Sources, _: Hashes) -> Iterator[Finding]:
    """Compare `bag-info.txt` with what a seal writes, line by line; the check of tag files reports a missing one."""
    try:
        text = read_plain(sources.folder / INFO).decode("utf-8", errors="replace")
    except FileNotFoundError:
        return
    if not sources.reading.lines:
        yield Finding(INFO, 0, 0, "cannot be checked: the journal has no events")
        return
    due = info_of(sources.folder, identifier_of(text), sources.reading).decode()
    for number, (line, right) in enumerate(zip_longest(text.split("\n"), due.split("\n"), fillvalue=""), 1):
        if line != right:
            name = (right or line).partition(":")[0]
            values = (shown(each.partition(": ")[2]) or "missing" for each in (line, right))
            text = "field '{}' is {}, and journal and files give {}".format(shown(name), *values)
            yield Finding(INFO, number, 1, text)


def _file_findings(sources: Sources, hashes: Hashes) -> Iterator[Finding]:
    """Compare every file with the journal, which names what was frozen first, and the whole folder at its end."""
    if [type(event) for event in sources.reading.events[:2]] not in _HEAD:
        yield Finding(JOURNAL, 0, 0, "its second event does not name what was frozen")
    later = {event.file: event.sha256 for event in sources.reading.events if isinstance(event, FrozenLater)}
    frozen = {**frozen_files(sources.reading.lines), **later}
    for path, digest in frozen.items():
        if hashes.get(path) != digest:
            when = "when it was first used" if path in later else "before the first step"
            what = f"it is not what was frozen {when}" if path in hashes else "what was frozen is missing"
            yield Finding(shown(path), 0, 0, what)
    if not _has_end(sources.reading):
        yield Finding(
            JOURNAL, 0, 0, "its last event does not name the files: they were compared with the manifest only"
        )
        return
    ended = _hashes_at_end(sources.reading)
    for path in sorted({*ended, *filter(is_named, hashes)} - {*frozen}):
        if path not in hashes:
            yield Finding(shown(path), 0, 0, "the journal names it, and it is missing")
        elif path not in ended:
            yield Finding(shown(path), 0, 0, "the journal does not name it")
        elif hashes[path] != ended[path]:
            yield Finding(shown(path), 0, 0, "it is not the file that the journal names")


def _has_end(reading: JournalReading) -> bool:
    return bool(reading.lines) and isinstance(reading.lines[-1].event, End)


def _hashes_at_end(reading: JournalReading) -> Mapping[str, str]:
    """Return the hashes of files in the journal's last event.

    Raises:
        EvidenceError: if it has none.
    """
    last = reading.lines[-1] if reading.lines else None
    if last is None or not isinstance(last.event, End):
        raise EvidenceError("the journal has no end that names the files")
    return _hashes(last.wall.get("files"), "end")


def frozen_files(lines: Iterable[JournalLine]) -> dict[str, str]:
    """Return path and SHA-256 of the files frozen before the first step.

    Raises:
        EvidenceError: if the event does not name them.
    """
    began = [(line.event, line.wall) for line in lines]
    named = [part for event, wall in began if isinstance(event, Frozen) for part in (event.files, wall.get("files"))]
    return {path: digest for files in named for path, digest in _hashes(files, "frozen").items()}


def _hashes(files: Any, kind: str) -> Mapping[str, str]:  # noqa: ANN401 - whatever a journal holds
    if not isinstance(files, dict) or not all(isinstance(digest, str) for digest in files.values()):
        raise EvidenceError(f"the event {kind} does not name files with their hashes")
    return files


def _introduced_findings(sources: Sources, hashes: Hashes) -> Iterator[Finding]:
    yield from introduced_findings(sources.reading, hashes)


def _begun_findings(sources: Sources, hashes: Hashes) -> Iterator[Finding]:
    run = sources.state.run
    if run is None:
        return
    for field, path in (("catalogue", CATALOGUE), ("parameters", PARAMETERS), ("calibration", CALIBRATION)):
        if getattr(run, field, None) != hashes.get(path):
            yield Finding(path, 0, 0, f"this is not the {field} that the run started with")


def _repeated_findings(sources: Sources, _: Hashes) -> Iterator[Finding]:
    """Compare facts recorded twice; a run killed before anything was frozen has used none of them."""
    run = sources.state.run
    if run is not None and any(isinstance(event, Frozen) for event in sources.reading.events):
        for look, path in LOOKS:
            yield from guarded(partial(look, sources, run), path)


def named_results(reading: JournalReading, hashes: Hashes) -> Iterator[Finding]:
    """Yield a finding if the results, or the guardian's journal, are not those that the journal names.

    Missing results are reported elsewhere.

    Args:
        reading: at least the last two lines of the journal.
        hashes: path and SHA-256 of every file below `data`.
    """
    named = next((event for event in reversed(reading.events) if isinstance(event, Results)), None)
    if named is not None and named.sha256 != hashes.get(RESULTS, named.sha256):
        yield Finding(RESULTS, 0, 0, "it is not the file that the journal's event results names")
    if named is not None and named.guardian and named.guardian != hashes.get(GUARDIAN):
        yield Finding(GUARDIAN, 0, 0, "it is not the guardian's journal that the journal's event results names")


def _results_findings(sources: Sources, hashes: Hashes) -> Iterator[Finding]:
    """Compare the results with those derived from journal and frozen catalogue, field by field."""
    yield from named_results(sources.reading, hashes)
    if sources.reading.findings or sources.reading.torn or not _has_end(sources.reading):
        yield Finding(RESULTS, 0, 0, "cannot be compared with the journal, which is damaged")
        return
    sealed = read_plain(sources.folder / RESULTS) if RESULTS in hashes else None
    derived = sources.results(_format(sealed or b""))
    named = sources.state.results
    if named is not None and named.verdict is not derived.verdict:
        line = next(line.number for line in sources.reading.lines if line.event is named)
        yield Finding(JOURNAL, line, 1, f"field 'verdict' is {named.verdict}, and the journal gives {derived.verdict}")
    if sealed is None or is_outcome(sealed, derived) or sealed == (due := write_outcome(derived)):
        return
    try:
        found = parse_strict(sealed)
    except JsonError as error:
        yield Finding(RESULTS, error.line, error.column, error.bare)
        return
    sentences = list(_differences(without_sentences(found), without_sentences(parse_strict(due))))
    if not sentences and canonical(found) == sealed:
        return
    for sentence in sentences[:_MOST_FIELDS] or ["not canonical JSON"]:
        yield Finding(RESULTS, 1, 1, sentence)
    if more := sentences[_MOST_FIELDS:]:
        yield Finding(RESULTS, 1, 1, f"{len(more)} more fields are not what the journal gives")


_MOST_FIELDS = 20
_WITH_CONDITIONS = 3
"""First format of results that lists what was proven; before, not every run on hardware could be recognised."""
_LONGEST_VALUE = 60


def _differences(found: object, due: object, place: str = "") -> Iterator[str]:
    """Yield a sentence for every field of the results that does not follow from the journal."""
    name = f"field '{shown(place)}'" if place else "it"
    if isinstance(found, dict) and isinstance(due, dict):
        for key in sorted(found.keys() | due.keys()):
            inner = f"{place}.{key}" if place else key
            if key in found and key in due:
                yield from _differences(found[key], due[key], inner)
            else:
                yield f"field '{shown(inner)}' {'is missing' if key in due else 'is not what the journal gives: none'}"
    elif isinstance(found, list) and isinstance(due, list) and len(found) == len(due):
        for index, (each, right) in enumerate(zip(found, due, strict=True)):
            yield from _differences(each, right, f"{place}[{index}]")
    elif isinstance(found, list) and isinstance(due, list):
        yield f"{name} has {len(found)} entries, and the journal gives {len(due)}"
    elif type(found) is not type(due) or found != due:
        yield f"{name} is {_in_short(found)}, and the journal gives {_in_short(due)}"


def _in_short(value: object) -> str:
    text = canonical(value).decode()
    return shown(text if len(text) <= _LONGEST_VALUE else f"{text[:_LONGEST_VALUE]}...")


def _format(results: bytes) -> int:
    """Return the format that results declare; the newest if they declare none."""
    try:
        form = msgspec.json.decode(results, type=_Head).format
    except (msgspec.MsgspecError, UnicodeDecodeError):
        return FORMAT
    return form if 0 < form <= FORMAT else FORMAT


class _Head(msgspec.Struct, frozen=True):
    """The part of results that is read before anything in them is believed."""

    format: int


def _source_findings(sources: Sources, _: Hashes) -> Iterator[Finding]:
    """Compare a run declared as hardware with its journal and its frozen files; not for older formats."""
    results = read_plain(sources.folder / RESULTS) if (sources.folder / RESULTS).exists() else b""
    state = sources.state
    if state.run is None or state.run.source is not Source.HARDWARE or _format(results) < _WITH_CONDITIONS:
        return
    for why in against_hardware(state, sources.facts):
        yield Finding(JOURNAL, 1, 1, f"field 'source' is hardware, but {why}")


def _recording_findings(sources: Sources, hashes: Hashes) -> Iterator[Finding]:
    """Compare rows with the journal's hashes; a file that the run did not write is not even opened."""
    written = _hashes_at_end(sources.reading) if _has_end(sources.reading) else hashes
    state = sources.state
    for identifier, claim in state.rows.items():
        path = f"{RECORDINGS}/{identifier}.h5"
        ended = state.ended.get(identifier)
        if ended is None:
            yield Finding(shown(path), 0, 0, "the journal has no end of this recording")
        elif path not in hashes:
            yield Finding(shown(path), 0, 0, "the recording is missing")
        elif hashes[path] == written.get(path):
            yield from guarded(partial(_row_findings, sources.folder, path, claim, ended.rows), shown(path))
            if (begun := state.recordings.get(identifier)) is not None:
                yield from guarded(partial(_fact_findings, sources.folder / path, begun, ended), shown(path))


def _fact_findings(path: Path, begun: Recording, ended: RecordingEnd) -> Iterator[Finding]:
    for text in differing_facts(path, begun=begun, ended=ended):
        yield Finding(f"{RECORDINGS}/{path.name}", 0, 0, shown(text))


def _row_findings(folder: Path, path: str, claim: Mapping[int, str], rows: int) -> Iterator[Finding]:
    """Compare the rows with every hash in the journal; one more row is requested, and must not exist."""
    *found, (there, _) = hashes_of(folder / path, [*claim, max(claim) + 1])
    if there != rows:
        yield Finding(path, 0, 0, f"it has {there} rows, and the journal {rows}")
    for due, (count, digest) in zip(sorted(claim), found, strict=True):
        if count != due or digest != claim[due]:
            yield Finding(path, 0, 0, f"its first {due} rows are not those that the journal names")


def _attachment_findings(sources: Sources, hashes: Hashes) -> Iterator[Finding]:
    given = [(each.file, each.sha256) for each in sources.state.given]
    for file, digest in [*((each.file, each.sha256) for each in sources.state.attachments), *given]:
        path = f"{ATTACHMENTS}/{file}"
        if hashes.get(path) != digest:
            yield Finding(shown(path), 0, 0, "this is not the attachment that the journal names")


def _check_findings(sources: Sources, _: Hashes) -> Iterator[Finding]:
    catalogue = sources.facts.catalogue
    for line in sources.reading.lines:
        if isinstance(line.event, Check):
            yield from guarded(partial(_of_check, line.number, line.event, catalogue), f"{JOURNAL}:{line.number}")


def _of_check(line: int, check: Check, catalogue: Catalogue) -> Iterator[Finding]:
    for message in judge_again(check, catalogue):
        yield Finding(JOURNAL, line, 1, message)
