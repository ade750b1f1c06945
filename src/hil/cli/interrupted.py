"""What can be done with a run that was interrupted, by a glance at its journal."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from hil.evidence.folder import JOURNAL

__all__ = ["ways_on"]

_TAIL = 1 << 20
"""Bytes at a journal's end in which its last events stand, if it has come to them."""


def ways_on(folder: Path) -> Iterator[str]:
    """Yield what a person does next, a line each; no more is offered than the run's journal allows.

    The whole journal is not read, because that of weeks is long: nothing is verified here.

    Args:
        folder: the run's folder, whose process has ended.
    """
    yield f"look after the bench first; then see how far it came with: hil status {folder.name}"
    seal = f"seal it as it is with: hil seal {folder}"
    try:
        why_not = _why_not_resumed(folder / JOURNAL)
    except OSError:
        why_not = "its journal cannot be read"
    if why_not:
        yield f"it cannot be gone on with, {why_not}; {seal}"
    else:
        yield f"go on with it with: hil resume {folder}"
        yield f"or {seal}"


def _why_not_resumed(journal: Path) -> str:
    """Return why a run cannot be resumed, nothing where it can.

    One on a bench of its own process is made again from its first step; any other bench needs a case to enter it at.
    """
    live = planned = began = False
    with journal.open("rb") as lines:
        for line in lines:
            live = live or (b'"kind":"run"' in line and b'"live":{' in line)
            planned = planned or b'"kind":"planned"' in line
            if began := b'"kind":"case"' in line:
                break
        lines.seek(0, os.SEEK_END)
        lines.seek(max(0, lines.tell() - _TAIL))
        last = lines.readlines()
    if any(b'"kind":"results"' in line for line in last):
        return "because it has ended and only its seal is missing"
    if any(b'"kind":"stop"' in line and b'"resumable":true' not in line for line in last):
        return "because it was stopped for good"
    return "" if planned and (began or not live) else "because no case had begun"
