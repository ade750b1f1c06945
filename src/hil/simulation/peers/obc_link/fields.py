"""What requests of the OBC link say, field by field, and what the simulated board refuses in them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum

from hil.simulation.peers.obc_link.uart import LARGEST, OVERHEAD

__all__ = [
    "BUSES",
    "LINES",
    "MESSAGES",
    "STREAMS",
    "TRANSFERS",
    "Code",
    "FifoTransfer",
    "Message",
    "Program",
    "Reader",
    "Refusal",
    "RegisterTransfer",
    "messages_of",
    "program_of",
]

BUSES, LINES, STREAMS, TRANSFERS, MESSAGES = 1, 2, 1, 8, 8

_BITS = 9
_LONGEST_BITS_SECONDS = 0.1
_MOST_DETAIL = 0xFFFF
_SHORTEST_US, _LONGEST_US = 1000, 3_600_000_000
_REPLY_HEAD, _FRAME_HEAD, _ITEM_HEAD = 2, 19, 3


class Code(IntEnum):
    """Codes of replies."""

    OK = 0
    UNKNOWN_TYPE = 1
    VERSION = 2
    LENGTH = 3
    PARAMETER = 4
    SEQUENCE = 5
    BUSY = 6
    NOT_RUNNING = 7
    TOO_LONG = 8


class Refusal(Exception):
    """The request is answered with an error code and its detail."""

    def __init__(self, code: Code, detail: int) -> None:
        super().__init__(code, detail)
        self.payload = bytes([code]) + min(detail, _MOST_DETAIL).to_bytes(2, "little")


class Reader:
    """Reads a payload from its beginning.

    A payload that ends early is a wrong length at once. Values are noted and reported by `end`, when the length is
    known to be right; a value that decides the length is reported at once, with whatever is wrong before it.
    """

    def __init__(self, payload: bytes) -> None:
        self._payload = payload
        self._place = 0
        self._wrong: int | None = None

    def number(self, size: int, lowest: int = 0, highest: int | None = None, *, decides: bool = False) -> int:
        """Return an integer of `size` bytes; `decides` says that the length hangs on it."""
        value = int.from_bytes(self.taken(size), "little")
        if value < lowest or (highest is not None and value > highest):
            self.refuse(self._place - size)
            if decides:
                self._tell()
        return value

    def taken(self, size: int) -> bytes:
        """Return bytes as they are."""
        if self._place + size > len(self._payload):
            raise Refusal(Code.LENGTH, len(self._payload))
        self._place += size
        return self._payload[self._place - size : self._place]

    def refuse(self, offset: int) -> None:
        """Note that the field at an offset is not allowed; the first one counts."""
        if self._wrong is None:
            self._wrong = offset

    def end(self) -> None:
        """Refuse a payload that continues, and values that are not allowed."""
        if self._place != len(self._payload):
            raise Refusal(Code.LENGTH, len(self._payload))
        self._tell()

    def _tell(self) -> None:
        if self._wrong is not None:
            raise Refusal(Code.PARAMETER, self._wrong)


@dataclass(frozen=True, slots=True)
class Message:
    """One message of an I2C request: what is written, or how much is read."""

    address: int
    written: bytes
    length: int

    @property
    def size(self) -> int:
        """The bytes on the bus."""
        return 1 + len(self.written) + self.length


@dataclass(frozen=True, slots=True)
class RegisterTransfer:
    """Write the register's number, read."""

    address: int
    register: int
    length: int

    @property
    def size(self) -> int:
        """The bytes on the bus."""
        return 3 + self.length


@dataclass(frozen=True, slots=True)
class FifoTransfer:
    """Read a counter, then whole records."""

    address: int
    counter: int
    unit: int
    record: int
    register: int
    length: int

    @property
    def size(self) -> int:
        """The bytes on the bus at the most."""
        return 5 + 3 + self.length


@dataclass(frozen=True, slots=True, kw_only=True)
class Program:
    """What STREAM_START asks for; `period_us` is 0 where a line triggers."""

    number: int
    period_us: int
    line: int | None
    watermark: int
    transfers: tuple[RegisterTransfer | FifoTransfer, ...]


def messages_of(payload: bytes, bits_per_second: float) -> tuple[Message, ...]:
    """Return the messages of an I2C request.

    Raises:
        Refusal: if it is not allowed, or too long for a frame or the bus.
    """
    reader = Reader(payload)
    reader.number(1, 0, BUSES - 1)
    count = reader.number(1, 1, MESSAGES, decides=True)
    messages = tuple(_message(reader) for _ in range(count))
    reader.end()
    _fits(_REPLY_HEAD + sum(_ITEM_HEAD + message.length for message in messages))
    _brief(messages, bits_per_second)
    return messages


def program_of(payload: bytes, bits_per_second: float, busy: Callable[[], None]) -> Program:
    """Return the program of a STREAM_START.

    Args:
        payload: the request's.
        bits_per_second: speed of the bus.
        busy: refuses where the stream runs already; asked in its place in the order of checks.

    Raises:
        Refusal: if it is not allowed, or too long for a frame or the bus.
    """
    reader = Reader(payload)
    number = reader.number(1, 0, STREAMS - 1)
    reader.number(1, 0, BUSES - 1)
    by_line = bool(reader.number(1, 0, 1))
    trigger = reader.number(4, *((0, LINES - 1) if by_line else (_SHORTEST_US, _LONGEST_US)))
    watermark = reader.number(2)
    count = reader.number(1, 1, TRANSFERS, decides=True)
    transfers = tuple(_transfer(reader) for _ in range(count))
    if watermark and not any(isinstance(transfer, FifoTransfer) for transfer in transfers):
        reader.refuse(7)
    reader.end()
    busy()
    _fits(_FRAME_HEAD + sum(_ITEM_HEAD + transfer.length for transfer in transfers))
    _brief(transfers, bits_per_second)
    return Program(
        number=number,
        period_us=0 if by_line else trigger,
        line=trigger if by_line else None,
        watermark=watermark,
        transfers=transfers,
    )


def _message(reader: Reader) -> Message:
    address = reader.number(1, 0, 0x7F)
    reading = bool(reader.number(1, 0, 1, decides=True))
    length = reader.number(2, 1 if reading else 0)
    return Message(address, b"" if reading else reader.taken(length), length if reading else 0)


def _transfer(reader: Reader) -> RegisterTransfer | FifoTransfer:
    is_fifo = bool(reader.number(1, 0, 1, decides=True))
    address, register = reader.number(1, 0, 0x7F), reader.number(1)
    if not is_fifo:
        return RegisterTransfer(address, register, reader.number(2, 1))
    unit, record = reader.number(1, 1), reader.number(1, 1)
    data = reader.number(1)
    return FifoTransfer(address, register, unit, record, data, reader.number(2, record))


def _fits(payload: int) -> None:
    if payload + OVERHEAD > LARGEST:
        raise Refusal(Code.TOO_LONG, payload + OVERHEAD)


def _brief(parts: Sequence[Message | RegisterTransfer | FifoTransfer], bits_per_second: float) -> None:
    if sum(part.size for part in parts) * _BITS / bits_per_second > _LONGEST_BITS_SECONDS:
        raise Refusal(Code.TOO_LONG, 0)
