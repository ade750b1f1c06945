"""Every file of a package is named in its journal: what was frozen when it began, the whole folder at its end."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from hil.evidence.durable import PART
from hil.evidence.events import End, Frozen, Recovered, Run
from hil.evidence.folder import JOURNAL, RECORDINGS, REPORT
from hil.evidence.journal.reader import JournalReading
from hil.evidence.package.bag import hash_payload
from hil.evidence.package.listing import shown
from hil.model.errors import EvidenceError, Finding

__all__ = ["file_findings", "hashes_at_end", "inventory", "remove_halves"]

_HEAD = ([Run, Frozen], [Run, Recovered])
"""How a sealed journal begins; a run that was killed before its first case has nothing frozen to name."""


def inventory(folder: Path) -> dict[str, str]:
    """Return path and SHA-256 of every file below `data` that is final before the journal's last event.

    The journal cannot name itself, nor the report, which prints the evidence digest; and it cannot hold a name that is
    no text: the run wrote no such file, and verification finds it.

    Raises:
        OSError: where a file cannot be read.
    """
    return {path: digest for path, digest in hash_payload(folder).items() if _is_named(path) and _is_text(path)}


def remove_halves(folder: Path) -> None:
    """Remove files that a killed process left half written."""
    for place in (folder, folder / "data", folder / RECORDINGS):
        for half in place.glob(f"*{PART}"):
            half.unlink()


def hashes_at_end(reading: JournalReading) -> Mapping[str, str]:
    """Return what the journal's last event says of the files.

    Raises:
        EvidenceError: where it says nothing.
    """
    last = reading.lines[-1] if reading.lines else None
    if last is None or not isinstance(last.event, End):
        raise EvidenceError("the journal has no end that names the files")
    return _hashes(last.wall.get("files"), "end")


def file_findings(reading: JournalReading, hashes: Mapping[str, str]) -> Iterator[Finding]:
    """Compare every file with the hashes in the journal.

    Args:
        reading: the journal of a sealed run.
        hashes: path and SHA-256 of every file below `data`, as they are now.
    """
    if [type(event) for event in reading.events[:2]] not in _HEAD:
        yield Finding(JOURNAL, 0, 0, "its second event does not name what was frozen")
    frozen = _frozen(reading)
    for path, digest in frozen.items():
        if hashes.get(path) != digest:
            what = "it is not what was frozen before the first step" if path in hashes else "what was frozen is missing"
            yield Finding(shown(path), 0, 0, what)
    ended = hashes_at_end(reading)
    for path in sorted({*ended, *filter(_is_named, hashes)} - {*frozen}):
        if path not in hashes:
            yield Finding(shown(path), 0, 0, "the journal names it, and it is missing")
        elif path not in ended:
            yield Finding(shown(path), 0, 0, "the journal does not name it")
        elif hashes[path] != ended[path]:
            yield Finding(shown(path), 0, 0, "it is not the file that the journal names")


def _frozen(reading: JournalReading) -> dict[str, str]:
    lines = [(line.event, line.wall) for line in reading.lines]
    named = [part for event, wall in lines if isinstance(event, Frozen) for part in (event.files, wall.get("files"))]
    return {path: digest for files in named for path, digest in _hashes(files, "frozen").items()}


def _hashes(files: Any, kind: str) -> Mapping[str, str]:  # noqa: ANN401 - whatever a journal holds
    if not isinstance(files, dict) or not all(isinstance(digest, str) for digest in files.values()):
        raise EvidenceError(f"the event {kind} does not name files with their hashes")
    return files


def _is_named(path: str) -> bool:
    return path != JOURNAL and not path.startswith(f"{REPORT}/")


def _is_text(path: str) -> bool:
    return not any("\ud800" <= letter <= "\udfff" for letter in path)
