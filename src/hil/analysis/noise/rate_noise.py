"""Noise of one axis by sample index: white, flicker, random walk, angle quantisation, and a ramp."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil.analysis.noise.processes import AngleQuantisation, Flicker, Normals, Process, RandomWalk, White

__all__ = ["BLOCK", "NoiseLevels", "RateNoise"]

BLOCK = 16384
"""Samples per block."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseLevels:
    """Noise levels of an axis, in the terms and symbols of IEEE Std 952-1997.

    Attributes:
        white: angle random walk N [unit/sqrt(Hz)].
        flicker: bias instability B [unit]; its floor is 0.664 B.
        random_walk: random walk of the rate K [unit*sqrt(Hz)].
        quantisation: angle quantisation Q [unit*s].
        ramp: drift rate R [unit/s], which is deterministic.
    """

    white: float = 0.0
    flicker: float = 0.0
    random_walk: float = 0.0
    quantisation: float = 0.0
    ramp: float = 0.0


class RateNoise:
    """Noise samples 0, 1, 2… of one axis; a sample depends only on the streams and its index.

    Blocks are generated in order, and the present one is kept: access is forwards, or backwards within a block.

    Args:
        stream: returns the source of random numbers for a name.
        levels: noise levels.
        rate: sampling rate [Hz].
        bandwidth: noise bandwidth of the filter before the sampling, in Hz.
    """

    def __init__(self, stream: Callable[[str], Normals], levels: NoiseLevels, *, rate: float, bandwidth: float) -> None:
        self._slope = levels.ramp / rate
        self._parts: dict[str, Process] = {
            "white": White(stream("white"), levels.white, rate=rate, bandwidth=bandwidth, block=BLOCK),
            "flicker": Flicker(stream("flicker"), levels.flicker, BLOCK),
            "random_walk": RandomWalk(stream("random walk"), levels.random_walk, rate, BLOCK),
            "quantisation": AngleQuantisation(stream("quantisation"), levels.quantisation, rate, BLOCK),
        }
        self._number = -1
        self._values: NDArray[np.float64] = np.empty(0)
        self._carried = self._carry()

    @property
    def gone(self) -> int:
        """Number of samples that are no longer accessible: those before the present block."""
        return max(self._number, 0) * BLOCK

    def samples(self, first: int, count: int) -> NDArray[np.float64]:
        """Return samples `first` to `first + count - 1`, shape (count,).

        Raises:
            ValueError: if they begin before the present block.
        """
        if first < self.gone:
            raise ValueError(f"sample {first} has gone; the present block begins at {self._number * BLOCK}")
        place = first - self.gone
        if self._number >= 0 and place + count <= BLOCK:
            return self._values[place : place + count].copy()
        parts = []
        end = first + count
        while first < end:
            number, place = divmod(first, BLOCK)
            self._reach(number)
            parts.append(self._values[place : place + end - first])
            first += parts[-1].size
        return np.concatenate(parts) if parts else np.empty(0)

    def sample(self, index: int) -> float:
        """Return one sample; `samples` is faster for a series."""
        place = index - self.gone
        if self._number >= 0 and 0 <= place < BLOCK:
            return float(self._values[place])
        return float(self.samples(index, 1)[0])

    def state(self) -> dict[str, Any]:
        """Return the state needed to continue, as JSON values."""
        return {"number": self._number, "carried": {name: dict(each) for name, each in self._carried.items()}}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from what `state` returned: regenerate the present block from the state before it.

        Raises:
            ValueError: it is the state of something else.
        """
        number, carried = state["number"], state["carried"]
        if carried.keys() != self._parts.keys():
            raise ValueError(f"carried: expected {', '.join(self._parts)}")
        self._number = number - 1
        for name, part in self._parts.items():
            part.restore(carried[name])
        self._carried = self._carry()
        if number >= 0:
            self._reach(number)
        else:
            self._number = number

    def _reach(self, number: int) -> None:
        while self._number < number:
            self._carried = self._carry()
            self._number += 1
            first, *others = self._parts.values()
            total = first.block(self._number)
            for part in others:
                total += part.block(self._number)
            if self._slope:
                total += self._slope * np.arange(self._number * BLOCK, (self._number + 1) * BLOCK)
            self._values = total

    def _carry(self) -> dict[str, dict[str, Any]]:
        return {name: part.state() for name, part in self._parts.items()}
