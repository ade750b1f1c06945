"""URL schemes for pyserial, `sim://`, `replay://` and `live://`: ports whose far end is an object of this process."""

from __future__ import annotations

from typing import ClassVar

from serial import PortNotOpenError, SerialBase, SerialException

from hil.wire.exchange import FarEnd, find_stream

__all__ = ["UrlPort"]


class UrlPort(SerialBase):
    """What both URL schemes share: the stream is looked up at open, and every operation goes to it.

    Of the modem lines the far end learns when DTR rises; the others are constant. `read_until` reads byte by
    byte on the bench's clock; the one of pyserial would look at wall time.
    """

    scheme: ClassVar[str] = ""

    _stream: FarEnd | None = None

    def open(self) -> None:
        """Find the stream of the URL and tell it."""
        stream = find_stream(self.portstr or "")
        if stream is None:
            raise SerialException(f"nothing answers at {self.portstr}")
        self._stream = stream
        self.is_open = True
        stream.opened()

    def close(self) -> None:
        """Tell the stream and let go of it; closing twice is harmless."""
        if self._stream is not None:
            self._stream.closed()
        self._stream = None
        self.is_open = False

    @property
    def in_waiting(self) -> int:
        """The number of bytes that can be read at once."""
        return self.end.waiting()

    def read(self, size: int = 1, /) -> bytes:
        """Return `size` bytes, or what came within the timeout; without a timeout it is refused."""
        if self.timeout is None:
            raise SerialException(f"{self.portstr}: a read without a timeout could wait for ever")
        return self.end.read(size, self.timeout)

    def read_until(self, expected: bytes = b"\n", size: int | None = None) -> bytes:
        """Return bytes up to and with `expected`, or `size` bytes, or what came until nothing did."""
        line = bytearray()
        while not line.endswith(expected) and (size is None or len(line) < size):
            byte = self.read(1)
            if not byte:
                break
            line += byte
        return bytes(line)

    def write(self, data: bytes, /) -> int:  # type: ignore[override]  # the stub allows None for closed ports
        """Write all bytes."""
        self.end.write(bytes(data))
        return len(data)

    def flush(self) -> None:
        """Return at once: a write ends when its last bit has left."""

    def reset_input_buffer(self) -> None:
        """Throw away what was received and not read."""
        self.end.discard()

    def reset_output_buffer(self) -> None:
        """Return at once: nothing is ever queued."""

    @property
    def end(self) -> FarEnd:
        """The far end of the stream, which a tap talks to without a detour."""
        if self._stream is None:
            raise PortNotOpenError
        return self._stream

    def _reconfigure_port(self) -> None:
        """Accept any setting; the speed of the line is the bench file's."""

    def _update_rts_state(self) -> None:
        """Accept it; no peer listens to RTS."""

    def _update_dtr_state(self) -> None:
        """Tell the far end that DTR rises; nobody listens to its fall."""
        if self.dtr:
            self.end.dtr_rose()

    def _update_break_state(self) -> None:
        """Accept it; no peer listens to a break."""
