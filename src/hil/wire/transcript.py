"""The transcript: every operation on every port and bus, in the order in which it happened."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from io import FileIO
from pathlib import Path

from hil.model.errors import EvidenceError

__all__ = ["HEADER", "Operation", "Transcript", "read_transcript"]

_COLUMNS = "sequence\tdevice\toperation\tstart_ns\tend_ns\tsent\treceived\terror\n"
HEADER = f"hil/transcript/2 {_COLUMNS}"
"""The first line: format and columns, as many of them as every line has."""

_HEADER_1 = f"hil/transcript/1\t{_COLUMNS}"
"""Format 1 had the same lines, below a header with one field more."""

_FIELDS = 8


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
    """Collects operations as they happen; one for all devices, so that their order is kept.

    Lines wait in memory until `flush`, so that a full disk never looks like a fault of a device.

    Args:
        sink: an unbuffered file; None keeps none, for benches whose bytes nobody asks for.
    """

    def __init__(self, sink: FileIO | None) -> None:
        self._sink = sink
        self._sequence = 0
        self._waiting = bytearray(HEADER.encode())

    def note(
        self,
        device: str,
        name: str,
        start_ns: int,
        end_ns: int,
        *,
        sent: bytes = b"",
        received: bytes = b"",
        error: str = "",
    ) -> None:
        """Take one operation."""
        if self._sink is None:
            return
        line = f"{self._sequence}\t{device}\t{name}\t{start_ns}\t{end_ns}\t{sent.hex()}\t{received.hex()}\t{error}\n"
        self._sequence += 1
        self._waiting += line.encode()

    def flush(self) -> None:
        """Hand what is waiting to the operating system; what finds no space goes on waiting.

        Raises:
            OSError: where the disk is full or fails.
        """
        if self._sink is None:
            return
        while self._waiting:
            written = self._sink.write(self._waiting)
            del self._waiting[:written]


def read_transcript(path: Path) -> Iterator[Operation]:
    """Yield the operations of a transcript; a torn last line is left out.

    Raises:
        EvidenceError: if the file is missing, is not a transcript, or a line of it is damaged.
    """
    if not path.is_file():
        raise EvidenceError(f"{path} is missing", "without its transcript a run cannot be replayed")
    with path.open(encoding="utf-8", newline="\n") as lines:
        if next(lines, "") not in {HEADER, _HEADER_1}:
            raise EvidenceError(f"{path.name} is not a transcript of format 1 or 2")
        for number, line in enumerate(lines, start=2):
            if line.endswith("\n"):
                yield _parse(line, path.name, number)


def _parse(line: str, name: str, number: int) -> Operation:
    fields = line[:-1].split("\t", _FIELDS - 1)
    try:
        sequence, device, operation, start, end, sent, received, error = fields
        return Operation(
            int(sequence), device, operation, int(start), int(end), bytes.fromhex(sent), bytes.fromhex(received), error
        )
    except ValueError:
        raise EvidenceError(f"{name}:{number}: the line is damaged", "hil verify tells what else is") from None
