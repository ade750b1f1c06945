"""Serial lines over a network (RFC 2217): Telnet's escapes, and the settings of the line."""

from __future__ import annotations

import errno
import struct
import time
from collections.abc import Callable
from threading import Event

from hil.guardian.ports.line import Gone, Line
from hil.model.serial_line import SerialLine

__all__ = ["Telnet", "TelnetLine"]

_IAC, _DONT, _DO, _WONT, _WILL, _SB, _SE = 255, 254, 253, 252, 251, 250, 240
_BINARY, _ECHO, _SUPPRESS_GO_AHEAD, _COM_PORT = 0, 1, 3, 44
_OURS = (_BINARY, _SUPPRESS_GO_AHEAD, _COM_PORT)
_THEIRS = (_BINARY, _SUPPRESS_GO_AHEAD)
# RFC 2217, section 3: what the client sets, and its values.
_SPEED, _DATA_BITS, _PARITY, _STOP_BITS, _CONTROL = 1, 2, 3, 4, 5
_ANSWER = 100
_PARITIES = {"none": 1, "odd": 2, "even": 3, "mark": 4, "space": 5}
_STOPS = {"1": 1, "2": 2, "1.5": 3}
_FLOWS = {"none": 1, "xon/xoff": 2, "rts/cts": 3}
_DTR = {True: 8, False: 9}
_LONGEST_SUBNEGOTIATION = 256
_DTR_S = 0.2


class Telnet:
    """Strips Telnet from received bytes, and adds it to those sent.

    Attributes:
        answers: bytes to be sent, unescaped, in answer to requests of the other end.
        refused: what the other end refused; nothing may be sent to the instrument then.
    """

    def __init__(self) -> None:
        self.answers = b""
        self.refused = ""
        self._wanted: dict[int, bytes] = {}
        self._agreed: set[tuple[int, int]] = set()
        self._state: Callable[[int], None] = self._data
        self._verb = 0
        self._subnegotiated = bytearray()
        self._plain = bytearray()

    @staticmethod
    def escaped(data: bytes) -> bytes:
        """Return data escaped for sending: the byte that begins a command is doubled."""
        return data.replace(b"\xff", b"\xff\xff")

    def offers(self) -> bytes:
        """Return the opening negotiation: a line without translations, whose settings this end may change."""
        ours = b"".join(bytes((_IAC, _WILL, option)) for option in _OURS)
        return ours + b"".join(bytes((_IAC, _DO, option)) for option in _THEIRS)

    @property
    def is_agreed(self) -> bool:
        """Whether the other end has accepted the offers."""
        return {(_DO, _BINARY), (_DO, _COM_PORT), (_WILL, _BINARY)} <= self._agreed

    def settings(self, baud: int, line: SerialLine) -> bytes:
        """Return the commands that set the line; their answers are then awaited."""
        self._wanted = {
            _SPEED: struct.pack(">I", baud or 9600),
            _DATA_BITS: bytes((line.data_bits,)),
            _PARITY: bytes((_PARITIES[line.parity],)),
            _STOP_BITS: bytes((_STOPS[line.stop_bits],)),
            _CONTROL: bytes((_FLOWS[line.flow],)),
        }
        return b"".join(_subnegotiation(key, value) for key, value in self._wanted.items())

    @property
    def is_set(self) -> bool:
        """Whether the other end has confirmed every setting."""
        return not self._wanted

    def dtr(self, *, up: bool) -> bytes:
        """Return the command that raises or drops DTR."""
        return _subnegotiation(_CONTROL, bytes((_DTR[up],)))

    def plain(self, data: bytes) -> bytes:
        """Return the instrument's bytes in what was received; Telnet's own are processed."""
        for byte in data:
            self._state(byte)
        plain, self._plain = bytes(self._plain), bytearray()
        return plain

    def _data(self, byte: int) -> None:
        if byte == _IAC:
            self._state = self._command
        else:
            self._plain.append(byte)

    def _command(self, byte: int) -> None:
        self._state = self._data
        if byte == _IAC:
            self._plain.append(byte)
        elif byte in {_WILL, _WONT, _DO, _DONT}:
            self._verb, self._state = byte, self._option
        elif byte == _SB:
            self._subnegotiated, self._state = bytearray(), self._inside

    def _option(self, option: int) -> None:
        self._state, verb = self._data, self._verb
        is_expected = option in (_OURS if verb in {_DO, _DONT} else _THEIRS)
        if verb in {_DO, _WILL} and is_expected:
            self._agreed.add((verb, option))
        elif verb == _WILL:  # whether it echoes does not matter here
            self.answers += bytes((_IAC, _DO if option == _ECHO else _DONT, option))
        elif verb == _DO:
            self.answers += bytes((_IAC, _WONT, option))
        elif is_expected and option == _COM_PORT:
            self.refused = "it does not set lines (RFC 2217): switch that on at the server, or use socket://"
        elif is_expected and option == _BINARY:
            self.refused = "it does not pass every byte through (RFC 856)"

    def _inside(self, byte: int) -> None:
        if byte == _IAC:
            self._state = self._escape_inside
        elif len(self._subnegotiated) < _LONGEST_SUBNEGOTIATION:
            self._subnegotiated.append(byte)

    def _escape_inside(self, byte: int) -> None:
        self._state = self._inside
        if byte == _IAC:
            self._subnegotiated.append(byte)
        elif byte == _SE:
            self._state = self._data
            self._take_subnegotiation(bytes(self._subnegotiated))

    def _take_subnegotiation(self, content: bytes) -> None:
        """Take what the other end reports about the line; modem lines are ignored."""
        if len(content) < 3 or content[0] != _COM_PORT or content[1] - _ANSWER not in self._wanted:
            return
        key, value = content[1] - _ANSWER, content[2:]
        if value == self._wanted[key]:
            del self._wanted[key]
        elif key != _CONTROL:  # an answer to another control, such as DTR, has the same key
            self.refused = (
                f"it set {value.hex()} where {self._wanted[key].hex()} was asked for (RFC 2217, command {key})"
            )


