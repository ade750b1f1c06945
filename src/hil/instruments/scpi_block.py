"""Binary blocks in a SCPI session, for reading waveforms and memories."""

from __future__ import annotations

from hil.instruments.scpi_session import ClosedSession
from hil.model.errors import NoReply

__all__ = ["BlockSession"]

_PART = 4096
_MOST_SHOWN = 60
_DIGITS = (b"1", b"2", b"3", b"4", b"5", b"6", b"7", b"8", b"9")


class BlockSession(ClosedSession):
    """A session that can read definite-length blocks (IEEE 488.2-1992, 8.7.9): `#`, digits, length, bytes.

    The identification closes a block as it closes any reply. A byte corrupted within a block is not
    detected.
    """

    def block(self, command: str) -> bytes:
        """Query a block, and return its bytes; silence and malformed replies are retried.

        Raises:
            NoReply, Garbled: see `query`.
        """
        return self._query(lambda: self._ask_block(command))

    def _ask_block(self, command: str) -> bytes:
        self._send(command)
        head = self._exactly(command, 2)
        digits = head[1:]
        length = self._exactly(command, int(digits)) if head[:1] == b"#" and digits in _DIGITS else b""
        if not length.isdigit():
            raise self._garbled(command, "a block: #, digits, length", repr((head + length)[:_MOST_SHOWN]))
        data = self._exactly(command, int(length))
        end = self._exactly(command, len(self.terminator))
        if end != self.terminator:
            raise self._garbled(command, f"a block of {int(length)} bytes", f"{end!r} after it")
        self._bare("*IDN?", self._closes)
        return data

    def _exactly(self, command: str, count: int) -> bytes:
        """Read exactly `count` bytes, in parts that are each quick to read."""
        came = b""
        while len(came) < count:
            try:
                part = self._port.read(min(count - len(came), _PART))
            except OSError as error:
                raise self._port_failed(command, error) from error
            if not part:
                raise NoReply(
                    self._device,
                    f"asked `{command}`, only {len(came)} of {count} bytes came within {self.timeout:g} s",
                    "check the instrument's power and cable",
                )
            came += part
        return came
