"""The interrupt pin INT1 of the simulated IIM-42652."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import cast

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
        self._rise_ns: int | None = None
        self._clock: PeerClock

    def attach(self, clock: PeerClock) -> None:
        """Connect the clock."""
        self._clock = clock

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
            self._rise_at(self._clock.now_ns() + (_SHORT_PULSE_NS if timing & _SHORT_PULSE else _PULSE_NS))

    def clear(self) -> None:
        """Let a latched pin go; active low, that is a rising edge."""
        if self._asserted:
            self._asserted = False
            if not self._registers[Register.INT_CONFIG] & _ACTIVE_HIGH:
                self._rise_at(self._clock.now_ns())

    def reset(self) -> None:
        """Be as after power-on."""
        self._asserted, self._rise_ns = False, None

    def state(self) -> Mapping[str, object]:
        """Return it as JSON values."""
        return {"asserted": self._asserted, "rise_ns": self._rise_ns}

    def restore(self, state: Mapping[str, object]) -> None:
        """Go on from what `state` returned."""
        self._asserted = bool(state["asserted"])
        self._rise_ns = None
        rise_ns = cast("int | None", state["rise_ns"])
        if rise_ns is not None:
            self._rise_at(rise_ns)

    def _rise_at(self, when_ns: int) -> None:
        self._rise_ns = when_ns
        self._clock.at(when_ns, lambda: self._rise_if(when_ns))

    def _rise_if(self, when_ns: int) -> None:
        if self._rise_ns == when_ns:
            self._rise_ns = None
            self._rise()

    def _rise(self) -> None:
        for callback in self._listeners:
            callback()
