"""Modbus RTU session on a port: retries, stray bytes, and the fault that each failure becomes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from hil.clock.port import Clock
from hil.instruments.modbus_line import ModbusLine, Reply, coil, coils, question, register, timed_coil
from hil.instruments.safing import LONGEST_REPLY_S
from hil.model.errors import DeviceFault, Garbled, NoReply, Rejected
from hil.wire.port import Port

__all__ = ["ModbusSession"]

_ATTEMPTS = 3
_IS_EXCEPTION = 0x80
_MOST_SHOWN = 32
_ENVELOPE = 5  # unit, function, byte count, and two checksum bytes
# Modbus Application Protocol Specification V1.1b3, section 7.
_EXCEPTIONS = {
    1: "it does not know this function",
    2: "it has no such address",
    3: "it does not accept this value",
    4: "it failed while it carried the request out",
    5: "it accepted the request and needs long to carry it out",
    6: "it is busy",
    8: "its memory failed a parity check",
    10: "the gateway has no path to it",
    11: "the gateway got no reply from it",
}

_T = TypeVar("_T")


class ModbusSession:
    """The host's end of one Modbus RTU line to one unit.

    Reads are retried on silence or malformed replies; writes are sent once, and the driver reads back
    their outcome. A reply does not show which of two equal requests it answers, so no bytes may be
    waiting before a read, and a read that proves something is followed by a quiet gap.

    Args:
        device: the instrument's name in the bench file, for messages.
        port: the open byte stream.
        clock: the bench's clock.
        unit: the unit's address, 1 to 247.
        timeout: longest wait for one reply in seconds.
    """

    def __init__(self, device: str, port: Port, clock: Clock, unit: int, *, timeout: float = LONGEST_REPLY_S) -> None:
        self._device = device
        self._unit = unit
        self._timeout = timeout
        self._client = ModbusLine(port, clock, unit, self._timeout)
        self._settled = True

    @property
    def unit(self) -> int:
        """The unit's address."""
        return self._unit

    @property
    def timeout(self) -> float:
        """Longest wait for one reply [s]."""
        return self._timeout

    @property
    def discarded(self) -> int:
        """Number of unsolicited bytes received."""
        return self._client.discarded

    def must_be_quiet(self, gap: float = 0.0) -> None:
        """Refuse unsolicited bytes that are waiting, or arrive within `gap` seconds, 0.5 at most.

        After a fault late replies are expected; the next exchange waits for them and discards them.

        Raises:
            Garbled: something came; it may be the reply to another request.
            NoReply: the port failed.
        """
        if not self._settled:
            return
        try:
            stray = self._client.unasked(gap)
        except OSError as error:
            raise NoReply(self._device, f"the port failed: {error}", "check cable and power") from error
        if stray:
            self._settled = False
            raise Garbled(
                self._device,
                f"{stray[:_MOST_SHOWN].hex(' ')} arrived unsolicited",
                "check what else talks on the line, and its termination",
            )

    def read_coils(self, address: int, count: int) -> tuple[bool, ...]:
        """Read `count` coils starting at `address` (function 01)."""

        def parse(reply: Reply) -> tuple[bool, ...]:
            self._must_measure(_ENVELOPE + (count + 7) // 8)
            return tuple(bool(bit) for bit in reply.bits[:count])

        asked = f"coils {address} to {address + count - 1}"
        return self._read(asked, 1, question(1, address, count, self._unit), parse)

    def read_holding(self, address: int, count: int) -> tuple[int, ...]:
        """Read `count` holding registers starting at `address` (function 03)."""

        def parse(reply: Reply) -> tuple[int, ...]:
            self._must_measure(_ENVELOPE + 2 * count)
            return tuple(int(register) for register in reply.registers)

        asked = f"holding register {address:#06x}, {count} long"
        return self._read(asked, 3, question(3, address, count, self._unit), parse)

    def write_coil(self, address: int, on: bool) -> None:
        """Switch one coil (function 05); the unit echoes the request byte by byte."""
        asked = f"coil {address} {'on' if on else 'off'}"
        self._exchange(asked, 5, coil(address, on, self._unit), self._must_echo)

    def write_timed_coil(self, address: int, tenths: int) -> None:
        """Switch one coil on for `tenths` x 0.1 s (function 05, a vendor's value); the unit echoes the request."""
        asked = f"coil {address:#06x} on for {tenths / 10:g} s"
        self._exchange(asked, 5, timed_coil(address, tenths, self._unit), self._must_echo)

    def write_coils(self, address: int, values: Sequence[bool]) -> None:
        """Write consecutive coils starting at `address` (function 0F); the unit repeats address and count."""

        def parse(reply: Reply) -> None:
            if (reply.address, reply.count) != (address, len(values)):
                raise ValueError("address and count of the request")

        asked = f"coils {address} to {address + len(values) - 1} switched"
        self._exchange(asked, 15, coils(address, values, self._unit), parse)

    def write_holding(self, address: int, value: int) -> None:
        """Write one holding register (function 06), 0 to 65535; the unit echoes the request byte by byte."""
        asked = f"holding register {address:#06x} set to {value}"
        self._exchange(asked, 6, register(address, value, self._unit), self._must_echo)

    def _must_echo(self, _reply: Reply) -> None:
        if self._client.received != self._client.sent:
            raise ValueError(f"the echo {self._client.sent.hex(' ')}")

    def _must_measure(self, size: int) -> None:
        """Refuse a reply of the wrong size; pymodbus accepts any, even half registers."""
        if len(self._client.received) != size:
            raise ValueError(f"one frame of {size} bytes")

    def _read(self, asked: str, function: int, request: bytes, parse: Callable[[Reply], _T]) -> _T:
        faults: list[DeviceFault] = []
        self.must_be_quiet()
        while len(faults) < _ATTEMPTS:
            try:
                return self._exchange(asked, function, request, parse)
            except (NoReply, Garbled) as fault:
                faults.append(fault)
        raise faults[0]

    def _exchange(self, asked: str, function: int, request: bytes, parse: Callable[[Reply], _T]) -> _T:
        """Send one request and check its reply.

        Raises:
            NoReply: not one byte came, or the port failed.
            Garbled: the bytes received are not a reply to this request.
            Rejected: the unit answered with an exception.
        """
        try:
            if not self._settled:
                self._client.settle()
            self._settled = False
            reply = self._client.ask(request)
        except OSError as error:
            raise NoReply(self._device, f"the port failed at {asked}: {error}", "check cable and power") from error
        if reply is None:
            raise self._silence(asked)
        if reply.function_code == function | _IS_EXCEPTION:
            self._settled = True
            raise self._rejected(asked, reply.exception_code)
        if reply.function_code != function:
            raise self._garbled(asked, f"a reply to function {function:02X}")
        try:
            value = parse(reply)
        except ValueError as error:
            raise self._garbled(asked, str(error)) from None
        self._settled = True
        return value

    def _rejected(self, asked: str, code: int) -> Rejected:
        meaning = _EXCEPTIONS.get(code, "a code that the protocol does not name")
        return Rejected(
            self._device,
            f"asked for {asked}, unit {self._unit} answered exception {code}: {meaning}",
            "compare the request with the instrument's register table",
        )

    def _silence(self, asked: str) -> DeviceFault:
        if self._client.received:
            return self._garbled(asked, f"a frame of unit {self._unit}")
        return NoReply(
            self._device,
            f"asked for {asked}, unit {self._unit} gave no reply within {self._timeout:g} s",
            "check its power, its A and B wires, its address and its speed",
        )

    def _garbled(self, asked: str, expected: str) -> Garbled:
        return Garbled(
            self._device,
            f"asked for {asked}, expected {expected}, got {self._client.received.hex(' ') or 'nothing'}",
            "check the line's speed, termination and shielding, and what else talks on it",
        )
