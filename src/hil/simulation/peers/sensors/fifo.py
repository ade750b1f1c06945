"""FIFO of a simulated sensor: packets in, bytes out."""

from __future__ import annotations

from hil.wire.checkpoint import Kept, Stateful

__all__ = ["Fifo"]

_EMPTY = b"\xff"
_MOST_LOST = 0xFFFF


class Fifo(Stateful):
    """Packets of one size.

    Args:
        size: bytes that it holds.
        packet: bytes of a packet, until `flush` says otherwise.
    """

    packet: Kept[int]
    lost: Kept[int]
    _data: Kept[bytearray]

    def __init__(self, size: int, packet: int) -> None:
        self._size = size
        self.packet = packet
        self._data = bytearray()
        self.lost = 0

    @property
    def capacity(self) -> int:
        """Packets that it can hold."""
        return self._size // self.packet

    @property
    def filled(self) -> int:
        """Bytes in it."""
        return len(self._data)

    @property
    def packets(self) -> int:
        """Packets in it; one that was read in part counts."""
        return -(-len(self._data) // self.packet)

    def push(self, packets: bytes, *, newest_go: bool) -> None:
        """Put packets in; overflow is lost and counted: the newest packets, or else the oldest."""
        size = self.packet
        surplus = max(0, self.packets + len(packets) // size - self.capacity)
        self.lost = min(_MOST_LOST, self.lost + surplus)
        if newest_go:
            self._data += packets[: len(packets) - surplus * size]
        else:
            self._data += packets
            part = -len(self._data) % size
            del self._data[: max(0, surplus * size - part)]

    def take(self, count: int, *, resume: bool) -> bytes:
        """Read bytes; after the last there is FFh. A packet that was not read whole is kept, unless reads resume."""
        taken = bytes(self._data[:count])
        del self._data[: len(taken) if resume else len(taken) // self.packet * self.packet]
        return taken + _EMPTY * (count - len(taken))

    def flush(self, packet: int) -> None:
        """Empty the FIFO, and set the packet size."""
        self._data.clear()
        self.packet, self.lost = packet, 0
