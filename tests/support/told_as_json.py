"""Events and results as the JSON of the package, for tests that look at its files and not at types."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from hil.documents.canonical import JsonError, parse_strict
from hil.evidence.events.codec import plain
from hil.evidence.folder import RESULTS
from hil.evidence.journal.reader import JournalReading
from hil.evidence.package.contents import Package
from hil.evidence.results.outcome import Outcome, read_outcome, write_outcome

__all__ = ["bodies", "results_as_json"]


def bodies(source: Package | JournalReading, *kinds: str) -> tuple[dict[str, Any], ...]:
    """Return the bodies of the events of a journal, or of those of some kinds; of a package those that stand."""
    return tuple(plain(event) for event in source.events if not kinds or event.kind() in kinds)


def results_as_json(source: Package | Outcome) -> dict[str, Any]:
    """Return the results of a package as `data/results.json` has them."""
    if isinstance(source, Outcome):
        return dict(parse_strict(write_outcome(source)))
    path = source.folder / RESULTS
    if source.cut_short or not path.exists():  # a format of the future is refused here
        return results_as_json(source.outcome())
    try:
        return dict(_read(path.read_bytes()))
    except JsonError:  # in the words of the package
        return results_as_json(source.outcome())


@lru_cache(maxsize=4)
def _read(data: bytes) -> dict[str, Any]:
    """Read results once, though many tests of a module look at those of the same run."""
    return dict(parse_strict(write_outcome(read_outcome(data))))
