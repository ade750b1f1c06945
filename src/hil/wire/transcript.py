"""The transcript: every operation on every port and bus, in order of occurrence."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import FileIO
from pathlib import Path

from hil.model.errors import Diverged, EvidenceError

__all__ = [
    "HEADER",
    "Operation",
    "Transcript",
    "count_operations",
    "damaged_lines",
    "format_of",
    "past_lines",
    "read_transcript",
]

_COLUMNS = "sequence\tdevice\toperation\tstart_ns\tend_ns\tsent\treceived\terror\n"
HEADER = f"hil/transcript/10 {_COLUMNS}"
"""The first line: format and column names."""

_FORMATS = {
    HEADER: 10,
    f"hil/transcript/9 {_COLUMNS}": 9,
    f"hil/transcript/8 {_COLUMNS}": 8,
    f"hil/transcript/7 {_COLUMNS}": 7,
    f"hil/transcript/6 {_COLUMNS}": 6,
    f"hil/transcript/5 {_COLUMNS}": 5,
    f"hil/transcript/4 {_COLUMNS}": 4,
    f"hil/transcript/3 {_COLUMNS}": 3,
    f"hil/transcript/2 {_COLUMNS}": 2,
    f"hil/transcript/1\t{_COLUMNS}": 1,
}
"""Up to format 9 turns of monitors and holds did not tell their place. Up to format 8 sensors were read more often
than is needed. Up to format 7 no sensor was asked for its name between samples. Up to format 6 recordings beside a
case did not share the bus by plan, rows of roles that are sampled fed no limits, and no arming looked whether there
is room for recordings. Up to format 5 none was refused for want of room, nor its rate and gap excused. Up to format 4
a question and its reply on a Modbus line were operations of their own. Up to format 3 rows of a stream did not wait
for their limits. Format 2 gave a monitor's turn at a point the name of one in a wait, format 1 had a field more in
its header."""

_FIELDS = 8
_NUMBERS = frozenset({"sequence", "start_ns", "end_ns"})
_BYTES = frozenset({"sent", "received"})
_HEX = re.compile("(?:[0-9a-fA-F]{2})*")
_SHOWN = 120


@dataclass(frozen=True, slots=True)
class Operation:
    """One line of a transcript; times in nanoseconds of the bench's clock, `error` empty if there was none."""

    sequence: int
    device: str
    name: str
    start_ns: int
    end_ns: int
    sent: bytes
    received: bytes
    error: str


class Transcript:
    """Collects operations as they happen, for all devices together, to preserve their order.

    Lines are buffered until `flush`, so that a full disk never looks like a fault of a device.

    Args:
        sink: an unbuffered file, opened for appending if it exists; None for benches whose bytes are not
            kept.
        past: the lines already in the file; the first operations must match them, and are not written
            twice.

    Attributes:
        at_divergence: called with an operation that differs from the file's, before it is raised.
    """

    def __init__(self, sink: FileIO | None, past: Iterator[str] | None = None) -> None:
        self.at_divergence: Callable[[Diverged], object] = lambda _: None
        self._sink = sink
        self._past = past or iter(())
        self._held = next(self._past, "")
        self._sequence = 0
        self._lines = [] if past else [HEADER]
        self._waiting = bytearray()

    @property
    def operations(self) -> int:
        """Number of operations recorded."""
        return self._sequence

    @property
    def comes_again(self) -> bool:
        """Whether the file has operations that are yet to be repeated."""
        return bool(self._held)

    def sent_next(self, device: str, name: str) -> bytes | None:
        """Return what the next operation to be repeated sent, None if it is not this one."""
        fields = self._held.split("\t")
        return bytes.fromhex(fields[5]) if fields[1:3] == [device, name] else None

    def note(
        self,
        device: str,
        name: str,
        start_ns: int,
        end_ns: int,
        sent: bytes = b"",
        received: bytes = b"",
        error: str = "",
    ) -> None:
        """Record one operation.

        Raises:
            Diverged: if the file has a different one in its place.
        """
        if self._sink is None:
            return
        line = f"{self._sequence}\t{device}\t{name}\t{start_ns}\t{end_ns}\t{sent.hex()}\t{received.hex()}\t{error}\n"
        self._sequence += 1
        if self._held:
            self._compare(line)
        else:
            self._lines.append(line)

    def skip(self, operations: int) -> None:
        """Skip the file's operations up to that number, which are not repeated."""
        while self._held and self._sequence < operations:
            self._held = next(self._past, "")
            self._sequence += 1

    def flush(self) -> None:
        """Write buffered lines to the operating system; lines that find no space stay buffered.

        Raises:
            OSError: if the disk is full or fails.
        """
        if self._sink is None:
            return
        self._waiting += "".join(self._lines).encode()
        self._lines.clear()
        while self._waiting:
            written = self._sink.write(self._waiting)
            del self._waiting[:written]

    def sync(self) -> None:
        """Flush everything to disk.

        Raises:
            OSError: if the disk is full or fails.
        """
        self.flush()
        if self._sink is not None:
            os.fsync(self._sink.fileno())

    def _compare(self, line: str) -> None:
        """Compare an operation with the file's in its place."""
        held = self._held
        if held != line:
            error = Diverged(f"transcript: {line.strip()[:_SHOWN]!r}, but the record holds {held.strip()[:_SHOWN]!r}")
            self.at_divergence(error)
            raise error
        self._held = next(self._past, "")


