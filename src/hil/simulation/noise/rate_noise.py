"""The noise of one axis: white, flicker, random walk and quantisation of the angle, by index of the sample."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from hil.simulation.noise.flicker import Flicker
from hil.simulation.noise.quantisation import AngleQuantisation
from hil.simulation.noise.random_walk import RandomWalk
from hil.simulation.noise.white import White
from hil.simulation.seeds import Stream

__all__ = ["BLOCK", "NoiseLevels", "RateNoise"]

BLOCK = 16384
"""Samples of a block."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseLevels:
    """What an axis has of each noise, in the words and letters of IEEE Std 952-1997.

    Attributes:
        white: angle random walk N [unit/sqrt(Hz)].
        flicker: bias instability B [unit]; its floor is 0.664 B.
        random_walk: random walk of the rate K [unit*sqrt(Hz)].
        quantisation: of the angle, Q [unit*s].
    """

    white: float = 0.0
    flicker: float = 0.0
    random_walk: float = 0.0
    quantisation: float = 0.0


class RateNoise:
    """Samples 0, 1, 2… of one axis. What a sample is depends on the streams and its index only.

    Blocks are made in their order, and the present one is kept: asking goes forwards, or back within a block.

    Args:
        stream: gives the random numbers of a name.
        levels: what there is of each noise.
        rate: samples per second.
        bandwidth: noise bandwidth of the filter before the sampling, in Hz.
    """

    def __init__(self, stream: Callable[[str], Stream], levels: NoiseLevels, *, rate: float, bandwidth: float) -> None:
        self._white = White(stream("white"), levels.white, rate=rate, bandwidth=bandwidth, block=BLOCK)
        self._flicker = Flicker(stream("flicker"), levels.flicker, BLOCK)
        self._walk = RandomWalk(stream("random walk"), levels.random_walk, rate, BLOCK)
        self._quantisation = AngleQuantisation(stream("quantisation"), levels.quantisation, rate, BLOCK)
        self._number = -1
        self._values: NDArray[np.float64] = np.empty(0)
        self._carried = self._carry()

    def samples(self, first: int, count: int) -> NDArray[np.float64]:
        """Return samples `first` to `first + count - 1`, shape (count,).

        Raises:
            ValueError: if they begin before the present block.
        """
        if first < max(self._number, 0) * BLOCK:
            raise ValueError(f"sample {first} has gone; the present block begins at {self._number * BLOCK}")
        parts = []
        end = first + count
        while first < end:
            number, place = divmod(first, BLOCK)
            self._reach(number)
            parts.append(self._values[place : place + end - first])
            first += parts[-1].size
        return np.concatenate(parts) if parts else np.empty(0)

    def state(self) -> Mapping[str, object]:
        """Return the present block's number and what came into it from the one before."""
        return {"block": self._number, **self._carried}

    def restore(self, state: Mapping[str, object]) -> None:
        """Go on from what `state` returned."""
        self._white.restore(cast("float", state["white"]))
        self._flicker.restore(cast("list[float]", state["flicker"]))
        self._walk.restore(cast("float", state["random_walk"]))
        self._quantisation.restore(cast("float", state["quantisation"]))
        number = cast("int", state["block"])
        self._number = number - 1
        self._carried = self._carry()
        if number >= 0:
            self._reach(number)
        else:
            self._number = number

    def _reach(self, number: int) -> None:
        while self._number < number:
            self._carried = self._carry()
            self._number += 1
            total = self._white.block(self._number)
            total += self._flicker.block(self._number)
            total += self._walk.block(self._number)
            total += self._quantisation.block(self._number)
            self._values = total

    def _carry(self) -> dict[str, object]:
        return {
            "white": self._white.state(),
            "flicker": self._flicker.state(),
            "random_walk": self._walk.state(),
            "quantisation": self._quantisation.state(),
        }
