"""Reader of the journal: events, a torn tail, and every break in chain or sequence."""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import islice, takewhile
from pathlib import Path
from typing import Any, BinaryIO

import msgspec

from hil.documents.canonical import JsonError, parse_strict
from hil.evidence.durable import open_plain, read_plain, sync_file, sync_folder
from hil.evidence.events import Event, Recovered, Results, Resumed
from hil.evidence.events.codec import decode, is_text_of
from hil.evidence.folder import JOURNAL, TORN
from hil.model.errors import EvidenceError, Finding

__all__ = [
    "FIRST",
    "FORMAT",
    "LONGEST_LINE",
    "Body",
    "JournalLine",
    "JournalReading",
    "UnknownFormat",
    "cut_torn_tail",
    "read_ends",
    "read_journal",
    "require_known_format",
]

FORMAT = 1
"""The format of packages that this version writes and reads."""

Body = Mapping[str, Any]
"""The body of one event: JSON values, `seq`, `t` and `kind` among them."""

FIRST = "0" * 64
"""The predecessor's hash in the first line."""

LONGEST_LINE = 64_000_000
"""No event is longer than this; longer lines are not held in memory."""

_SHORT = 100
_OF_LINE = frozenset({"body", "prev", "wall"})
_START = b'{"body":'
_BEFORE_PREVIOUS = b',"prev":"'
_AFTER_PREVIOUS = b'","wall":'
_WALL = len(_BEFORE_PREVIOUS) + len(FIRST)
"""Offset of the wall's name in the rest of a line."""
_BLOCK = 1 << 20
_PIECE = 1 << 16
"""Longer than the last two lines of most journals."""


class UnknownFormat(EvidenceError):
    """A package of a format that this version does not read."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JournalLine:
    """One event.

    Attributes:
        number: the line's number, from 1.
        event: the event.
        wall: facts of this place and moment only: the stamp, and hashes of files that hold such facts.
        raw: the body's bytes.
        rest: the line's bytes after the body.
        as_written: whether it is known to be exactly as the writer writes it; otherwise this was not checked.
    """

    number: int
    event: Event
    wall: Body
    raw: bytes
    rest: bytes
    as_written: bool = False

    @property
    def sha256(self) -> str:
        """The SHA-256 of the line, as the next one names it."""
        return hashlib.sha256(_START + self.raw + self.rest).hexdigest()

    @property
    def canonical(self) -> bool:
        """Whether every byte of the line is as the writer writes it."""
        return self.as_written or _is_written(self.raw, self.rest, self.event, self.wall)


@dataclass(frozen=True, slots=True, kw_only=True)
class JournalReading:
    """Result of reading a journal.

    Attributes:
        lines: the lines that could be read.
        first: the body of the first line as JSON, even if its event is not one that this version knows.
        torn: bytes after the last newline, `LONGEST_LINE` at most.
        findings: where lines cannot be read, or chain or sequence break.
        head: SHA-256 of the last line.
        events: the events, in order.
    """

    lines: tuple[JournalLine, ...]
    first: Body
    torn: bytes
    findings: tuple[Finding, ...]
    head: str
    events: tuple[Event, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Collect the events once: they are used many times."""
        object.__setattr__(self, "events", tuple([line.event for line in self.lines]))

    @property
    def content_digest(self) -> str:
        """SHA-256 over the bodies before the results, each with a newline."""
        content = hashlib.sha256()
        for line in takewhile(lambda line: not isinstance(line.event, Results), self.lines):
            content.update(line.raw + b"\n")
        return content.hexdigest()


def read_journal(path: Path) -> JournalReading:
    """Read a journal, whatever state it is in.

    Raises:
        EvidenceError: if there is no file to read.
    """
    return _read(path, _reading)


def read_ends(path: Path) -> JournalReading:
    """Read the first two and the last two lines of a journal, and nothing between them.

    These show what a run was, what was frozen, and how it ended. The last two have the line numbers that follow from
    their sequence numbers; the chain between them is not checked.

    Raises:
        EvidenceError: if there is no file to read.
    """
    return _read(path, _ends)


def _read(path: Path, how: Callable[[BinaryIO], JournalReading]) -> JournalReading:
    try:
        with open_plain(path) as stream:
            return how(stream)
    except OSError as error:
        raise EvidenceError(
            f"{path}: the journal cannot be read: {error.strerror}", "is this a run's folder?"
        ) from error


