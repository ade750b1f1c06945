"""URL schemes for pyserial, `sim://`, `replay://` and `live://`: ports whose far end is an object of this process."""

from __future__ import annotations

from typing import ClassVar

from serial import PortNotOpenError, SerialBase, SerialException

from hil.wire.exchange import FarEnd, find_stream

__all__ = ["UrlPort"]


class UrlPort(SerialBase):
    """Base of the URL schemes: the stream is looked up at open, and every operation is delegated to it.

    Of the modem lines only a rise of DTR reaches the far end; the others are constant. `read_until` reads byte by
    byte on the bench's clock, because pyserial's version uses wall time.
    """

    scheme: ClassVar[str] = ""

    _stream: FarEnd | None = None

    def open(self) -> None:
        """Look up the URL's stream, and notify it."""
        stream = find_stream(self.portstr or "")
        if stream is None:
            raise SerialException(f"nothing answers at {self.portstr}")
        self._stream = stream
        self.is_open = True
        stream.opened()

    def close(self) -> None:
        """Notify the stream and release it; closing twice is harmless."""
        if self._stream is not None:
            self._stream.closed()
        self._stream = None
        self.is_open = False

    @property
    def in_waiting(self) -> int:
        """The number of bytes that can be read without waiting."""
        return self.end.waiting()

    def read(self, size: int = 1, /) -> bytes:
        """Return `size` bytes, or fewer at the timeout; reading without a timeout is refused."""
        if self.timeout is None:
            raise SerialException(f"{self.portstr}: a read without a timeout could wait for ever")
        return self.end.read(size, self.timeout)

    def read_until(self, expected: bytes = b"\n", size: int | None = None) -> bytes:
        """Return bytes up to and including `expected`, or `size` bytes, or fewer at the timeout."""
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
        """Discard received bytes not read yet."""
        self.end.discard()

    def reset_output_buffer(self) -> None:
        """Return at once: nothing is ever queued."""

    @property
    def end(self) -> FarEnd:
        """The far end of the stream, for direct use by a tap."""
        if self._stream is None:
            raise PortNotOpenError
        return self._stream

    def _reconfigure_port(self) -> None:
        """Accept any setting; the bench file sets the speed of the line."""

    def _update_rts_state(self) -> None:
        """Accept it; no peer uses RTS."""

    def _update_dtr_state(self) -> None:
        """Notify the far end of a rise of DTR; a fall is ignored."""
        if self.dtr:
            self.end.dtr_rose()

    def _update_break_state(self) -> None:
        """Accept it; no peer uses a break."""
