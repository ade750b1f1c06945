"""The nearest known word, for errors about an unknown one."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

__all__ = ["did_you_mean", "nearest"]


_LONGEST = 100
"""Longer words are not compared: no known word is longer, and the cost is quadratic in the length."""


def nearest(word: str, known: Iterable[str]) -> str:
    """Return the known word nearest to `word`, or an empty string if none is near."""
    if len(word) > _LONGEST:
        return ""
    folded: dict[str, str] = {}
    for candidate in known:
        folded.setdefault(candidate.casefold(), candidate)
    matches = get_close_matches(word.casefold(), folded, n=1, cutoff=0.6)
    return folded[matches[0]] if matches else ""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return `, did you mean 'x'?` with the nearest known word, or an empty string."""
    match = nearest(word, known)
    return f", did you mean '{match}'?" if match else ""