def require_known_format(reading: JournalReading) -> None:
    """Require that this version knows the format named by a run's first event.

    Raises:
        UnknownFormat: if it does not.
    """
    run = reading.first
    if run.get("kind") != "run" or ((found := run.get("format")) == FORMAT and type(found) is int):
        return
    raise UnknownFormat(
        f"the package has format {found}, and this version of hil reads format {FORMAT}",
        f"use the version that wrote it ({run.get('version', 'unknown')}), or a newer one",
    )


def cut_torn_tail(folder: Path) -> int:
    """Move an incomplete line at the journal's end to a file of its own; return how many of its bytes no event records.

    The tail is on disk in its new place before it is removed from the old one. If the process ended between that and
    the event that records it, the next event does.
    """
    journal, kept = folder / JOURNAL, folder / TORN
    with open_plain(journal) as stream:
        size, begin = _torn_part(stream)
        stream.seek(begin)
        torn = stream.read(size - begin)
    untold = _unrecorded(journal, kept)
    if not torn:
        return untold
    if not untold or not read_plain(kept).endswith(torn):
        with kept.open("ab") as stream:
            stream.write(torn)
        sync_file(kept)
        sync_folder(kept.parent)
        untold += len(torn)
    os.truncate(journal, begin)
    sync_file(journal)
    return untold


def _unrecorded(journal: Path, kept: Path) -> int:
    """Return how many bytes of earlier tails no event records."""
    if not kept.exists():
        return 0
    recorded = (event.torn_bytes for event in read_journal(journal).events if isinstance(event, Recovered | Resumed))
    return max(0, kept.stat().st_size - sum(recorded))


def _torn_part(stream: BinaryIO) -> tuple[int, int]:
    """Return the size of a journal, and where the part after its last newline begins."""
    size = begin = stream.seek(0, os.SEEK_END)
    while begin:
        start = max(0, begin - _BLOCK)
        stream.seek(start)
        newline = stream.read(begin - start).rfind(b"\n")
        if newline >= 0:
            return size, start + newline + 1
        begin = start
    return size, 0


def _ends(stream: BinaryIO) -> JournalReading:
    size, whole = _torn_part(stream)
    stream.seek(0)
    head = list(islice(_raw_lines(stream), 2))
    tail = [(raw, None) for raw in _last_lines(stream, stream.tell(), whole)]
    lines: list[JournalLine] = []
    findings: list[Finding] = []
    first: Body = {}
    for number, (raw, endless) in enumerate([*head, *tail], 1):
        try:
            body, wall, _ = _parts(raw.removesuffix(b"\n"), whole=endless is None)
            first = first or body
            line = _line(number, raw, body, wall)
        except JsonError as error:
            findings.append(_finding(number if number <= len(head) else 0, error.bare, error.column))
        else:
            lines.append(line if number <= len(head) else replace(line, number=line.event.seq + 1))
    torn = b"" if size == whole else b"torn"
    return JournalReading(lines=tuple(lines), first=first, torn=torn, findings=tuple(findings), head="")


def _last_lines(stream: BinaryIO, begin: int, end: int) -> list[bytes]:
    """Return the last two complete lines between two offsets."""
    start, data = end, b""
    while start > begin and data.count(b"\n") < 3 and len(data) <= LONGEST_LINE:
        before, start = start, max(begin, start - _PIECE)
        stream.seek(start)
        data = stream.read(before - start) + data
    return [each + b"\n" for each in data.split(b"\n")[-3:-1]]


def _line(number: int, raw: bytes, body: Body, wall: Body) -> JournalLine:
    cut = raw.rfind(_BEFORE_PREVIOUS)
    event = decode(body)
    return JournalLine(number=number, event=event, wall=wall, raw=raw[len(_START) : cut], rest=raw[cut:-1])


def _reading(stream: BinaryIO) -> JournalReading:
    lines: list[JournalLine] = []
    findings: list[Finding] = []
    first: Body = {}
    previous, torn = FIRST, b""
    for number, (raw, head) in enumerate(_raw_lines(stream), 1):
        if not raw.endswith(b"\n"):
            torn = raw
            break
        try:
            if head is None and (written := _as_written(number, raw)) is not None:
                body, named, line = written
            else:
                body, wall, named = _parts(raw[:-1], whole=head is None)
                line = _line(number, raw, body, wall)
            first = first if number > 1 else body
        except JsonError as error:
            findings.append(_finding(number, error.bare, error.column))
        else:
            lines.append(line)
            findings.extend(_out_of_place(line, named, previous))
        previous = head or hashlib.sha256(raw[:-1]).hexdigest()
    return JournalReading(lines=tuple(lines), first=first, torn=torn, findings=tuple(findings), head=previous)


