"""The one place that draws random numbers: by index, so that reading them in different pieces cannot change them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["BLOCK", "RandomStream"]

BLOCK = 64
"""How many numbers follow from one state of the generator."""

_WORD = 2**64


class RandomStream:
    """Numbers of one purpose, addressed by index (Philox 4x64, counter-based).

    A value depends on the key and the index only. There is nothing to save or restore.

    Args:
        key: the 128-bit key of the generator.
    """

    def __init__(self, key: int) -> None:
        self._key = key
        self._source: _Source | None = None
        self._normal_block = -1
        self._normals: list[float] = []
        self._uniform_block = -1
        self._uniforms: NDArray[np.float64] = np.empty(0)

    def normal(self, index: int) -> float:
        """Return the standard normal number of that index, counted from 0."""
        block, place = divmod(index, BLOCK)
        if block != self._normal_block:
            self._normals = self.normals(block)
            self._normal_block = block
        return self._normals[place]

    def normals(self, block: int) -> list[float]:
        """Return the numbers of `normal` from index `BLOCK * block` on, as many as that."""
        numbers: list[float] = self._generator(block, 0).standard_normal(BLOCK).tolist()
        return numbers

    def uniform(self, index: int) -> float:
        """Return the number of that index, counted from 0, uniform in [0, 1)."""
        block, place = divmod(index, BLOCK)
        if block != self._uniform_block:
            self._uniforms = self._generator(block, 1).random(BLOCK)
            self._uniform_block = block
        return float(self._uniforms[place])

    def normal_block(self, number: int, size: int) -> NDArray[np.float64]:
        """Return the first `size` standard normal numbers of a block, counted from 0, shape (size,).

        Blocks are as long as anybody wants them, and have nothing in common with each other, nor with the numbers of
        `normal`. A longer part of a block begins with the shorter.
        """
        return self._generator(number, 2).standard_normal(size)

    def _generator(self, block: int, purpose: int) -> np.random.Generator:
        if self._source is None:
            self._source = _Source(self._key)
        return self._source.at(block, purpose)


class _Source:
    """A generator that is set to one counter after the other: a new one takes ten times as long."""

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
