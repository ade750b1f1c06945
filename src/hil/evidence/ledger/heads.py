"""Journal heads in the ledger: a journal that is shorter, or does not match, was truncated or rewritten."""

from __future__ import annotations

from pathlib import Path

from hil.evidence.journal.reader import JournalReading
from hil.evidence.ledger.book import Ledger, read
from hil.evidence.ledger.entries import Head
from hil.model.errors import Refused

__all__ = ["cut_or_rewritten", "require_uncut"]

_HINT = "keep the folder as it is, and find out who changed it; the run is repeated as a new one"


def require_uncut(folder: Path, reading: JournalReading, what: str, ledger: Ledger | None = None) -> None:
    """Require that a journal holds every event up to its latest head in the ledger of its folder of reports.

    Args:
        folder: the run's folder.
        reading: its journal, whose chain is whole.
        what: the intended operation on the run, such as `resume`.
        ledger: the ledger, if it was read already.

    Raises:
        Refused: if it is shorter, or has a different event anywhere.
        EvidenceError: if the ledger exists and cannot be read.
    """
    if problem := cut_or_rewritten(folder, reading, ledger):
        raise Refused(f"{folder.name}: cannot {what}: {problem}", _HINT)


def cut_or_rewritten(folder: Path, reading: JournalReading, ledger: Ledger | None = None) -> str:
    """Return how a journal, whose chain is whole, contradicts its heads in the ledger; empty if it does not.

    Raises:
        EvidenceError: if the ledger exists and cannot be read.
    """
    heads = (ledger or read(folder.parent)).of(Head, folder.name)
    count = len(reading.lines)
    for seen in sorted(heads, key=lambda each: -each.events):
        if count < seen.events:
            return f"the journal has {count} events, and the ledger saw event {seen.events} on {seen.utc}: it was cut"
        if reading.lines[seen.events - 1].sha256 != seen.sha256:
            return (
                f"event {seen.events} of the journal is not the one that the ledger saw on {seen.utc}: it was rewritten"
            )
    return ""
