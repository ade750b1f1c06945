"""Acknowledgement of a latched bench: a named person says what was seen."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from hil.bench.lease import (
    ack_line,
    clear_latches_of,
    holds_a_lease,
    keepers_of_run,
    latches_of,
    require_clearable,
)
from hil.clock import wall
from hil.evidence.folder import JOURNAL, is_held, is_run, is_sealed
from hil.evidence.inbox import post
from hil.evidence.ledger.book import append
from hil.evidence.ledger.entries import Acknowledged as Entry
from hil.evidence.safed import guardian_hash, guardian_lines, is_acknowledged, last_act
from hil.model.errors import Refused

__all__ = ["Acknowledged", "acknowledge", "require_acknowledged", "waits_for_ack"]

_LEAVES_S = 5.0
_LOOK_S = 0.05


@dataclass(frozen=True, slots=True)
class Acknowledged:
    """Result of an acknowledgement: the benches that were latched, and the ledger's entry, if there is one."""

    benches: tuple[str, ...]
    entry: Entry | None


def waits_for_ack(folder: Path) -> bool:
    """Return whether a run has left a latch, or an end by the guardian that has not been acknowledged."""
    if is_run(folder) and is_held(folder):  # an armed bench is latched until its run releases it
        return False
    return bool(latches_of(folder.name)) or not (is_sealed(folder) or is_acknowledged(folder))


def require_acknowledged(folder: Path) -> None:
    """Require, before a run resumes, that what the guardian did has been acknowledged.

    Raises:
        Refused: if it has not.
    """
    if not is_acknowledged(folder):
        raise Refused(
            f"{folder.name}: the guardian ended this run, and that has not been acknowledged",
            f"check the bench, then: {ack_line(folder.name)}",
        )


def acknowledge(folder: Path, reports: Path, *, by: str, text: str) -> Acknowledged:
    """Record that a person checked the latched bench of a run, and remove the run's latches.

    Args:
        folder: the run's folder; it may be gone, as long as a latch names it.
        reports: the workspace's folder of reports, for the ledger of runs that are sealed, gone or another user's.
        by: who looked.
        text: what was seen and done.

    Raises:
        Refused: if name or text is missing, the run or its guardian is still active, nothing needs it, or this
            user may not acknowledge it.
        EvidenceError: if it cannot be recorded; the latches are then still there.
    """
    by, text = by.strip(), text.strip()
    files = latches_of(folder.name)
    latches = tuple(files.values())
    _require_over(folder)
    there = (folder / JOURNAL).is_file()
    if not latches and not (there and waits_for_ack(folder)):
        raise Refused(f"{folder.name}: there is nothing to acknowledge", "hil status shows the state of a run")
    if not by or not text:
        missing = " and ".join(name for name, value in (("--by NAME", by), ("--text TEXT", text)) if not value)
        raise Refused(f"an acknowledgement needs {missing}", ack_line(folder.name))
    require_clearable(files)
    entry = None
    if there and not is_sealed(folder) and os.access(folder, os.W_OK):
        post(folder, "ack", by=by, text=text, seen=guardian_hash(folder))
    else:
        why = tuple(each.why for each in latches)
        entry = append(reports, Entry(run=folder.name, by=by, text=text, why=why))
    clear_latches_of(folder.name)
    _wait_for_guardian(folder.name)
    return Acknowledged(tuple(dict.fromkeys(each.bench for each in latches)), entry)


def _wait_for_guardian(run: str) -> None:
    """Wait briefly for a guardian that kept retrying to exit, so that the bench is free when the command is done."""
    until = wall.monotonic() + _LEAVES_S
    while holds_a_lease(run) and wall.monotonic() < until:
        wall.pause(_LOOK_S)


def _require_over(folder: Path) -> None:
    """Require that nothing is active but a guardian that keeps retrying, which exits once its latch is removed."""
    hint = "wait for its end, or stop it with hil stop"
    if is_run(folder) and is_held(folder):
        raise Refused(f"{folder.name}: the run, or its guardian, is still running", hint)
    act = last_act(guardian_lines(folder))
    if (act is None or not act.trying) and holds_a_lease(folder.name):
        guardian = f"its guardian{keepers_of_run(folder.name)}"
        raise Refused(f"{folder.name}: {guardian} still holds the bench", "wait some seconds until it is done")
