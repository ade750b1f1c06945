"""Sensors sharing a die: the first to start resets it, the last to stop puts it to sleep."""

from __future__ import annotations

from typing import ClassVar

from hil.instruments.sensors.axes import Axes

__all__ = ["SharedDie"]


class SharedDie(Axes):
    """One of several sensors on a die; each sample is a new one.

    Attributes:
        reset: register and value that reset the die, and the duration of the reset in s.
        fresh: data-ready register and the bits that must all be set.
    """

    reset: ClassVar[tuple[int, int, float]]
    fresh: ClassVar[tuple[int, int]]

    def _reset_alone(self) -> None:
        """Reset the die, unless another sensor of the chip is running."""
        register, value, seconds = self.reset
        if not self._others_run():
            self._registers.write(register, value)
            self._clock.sleep(seconds)
            self._registers.bank_lost()

    def _is_fresh(self) -> bool:
        register, bits = self.fresh
        return self._registers.read(register) & bits == bits

    def _await_sample(self) -> None:
        self._await_new(self._is_fresh, self._sampling.rate)

    def _sample(self) -> tuple[float, ...]:
        self._await_sample()
        return super()._sample()
