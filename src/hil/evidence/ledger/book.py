"""The ledger's files: append-only, chained lines, read and checked as a whole, and the objects that they name."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from hil.clock import wall
from hil.documents.canonical import JsonError, parse_strict
from hil.evidence.durable import read_plain, sync_folder, sync_open, write_whole
from hil.evidence.ledger.entries import (
    FORMAT,
    ZERO,
    Acknowledged,
    Entry,
    Opened,
    Repaired,
    decode,
    encode,
    line_hash,
    stamped,
)
from hil.model.errors import EvidenceError, Finding

__all__ = [
    "LEDGER",
    "Ledger",
    "append",
    "append_all",
    "append_once",
    "check",
    "head",
    "ledger_file",
    "object_file",
    "put_object",
    "read",
    "read_object",
]

LEDGER = ".ledger"
_LINES = "ledger.jsonl"
_OBJECTS = "objects"
_ACKNOWLEDGEMENTS = "acknowledgements"
_BLOCK = 16_384
_HASH = re.compile(r"[0-9a-f]{64}")
_TORN = "the last line is incomplete: its writer was ended; the next entry cuts it off, keeps it and notes it"
_MEND = "restore the ledger from a copy whose head was published"

_Entry = TypeVar("_Entry", bound=Entry)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ledger:
    """A ledger as read and checked.

    Attributes:
        reports: the folder of reports it belongs to.
        entries: every entry that could be read, in order.
        hashes: the SHA-256 of every whole line; the last is the head.
        findings: everything that is wrong with its lines or their chain; lines count from 1.
        torn: how many bytes of an incomplete line are at its end; this is not damage.
        older: acknowledgements that older versions wrote to files of their own.
    """

    reports: Path
    entries: tuple[Entry, ...] = ()
    hashes: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()
    torn: int = 0
    older: tuple[Acknowledged, ...] = ()

    @property
    def head(self) -> str:
        """The SHA-256 of the last whole line; 64 zeros if there is none."""
        return self.hashes[-1] if self.hashes else ZERO

    def of(self, kind: type[_Entry], run: str | None = None) -> tuple[_Entry, ...]:
        """Return the entries of a kind, in order; only those of a run if one is named."""
        found = (each for each in self.entries if isinstance(each, kind))
        return tuple(each for each in found if run is None or getattr(each, "run", None) == run)

    def lacks(self, published_head: str | None) -> tuple[Finding, ...]:
        """Return a finding if it does not contain a head that was published; None and 64 zeros are always contained."""
        if published_head in {None, ZERO, *self.hashes}:
            return ()
        what = f"no line has the published head {published_head}: the ledger was cut off, rewritten or forked"
        return (_finding(max(len(self.hashes) - 1, 0), f"{what}; {_MEND}"),)


def ledger_file(reports: Path) -> Path:
    """Return the path of the ledger's lines."""
    return reports / LEDGER / _LINES


def read(reports: Path) -> Ledger:
    """Read the ledger of a folder of reports and check its chain; without one there are no entries.

    Raises:
        EvidenceError: if it exists and cannot be read.
    """
    lines, torn = _lines(_bytes(reports))
    entries: list[Entry] = []
    findings: list[Finding] = []
    hashes = [line_hash(line) for line in lines]
    for number, line in enumerate(lines):
        try:
            entry = decode(line)
        except JsonError as error:
            findings.append(_finding(number, f"{error.bare}; {_MEND}"))
            continue
        entries.append(entry)
        findings += _misplaced(entry, number, hashes[number - 1] if number else ZERO)
    older = tuple(_older(reports / LEDGER / _ACKNOWLEDGEMENTS))
    return Ledger(
        reports=reports,
        entries=tuple(entries),
        hashes=tuple(hashes),
        findings=tuple(findings),
        torn=len(torn),
        older=older,
    )


def head(reports: Path) -> str:
    """Return the head of the ledger: the SHA-256 of its last whole line, 64 zeros without one; nothing is checked.

    Raises:
        EvidenceError: if it exists and cannot be read.
    """
    lines, _ = _lines(_bytes(reports))
    return line_hash(lines[-1]) if lines else ZERO


