"""The way of something that changes its rate with a constant acceleration, in closed form."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["travelled"]


def travelled(
    rate: float, command: float, acceleration: float, elapsed: float | NDArray[np.float64]
) -> tuple[float | NDArray[np.float64], float | NDArray[np.float64]]:
    """Return the way and the rate after some time.

    The rate goes from `rate` to `command` at `acceleration` and stays there: w0 t + s a t^2 / 2 up to the end of the
    ramp, and the command times what is left after it.

    Args:
        rate: at the beginning [deg/s].
        command: where it goes [deg/s].
        acceleration: its size [deg/s2]; 0 keeps the rate.
        elapsed: time [s], not below 0; any shape.

    Returns:
        Way [deg] and rate [deg/s], both of the shape of `elapsed`.
    """
    if rate == command or not acceleration > 0:
        return rate * elapsed, rate + 0.0 * elapsed
    slope = acceleration if command > rate else -acceleration
    ramp = (command - rate) / slope
    ramping = np.minimum(elapsed, ramp)
    way = rate * ramping + slope * ramping * ramping / 2 + command * (elapsed - ramping)
    return way, np.where(elapsed < ramp, rate + slope * ramping, command)
