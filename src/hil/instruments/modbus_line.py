"""The host's end of a Modbus RTU line: pymodbus frames and decodes, the bench's clock bounds.

pymodbus' own serial client opens ports, sleeps and keeps deadlines on the wall clock, so only its framer and its PDUs
are used, and in this module alone: no wall time decides anything. What ends an exchange is the port's timeout and the
bench's clock.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Sequence
from functools import lru_cache
from typing import Protocol

from pymodbus.exceptions import ModbusException
from pymodbus.framer import FramerRTU
from pymodbus.pdu import DecodePDU
from pymodbus.pdu.bit_message import (
    ReadCoilsRequest,
    ReadCoilsResponse,
    WriteMultipleCoilsRequest,
    WriteMultipleCoilsResponse,
    WriteSingleCoilRequest,
)
from pymodbus.pdu.register_message import (
    ReadHoldingRegistersRequest,
    ReadHoldingRegistersResponse,
    WriteSingleRegisterRequest,
)

from hil.clock.port import Clock
from hil.instruments.safing import LONGEST_REPLY_S
from hil.model.safing import Exchange
from hil.wire.port import Port

__all__ = [
    "SILENCE",
    "ModbusLine",
    "Reply",
    "coil",
    "coils",
    "coils_taken",
    "coils_told",
    "exchange",
    "exchange_like",
    "one_register",
    "question",
    "register",
    "registers_told",
    "timed_coil",
]

_QUIET_S = 0.05
_FRAMER = FramerRTU(DecodePDU(is_server=False))
_READS = {1: ReadCoilsRequest, 3: ReadHoldingRegistersRequest}

_LOGGER = logging.getLogger("pymodbus")
_LOGGER.addHandler(logging.NullHandler())
_LOGGER.propagate = False
_SILENCE_S = 0.05  # 3.5 characters of 11 bits take 32 ms at 1200 baud, and an adapter may hold bytes for 16 ms

SILENCE = Exchange(send=b"", quiet_s=_SILENCE_S)
"""What ends half a frame."""


class Reply(Protocol):
    """What is read of pymodbus' decoded replies; each kind has some of it."""

    function_code: int
    exception_code: int
    address: int
    count: int
    bits: list[bool]
    registers: list[int]


@lru_cache(maxsize=256)
def question(function: int, address: int, count: int, unit: int) -> bytes:
    """Return the frame of a read (functions 01 and 03); a bench asks the same ones for weeks."""
    return bytes(_FRAMER.buildFrame(_READS[function](address=address, count=count, dev_id=unit)))


def coil(address: int, on: bool, unit: int) -> bytes:
    """Return the frame that switches one coil (function 05)."""
    return bytes(_FRAMER.buildFrame(WriteSingleCoilRequest(address=address, bits=[on], dev_id=unit)))


def timed_coil(address: int, tenths: int, unit: int) -> bytes:
    """Return the frame that switches one coil on for tenths of a second (function 05; not a value of the standard)."""
    body = bytes([unit, 5]) + address.to_bytes(2, "big") + tenths.to_bytes(2, "big")
    return body + int(FramerRTU.compute_CRC(body)).to_bytes(2, "big")


def coils(address: int, values: Sequence[bool], unit: int) -> bytes:
    """Return the frame that switches coils from `address` on (function 0F)."""
    return bytes(_FRAMER.buildFrame(WriteMultipleCoilsRequest(address=address, bits=list(values), dev_id=unit)))


def register(address: int, value: int, unit: int) -> bytes:
    """Return the frame that writes one holding register (function 06)."""
    return bytes(_FRAMER.buildFrame(WriteSingleRegisterRequest(address=address, registers=[value], dev_id=unit)))


def coils_taken(address: int, count: int, unit: int) -> bytes:
    """Return the frame by which a unit acknowledges that it switched coils (function 0F)."""
    return bytes(_FRAMER.buildFrame(WriteMultipleCoilsResponse(address=address, count=count, dev_id=unit)))


def coils_told(values: Sequence[bool], unit: int) -> bytes:
    """Return the frame by which a unit says how its coils are (function 01)."""
    return bytes(_FRAMER.buildFrame(ReadCoilsResponse(bits=list(values), dev_id=unit)))


