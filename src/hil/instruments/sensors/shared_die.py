"""A sensor that shares its die with others: the first that starts resets the die, the last that stops lets it sleep."""

from __future__ import annotations

from typing import ClassVar

from hil.instruments.sensors.axes import Axes

__all__ = ["SharedDie"]


class SharedDie(Axes):
    """One of several sensors on a die, of which a sample is one that was not read yet.

    Attributes:
        reset: register and value that reset the die, and seconds until that is over.
        fresh: register and bits that say, all of them, that there is a new sample.
    """

    reset: ClassVar[tuple[int, int, float]]
    fresh: ClassVar[tuple[int, int]]

    def _reset_alone(self) -> None:
        """Reset the die, unless another sensor of the chip runs."""
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
