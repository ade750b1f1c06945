"""Events and results as the JSON of the package, for tests that look at its files and not at types."""

from __future__ import annotations

from typing import Any

from hil.documents.canonical import parse_strict
from hil.evidence.events.codec import plain
from hil.evidence.journal.reader import JournalReading
from hil.evidence.package.contents import Package
from hil.evidence.results.outcome import Outcome, write_outcome

__all__ = ["bodies", "results_as_json"]


def bodies(source: Package | JournalReading, *kinds: str) -> tuple[dict[str, Any], ...]:
    """Return the bodies of the events of a journal, or of those of some kinds; of a package those that stand."""
    return tuple(plain(event) for event in source.events if not kinds or event.kind() in kinds)


def results_as_json(source: Package | Outcome) -> dict[str, Any]:
    """Return the results of a package as `data/results.json` has them."""
    outcome = source if isinstance(source, Outcome) else source.outcome()
    return dict(parse_strict(write_outcome(outcome)))