def _as_written(number: int, raw: bytes) -> tuple[Body, str, JournalLine] | None:
    """Return body, predecessor and line if it is exactly as written; None for any other, which has to be read strictly.

    The library reads a line many times as fast, but accepts what must be refused, such as a duplicate key. Its result
    is what the line says only if every byte follows from it.
    """
    cut = raw.rfind(_BEFORE_PREVIOUS)
    text, rest = raw[len(_START) : cut], raw[cut:-1]
    try:
        found = _DECODE(raw)
        body, wall, named = _shared(found.body), _shared(found.wall), found.prev
        event = decode(body)
        whole = raw.startswith(_START) and "t" in body and rest[len(_BEFORE_PREVIOUS) : _WALL] == named.encode()
        if not whole or not _is_written(text, rest, event, wall):
            return None
    except (msgspec.MsgspecError, UnicodeError, RecursionError, JsonError):
        return None
    return body, named, JournalLine(number=number, event=event, wall=wall, raw=text, rest=rest, as_written=True)


def _is_written(text: bytes, rest: bytes, event: Event, wall: Body) -> bool:
    """Return whether every byte of a line is as the writer writes it, except its predecessor's hash."""
    between, stamp = rest[_WALL : (at := _WALL + len(_AFTER_PREVIOUS))], rest[at:-1]
    closed = rest.endswith(b"}") and between == _AFTER_PREVIOUS
    return closed and is_text_of(text, event) and is_text_of(stamp, wall)


class _Line(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    body: dict[str, Any]
    prev: str
    wall: dict[str, Any]


_DECODE = msgspec.json.Decoder(_Line).decode


def _raw_lines(stream: BinaryIO) -> Iterator[tuple[bytes, str | None]]:
    """Yield line by line; of one that is too long, only its newline, if it has one, and the hash of what is before."""
    while raw := stream.readline(LONGEST_LINE + 1):
        if raw.endswith(b"\n") or len(raw) <= LONGEST_LINE:
            yield raw, None
            continue
        content, last = hashlib.sha256(), raw
        while not last.endswith(b"\n") and (further := stream.readline(_BLOCK)):
            content.update(last)
            last = further
        content.update(last.removesuffix(b"\n"))
        yield (b"\n" if last.endswith(b"\n") else raw[:LONGEST_LINE]), content.hexdigest()


def _parts(raw: bytes, *, whole: bool) -> tuple[Body, Body, str]:
    """Return body and wall of a line, and its predecessor's hash."""
    if not whole:
        raise JsonError(f"the line has more than {LONGEST_LINE} bytes")
    value = parse_strict(raw)
    if not isinstance(value, dict):
        raise JsonError("the line must be an object with the fields body, prev and wall")
    if value.keys() != _OF_LINE:
        missing = [f"field '{name}' is missing" for name in sorted(_OF_LINE - value.keys())]
        raise JsonError("; ".join([*missing, *(f"unknown field '{name}'" for name in sorted(value.keys() - _OF_LINE))]))
    body, previous, stamp = value["body"], value["prev"], value["wall"]
    if not isinstance(body, dict) or not isinstance(previous, str) or not isinstance(stamp, dict):
        raise JsonError("fields 'body' and 'wall' must be objects, and field 'prev' must be text")
    if not isinstance(body.get("kind"), str):
        raise JsonError("field 'kind' must be text: the kind of the event")
    if type(body.get("t")) not in {int, float}:
        raise JsonError("field 't' must be a number: the bench time in s")
    return _shared(body), _shared(stamp), previous


def _shared(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return an object that shares names and short texts with other lines: weeks of events repeat them."""
    return {
        name: sys.intern(value) if type(value) is str and len(value) <= _SHORT else value
        for name, value in fields.items()
    }


def _out_of_place(line: JournalLine, named: str, previous: str) -> Iterator[Finding]:
    if named != previous:
        yield _finding(line.number, "the chain is broken: this line or the one before it was changed")
    if line.event.seq != line.number - 1:
        yield _finding(line.number, f"field 'seq': expected {line.number - 1}, found {line.event.seq}")


def _finding(line: int, message: str, column: int = 0) -> Finding:
    return Finding(path=JOURNAL, line=line, column=column or 1, message=message)
