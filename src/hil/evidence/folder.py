"""The folder of a run: its name, its initial content, and the lock on it."""

from __future__ import annotations

import os
import re
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hil.clock import wall
from hil.evidence.durable import DISK_FULL, sync_folder, sync_open
from hil.model.errors import EvidenceError, Refused

__all__ = [
    "ATTACHMENTS",
    "CALIBRATION",
    "CATALOGUE",
    "CHECKPOINT",
    "DUT",
    "GUARDIAN",
    "INBOX",
    "INBOX_FILES",
    "JOURNAL",
    "PARAMETERS",
    "RECORDINGS",
    "REGISTERS",
    "REPORT",
    "REPORT_FILES",
    "RESERVE",
    "RESULTS",
    "SEAL",
    "SOFTWARE",
    "TORN",
    "TRANSCRIPT",
    "create",
    "free_reserve",
    "hold",
    "is_held",
    "is_run",
    "is_sealed",
    "renew_reserve",
    "require_space",
]

JOURNAL = "data/journal.jsonl"
TORN = "data/journal.torn"
GUARDIAN = "data/guardian.jsonl"
RESULTS = "data/results.json"
CATALOGUE = "data/catalogue/catalogue.json"
PARAMETERS = "data/catalogue/parameters.json"
CALIBRATION = "data/bench/calibration.json"
REGISTERS = "data/registers"
SOFTWARE = "data/software.json"
DUT = "data/dut.json"
TRANSCRIPT = "data/transcript.tsv"
RECORDINGS = "data/recordings"
ATTACHMENTS = "data/attachments"
REPORT = "data/report"
REPORT_FILES = ("junit.xml", "report.html")
"""The files of the report; everything else in its folder came from elsewhere."""
INBOX = "inbox"
INBOX_FILES = "inbox/files"
RESERVE = "reserve.bin"
CHECKPOINT = "checkpoint.json"
SEAL = "bagit.txt"

_RESERVED_BYTES = 8_000_000
_LONGEST_PART = 40
_ELSEWHERE = "free some space, or choose another place with --output"
_ATTEMPTS = 5


def create(reports: Path, *, bench: str, dut: str) -> Path:
    """Create and return the folder `<UTC>-<bench>-<dut>-<6 hex>` in `reports`, ready for a journal.

    Raises:
        EvidenceError: if the folder cannot be written.
    """
    name = f"{wall.compact_utc()}-{_safe(bench)}-{_safe(dut)}-{secrets.token_hex(3)}"
    folder = reports / name
    try:
        folder.mkdir(parents=True)
        for inner in (RECORDINGS, ATTACHMENTS, INBOX_FILES):
            (folder / inner).mkdir(parents=True)
        _reserve(folder / RESERVE)
        sync_folder(folder)
        sync_folder(reports)
    except OSError as error:
        raise EvidenceError(
            f"{folder}: the run's folder cannot be written: {error.strerror}", "choose another place with --output"
        ) from error
    return folder


def require_space(place: Path, bytes_needed: int, hint: str = _ELSEWHERE) -> None:
    """Refuse a run if there is no space for its evidence at `place`, which need not exist yet; `hint` says what to do.

    Raises:
        Refused: with both numbers.
    """
    while not place.exists():
        place = place.parent
    free, needed = shutil.disk_usage(place).free, bytes_needed + _RESERVED_BYTES
    if free < needed:
        raise Refused(
            f"{place}: {free / 1e6:.0f} MB are free, and this run may need {needed / 1e6:.0f} MB",
            hint,
        )


def free_reserve(reserve: Path | None) -> bool:
    """Release the reserved space on a full disk; return whether there was any."""
    if reserve is None or not reserve.exists():
        return False
    reserve.unlink()
    return True


def renew_reserve(folder: Path) -> None:
    """Reserve the space again in the folder of a resumed run, if it was released.

    Raises:
        EvidenceError: if the folder cannot be written.
    """
    try:
        if not (folder / RESERVE).exists():
            _reserve(folder / RESERVE)
    except OSError as error:
        raise EvidenceError(
            f"{folder}: the run's folder cannot be written: {error.strerror}", "make it writable, and resume the run"
        ) from error


def is_sealed(folder: Path) -> bool:
    """Return whether there is a file in the seal's place; `verify` checks whether it is a seal."""
    return os.path.lexists(folder / SEAL)


def is_run(folder: Path) -> bool:
    """Return whether this looks like the folder of a run, complete or not."""
    return os.path.lexists(folder / SEAL) or os.path.lexists(folder / "data")


@contextmanager
def hold(folder: Path) -> Iterator[int]:
    """Lock a run's folder while this process lives, however it ends, so that no other process can seal it.

    Yields the descriptor that holds the lock.

    The lock is on the folder itself, so that no trace of it is left in a package.

    Raises:
        Refused: while another process holds it.
    """
    import fcntl  # noqa: PLC0415 - packages are read where there is no fcntl

    descriptor = _opened(folder)
    try:
        for attempt in range(_ATTEMPTS):
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if attempt == _ATTEMPTS - 1:
                    raise Refused(
                        f"{folder.name}: the run is in progress in another process",
                        "wait for its end, or stop it with hil stop",
                    ) from None
                wall.pause(0.01)  # another process may only be testing the lock, see is_held
            except OSError as error:
                raise Refused(
                    f"{folder}: this file system cannot hold a run: {error.strerror}",
                    "choose a folder on a disk of this machine with --output",
                ) from error
        yield descriptor
    finally:
        os.close(descriptor)


def is_held(folder: Path) -> bool:
    """Return whether a live process holds the folder; False on systems without locks."""
    try:
        import fcntl  # noqa: PLC0415 - packages are read where there is no fcntl
    except ImportError:
        return False
    descriptor = _opened(folder)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    finally:
        os.close(descriptor)
    return False


def _opened(folder: Path) -> int:
    try:
        return os.open(folder, os.O_RDONLY | getattr(os, "O_DIRECTORY", 0))
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise EvidenceError(
            f"{folder}: cannot be opened: {why}", "name a folder of reports/ that you may read"
        ) from error


def _safe(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9._-]+", "_", text).strip("._-")[:_LONGEST_PART] or "unnamed"


def _reserve(path: Path) -> None:
    with path.open("wb") as stream:
        try:
            os.posix_fallocate(stream.fileno(), 0, _RESERVED_BYTES)
        except (AttributeError, OSError) as error:
            if getattr(error, "errno", None) in DISK_FULL:
                raise
            stream.write(bytes(_RESERVED_BYTES))
        stream.flush()
        sync_open(stream.fileno())
