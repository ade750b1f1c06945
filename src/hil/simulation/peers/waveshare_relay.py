"""A Waveshare Modbus RTU relay board with eight changeover contacts.

Facts from its published protocol (second version): 01 reads relays, 05 writes one (FF00 on, 0000 off,
5500 toggles, address 00FF all), 0F writes several, 03 and 06 reach the slave's address (4000h), 06 the
line's parameters (2000h), 03 the version in hundredths (8000h). The address 0 reaches every board: relay
commands are then carried out without an answer, 03 and 06 are answered as published for finding a board.
05 at 0200h and the relay closes it for so many tenths of a second, at 0400h opens it for as long; the command begins
that time again, and any other command to the relay ends it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Annotated

from hil.clock.port import NANOSECONDS
from hil.model.notation import NotNegative, whole
from hil.simulation.faults import Fault, Faults
from hil.simulation.peers.modbus_rtu import FrameReader, checked, seal
from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.peers.timing import Alarm, Alarms
from hil.simulation.plants.terminal import InputPoint
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import Line, PeerClock

__all__ = ["MODEL", "RelayTruth", "WaveshareRelay", "Welded", "build"]

_CONTACTS = 8
_READ_REGISTER, _WRITE_REGISTER = 0x03, 0x06
_ALL = 0x00FF
_ON, _OFF, _TOGGLE = 0xFF00, 0x0000, 0x5500
_FLASH = {0x02: True, 0x04: False}
_LONGEST_FLASH = 0x7FFF
_TENTH_NS = NANOSECONDS // 10
_ADDRESS, _LINE, _VERSION = 0x4000, 0x2000, 0x8000
_SIMULATED = 0x5349
"""The version of a simulated board, the letters SI; no real one can have it."""
_USUAL_BAUD = 9600
_REPLY_NS = 2_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Welded(Fault):
    """A contact that is closed does not open."""

    name = "welded"

    contact: Annotated[int, whole(1)]

    def concerns(self, part: int) -> bool:
        """Return whether it is this contact."""
        return self.contact == part


@dataclass(frozen=True, slots=True, kw_only=True)
class RelayTruth:
    """One board.

    Attributes:
        address: of the unit, None for the one that the bench file has.
        welded: contacts that do not open.
        operate_time: from a command to its contact [s].
    """

    address: Annotated[int | None, whole(1, 255)] = None
    welded: tuple[Annotated[int, whole(1, _CONTACTS)], ...] = ()
    operate_time: NotNegative = 8e-3


class _Exceptional(Exception):
    """The request is answered with an exception code."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class WaveshareRelay(Stateful):
    """The board: coils as commanded, and contacts that follow them a little later, unless they are welded.

    The fault `welded` lets a contact that is closed, or closes later, not open again while it lasts.

    Args:
        address: slave address, 1 to 255.
        baud: of its line.
        operate_ns: from the command to the contact.
        welded: contacts that stay closed from the start on.
        contacts: plant inputs by contact number.
        faults: what goes wrong.
    """

    _address: Kept[int]
    _coils: Kept[list[bool]]
    _closed: Kept[dict[int, bool]]
    _moving: Kept[dict[int, Alarm]]
    _timed: Kept[dict[int, Alarm]]
    _freed: Kept[Alarms]
    _reader: Kept[FrameReader]

    def __init__(
        self,
        *,
        address: int,
        baud: int,
        operate_ns: int,
        welded: tuple[int, ...],
        contacts: Mapping[int, InputPoint],
        faults: Faults,
    ) -> None:
        self._address = address
        self._operate_ns = operate_ns
        self._welded = welded
        self._points = contacts
        self._faults = faults
        self._coils = [False] * _CONTACTS
        self._closed = dict.fromkeys(range(1, _CONTACTS + 1), False)
        self._reader = FrameReader(baud, self._frame)
        self._line: Line
        self._clock: PeerClock

    def attach(self, line: Line, clock: PeerClock) -> None:
        """Connect the line; all coils are released, welded contacts are closed."""
        self._line = line
        self._clock = clock
        self._reader.attach(clock)
        contacts = range(1, _CONTACTS + 1)
        self._moving = {contact: Alarm(clock, partial(self._follow, contact)) for contact in contacts}
        self._timed = {contact: Alarm(clock, partial(self._flip, contact)) for contact in contacts}
        welds = self._faults.of(Welded)
        self._freed = Alarms(clock, [(fault.end_ns, partial(self._follow, fault.contact)) for fault in welds])
        for contact in contacts:
            self._follow(contact)

    def receive(self, data: bytes) -> None:
        """Take bytes of the line."""
        self._reader.receive(data)

    def _frame(self, frame: bytes) -> None:
        body = checked(frame)
        if body is None or body[0] not in {0, self._address}:
            return
        function, data = body[1], body[2:]
        answered = body[0] != 0 or function in {_READ_REGISTER, _WRITE_REGISTER}
        reply = self._reply(function, data)
        if answered:
            sender = self._address if function == _READ_REGISTER else body[0]
            self._line.send(seal(bytes([sender]) + reply), _REPLY_NS)

    def _reply(self, function: int, data: bytes) -> bytes:
        action = self._functions.get(function)
        if action is None:
            return bytes([function | 0x80, 1])
        try:
            return bytes([function]) + action(data)
        except _Exceptional as refusal:
            return bytes([function | 0x80, refusal.code])

    @property
    def _functions(self) -> Mapping[int, Callable[[bytes], bytes]]:
        return {
            0x01: self._read_coils,
            _READ_REGISTER: self._read_register,
            0x05: self._write_coil,
            _WRITE_REGISTER: self._write_register,
            0x0F: self._write_coils,
        }

    def _read_coils(self, data: bytes) -> bytes:
        start, count = _words(data, 2)
        _in_range(start, count)
        value = sum(1 << place for place, on in enumerate(self._coils[start : start + count]) if on)
        return bytes([1, value])

    def _write_coil(self, data: bytes) -> bytes:
        number, value = _words(data, 2)
        if number >> 8 in _FLASH:
            self._flash(number & 0xFF, value, on=_FLASH[number >> 8])
            return data
        if number >= _CONTACTS and number != _ALL:
            raise _Exceptional(2)
        if value not in {_ON, _OFF, _TOGGLE}:
            raise _Exceptional(3)
        for coil in range(_CONTACTS) if number == _ALL else (number,):
            self._set(coil, on=not self._coils[coil] if value == _TOGGLE else value == _ON)
        return data

    def _flash(self, coil: int, tenths: int, *, on: bool) -> None:
        if coil >= _CONTACTS:
            raise _Exceptional(2)
        if not 1 <= tenths <= _LONGEST_FLASH:
            raise _Exceptional(3)
        self._set(coil, on=on)
        self._timed[coil + 1].set(self._clock.now_ns() + tenths * _TENTH_NS)

    def _flip(self, contact: int) -> None:
        self._set(contact - 1, on=not self._coils[contact - 1])

    def _write_coils(self, data: bytes) -> bytes:
        if len(data) < 6:
            raise _Exceptional(3)
        start, count = _words(data[:4], 2)
        _in_range(start, count)
        if data[4] != 1 or len(data) != 6:
            raise _Exceptional(3)
        for place in range(count):
            self._set(start + place, on=bool(data[5] >> place & 1))
        return data[:4]

    def _read_register(self, data: bytes) -> bytes:
        register, count = _words(data, 2)
        values = {_ADDRESS: self._address, _VERSION: _SIMULATED}
        if register not in values:
            raise _Exceptional(2)
        if count != 1:
            raise _Exceptional(3)
        return b"\x02" + values[register].to_bytes(2, "big")

    def _write_register(self, data: bytes) -> bytes:
        register, value = _words(data, 2)
        if register == _ADDRESS:
            if not 1 <= value <= 0xFF:
                raise _Exceptional(3)
            self._address = value
        elif register != _LINE:
            raise _Exceptional(2)
        elif value >> 8 > 2 or value & 0xFF > 7:
            raise _Exceptional(3)
        return data

    def _set(self, coil: int, *, on: bool) -> None:
        self._timed[coil + 1].clear()
        if self._coils[coil] != on:
            self._coils[coil] = on
            self._moving[coil + 1].set(self._clock.now_ns() + self._operate_ns)

    def _follow(self, contact: int) -> None:
        """Bring a contact to where its coil has it by now; one that still moves stays."""
        now_ns = self._clock.now_ns()
        moves_until_ns = self._moving[contact].due_ns
        if moves_until_ns is not None and moves_until_ns > now_ns:
            return
        sticks = self._closed[contact] and self._faults.now(Welded, now_ns, contact) is not None
        self._closed[contact] = sticks or contact in self._welded or self._coils[contact - 1]
        if contact in self._points:
            self._points[contact].command(self._closed[contact])


