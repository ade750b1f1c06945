"""Incremental capacity dQ/dV: the distribution of a cell's charge over voltage."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.battery.steps import StepKind
from hil.model.errors import Refused

__all__ = ["IncrementalCapacity", "Peak", "incremental_capacity"]

_MOST = 1_000_000  # steps of a grid


@dataclass(frozen=True, slots=True, kw_only=True)
class Peak:
    """A peak of dQ/dV.

    Attributes:
        voltage: V, to a fraction of the grid by a parabola through three points.
        height: Ah/V.
        prominence: Ah/V above the higher of the two valleys beside it.
    """

    voltage: float
    height: float
    prominence: float


@dataclass(frozen=True, slots=True, kw_only=True)
class IncrementalCapacity:
    """Charge per volt over the voltage.

    Attributes:
        voltage: V, evenly spaced.
        density: dQ/dV at these voltages, in Ah/V, for a discharge as for a charge above zero.
        peaks: from the lowest voltage to the highest.
    """

    voltage: NDArray[np.float64]
    density: NDArray[np.float64]
    peaks: tuple[Peak, ...]

    def drawn(self, kind: StepKind) -> NDArray[np.float64]:
        """Return the density as charts have it: below zero for a discharge, so that it does not cover the charge."""
        return -self.density if kind is StepKind.DISCHARGE else self.density


def incremental_capacity(
    voltage: ArrayLike, charge: ArrayLike, *, step: float = 0.005, window: float = 0.055, prominence: float = 0.05
) -> IncrementalCapacity:
    """Return dQ/dV of one charge or discharge at constant current.

    The samples' shares of charge are sorted by voltage and summed, which gives a Q(V) that never falls however noisy or
    coarse the voltage is; samples of one voltage count as one at the middle of their charge. Q is taken on an even grid
    of V and differentiated by a polynomial of third order in a moving window (A. Savitzky and M. J. E. Golay, Anal.
    Chem. 36, 1964). At C/2 the resistance moves peaks by I R; C/20 shows them where they are.

    Args:
        voltage: in V, shape (n,), without the part at constant voltage.
        charge: in Ah since the beginning, not falling, shape (n,).
        step: of the grid, in V.
        window: of the polynomial, in V; peaks that are narrower are lowered.
        prominence: least prominence of a peak, as a fraction of the highest density.

    Raises:
        Refused: the voltage covers too few steps of the grid for one window, or far too many.
    """
    from scipy import signal  # noqa: PLC0415 - start-up stays light

    levels, taken = _rising(np.asarray(voltage, dtype=float), np.asarray(charge, dtype=float))
    width = max(round(window / step) // 2 * 2 + 1, 5)
    low, high = np.ceil(levels[0] / step), np.floor(levels[-1] / step)
    if high - low > _MOST:
        raise Refused(f"{np.ptp(levels):.3g} V hold more than {_MOST} steps of {step:g} V", "give a coarser grid")
    grid = np.arange(low, high + 1) * step
    if grid.size < width:
        raise Refused(
            f"{np.ptp(levels):.3g} V hold fewer than {width} steps of {step:g} V",
            "give a whole charge or discharge, or a finer grid",
        )
    density = signal.savgol_filter(np.interp(grid, levels, taken), width, 3, deriv=1, delta=step)
    places, found = signal.find_peaks(density, prominence=prominence * float(density.max()))
    peaks = [
        Peak(voltage=_top(grid, density, int(place)), height=float(density[place]), prominence=float(each))
        for place, each in zip(places, found["prominences"], strict=True)
    ]
    return IncrementalCapacity(voltage=grid, density=density, peaks=tuple(peaks))


def _rising(
    voltage: NDArray[np.float64], charge: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return rising voltages and the charge that was taken up to the middle of each."""
    increments = np.diff(charge)
    shares = np.zeros(charge.size)
    shares[:-1] += increments / 2.0
    shares[1:] += increments / 2.0
    levels, places = np.unique(voltage, return_inverse=True)
    weights = np.bincount(places, weights=shares)
    return levels, np.cumsum(weights) - weights / 2.0


def _top(grid: NDArray[np.float64], density: NDArray[np.float64], place: int) -> float:
    before, here, after = density[place - 1 : place + 2]
    bend = before - 2.0 * here + after
    shift = 0.5 * (before - after) / bend if bend < 0 else 0.0
    return float(grid[place] + shift * (grid[1] - grid[0]))
