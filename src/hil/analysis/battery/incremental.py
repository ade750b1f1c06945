"""Incremental capacity dQ/dV: distribution of a cell's charge over voltage."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.battery.steps import StepKind
from hil.model.errors import Refused

__all__ = ["IncrementalCapacity", "Peak", "incremental_capacity"]

_MOST = 1_000_000  # grid steps


@dataclass(frozen=True, slots=True, kw_only=True)
class Peak:
    """A peak of dQ/dV.

    Attributes:
        voltage: voltage [V], interpolated within the grid by a parabola through three points.
        height: height [Ah/V].
        prominence: height above the higher of the two adjacent valleys [Ah/V].
    """

    voltage: float
    height: float
    prominence: float


@dataclass(frozen=True, slots=True, kw_only=True)
class IncrementalCapacity:
    """Charge per volt over voltage.

    Attributes:
        voltage: evenly spaced voltages [V], shape (k,).
        density: dQ/dV at these voltages [Ah/V], positive for charge and discharge, shape (k,).
        peaks: peaks in ascending order of voltage.
    """

    voltage: NDArray[np.float64]
    density: NDArray[np.float64]
    peaks: tuple[Peak, ...]

    def drawn(self, kind: StepKind) -> NDArray[np.float64]:
        """Return the density for plotting, shape (k,): negative for a discharge, so as not to overlap the charge."""
        return -self.density if kind is StepKind.DISCHARGE else self.density


def incremental_capacity(
    voltage: ArrayLike, charge: ArrayLike, *, step: float = 0.005, window: float = 0.055, prominence: float = 0.05
) -> IncrementalCapacity:
    """Return dQ/dV of one charge or discharge at constant current.

    The samples' charge increments are sorted by voltage and summed, which gives a monotone Q(V) however noisy or coarse
    the voltage; samples of equal voltage count as one at the middle of their charge. Q is interpolated to an even grid
    of V and differentiated by a third-order polynomial in a moving window (A. Savitzky and M. J. E. Golay, Anal. Chem.
    36, 1964). At C/2 the resistance shifts peaks by I R; C/20 shows their true positions.

    Args:
        voltage: voltages in V, shape (n,), without the constant-voltage part.
        charge: cumulative charge in Ah, non-decreasing, shape (n,).
        step: grid step [V].
        window: width of the polynomial window [V]; narrower peaks are lowered.
        prominence: least prominence of a peak, as a fraction of the highest density.

    Raises:
        Refused: the voltage range covers too few grid steps for one window, or far too many.
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
    """Return ascending voltages, and the cumulative charge up to the middle of each."""
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
