"""A peer that answers every line after a delay, for tests of the line alone."""

from __future__ import annotations


class EchoPeer:
    """Sends back what it received, `delay_ns` later."""

    def __init__(self, delay_ns: int = 0) -> None:
        self.delay_ns = delay_ns
        self.received = b""
        self.received_at: list[int] = []

    def attach(self, line, clock) -> None:
        """Keep line and clock."""
        self.line, self.clock = line, clock

    def receive(self, data: bytes) -> None:
        """Note the bytes and send them back."""
        self.received += data
        self.received_at.append(self.clock.now_ns())
        self.line.send(data, self.delay_ns)

    def state(self):
        """Return nothing: an echo remembers nothing."""
        return {}

    def restore(self, state) -> None:
        """Take nothing back."""


class MemoryPeer:
    """A bus device of 256 registers with a pointer that counts up."""

    addresses = (0x50,)

    def __init__(self) -> None:
        self.registers = bytearray(range(256))
        self.pointer = 0

    def attach(self, clock) -> None:
        """Keep the clock."""
        self.clock = clock

    def write(self, address: int, data: bytes) -> None:
        """Set the pointer, then the registers from there on."""
        self.pointer = data[0]
        for byte in data[1:]:
            self.registers[self.pointer] = byte
            self.pointer = (self.pointer + 1) % 256

    def read(self, address: int, count: int) -> bytes:
        """Give registers from the pointer on."""
        data = bytes(self.registers[(self.pointer + i) % 256] for i in range(count))
        self.pointer = (self.pointer + count) % 256
        return data
