"""Random numbers addressed by index, so that the order and size of reads cannot change them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["BLOCK", "RandomStream"]

BLOCK = 64
"""Numbers per state of the generator."""

_WORD = 2**64


class RandomStream:
    """Random numbers for one purpose, addressed by index (Philox 4x64, counter-based).

    A value depends only on key and index, so there is no state to save or restore.

    Args:
        key: 128-bit key of the generator.
    """

    def __init__(self, key: int) -> None:
        self._key = key
        self._source: _Source | None = None
        self._normal_block = -1
        self._normals: list[float] = []
        self._uniform_block = -1
        self._uniforms: NDArray[np.float64] = np.empty(0)

    def normal(self, index: int) -> float:
        """Return the standard normal number at an index, counted from 0."""
        block, place = divmod(index, BLOCK)
        if block != self._normal_block:
            self._normals = self.normals(block)
            self._normal_block = block
        return self._normals[place]

    def normals(self, block: int) -> list[float]:
        """Return BLOCK numbers of `normal`, from index `BLOCK * block` on."""
        numbers: list[float] = self._generator(block, 0).standard_normal(BLOCK).tolist()
        return numbers

    def uniform(self, index: int) -> float:
        """Return the uniform number in [0, 1) at an index, counted from 0."""
        block, place = divmod(index, BLOCK)
        if block != self._uniform_block:
            self._uniforms = self._generator(block, 1).random(BLOCK)
            self._uniform_block = block
        return float(self._uniforms[place])

    def normal_block(self, number: int, size: int) -> NDArray[np.float64]:
        """Return the first `size` standard normal numbers of a block, counted from 0, shape (size,).

        Blocks can be of any length, and are independent of each other and of the numbers of `normal`. A longer part of
        a block begins with the shorter.
        """
        return self._generator(number, 2).standard_normal(size)

    def _generator(self, block: int, purpose: int) -> np.random.Generator:
        if self._source is None:
            self._source = _Source(self._key)
        return self._source.at(block, purpose)


class _Source:
    """A generator reused by resetting its counter: creating a new one takes ten times as long."""

    def __init__(self, key: int) -> None:
        self._philox = np.random.Philox(key=key)
        self._fresh = self._philox.state
        self._generator = np.random.Generator(self._philox)

    def at(self, block: int, purpose: int) -> np.random.Generator:
        """Return the generator at the beginning of a block."""
        # The lowest 64 bits of the counter are left to the block itself, so that blocks never overlap.
        self._fresh["state"]["counter"][:] = (0, block % _WORD, block // _WORD, purpose)
        self._philox.state = self._fresh
        return self._generator
