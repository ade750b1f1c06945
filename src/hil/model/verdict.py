"""Verdicts and their order of severity."""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum

__all__ = ["NO_CHECK", "Verdict", "worst"]

NO_CHECK = " got no check of "
"""Text in a reason between a requirement and its unchecked parameters."""


class Verdict(StrEnum):
    """Verdict of a check, a case or a requirement; declared from best to worst."""

    RECORDED = "RECORDED"
    PASS = "PASS"  # noqa: S105 - a verdict, not a password
    INCONCLUSIVE = "INCONCLUSIVE"
    NOT_RUN = "NOT_RUN"
    NOT_EVALUATED = "NOT_EVALUATED"
    FAIL = "FAIL"
    ABORTED = "ABORTED"
    ERROR = "ERROR"

    @property
    def good(self) -> bool:
        """Whether this verdict supports a requirement at all."""
        return self in {Verdict.PASS, Verdict.RECORDED}


_SEVERITY = {verdict: rank for rank, verdict in enumerate(Verdict)}


def worst(verdicts: Iterable[Verdict]) -> Verdict:
    """Return the worst of the verdicts; without any it is NOT_EVALUATED, never a pass."""
    return max(verdicts, key=_SEVERITY.__getitem__, default=Verdict.NOT_EVALUATED)
