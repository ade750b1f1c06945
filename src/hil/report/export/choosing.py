"""Which recordings of a package a person means."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from hil.documents.suggest import did_you_mean
from hil.evidence.package.listing import shown
from hil.model.errors import Refused

__all__ = ["choose"]

Begun = Mapping[str, Any]
"""The body of a `recording` event."""

_LISTED = 12


def choose(begun: Sequence[Begun], recordings: Sequence[str], cases: Sequence[str]) -> tuple[Begun, ...]:
    """Return the recordings that are asked for, in the order of the run.

    Args:
        begun: the bodies of all `recording` events.
        recordings: ids or names; a name means every recording that has it; all recordings where it is empty.
        cases: cases as the procedure shows them, what stands behind their `::`, or that without its parameters; all
            cases, and what was recorded outside of cases, where it is empty.

    Raises:
        Refused: for a word that fits none, and where nothing is left.
    """
    if not begun:
        raise Refused("the package has no recordings", "hil report tells what is in it")
    chosen = _fitting(begun, recordings, "recording", _words_of_recording)
    for case in cases:
        _fitting(begun, [case], "case with recordings", _words_of_case)
    both = tuple(one for one in chosen if not cases or not _words_of_case(one).isdisjoint(cases))
    if not both:
        raise Refused("none of these recordings was taken in these cases", "leave out --case or --recording")
    return both


def _fitting(
    begun: Sequence[Begun], asked: Sequence[str], what: str, words: Callable[[Begun], set[str]]
) -> list[Begun]:
    known = list(dict.fromkeys(word for one in begun for word in sorted(words(one))))
    for word in asked:
        if word not in known:
            listed = ", ".join(shown(word) for word in known[:_LISTED]) or "none"
            more = f" and {len(known) - _LISTED} more" if len(known) > _LISTED else ""
            message = shown(f"there is no {what} '{word}'{did_you_mean(word, known)}")
            raise Refused(message, f"there are {listed}{more}")
    return [one for one in begun if not asked or not words(one).isdisjoint(asked)]


def _words_of_recording(begun: Begun) -> set[str]:
    return {begun["recording"], begun["name"]}


def _words_of_case(begun: Begun) -> set[str]:
    if begun["case"] is None:
        return set()
    name = begun["case"].rpartition("::")[2]
    return {begun["case"], name, name.partition("[")[0]}
