"""The interrupt pin of a simulated sensor."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from hil.simulation.peers.timing import Alarm
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import PeerClock

__all__ = ["Pin", "PinSetting"]


class PinSetting(NamedTuple):
    """Pin configuration from the registers.

    Attributes:
        works: whether the pin is enabled.
        high: whether it is active high.
        latched: whether it stays asserted until the status is read.
        pulse_ns: pulse width.
    """

    works: bool
    high: bool
    latched: bool
    pulse_ns: int


class Pin(Stateful):
    """Reports rising edges to its listeners; active low, it is the end of a pulse that rises.

    Args:
        look: what the registers say of it now.
    """

    _asserted: Kept[bool]
    _rising: Kept[Alarm]

    def __init__(self, look: Callable[[], PinSetting]) -> None:
        self._look = look
        self._listeners: list[Callable[[], None]] = []
        self._asserted = False
        self._clock: PeerClock

    def attach(self, clock: PeerClock) -> None:
        """Connect the clock."""
        self._clock = clock
        self._rising = Alarm(clock, self._rise)

    def listen(self, callback: Callable[[], None]) -> None:
        """Call back at every rising edge."""
        self._listeners.append(callback)

    def trigger(self) -> None:
        """Assert the pin; if already latched there is no new edge."""
        setting = self._look()
        if not setting.works or self._asserted:
            return
        self._asserted = setting.latched
        if setting.high:
            self._rise()
        elif not self._asserted:
            self._rising.set(self._clock.now_ns() + setting.pulse_ns)

    def clear(self) -> None:
        """Release a latched pin, which is a rising edge if active low."""
        if self._asserted:
            self._asserted = False
            if not self._look().high:
                self._rising.set(self._clock.now_ns())

    def reset(self) -> None:
        """Reset to the power-on state."""
        self._asserted = False
        self._rising.clear()

    def _rise(self) -> None:
        for callback in self._listeners:
            callback()