def _words(data: bytes, count: int) -> tuple[int, ...]:
    if len(data) != 2 * count:
        raise _Exceptional(3)
    return tuple(int.from_bytes(data[place : place + 2], "big") for place in range(0, len(data), 2))


def _in_range(start: int, count: int) -> None:
    if not 1 <= count <= _CONTACTS:
        raise _Exceptional(3)
    if start + count > _CONTACTS:
        raise _Exceptional(2)


def build(setup: PeerSetup) -> WaveshareRelay:
    """Build the board; terminals `1` to `8` go to inputs of plants.

    Raises:
        TruthError: with everything that is wrong in its truth or terminals.
    """
    truth = setup.truth
    board = truth.part(RelayTruth)
    points = {number: setup.connections.input(str(number)) for number in range(1, _CONTACTS + 1)}
    setup.finish()
    return WaveshareRelay(
        address=board.address or setup.instrument.address or 1,
        baud=setup.instrument.baud or _USUAL_BAUD,
        operate_ns=round(board.operate_time * NANOSECONDS),
        welded=board.welded,
        contacts={number: point for number, point in points.items() if point is not None},
        faults=setup.faults,
    )


MODEL = PeerModel(link="serial", fault_kinds=(Welded,), build=build)
"""The model for the driver `waveshare-relay`."""
