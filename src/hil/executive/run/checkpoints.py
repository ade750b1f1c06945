"""Checkpoints of a simulated bench, on the disk every second, from which a killed run can be resumed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hil.bench.binding import BoundBench
from hil.clock import wall
from hil.evidence.durable import write_whole
from hil.evidence.folder import CHECKPOINT
from hil.model.errors import EvidenceError
from hil.wire.checkpoint import Checkpoint

__all__ = ["Checkpoints", "read_checkpoint"]

_FORMAT = 1
_EVERY_S = 1.0
_SHARE = 20
"""Of this many seconds one at most goes into checkpoints, however large the world is."""


class Checkpoints:
    """Writes down where the bench is.

    The transcript is on the disk up to there before, and holds all that a case has learnt until then.

    Args:
        folder: the run's folder.
        bench: the bench; nothing is written of one that cannot tell where it is.
    """

    def __init__(self, folder: Path, bench: BoundBench) -> None:
        self._path = folder / CHECKPOINT
        self._bench = bench
        self._due = wall.monotonic() + _EVERY_S

    def tick(self) -> None:
        """Write one if it is time; called at scheduling points only.

        Raises:
            OSError: where the disk is full or fails.
        """
        began = wall.monotonic()
        if began < self._due:
            return
        self.write()
        now = wall.monotonic()
        self._due = now + max(_EVERY_S, _SHARE * (now - began))

    def write(self) -> None:
        """Write one.

        Raises:
            OSError: where the disk is full or fails.
        """
        self._bench.transcript.sync()
        if found := self._bench.checkpoint():
            told = {"format": _FORMAT, "at_ns": found.at_ns, "operations": found.operations, "state": found.state}
            write_whole(self._path, json.dumps(told).encode())


def read_checkpoint(folder: Path) -> Checkpoint | None:
    """Return the last checkpoint of a run, None where there is none.

    Raises:
        EvidenceError: if it cannot be read.
    """
    path = folder / CHECKPOINT
    try:
        told = json.loads(path.read_bytes())
        return _checkpoint(told)
    except FileNotFoundError:
        return None
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise EvidenceError(
            f"{path}: this is no checkpoint: {error}",
            "remove it: the run is then made again from its first step, and must come to the same",
        ) from error


def _checkpoint(told: Mapping[str, Any]) -> Checkpoint:
    if told["format"] != _FORMAT:
        raise ValueError(f"it has format {told['format']}")
    return Checkpoint(at_ns=int(told["at_ns"]), operations=int(told["operations"]), state=dict(told["state"]))
