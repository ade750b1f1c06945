"""Lines of the simulated cycler: how level 2 seals and reads them, and what happens to them on the way."""

from __future__ import annotations

import re
from binascii import crc_hqx
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated

from hil.analysis.noise.numbers import RandomStream
from hil.model.notation import whole
from hil.simulation.faults import Fault, Faults, Share
from hil.simulation.peers.cycler.make import Reading
from hil.simulation.peers.timing import BoardClock
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import Line, PeerClock

__all__ = ["Command", "LineReader", "LostLines", "Output", "TornLines", "crc", "parse", "seal"]

_LONGEST = 64
_HIGHEST_TAG = 65_535
_LINE = re.compile(rb"(:(0|[1-9][0-9]{0,4}) ([!-~]+(?: [!-~]+)*))\*([0-9A-F]{4})")


def crc(data: bytes) -> str:
    """Return the CRC-16/IBM-3740 of some bytes as four hexadecimal digits."""
    return f"{crc_hqx(data, 0xFFFF):04X}"


def seal(data: bytes) -> bytes:
    """Return a line of the device with its CRC and its end."""
    return b"%b*%04X\r\n" % (data, crc_hqx(data, 0xFFFF))


@dataclass(frozen=True, slots=True)
class Command:
    """One line of the host: its tag, the command, and its fields."""

    tag: str
    name: str
    fields: tuple[str, ...]


def parse(line: bytes) -> Command | None:
    """Return what a line says, or None if it is not a line of a host; its end is not part of it."""
    match = _LINE.fullmatch(line)
    if match is None or int(match[2]) > _HIGHEST_TAG or crc(match[1]) != match[4].decode("ascii"):
        return None
    name, *fields = match[3].decode("ascii").split(" ")
    return Command(match[2].decode("ascii"), name, tuple(fields))


class LineReader(Stateful):
    """Cuts what comes into lines; of a line that is too long only so much is kept that it is seen to be."""

    _rest: Kept[bytes]

    def __init__(self) -> None:
        self._rest = b""

    def clear(self) -> None:
        """Forget an unfinished line."""
        self._rest = b""

    def take(self, data: bytes) -> list[Command | None]:
        """Return the lines that are complete with these bytes, None for what is not a line of a host."""
        *lines, rest = (self._rest + data).split(b"\n")
        self._rest = rest[:_LONGEST]
        return [None if len(line) >= _LONGEST else parse(line.removesuffix(b"\r")) for line in lines if _holds(line)]


def _holds(line: bytes) -> bool:
    return line not in {b"", b"\r"}


_WRAP = 2**32
_US_PER_MS = 1000
_DRAWS = 3
_NUMBERS = b"%.3f;%.3f;%.4f;%.1f"
_DATA = _NUMBERS + b";%d;%d;%b"


@dataclass(frozen=True, slots=True, kw_only=True)
class LostLines(Fault):
    """As many lines as it says never arrive."""

    name = "lost-lines"

    lines: Annotated[int, whole(1)] = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class TornLines(Fault):
    """A piece is cut out of a share of the lines."""

    name = "torn-lines"

    share: Share = 1.0


class Output(Stateful):
    """Sends lines, in level 2 numbered, timed and sealed.

    The fault `lost-lines` swallows as many lines as it says, `torn-lines` cuts a piece out of some of them.

    Args:
        extended: whether it speaks level 2.
        device_clock: the device's time.
        faults: what goes wrong.
        chance: decides which lines are torn, and where.
    """

    number: Kept[int]
    _sent: Kept[int]
    _swallowed: Kept[list[int]]

    def __init__(self, *, extended: bool, device_clock: BoardClock, faults: Faults, chance: RandomStream) -> None:
        self.number = 1
        self._extended = extended
        self._device_clock = device_clock
        self._lost = faults.of(LostLines)
        self._torn = faults.of(TornLines)
        self._swallowed = [0] * len(self._lost)
        self._sent = 0
        self._chance = chance
        self._line: Line
        self._clock: PeerClock

    def attach(self, line: Line, clock: PeerClock) -> None:
        """Connect the line."""
        self._line = line
        self._clock = clock

    def milliseconds(self) -> int:
        """Return the device's time as its lines show it."""
        return self._device_clock.at(self._clock.now_ns()) // _US_PER_MS % _WRAP

    def numbered(self, text: str, tail: str = "") -> None:
        """Send a mark; in level 2 its number and the present time stand before the tail."""
        if not self._extended:
            self._send(f"{text}\r\n".encode("ascii"))
            return
        self.number = number = (self.number + 1) % _WRAP
        self.reply(f"{text};{number};{self.milliseconds()}{tail}")

    def data(self, lines: Iterable[tuple[Reading, int, int, int]], code: bytes) -> None:
        """Send data lines; in level 2 with their numbers, the device's time, and the code of its state.

        Args:
            lines: of each what was measured, the energy of the half-cycle in units of 0.1 mWh, the device's time [us],
                and how long from now it is until then [ns].
            code: `C`, `D` or `R`.
        """
        number, send = self.number, self._send if self._lost or self._torn else self._line.send
        if not self._extended:
            for (volts, amperes, degrees), energy, _, after_ns in lines:
                send(_NUMBERS % (volts / 1000, amperes / 1000, energy / 10_000, degrees / 10) + b"\r\n", after_ns)
            return
        for (volts, amperes, degrees), energy, at_us, after_ns in lines:
            number = (number + 1) % _WRAP
            shown_ms = at_us // _US_PER_MS % _WRAP
            told = _DATA % (volts / 1000, amperes / 1000, energy / 10_000, degrees / 10, number, shown_ms, code)
            send(b"%b*%04X\r\n" % (told, crc_hqx(told, 0xFFFF)), after_ns)  # `seal`, without a call for each line
        self.number = number

    def reply(self, text: str) -> None:
        """Send a reply."""
        self._send(seal(text.encode("ascii")))

    def restored(self) -> None:
        """Count for faults that were added since, too."""
        self._swallowed += [0] * (len(self._lost) - len(self._swallowed))

    def _send(self, data: bytes, after_ns: int = 0) -> None:
        self._sent += 1
        if self._lost and self._is_swallowed():
            return
        self._line.send(self._tear(data) if self._torn else data, after_ns)

    def _is_swallowed(self) -> bool:
        now_ns = self._clock.now_ns()
        for place, fault in enumerate(self._lost):
            if fault.holds(now_ns) and self._swallowed[place] < fault.lines:
                self._swallowed[place] += 1
                return True
        return False

    def _tear(self, data: bytes) -> bytes:
        now_ns = self._clock.now_ns()
        share = max((fault.share for fault in self._torn if fault.holds(now_ns)), default=0.0)
        hit, start, length = (self._chance.uniform(self._sent * _DRAWS + draw) for draw in range(_DRAWS))
        if hit >= share:
            return data
        first = int(start * (len(data) - 1))
        return data[:first] + data[first + 1 + int(length * (len(data) - 1 - first)) :]
