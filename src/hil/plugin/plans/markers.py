"""The markers that a case can have."""

from __future__ import annotations

__all__ = ["KNOWN", "MARKERS"]

MARKERS = (
    "requirement(id, ...): the requirements that this case verifies",
    "max_duration(seconds): bench time after which this case is an ERROR (default: one hour)",
    "repeatable(reason): an attempt of this case that an interruption left without a verdict does not count",
)
"""The markers of `hil`, in pytest's form."""

KNOWN = (*(each.partition("(")[0] for each in MARKERS), "parametrize", "skip", "skipif", "usefixtures", "xfail")
"""The names of all markers that a case can have."""
