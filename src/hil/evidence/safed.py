"""Runs ended by the guardian: which they are, what it logged, and whether that is acknowledged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hil.documents.canonical import JsonError, parse_strict
from hil.evidence.durable import read_plain, sha256_of
from hil.evidence.events import Acknowledged, End, Event, Resumed
from hil.evidence.folder import GUARDIAN, JOURNAL
from hil.evidence.inbox import peek
from hil.evidence.journal.reader import read_journal
from hil.model.errors import EvidenceError

__all__ = ["LastAct", "guardian_hash", "guardian_lines", "is_acknowledged", "last_act", "was_safed"]

_LARGEST = 20_000_000


@dataclass(frozen=True, slots=True)
class LastAct:
    """The guardian's last act, from its journal.

    Attributes:
        since: when it began, UTC.
        unproven: the outputs not proven safe by the last queries; None if that is not on record.
        proven: the outputs that were proven safe so far.
        proves: whether it guarded any output.
        finished: whether it had finished, and was no longer retrying.
        trying: whether it had reported that it keeps retrying.
        pid: its process, 0 if that is not on record.
    """

    since: str
    unproven: tuple[str, ...] | None
    proven: tuple[str, ...]
    proves: bool
    finished: bool
    trying: bool
    pid: int

    @property
    def safe(self) -> bool:
        """Whether every output was proven safe in the end."""
        return self.finished and self.proves and self.unproven == ()


def last_act(lines: Sequence[dict[str, Any]]) -> LastAct | None:
    """Return the last act in the guardian's journal, None if it never acted.

    Args:
        lines: as `guardian_lines` returns them.
    """
    starts = [place for place, line in enumerate(lines) if line.get("event") == "acting"]
    if not starts:
        return None
    act = lines[starts[-1] :]
    by_event = {str(line.get("event")): line for line in act}
    done, trying = by_event.get("done"), by_event.get("trying")
    concluded = done or trying
    unproven = None if concluded is None else _unproven(act[act.index(concluded) :])
    return LastAct(
        since=str(act[0].get("utc", "")),
        unproven=unproven,
        proven=tuple(output for output, ok in _proofs(act).items() if ok),
        proves=done is None or bool(done.get("proven", any(line.get("event") == "proof" for line in act))),
        finished=done is not None,
        trying=trying is not None,
        pid=trying["pid"] if trying and isinstance(trying.get("pid"), int) else 0,
    )


def _unproven(lines: Sequence[dict[str, Any]]) -> tuple[str, ...]:
    """Return the outputs that are not proven safe, by a line that names them and the proofs after it."""
    named = lines[0].get("unproven")
    states = dict.fromkeys(map(str, named), False) if isinstance(named, list) else {}
    return tuple(output for output, ok in (states | _proofs(lines)).items() if not ok)


def _proofs(lines: Sequence[dict[str, Any]]) -> dict[str, bool]:
    """Return, for each output that was queried, whether the last query proved it safe."""
    return {str(line.get("output")): line.get("ok") is True for line in lines if line.get("event") == "proof"}


def guardian_hash(folder: Path) -> str:
    """Return the SHA-256 of the guardian's journal; empty if it did nothing in this run, or cannot be read."""
    path = folder / GUARDIAN
    try:
        return sha256_of(path) if path.stat().st_size else ""
    except OSError:
        return ""


def guardian_lines(folder: Path) -> tuple[dict[str, Any], ...]:
    """Return the lines of the guardian's journal; a malformed line is returned as its text."""
    try:
        data = read_plain(folder / GUARDIAN, _LARGEST)
    except OSError:
        return ()
    return tuple(_line(line) for line in data.splitlines() if line.strip())


def was_safed(folder: Path, events: Sequence[Event]) -> bool:
    """Return whether the guardian ended an unsealed run and proved it safe, and it has not been resumed since.

    A run with an unproven output counts as interrupted only.

    A resumed run's journal names the guardian's journal as it is now, before the bench is armed. What is driven after
    that is not what the guardian proved safe.
    """
    if not (seen := guardian_hash(folder)):
        return False
    act = last_act(guardian_lines(folder))
    if act is None or not act.safe:
        return False
    return not any(isinstance(event, End) or _acknowledges(event, seen) or _resumes(event, seen) for event in events)


def is_acknowledged(folder: Path) -> bool:
    """Return whether everything that the guardian did in a run has been acknowledged; True if it did nothing.

    An acknowledgement names the guardian's journal by its hash, so that it does not cover later acts.
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


def _resumes(event: Event, seen: str) -> bool:
    return isinstance(event, Resumed) and event.guardian == seen


def _line(line: bytes) -> dict[str, Any]:
    try:
        found = parse_strict(line)
    except JsonError:
        found = None
    return found if isinstance(found, dict) else {"text": line.decode(errors="replace")}