def past_lines(path: Path) -> Iterator[str] | None:
    """Truncate a torn last line of a transcript, and return its lines below the header; None without a header.

    Raises:
        EvidenceError: as `read_transcript`.
    """
    if not path.exists():
        return None
    with path.open("rb") as stream:
        if not stream.readline().endswith(b"\n"):
            return None
    size = sum(len(line) for line in _lines(path) if line.endswith("\n"))
    if size < path.stat().st_size:  # the lines are ASCII
        os.truncate(path, size)
    lines = _lines(path)
    next(lines)
    return lines


def format_of(path: Path) -> int:
    """Return the format of a transcript.

    Raises:
        EvidenceError: as `read_transcript`.
    """
    return _FORMATS[next(_lines(path))]


def count_operations(path: Path) -> int:
    """Return the number of complete operations in a transcript.

    Raises:
        EvidenceError: as `read_transcript`.
    """
    return sum(line.endswith("\n") for line in _lines(path)) - 1


def damaged_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Yield number and message of every damaged line of a transcript, except a torn last one.

    Raises:
        EvidenceError: if the file is missing.
    """
    if not path.is_file():
        raise EvidenceError(f"{path} is missing", "without its transcript a run cannot be replayed")
    with path.open(encoding="ascii", errors="surrogateescape", newline="\n") as lines:
        if next(lines, "") not in _FORMATS:
            yield 1, f"the line is damaged: expected the header of a transcript of format 1 to {_FORMATS[HEADER]}"
        for number, line in enumerate(lines, start=2):
            fields = line[:-1].split("\t", _FIELDS - 1)
            if line.endswith("\n") and (wrong := _wrong(fields, number - 2)):
                yield number, f"the line is damaged: {wrong}"


def _wrong(fields: list[str], sequence: int) -> str:
    """Return what is wrong with the fields of a line, empty if nothing is."""
    names = _COLUMNS.split()
    if len(fields) != _FIELDS:
        return f"expected {_FIELDS} fields ({', '.join(names)}), found {len(fields)}"
    for name, text in zip(names, fields, strict=True):
        if not text.isascii():
            return f"field '{name}' must be ASCII, found {text[:_SHOWN]!r}"
        if name in _NUMBERS and not text.isdecimal():
            return f"field '{name}' must be a whole number, found {text[:_SHOWN]!r}"
        if name in _BYTES and not _HEX.fullmatch(text):
            return f"field '{name}' must be bytes in hexadecimal digits, found {text[:_SHOWN]!r}"
    return "" if int(fields[0]) == sequence else f"field 'sequence': expected {sequence}, found {fields[0]}"


def read_transcript(path: Path) -> Iterator[Operation]:
    """Yield the operations of a transcript, except a torn last line.

    Raises:
        EvidenceError: if the file is missing, is not a transcript, or a line of it is damaged.
    """
    lines = _lines(path)
    next(lines)
    for number, line in enumerate(lines, start=2):
        if line.endswith("\n"):
            yield _parse(line, path.name, number)


def _lines(path: Path) -> Iterator[str]:
    """Yield the header of a transcript, and then every line, including a torn one."""
    if not path.is_file():
        raise EvidenceError(f"{path} is missing", "without its transcript a run cannot be replayed")
    with path.open(encoding="ascii", errors="surrogateescape", newline="\n") as lines:
        header = next(lines, "")
        if header not in _FORMATS:
            raise EvidenceError(f"{path.name} is not a transcript of format 1 to {_FORMATS[HEADER]}")
        yield header
        yield from lines


def _parse(line: str, name: str, number: int) -> Operation:
    fields = line[:-1].split("\t", _FIELDS - 1)
    try:
        sequence, device, operation, start, end, sent, received, error = fields
        return Operation(
            int(sequence), device, operation, int(start), int(end), bytes.fromhex(sent), bytes.fromhex(received), error
        )
    except ValueError:
        raise EvidenceError(f"{name}:{number}: the line is damaged", "hil verify shows what else is") from None