def registers_told(values: Sequence[int], unit: int) -> bytes:
    """Return the frame with which a unit reports holding registers (function 03)."""
    return bytes(_FRAMER.buildFrame(ReadHoldingRegistersResponse(registers=list(values), dev_id=unit)))


class ModbusLine:
    """Frames out, frames in, on a port that is already open.

    Args:
        port: the open byte stream.
        clock: the bench's clock.
        unit: whose replies count.
        timeout: longest wait for one reply in seconds.

    Attributes:
        sent: the last request.
        received: every byte that came after it.
        discarded: how many bytes came that nobody had asked for.
    """

    def __init__(self, port: Port, clock: Clock, unit: int, timeout: float) -> None:
        self._port = port
        self._clock = clock
        self._unit = unit
        self._timeout = timeout
        self._quiet_ns = -1  # when nothing waited, though somebody looked
        self.sent = b""
        self.received = b""
        self.discarded = 0

    def ask(self, request: bytes) -> Reply | None:
        """Send a frame; return the first reply of the unit, None if none came in time that can be decoded."""
        if self._quiet_ns != self._clock.now_ns():
            self._throw_away()
        self._quiet_ns = -1
        self.sent, deadline = request, self._clock.now() + self._timeout
        self._port.timeout = self._timeout
        self.received = waiting = data = self._port.exchange(request)
        while data:
            try:
                used, reply = _understood(waiting, self._unit)
            except ModbusException:
                return None
            if reply is not None:
                return reply
            data = self._receive(deadline - self._clock.now())
            self.received += data
            waiting = waiting[used:] + data
        return None

    def _throw_away(self) -> None:
        """Throw away what nobody asked for."""
        if waiting := self._port.in_waiting:
            self.discarded += waiting
            self._port.reset_input_buffer()

    def _receive(self, left: float) -> bytes:
        """Return what has come, or wait for the first byte for so many seconds; empty ends the exchange."""
        if left <= 0:
            return b""
        self._port.timeout = min(left, self._timeout)  # a difference of clock readings can be longer by rounding
        first = self._port.read(1)
        return first + self._port.read(self._port.in_waiting) if first else b""

    def unasked(self, gap: float) -> bytes:
        """Return what waits, or comes within `gap` seconds."""
        if not gap and not self._port.in_waiting:
            self._quiet_ns = self._clock.now_ns()
            return b""
        self._port.timeout = min(gap, LONGEST_REPLY_S)
        stray = self._port.read(1)
        if stray:
            stray += self._port.read(self._port.in_waiting)
        self.discarded += len(stray)
        return stray

    def settle(self) -> None:
        """Let a late reply come and throw it away, so that it answers no later request."""
        self._port.timeout = _QUIET_S
        deadline = self._clock.now() + self._timeout
        while self._clock.now() < deadline and self._port.read(1):
            self.discarded += 1 + self._port.in_waiting
            self._port.reset_input_buffer()


@lru_cache(maxsize=1024)
def _understood(data: bytes, unit: int) -> tuple[int, Reply | None]:
    """Return how many bytes are done with, and the reply in them; what a bench hears for weeks it hears often."""
    used, reply = _FRAMER.handleFrame(data, unit, 0)
    return used, reply


def exchange(request: bytes, reply: bytes, within_s: float) -> Exchange:
    """Return the exchange of a request and the one reply to it that is right, as bytes alone.

    A silence of 3.5 characters ends whatever frame was begun (Modbus over Serial Line V1.02, 2.5.1.1), and a unit
    throws half a frame away. The reply is compared whole, checksum included, and from the first byte on. So a number in
    a reply cannot be held to bounds, only to a value.
    """
    return Exchange(send=request, expect=rb"\A" + re.escape(reply), within_s=within_s, quiet_s=_SILENCE_S)


def exchange_like(request: bytes, reply: bytes, within_s: float) -> Exchange:
    """Return the exchange of a request and a reply of which only a regular expression is known.

    Its checksum cannot be compared, so this alone proves nothing: ask twice, and for something else besides.
    """
    return Exchange(send=request, expect=rb"\A" + reply, within_s=within_s, quiet_s=_SILENCE_S)


def one_register(address: int, unit: int, within_s: float) -> Exchange:
    """Return the exchange that asks for one register, whatever is in it."""
    return exchange_like(question(3, address, 1, unit), re.escape(bytes((unit,))) + rb"\x03\x02.{4}", within_s)
