"""Checkpoints of a simulated bench, written every second, from which a killed run can be resumed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hil.bench.bound import BoundBench
from hil.clock import wall
from hil.evidence.durable import open_plain, read_plain, write_whole
from hil.evidence.folder import CHECKPOINT, JOURNAL, TRANSCRIPT
from hil.model.errors import EvidenceError
from hil.wire.checkpoint import Checkpoint
from hil.wire.transcript import count_operations

__all__ = ["Checkpoints", "read_checkpoint"]

_FORMAT = 3
_EVERY_S = 1.0
_SHARE = 20
"""At most one in this many seconds goes into checkpoints, however large the world is."""


class Checkpoints:
    """Writes checkpoints of the bench.

    The transcript up to each checkpoint is on disk first, and holds everything that a case has learnt until then.

    Args:
        folder: the run's folder.
        bench: the bench; nothing is written for one without checkpoints.
    """

    def __init__(self, folder: Path, bench: BoundBench) -> None:
        self._path = folder / CHECKPOINT
        self._run = ""
        self._bench = bench
        self._due = wall.monotonic() + _EVERY_S

    def tick(self) -> None:
        """Write one if it is due; called at scheduling points only.

        Raises:
            OSError: if the disk is full or fails.
        """
        began = wall.monotonic()
        if began < self._due:
            return
        self.write()
        now = wall.monotonic()
        self._due = now + max(_EVERY_S, _SHARE * (now - began))

    def soon(self) -> None:
        """Have the next scheduling point write one."""
        self._due = 0.0

    def write(self) -> None:
        """Write one.

        Raises:
            OSError: if the disk is full or fails.
        """
        self._bench.transcript.sync()
        if found := self._bench.checkpoint():
            self._run = self._run or _mark_of(self._path.parent)
            state = json.dumps(found.state)
            fields = {"format": _FORMAT, "run": self._run, "at_ns": found.at_ns, "operations": found.operations}
            fields["sha256"] = _digest(found.at_ns, found.operations, state)
            write_whole(self._path, f'{json.dumps(fields)[:-1]}, "state": {state}}}'.encode())


def read_checkpoint(folder: Path) -> Checkpoint | None:
    """Return the last checkpoint of a run, None if there is none.

    Raises:
        EvidenceError: if it cannot be read, belongs to another run, or is ahead of the run's transcript.
    """
    path = folder / CHECKPOINT
    try:
        return _of_run(_checkpoint(json.loads(read_plain(path)), _mark_of(folder)), folder)
    except FileNotFoundError:
        return None
    except (OSError, ValueError, LookupError, TypeError, ArithmeticError, RecursionError) as error:
        raise EvidenceError(
            f"{path}: not a checkpoint of this run: {error}",
            "remove it: the run is then repeated from its first step, and must reproduce its journal",
        ) from error


def _of_run(found: Checkpoint, folder: Path) -> Checkpoint:
    held = count_operations(folder / TRANSCRIPT)
    if not 0 <= found.operations <= held:
        raise ValueError(f"it comes after {found.operations} operations, and the transcript holds {held}")
    return found


def _mark_of(folder: Path) -> str:
    """Return the hash of a run's first event, which identifies the run."""
    with open_plain(folder / JOURNAL) as lines:
        return hashlib.sha256(lines.readline()).hexdigest()


def _digest(at_ns: int, operations: int, state: str) -> str:
    return hashlib.sha256(f"{at_ns} {operations} {state}".encode()).hexdigest()


def _checkpoint(fields: Mapping[str, Any], run: str) -> Checkpoint:
    if fields["format"] != _FORMAT:
        raise ValueError(f"it has format {fields['format']!r:.20}")
    if fields["run"] != run:
        raise ValueError("it is of another run")
    if fields["sha256"] != _digest(fields["at_ns"], fields["operations"], json.dumps(fields["state"])):
        raise ValueError("it is not what was written")
    return Checkpoint(at_ns=int(fields["at_ns"]), operations=int(fields["operations"]), state=dict(fields["state"]))
