"""The host's end of a Modbus RTU line: framing and decoding by pymodbus, timing by the bench's clock.

pymodbus' serial client opens ports, sleeps and keeps deadlines on the wall clock, so only its framer and PDUs are
used, and only in this module: no outcome depends on wall time. The port's timeout and the bench's clock end an
exchange.
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
_SILENCE_S = 0.05  # 3.5 characters of 11 bits take 32 ms at 1200 baud, plus up to 16 ms adapter latency

SILENCE = Exchange(send=b"", quiet_s=_SILENCE_S)
"""Silence that terminates a partial frame."""


class Reply(Protocol):
    """Attributes used of pymodbus' decoded replies; each kind has some of them."""

    function_code: int
    exception_code: int
    address: int
    count: int
    bits: list[bool]
    registers: list[int]


@lru_cache(maxsize=256)
def question(function: int, address: int, count: int, unit: int) -> bytes:
    """Return the frame of a read (functions 01 and 03), cached because a bench repeats the same ones for weeks."""
    return bytes(_FRAMER.buildFrame(_READS[function](address=address, count=count, dev_id=unit)))


def coil(address: int, on: bool, unit: int) -> bytes:
    """Return the frame that switches one coil (function 05)."""
    return bytes(_FRAMER.buildFrame(WriteSingleCoilRequest(address=address, bits=[on], dev_id=unit)))


def timed_coil(address: int, tenths: int, unit: int) -> bytes:
    """Return the frame that switches one coil on for `tenths` x 0.1 s (function 05, with a non-standard value)."""
    body = bytes([unit, 5]) + address.to_bytes(2, "big") + tenths.to_bytes(2, "big")
    return body + int(FramerRTU.compute_CRC(body)).to_bytes(2, "big")


def coils(address: int, values: Sequence[bool], unit: int) -> bytes:
    """Return the frame that writes consecutive coils starting at `address` (function 0F)."""
    return bytes(_FRAMER.buildFrame(WriteMultipleCoilsRequest(address=address, bits=list(values), dev_id=unit)))


def register(address: int, value: int, unit: int) -> bytes:
    """Return the frame that writes one holding register (function 06)."""
    return bytes(_FRAMER.buildFrame(WriteSingleRegisterRequest(address=address, registers=[value], dev_id=unit)))


def coils_taken(address: int, count: int, unit: int) -> bytes:
    """Return the reply frame that acknowledges a write of coils (function 0F)."""
    return bytes(_FRAMER.buildFrame(WriteMultipleCoilsResponse(address=address, count=count, dev_id=unit)))


def coils_told(values: Sequence[bool], unit: int) -> bytes:
    """Return the reply frame that reports coils (function 01)."""
    return bytes(_FRAMER.buildFrame(ReadCoilsResponse(bits=list(values), dev_id=unit)))


def registers_told(values: Sequence[int], unit: int) -> bytes:
    """Return the reply frame that reports holding registers (function 03)."""
    return bytes(_FRAMER.buildFrame(ReadHoldingRegistersResponse(registers=list(values), dev_id=unit)))


class ModbusLine:
    """Frames out, frames in, on a port that is already open.

    Args:
        port: the open byte stream.
        clock: the bench's clock.
        unit: address of the unit whose replies are accepted.
        timeout: longest wait for one reply in seconds.

    Attributes:
        sent: the last request.
        received: every byte received since.
        discarded: number of unsolicited bytes received.
    """

    def __init__(self, port: Port, clock: Clock, unit: int, timeout: float) -> None:
        self._port = port
        self._clock = clock
        self._unit = unit
        self._timeout = timeout
        self._quiet_ns = -1  # when the line was last found empty
        self.sent = b""
        self.received = b""
        self.discarded = 0

    def ask(self, request: bytes) -> Reply | None:
        """Send a frame; return the unit's first reply, None if none came in time that can be decoded."""
        if self._quiet_ns != self._clock.now_ns():
            self._discard_stray()
        self._quiet_ns = -1
        self.sent, deadline = request, self._clock.now() + self._timeout
        self._port.timeout = self._timeout
        self.received = waiting = data = self._port.exchange(request)
        while data:
            try:
                used, reply = _decoded_reply(waiting, self._unit)
            except ModbusException:
                return None
            if reply is not None:
                return reply
            data = self._receive(deadline - self._clock.now())
            self.received += data
            waiting = waiting[used:] + data
        return None

    def _discard_stray(self) -> None:
        """Discard unsolicited bytes."""
        if waiting := self._port.in_waiting:
            self.discarded += waiting
            self._port.reset_input_buffer()

    def _receive(self, left: float) -> bytes:
        """Return the bytes received, waiting up to `left` seconds for the first; none ends the exchange."""
        if left <= 0:
            return b""
        self._port.timeout = min(left, self._timeout)  # rounding can make a difference of clock readings longer
        first = self._port.read(1)
        return first + self._port.read(self._port.in_waiting) if first else b""

    def unasked(self, gap: float) -> bytes:
        """Return unsolicited bytes that are waiting, or arrive within `gap` seconds."""
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
        """Wait for a late reply and discard it, so that it cannot answer a later request."""
        self._port.timeout = _QUIET_S
        deadline = self._clock.now() + self._timeout
        while self._clock.now() < deadline and self._port.read(1):
            self.discarded += 1 + self._port.in_waiting
            self._port.reset_input_buffer()


@lru_cache(maxsize=1024)
def _decoded_reply(data: bytes, unit: int) -> tuple[int, Reply | None]:
    """Return the number of bytes consumed, and the reply in them; cached because the same replies recur for weeks."""
    used, reply = _FRAMER.handleFrame(data, unit, 0)
    return used, reply


def exchange(request: bytes, reply: bytes, within_s: float) -> Exchange:
    """Return the exchange of a request and its only correct reply, as bytes.

    A silence of 3.5 characters ends any partial frame (Modbus over Serial Line V1.02, 2.5.1.1), and the unit discards
    it. The whole reply is compared from the first byte, including the checksum. So a number in it can only be compared
    with a value, not with bounds.
    """
    return Exchange(send=request, expect=rb"\A" + re.escape(reply), within_s=within_s, quiet_s=_SILENCE_S)


def exchange_like(request: bytes, reply: bytes, within_s: float) -> Exchange:
    """Return the exchange of a request and a reply that is known only as a regular expression.

    The reply's checksum cannot be checked, so it proves nothing alone: send it twice, with another query besides.
    """
    return Exchange(send=request, expect=rb"\A" + reply, within_s=within_s, quiet_s=_SILENCE_S)


def one_register(address: int, unit: int, within_s: float) -> Exchange:
    """Return the exchange that reads one register, accepting any value."""
    return exchange_like(question(3, address, 1, unit), re.escape(bytes((unit,))) + rb"\x03\x02.{4}", within_s)
