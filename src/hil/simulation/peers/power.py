"""The rail that feeds what an instrument drives, where another instrument of the bench gives it."""

from __future__ import annotations

from collections.abc import Callable

from hil.simulation.plants.terminal import SignalPoint

__all__ = ["Power"]

_LEAST_VOLTS = 9.0
"""Below, relays and amplifiers for 12 V let go."""


class Power:
    """Tells whether the rail is there, and when that changes.

    Args:
        point: the rail's voltage; None where the instrument has power of its own.
    """

    def __init__(self, point: SignalPoint | None) -> None:
        self._point = point

    @property
    def there(self) -> bool:
        """Whether the rail carries what is needed."""
        return self._point is None or self._point.observe() >= _LEAST_VOLTS

    def listen(self, callback: Callable[[], None]) -> None:
        """Call back when the rail may have changed."""
        if self._point is not None:
            self._point.plant.listen(callback)