def check(reports: Path, published_head: str | None = None) -> tuple[Finding, ...]:
    """Return everything that is wrong with a ledger and its objects; line, what, and what to do.

    Args:
        reports: the folder of reports.
        published_head: a head that was published earlier; the ledger must contain it.

    Raises:
        EvidenceError: if it exists and cannot be read.
    """
    ledger = read(reports)
    findings = list(ledger.findings)
    if ledger.torn:
        findings.append(_finding(len(ledger.hashes), f"{ledger.torn} bytes: {_TORN}"))
    findings += ledger.lacks(published_head)
    findings += _object_findings(reports, ledger)
    return tuple(findings)


def append(reports: Path, entry: _Entry) -> _Entry:
    """Append an entry, on disk when this returns, and return it with its place in the chain.

    Raises:
        EvidenceError: if the ledger cannot be written, or its last line cannot be read.
    """
    with _locked(ledger_file(reports)) as descriptor:
        return _write(reports, descriptor, entry)[0]  # type: ignore[return-value]  # what it was given


def append_all(reports: Path, entries: Iterable[Entry], *, after: str | None = None) -> None:
    """Append entries in order, all on disk when this returns.

    Args:
        reports: the folder of reports.
        entries: the entries to append.
        after: the head that the ledger must still have, if the entries were derived from its content.

    Raises:
        EvidenceError: as `append`, or if the ledger has another head by now; nothing is appended.
    """
    with _locked(ledger_file(reports)) as descriptor:
        if after is not None and head(reports) != after:
            raise EvidenceError(
                f"{ledger_file(reports)}: the ledger was continued while this was computed; nothing was entered",
                "repeat the command",
            )
        _write(reports, descriptor, *entries)


def append_once(reports: Path, entry: _Entry, stands: Callable[[Ledger], bool]) -> _Entry | None:
    """Append an entry unless `stands` says of the locked ledger that it is there already.

    Raises:
        EvidenceError: as `append`.
    """
    with _locked(ledger_file(reports)) as descriptor:
        return None if stands(read(reports)) else _write(reports, descriptor, entry)[0]  # type: ignore[return-value]


def object_file(reports: Path, name: str) -> Path:
    """Return the path of an object."""
    return reports / LEDGER / _OBJECTS / name


def put_object(reports: Path, data: bytes) -> str:
    """Store bytes beside the ledger and return their SHA-256, which is their name.

    Raises:
        EvidenceError: if they cannot be written.
    """
    name = hashlib.sha256(data).hexdigest()
    path = object_file(reports, name)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists():
            write_whole(path, data)
    except OSError as error:
        raise EvidenceError(f"{path}: the ledger cannot be written: {error.strerror}", "make it writable") from error
    return name


def read_object(reports: Path, name: str) -> bytes:
    """Return the bytes of an object.

    Raises:
        EvidenceError: if it is missing, cannot be read, or its bytes do not match its name.
    """
    path = object_file(reports, name)
    if not _HASH.fullmatch(name):
        raise EvidenceError(f"'{name}' is not the name of an object", "it is a SHA-256 of 64 hexadecimal digits")
    try:
        data = read_plain(path)
    except OSError as error:
        raise EvidenceError(f"{path}: cannot be read: {error.strerror}", _MEND) from error
    if hashlib.sha256(data).hexdigest() != name:
        raise EvidenceError(f"{path}: its bytes were changed: their SHA-256 is not its name", _MEND)
    return data


def _bytes(reports: Path) -> bytes:
    path = ledger_file(reports)
    try:
        return read_plain(path)
    except FileNotFoundError:
        return b""
    except OSError as error:
        raise EvidenceError(f"{path}: the ledger cannot be read: {error.strerror}", "check who may read it") from error


def _lines(data: bytes) -> tuple[list[bytes], bytes]:
    """Return the whole lines, newlines included, and what follows the last newline."""
    *whole, torn = data.split(b"\n")
    return [line + b"\n" for line in whole], torn


def _misplaced(entry: Entry, number: int, before: str) -> Iterator[Finding]:
    """Yield what is wrong with the place of an entry."""
    if entry.seq != number:
        yield _finding(number, f"this is entry {entry.seq}: lines were moved, taken out or put in; {_MEND}")
    if entry.prev != before:
        yield _finding(number, f"it does not follow from the line before it: the chain is broken here; {_MEND}")
    if isinstance(entry, Opened) != (number == 0):
        yield _finding(number, f"a ledger begins with one entry of kind 'opened', and has no other; {_MEND}")
    elif isinstance(entry, Opened) and entry.format != FORMAT:
        yield _finding(number, f"the ledger has format {entry.format}, and this version reads {FORMAT}; update hil")


