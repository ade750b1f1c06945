"""What the guardian did to the bench of a run, from its own journal."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from hil.documents.canonical import JsonError, parse_strict
from hil.report.material import Body, flag, text, texts
from hil.report.numbers import duration
from hil.report.page.view import Happening

__all__ = ["guarded"]


def guarded(journal: str) -> Iterator[Happening]:
    """Yield each time that the guardian acted, with why, how soon, and what it could not prove.

    Args:
        journal: its journal as text, one JSON object a line; a line that is none is left out.
    """
    acts: list[list[Body]] = []
    for line in _lines(journal):
        if text(line, "event") == "acting":
            acts.append([line])
        elif acts:
            acts[-1].append(line)
    for act in acts:
        yield Happening(at=text(act[0], "utc"), kind="guardian", case=None, text=_told(act))


def _lines(journal: str) -> Iterator[Body]:
    for line in journal.splitlines():
        try:
            told = parse_strict(line.encode())
        except JsonError:
            continue
        if isinstance(told, dict):
            yield told


def _told(act: list[Body]) -> str:
    named = {kind: [line for line in act if text(line, "event") == kind] for kind in ("off", "first pass over", "done")}
    off = _outputs(line for line in named["off"] if flag(line, "ok"))
    seconds = [duration(line.get("seconds")) for line in named["first pass over"]]
    told = f"{text(act[0], 'why')}; it switched off {off or 'nothing'}{f' within {seconds[0]}' if seconds else ''}"
    if not named["done"]:
        return f"{told}; whether all was proven safe is not written down"
    unproven = ", ".join(texts(named["done"][0], "unproven"))
    proven = f"NOT proven safe: {unproven}" if unproven else "every output was proven safe"
    return f"{told}; {proven}; the bench was latched"


def _outputs(lines: Iterable[Body]) -> str:
    return ", ".join(dict.fromkeys(text(line, "output") for line in lines))