def _subnegotiation(key: int, value: bytes) -> bytes:
    return bytes((_IAC, _SB, _COM_PORT, key)) + Telnet.escaped(value) + bytes((_IAC, _SE))


class TelnetLine(Line):
    """A line at the other end of a Telnet connection; what is heard and said are the instrument's bytes.

    Another process may have been in the middle of something: a piece of a command, which then looks like data, is
    discarded with everything that is heard while the instrument is brought into step.
    """

    def __init__(self, descriptor: int, baud: int = 0, interrupt: Event | None = None) -> None:
        super().__init__(descriptor, baud, interrupt)
        self.baud = baud or 9600
        self.telnet = Telnet()
        self._rest = b""

    def begin(self, line: SerialLine, until: float) -> None:
        """Negotiate a binary connection, and set the line.

        Raises:
            OSError: if the other end does not agree by the deadline, or is gone.
        """
        try:
            self._say_raw(self.telnet.offers(), until)
            self._await(lambda: self.telnet.is_agreed, "does not speak RFC 2217: is it set to telnet?", until)
            self._say_raw(self.telnet.settings(self.baud, line), until)
            self._await(lambda: self.telnet.is_set, "has not confirmed the settings of the line", until)
        except Gone as gone:
            raise OSError(errno.ECONNRESET, str(gone)) from gone

    def hear(self, until: float) -> bytes:
        """Return the first bytes from the instrument, empty if none come by the deadline. See `Line.hear`."""
        while True:
            came = super().hear(until)
            data = self.telnet.plain(came)
            self._answer()
            if data or not came or time.monotonic() >= until:
                return data

    def say(self, data: bytes, until: float) -> int:
        """Write until all is out or the deadline has passed; return how many bytes were certainly taken."""
        escaped = self._rest + self.telnet.escaped(data)
        taken = super().say(escaped, until)
        marks = taken - len(escaped[:taken].rstrip(b"\xff"))
        self._rest = b"\xff" * (marks % 2)  # half an escape would turn the next byte into a command
        return len(data) if taken == len(escaped) else taken * len(data) // len(escaped)

    def pull_dtr(self, *, up: bool) -> None:
        """Raise or drop DTR at the other end."""
        self._say_raw(self.telnet.dtr(up=up), time.monotonic() + _DTR_S)

    def _say_raw(self, data: bytes, until: float) -> None:
        if super().say(data, until) < len(data):
            raise OSError(errno.ETIMEDOUT, "it takes no bytes")

    def _answer(self) -> None:
        answers, self.telnet.answers = self.telnet.answers, b""
        if answers:
            super().say(answers, time.monotonic())

    def _await(self, condition: Callable[[], bool], otherwise: str, until: float) -> None:
        """Wait for a condition of the other end; what the instrument sends meanwhile is stale, and discarded."""
        while not condition():
            if self.telnet.refused or time.monotonic() >= until:
                raise OSError(errno.EPROTO, self.telnet.refused or f"it {otherwise}")
            self.telnet.plain(super().hear(until))
            self._answer()
