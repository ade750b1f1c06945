"""The FIFO of the simulated IIM-42652."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import cast

import numpy as np
from numpy.typing import NDArray

from hil.simulation.peers.iim42652.article import Samples
from hil.simulation.peers.iim42652.registers import Register, RegisterFile

__all__ = ["Fifo"]

_BYTES = 2048
_ACCEL, _GYRO, _TEMPERATURE, _TIMESTAMP = 0x01, 0x02, 0x04, 0x08
_RESUME = 0x40
_STREAM = 1
_HEADER_ACCEL, _HEADER_GYRO, _HEADER_TIMESTAMP = 0x40, 0x20, 0x08
_EMPTY = 0xFF
_NO_TEMPERATURE = -128
_MOST_LOST = 0xFFFF
_SENSORS = 0x03


class Fifo:
    """Packets of 8 bytes (one sensor) or 16 bytes (both), as FIFO_CONFIG1 asks for.

    One sensor: header, three axes, temperature. Both: header, accelerometer, gyroscope, temperature, time stamp.

    Args:
        registers: the sensor's registers.
    """

    def __init__(self, registers: RegisterFile) -> None:
        self._registers = registers
        self._data = bytearray()
        self.lost = 0

    @property
    def active(self) -> bool:
        """Whether samples go into it."""
        mode = self._registers[Register.FIFO_CONFIG] >> 6
        return bool(mode and self._registers[Register.FIFO_CONFIG1] & _SENSORS)

    @property
    def size(self) -> int:
        """Bytes of a packet."""
        return 16 if self._registers[Register.FIFO_CONFIG1] & _SENSORS == _SENSORS else 8

    @property
    def capacity(self) -> int:
        """Packets that it can hold."""
        return _BYTES // self.size

    @property
    def packets(self) -> int:
        """Packets in it; one that was read in part counts."""
        return -(-len(self._data) // self.size)

    @property
    def watermark(self) -> int:
        """Packets at which the watermark is reached, 0 for never."""
        low, high = self._registers[Register.FIFO_CONFIG2], self._registers[Register.FIFO_CONFIG3] & 0x0F
        level = high << 8 | low
        return level if self._counts_records else -(-level // self.size)

    @property
    def count(self) -> int:
        """What FIFO_COUNT says: bytes or packets."""
        return len(self._data) // self.size if self._counts_records else len(self._data)

    @property
    def _counts_records(self) -> bool:
        return bool(self._registers[Register.INTF_CONFIG0] & 0x40)

    def push(self, samples: Samples, acceleration: NDArray[np.int16], stamps: NDArray[np.uint16]) -> None:
        """Put samples in; what there is no room for is lost, the oldest in stream mode, else the newest."""
        size = self.size
        packets = self._packed(samples, acceleration, stamps)
        surplus = max(0, self.packets + len(packets) // size - self.capacity)
        self.lost = min(_MOST_LOST, self.lost + surplus)
        if self._registers[Register.FIFO_CONFIG] >> 6 == _STREAM:
            self._data += packets
            part = -len(self._data) % size
            del self._data[: max(0, surplus * size - part)]
        else:
            self._data += packets[: len(packets) - surplus * size]

    def take(self, count: int) -> bytes:
        """Read bytes; behind the last there is FFh. A packet that was not read whole is kept, unless reads resume."""
        taken = bytes(self._data[:count])
        resume = self._registers[Register.FIFO_CONFIG1] & _RESUME
        del self._data[: len(taken) if resume else len(taken) // self.size * self.size]
        return taken + bytes([_EMPTY]) * (count - len(taken))

    def flush(self) -> None:
        """Forget everything."""
        self._data.clear()
        self.lost = 0

    def state(self) -> Mapping[str, object]:
        """Return it as JSON values."""
        return {"data": self._data.hex(), "lost": self.lost}

    def restore(self, state: Mapping[str, object]) -> None:
        """Go on from what `state` returned."""
        self._data = bytearray.fromhex(cast("str", state["data"]))
        self.lost = cast("int", state["lost"])

    def _packed(self, samples: Samples, acceleration: NDArray[np.int16], stamps: NDArray[np.uint16]) -> bytes:
        config = self._registers[Register.FIFO_CONFIG1]
        order = ">" if self._registers[Register.INTF_CONFIG0] & 0x10 else "<"
        packets = np.zeros(samples.ends_ns.size, dtype=_layout(config & _SENSORS, order))
        packets["header"] = (_HEADER_ACCEL if config & _ACCEL else 0) | (_HEADER_GYRO if config & _GYRO else 0)
        packets["temperature"] = samples.fifo_temperature if config & _TEMPERATURE else _NO_TEMPERATURE
        if config & _ACCEL:
            packets["accel"] = acceleration
        if config & _GYRO:
            packets["gyro"] = samples.gyro
        if self.size > 8 and config & _TIMESTAMP:
            packets["header"] |= _HEADER_TIMESTAMP
            packets["stamp"] = stamps
        return packets.tobytes()


@lru_cache
def _layout(sensors: int, order: str) -> np.dtype[np.void]:
    """Return what a packet holds."""
    fields = [("header", "u1")]
    fields += [("accel", f"3{order}i2")] if sensors & _ACCEL else []
    fields += [("gyro", f"3{order}i2")] if sensors & _GYRO else []
    fields += [("temperature", "i1")]
    fields += [("stamp", f"{order}u2")] if sensors == _SENSORS else []
    return np.dtype(fields)
