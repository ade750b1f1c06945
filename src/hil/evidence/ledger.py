"""The ledger beside the packages: what is said of runs after their seal, one file per word, none ever changed."""

from __future__ import annotations

import os
import re
import secrets
from collections.abc import Mapping
from pathlib import Path

from hil.clock import wall
from hil.documents.canonical import canonical
from hil.evidence.durable import PART, sync_folder
from hil.model.errors import EvidenceError

__all__ = ["ACKNOWLEDGEMENTS", "LEDGER", "enter"]

LEDGER = ".ledger"
ACKNOWLEDGEMENTS = "acknowledgements"


def enter(reports: Path, book: str, run: str, said: Mapping[str, object]) -> Path:
    """Write an entry of the ledger and return its file; it is there whole or not at all, and in nobody's place.

    Args:
        reports: the folder of reports.
        book: which part of the ledger, such as `ACKNOWLEDGEMENTS`.
        run: the name of the run that it speaks of.
        said: what is said, as JSON.

    Raises:
        EvidenceError: if it cannot be written.
    """
    moment = wall.utc_now()
    place = reports / LEDGER / book
    path = place / f"{re.sub('[^0-9]', '', moment)}-{run}-{secrets.token_hex(4)}.json"
    part = path.with_name(path.name + PART)
    try:
        place.mkdir(parents=True, exist_ok=True)
        with part.open("xb") as stream:
            stream.write(canonical({"format": 1, "run": run, "utc": moment, **said}) + b"\n")
            stream.flush()
            os.fsync(stream.fileno())
        os.link(part, path)  # unlike a rename it never takes the place of another file
        part.unlink()
        sync_folder(place)
    except OSError as error:
        raise EvidenceError(f"{place}: the ledger cannot be written: {error.strerror}", "make it writable") from error
    return path
