"""The interrupt pin INT1 of the simulated IIM-42652."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from hil.simulation.peers.alarm import Alarm
from hil.simulation.peers.iim42652.registers import Register, RegisterFile
from hil.wire.peer import PeerClock

__all__ = ["Pin"]

_LATCHED, _ACTIVE_HIGH = 0x04, 0x01
_SHORT_PULSE, _ASYNC_RESET = 0x40, 0x10
_PULSE_NS, _SHORT_PULSE_NS = 100_000, 8_000


class Pin:
    """Tells whoever listens of rising edges.

    A pulse lasts 100 us, or 8 us with INT_TPULSE_DURATION; active low, it is its end that rises. Latched, the pin
    stays until the status is read. While INT_ASYNC_RESET is not cleared (it is set after power-on, and has to be 0
    for the pins to work) nothing comes.

    Args:
        registers: the sensor's registers.
    """

    def __init__(self, registers: RegisterFile) -> None:
        self._registers = registers
        self._listeners: list[Callable[[], None]] = []
        self._asserted = False
        self._clock: PeerClock
        self._rising: Alarm

    def attach(self, clock: PeerClock) -> None:
        """Connect the clock."""
        self._clock = clock
        self._rising = Alarm(clock, self._rise)

    def listen(self, callback: Callable[[], None]) -> None:
        """Call back at every rising edge."""
        self._listeners.append(callback)

    def trigger(self) -> None:
        """Assert the pin; one that is latched already has no new edge."""
        config, timing = self._registers[Register.INT_CONFIG], self._registers[Register.INT_CONFIG1]
        if timing & _ASYNC_RESET or self._asserted:
            return
        self._asserted = bool(config & _LATCHED)
        if config & _ACTIVE_HIGH:
            self._rise()
        elif not self._asserted:
            self._rising.set(self._clock.now_ns() + (_SHORT_PULSE_NS if timing & _SHORT_PULSE else _PULSE_NS))

    def clear(self) -> None:
        """Let a latched pin go; active low, that is a rising edge."""
        if self._asserted:
            self._asserted = False
            if not self._registers[Register.INT_CONFIG] & _ACTIVE_HIGH:
                self._rising.set(self._clock.now_ns())

    def reset(self) -> None:
        """Be as after power-on."""
        self._asserted = False
        self._rising.clear()

    def state(self) -> Mapping[str, object]:
        """Return it as JSON values."""
        return {"asserted": self._asserted, "rising": self._rising.state()}

    def restore(self, state: Mapping[str, object]) -> None:
        """Go on from what `state` returned."""
        self._asserted = bool(state["asserted"])
        self._rising.restore(state["rising"])

    def _rise(self) -> None:
        for callback in self._listeners:
            callback()
