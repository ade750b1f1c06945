"""The journal's reader: events, a torn tail, and every place where chain or sequence break."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import Any

from hil.documents.canonical import JsonError, parse_strict
from hil.evidence.durable import sync_file, sync_folder
from hil.evidence.folder import JOURNAL, TORN
from hil.model.errors import EvidenceError, Finding

__all__ = ["FIRST", "Body", "JournalLine", "JournalReading", "cut_torn_tail", "read_journal"]

Body = Mapping[str, Any]
"""The body of one event: JSON values, `seq`, `t` and `kind` among them."""

FIRST = "0" * 64
"""What the first line names as its predecessor."""

_START = b'{"body":'
_BEFORE_PREVIOUS = b',"prev":"'


@dataclass(frozen=True, slots=True, kw_only=True)
class JournalLine:
    """One event: its line number from 1, its body, its wall stamp, and the body's bytes."""

    number: int
    body: Body
    wall: Body
    raw: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class JournalReading:
    """A journal as it was found.

    Attributes:
        lines: the lines that could be read.
        torn: bytes after the last newline.
        findings: where lines cannot be read, or chain or sequence break.
        head: SHA-256 of the last line.
    """

    lines: tuple[JournalLine, ...]
    torn: bytes
    findings: tuple[Finding, ...]
    head: str

    @property
    def events(self) -> tuple[Body, ...]:
        """The bodies, in order."""
        return tuple(line.body for line in self.lines)

    @property
    def content_digest(self) -> str:
        """SHA-256 over the bodies before the results, each with a newline."""
        content = hashlib.sha256()
        for line in takewhile(lambda line: line.body["kind"] != "results", self.lines):
            content.update(line.raw + b"\n")
        return content.hexdigest()


def read_journal(path: Path) -> JournalReading:
    """Read a journal, whatever state it is in.

    Raises:
        EvidenceError: where there is no file to read.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise EvidenceError(
            f"{path}: the journal cannot be read: {error.strerror}", "is this a run's folder?"
        ) from error
    whole, torn = _split(data)
    lines: list[JournalLine] = []
    findings: list[Finding] = []
    previous = FIRST
    for number, raw in enumerate(whole, 1):
        try:
            line, named = _line(number, raw)
        except JsonError as error:
            findings.append(_finding(number, error.message))
        else:
            lines.append(line)
            findings.extend(_out_of_place(line, named, previous))
        previous = hashlib.sha256(raw).hexdigest()
    return JournalReading(lines=tuple(lines), torn=torn, findings=tuple(findings), head=previous)


def cut_torn_tail(folder: Path) -> int:
    """Move half a line at the journal's end into a file of its own; return how many bytes that were.

    The tail is on the disk in its new place before it goes from the old one.
    """
    journal, kept = folder / JOURNAL, folder / TORN
    data = journal.read_bytes()
    _, torn = _split(data)
    if not torn:
        return 0
    already = kept.read_bytes() if kept.exists() else b""
    if not already.endswith(torn):
        with kept.open("ab") as stream:
            stream.write(torn)
        sync_file(kept)
        sync_folder(kept.parent)
    os.truncate(journal, len(data) - len(torn))
    sync_file(journal)
    return len(torn)


def _split(data: bytes) -> tuple[list[bytes], bytes]:
    *whole, torn = data.split(b"\n")
    return whole, torn


def _line(number: int, raw: bytes) -> tuple[JournalLine, str]:
    value = parse_strict(raw)
    if not isinstance(value, dict) or value.keys() != {"body", "prev", "wall"}:
        raise JsonError("a line has body, prev and wall")
    body, previous, stamp = value["body"], value["prev"], value["wall"]
    if not isinstance(body, dict) or not isinstance(previous, str) or not isinstance(stamp, dict):
        raise JsonError("body and wall are objects, prev is text")
    if not isinstance(body.get("kind"), str) or not isinstance(body.get("t"), int | float):
        raise JsonError("a body has a kind, and t in seconds")
    cut = raw.rfind(_BEFORE_PREVIOUS)
    return JournalLine(number=number, body=body, wall=stamp, raw=raw[len(_START) : cut]), previous


def _out_of_place(line: JournalLine, named: str, previous: str) -> Iterator[Finding]:
    if named != previous:
        yield _finding(line.number, "the chain is broken: this line, or the one before it, is not the one written")
    if line.body.get("seq") != line.number - 1:
        yield _finding(line.number, f"sequence number {line.body.get('seq')} where {line.number - 1} is due")


def _finding(line: int, message: str) -> Finding:
    return Finding(path=JOURNAL, line=line, column=1, message=message)
