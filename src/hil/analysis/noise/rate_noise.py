"""The noise of one axis by index of the sample: white, flicker, random walk, quantisation of the angle, and a ramp."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil.analysis.noise.processes import AngleQuantisation, Flicker, Normals, Process, RandomWalk, White

__all__ = ["BLOCK", "NoiseLevels", "RateNoise"]

BLOCK = 16384
"""Samples of a block."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseLevels:
    """The noise levels of an axis, in the terms and letters of IEEE Std 952-1997.

    Attributes:
        white: angle random walk N [unit/sqrt(Hz)].
        flicker: bias instability B [unit]; its floor is 0.664 B.
        random_walk: random walk of the rate K [unit*sqrt(Hz)].
        quantisation: of the angle, Q [unit*s].
        ramp: drift rate R [unit/s], which is no noise.
    """

    white: float = 0.0
    flicker: float = 0.0
    random_walk: float = 0.0
    quantisation: float = 0.0
    ramp: float = 0.0


class RateNoise:
    """Samples 0, 1, 2… of one axis. A sample depends on the streams and its index only.

    Blocks are made in their order, and the present one is kept: asking goes forwards, or back within a block.

    Args:
        stream: gives the random numbers of a name.
        levels: what there is of each noise.
        rate: samples per second.
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
        """How many samples cannot be made any more: those before the present block."""
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
        """Return one sample; of a whole row `samples` is quicker."""
        place = index - self.gone
        if self._number >= 0 and 0 <= place < BLOCK:
            return float(self._values[place])
        return float(self.samples(index, 1)[0])

    def state(self) -> dict[str, Any]:
        """Return what is needed to continue, as JSON values."""
        return {"number": self._number, "carried": {name: dict(each) for name, each in self._carried.items()}}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from what `state` returned: make the present block again from what came into it.

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
