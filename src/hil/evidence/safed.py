"""Runs that the guardian ended: which those are, what it wrote down, and who has acknowledged it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hil.documents.canonical import JsonError, parse_strict
from hil.evidence.durable import read_plain, sha256_of
from hil.evidence.events import Acknowledged, End, Event
from hil.evidence.folder import GUARDIAN, JOURNAL
from hil.evidence.inbox import peek
from hil.evidence.journal.reader import read_journal
from hil.model.errors import EvidenceError

__all__ = ["guardian_hash", "guardian_lines", "is_acknowledged", "was_safed"]

_LARGEST = 20_000_000


def guardian_hash(folder: Path) -> str:
    """Return the SHA-256 of the guardian's journal; empty if it did nothing in this run, or cannot be read."""
    path = folder / GUARDIAN
    try:
        return sha256_of(path) if path.stat().st_size else ""
    except OSError:
        return ""


def guardian_lines(folder: Path) -> tuple[dict[str, Any], ...]:
    """Return what the guardian wrote down, line by line; a line that is none is given as its text."""
    try:
        data = read_plain(folder / GUARDIAN, _LARGEST)
    except OSError:
        return ()
    return tuple(_line(line) for line in data.splitlines() if line.strip())


def was_safed(folder: Path, events: Sequence[Event]) -> bool:
    """Return whether the guardian ended a run that is not sealed, and nobody has resumed it since.

    Its journal holds then no acknowledgement of the guardian's as that stands now: it is written down first of all
    when the run is resumed.
    """
    if not (seen := guardian_hash(folder)):
        return False
    return not any(isinstance(event, End) or _acknowledges(event, seen) for event in events)


def is_acknowledged(folder: Path) -> bool:
    """Return whether somebody has acknowledged all that the guardian did in a run, or it did nothing.

    An acknowledgement names the guardian's journal by its hash, so that it does not hold for what comes later.
    """
    if not (seen := guardian_hash(folder)):
        return True
    if any(message.kind == "ack" and message.sha256 == seen for message in peek(folder)):
        return True
    try:
        events = read_journal(folder / JOURNAL).events
    except EvidenceError:
        return False
    return any(_acknowledges(event, seen) for event in events)


def _acknowledges(event: Event, seen: str) -> bool:
    return isinstance(event, Acknowledged) and event.guardian == seen


def _line(line: bytes) -> dict[str, Any]:
    try:
        found = parse_strict(line)
    except JsonError:
        found = None
    return found if isinstance(found, dict) else {"text": line.decode(errors="replace")}
