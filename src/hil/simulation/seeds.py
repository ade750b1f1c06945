"""Random numbers of a simulated bench: by index, so that polling cannot change them."""

from __future__ import annotations

import hashlib

from hil.analysis.noise.numbers import RandomStream

__all__ = ["Seeds"]

_KEY_BYTES = 16


class Seeds:
    """Streams of one bench: keyed by the bench's seed, the device and the stream's name."""

    def __init__(self, bench: int) -> None:
        self._bench = bench

    def stream(self, device: str, name: str) -> RandomStream:
        """Return the stream of that name; equal names give equal numbers."""
        text = "\0".join((str(self._bench), device, name))
        digest = hashlib.sha256(text.encode("utf-8")).digest()
        return RandomStream(int.from_bytes(digest[:_KEY_BYTES], "big"))
