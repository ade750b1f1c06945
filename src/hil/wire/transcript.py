"""The transcript: every operation on every port and bus, in the order in which it happened."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from hil.model.errors import EvidenceError

__all__ = ["HEADER", "Operation", "Transcript", "read_transcript"]

HEADER = "hil/transcript/1\tsequence\tdevice\toperation\tstart_ns\tend_ns\tsent\treceived\terror\n"
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
    """Writes operations as they happen; one for all devices, so that their order is kept.

    Args:
        sink: where the lines go; None keeps none, for benches whose bytes nobody asks for.
    """

    def __init__(self, sink: BinaryIO | None) -> None:
        self._sink = sink
        self._sequence = 0
        self.in_transaction = False
        if sink is not None:
            sink.write(HEADER.encode())

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
        """Write one operation."""
        sequence = self._sequence
        self._sequence += 1
        if self._sink is not None:
            line = f"{sequence}\t{device}\t{name}\t{start_ns}\t{end_ns}\t{sent.hex()}\t{received.hex()}\t{error}\n"
            self._sink.write(line.encode())

    def flush(self) -> None:
        """Hand what was written to the operating system."""
        if self._sink is not None:
            self._sink.flush()


def read_transcript(path: Path) -> Iterator[Operation]:
    """Yield the operations of a transcript; a torn last line is left out.

    Raises:
        EvidenceError: if the file is not a transcript, or a line of it is damaged.
    """
    with path.open(encoding="utf-8", newline="\n") as lines:
        if next(lines, "") != HEADER:
            raise EvidenceError(f"{path.name} is not a transcript of format 1")
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
