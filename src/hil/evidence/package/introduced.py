"""Origin of a package's files: the event of the journal that introduced each; a file without one is no evidence."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from hil.evidence.durable import PART, sha256_of, sync_folder
from hil.evidence.events import Acknowledged, End, Event, Frozen, FrozenLater, Gate, Recovered, Results, Resumed, Run
from hil.evidence.folder import (
    ATTACHMENTS,
    GUARDIAN,
    JOURNAL,
    RECORDINGS,
    REGISTERS,
    REPORT,
    REPORT_FILES,
    RESULTS,
    TORN,
    TRANSCRIPT,
)
from hil.evidence.journal.reader import JournalReading
from hil.evidence.package.bag import is_named, payload_of
from hil.evidence.package.listing import list_folder, shown
from hil.evidence.state import fold
from hil.model.errors import Finding

__all__ = ["ASIDE", "introduced_findings", "lost_files", "set_aside", "strangers"]

ASIDE = ".aside"
"""The folder beside the packages for files that were in a run's folder and are no evidence."""

_FROZEN = (
    "data/bench/",
    "data/catalogue/",
    f"{REGISTERS}/",
    "data/packages/",
    "data/sources/",
    "data/dut.json",
    "data/place.json",
    "data/software.json",
)
"""Files frozen before the first event; a run killed before the second event has no others."""

_SHORT = 12


def strangers(reading: JournalReading, files: Iterable[str]) -> Iterator[str]:
    """Yield the files below `data` that no event introduced.

    Args:
        reading: the run's journal.
        files: paths below the run's folder.
    """
    here = tuple(files)
    known = set(_introduced(reading)) | {f"{REPORT}/{name}" for name in REPORT_FILES}
    for name in fold(reading.events).recordings:
        if f"{RECORDINGS}/{name}.h5" not in here:  # kept, because its samples were not those that the journal names
            known.add(f"{RECORDINGS}/{name}.rows")
    frozen = not any(isinstance(event, Frozen) for event in reading.events)
    for path in payload_of(here):
        if path not in known and not (frozen and path.startswith(_FROZEN)):
            yield path


def introduced_findings(reading: JournalReading, hashes: Iterable[str]) -> Iterator[Finding]:
    """Yield a finding for every sealed file that no event introduced; files added later are reported elsewhere."""
    named = _named_at_end(reading)
    if reading.findings or named is None:
        return  # the events are unknown
    for path in strangers(reading, (path for path in hashes if path in named or not is_named(path))):
        yield Finding(shown(path), 0, 0, "no event of the journal introduced this file")


def lost_files(folder: Path, reading: JournalReading, *, read: bool = True) -> Iterator[Finding]:
    """Yield a finding for every file named at the end of a journal that is now missing or different.

    A run whose process ended between that and the seal has lost none; an incomplete copy has.

    Args:
        folder: the run's folder.
        reading: its journal; without its `end` nothing is named.
        read: whether the files are compared with their hashes.
    """
    there = {*list_folder(folder).files}
    for path, digest in sorted((_named_at_end(reading) or {}).items()):
        if path not in there:
            yield Finding(shown(path), 0, 0, "the journal names it, and it is missing")
        elif read and sha256_of(folder / path) != digest:
            yield Finding(shown(path), 0, 0, "it is not the file that the journal names")


def _named_at_end(reading: JournalReading) -> Mapping[str, str] | None:
    last = reading.lines[-1] if reading.lines else None
    named = last.wall.get("files") if last and isinstance(last.event, End) else None
    return named if isinstance(named, dict) else None


def set_aside(folder: Path, reading: JournalReading) -> list[str]:
    """Move files that no event introduced out of a run's folder before its seal; return a sentence for each.

    Nothing is lost: they go to the folder `.aside` beside the run's, below the run's name.

    Raises:
        OSError: if a file cannot be moved.
    """
    notices = []
    waiting = [path for path in list_folder(folder).files if not path.endswith(PART)]
    for path in strangers(reading, waiting):
        size, digest = (folder / path).stat().st_size, sha256_of(folder / path)
        place = _free(folder.parent / ASIDE / folder.name / path)
        place.parent.mkdir(parents=True, exist_ok=True)
        (folder / path).rename(place)
        sync_folder(place.parent)
        notices.append(
            f"{shown(path)}: no event introduced this file ({size} bytes, SHA-256 {digest[:_SHORT]}...); it is no"
            f" evidence, and was set aside in {shown(place.relative_to(folder.parent).as_posix())}"
        )
    return notices


def _free(place: Path) -> Path:
    """Return an unused path: an earlier seal may have set a file of this name aside."""
    number = 1
    while (found := place if number == 1 else place.with_name(f"{place.name}.{number}")).exists():
        number += 1
    return found


def _introduced(reading: JournalReading) -> Iterator[str]:
    """Yield every path below `data` that an event introduced."""
    yield JOURNAL
    for line in reading.lines:
        event = line.event
        if isinstance(event, Frozen):
            beside = line.wall.get("files")
            yield from (*event.files, *(beside if isinstance(beside, dict) else ()))
    state = fold(reading.events)
    yield from (f"{RECORDINGS}/{name}.h5" for name in state.recordings)
    yield from (f"{ATTACHMENTS}/{event.file}" for event in state.attachments)
    yield from (f"{ATTACHMENTS}/{given.file}" for given in state.given)
    yield from _with_own_event(reading.events)


def _with_own_event(events: Sequence[Event]) -> Iterator[str]:
    """Yield the files that have an event of their own."""
    for event in events:
        match event:
            case Run():
                yield TRANSCRIPT
                if event.live is not None:
                    yield GUARDIAN
            case FrozenLater():
                yield event.file
            case Gate() if event.name.partition(":")[0] == "guardian":
                yield GUARDIAN
            case Acknowledged() if event.guardian:
                yield GUARDIAN
            case Recovered() | Resumed() if event.torn_bytes:
                yield TORN
            case Results():
                yield RESULTS