def _object_findings(reports: Path, ledger: Ledger) -> Iterator[Finding]:
    """Yield a finding for every object named by an entry that is missing or changed."""
    for entry in ledger.entries:
        for field in ("object", "statement", "signature"):
            if name := getattr(entry, field, ""):
                try:
                    read_object(reports, name)
                except EvidenceError as error:
                    yield _finding(entry.seq, f"its {field} is not there as written: {error}")


def _finding(number: int, message: str) -> Finding:
    return Finding(f"{LEDGER}/{_LINES}", number + 1, 1, message)


@contextmanager
def _locked(path: Path) -> Iterator[int]:
    """Open the ledger's lines for appending, with an exclusive lock on this machine; other writers wait."""
    import fcntl  # noqa: PLC0415 - packages are read where there is no fcntl

    descriptor = -1
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW, 0o666)
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield descriptor
    except OSError as error:
        raise EvidenceError(f"{path}: the ledger cannot be written: {error.strerror}", "make it writable") from error
    finally:
        if descriptor >= 0:
            os.close(descriptor)


def _write(reports: Path, descriptor: int, *entries: Entry) -> list[Entry]:
    """Append entries after the last whole line, preceded by any that must come first; return them with their place."""
    size = os.fstat(descriptor).st_size
    last, torn = _tail(descriptor, size)
    seq, prev = _end_of(reports, last)
    utc = wall.utc_now()
    first: list[Entry] = [] if last else [Opened(format=FORMAT)]
    if torn:
        first.append(Repaired(bytes=len(torn), object=put_object(reports, torn)))
        os.ftruncate(descriptor, size - len(torn))
    written: list[Entry] = []
    new: list[bytes] = []
    for each in (*first, *entries):
        seq, placed = seq + 1, stamped(each, seq=seq + 1, prev=prev, utc=utc)
        new.append(encode(placed))
        prev = line_hash(new[-1])
        written.append(placed)
    _put(descriptor, b"".join(new))
    if not last:
        sync_folder(ledger_file(reports).parent)
        sync_folder(reports)
    return written[len(first) :]


def _put(descriptor: int, data: bytes) -> None:
    """Append bytes and sync them; if that fails, none of them stays."""
    size = os.fstat(descriptor).st_size
    rest = memoryview(data)
    try:
        while rest:
            rest = rest[os.write(descriptor, rest) :]
        sync_open(descriptor)
    except OSError:
        with suppress(OSError):
            os.ftruncate(descriptor, size)
        raise


def _tail(descriptor: int, size: int) -> tuple[bytes, bytes]:
    """Return the last whole line, empty if there is none, and what follows it; nothing before it is read.

    A line holds its own number and the hash of the one before it. Reading the ledger finds any earlier damage.
    """
    data, start = b"", size
    while start and data.count(b"\n") < 2:
        step = min(_BLOCK, start)
        start -= step
        data = os.pread(descriptor, step, start) + data
    lines, torn = _lines(data)
    return lines[-1] if lines else b"", torn


def _end_of(reports: Path, last: bytes) -> tuple[int, str]:
    """Return number and hash of the last line; -1 and zeros if there is none."""
    if not last:
        return -1, ZERO
    try:
        entry = decode(last)
    except JsonError as error:
        number = _bytes(reports).count(b"\n")
        raise EvidenceError(f"{ledger_file(reports)}:{number}: nothing can be appended: {error.bare}", _MEND) from error
    return entry.seq, line_hash(last)


def _older(place: Path) -> Iterator[Acknowledged]:
    """Yield the acknowledgements of older versions, one file each, as far as they can be read."""
    for path in sorted(place.glob("*.json")) if place.is_dir() else ():
        try:
            said = parse_strict(read_plain(path))
        except (OSError, JsonError):
            continue
        if isinstance(said, dict) and said.get("format") == 1:
            run, utc, by, text = (str(said.get(name, "")) for name in ("run", "utc", "by", "text"))
            why = said.get("why")
            yield Acknowledged(
                run=run, utc=utc, by=by, text=text, why=tuple(map(str, why)) if isinstance(why, list) else ()
            )
